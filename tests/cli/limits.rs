//! Goal: a process whose limit of open files or of file size is too low reports it at its start or when the limit is
//! reached; everything else continues. Method: the real binary under `ulimit`, and running processes whose limits are
//! lowered.

use rustix::process::Resource;
use sweepd::transport::client::{Client, Topics};
use sweepd::transport::open_files::OpenFiles;

use super::{code, err, out};
use crate::live::{Desk, SECOND_NS, TWO_SPHERES, at, limited, output, run_out, step, until};

#[test]
fn bug_commands_with_too_few_open_files_told_of_versions_or_of_nothing() {
    let desk = Desk::new();
    let daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 3.0)]);
    let (scene, file) = (desk.dir.join("scene.toml"), desk.dir.join("heard.mcap"));
    let (scene, file) = (scene.to_str().unwrap(), file.to_str().unwrap());
    let mut commands = vec![
        vec!["monitor", "--json", "--ticks", "2", "--contacts"],
        vec!["query", "a", "b"],
        vec!["feed", scene, "--frames", "1"],
    ];
    if cfg!(feature = "mcap") {
        commands.push(vec!["record", file, "--ticks", "1"]);
    }
    for command in &mut commands {
        command.extend(["--instance", &desk.instance]);
    }
    commands.push(vec!["list"]);
    for files in (8..56).step_by(8) {
        let limit = format!("ulimit -n {files}");
        for command in &commands {
            let ended = run_out(limited(&limit), command);
            let said = err(&ended);
            assert_eq!(code(&ended), Some(4), "{files}: {command:?} {said}");
            let words = format!("of the {files} files open that it may");
            assert!(said.contains(&words), "{files}: {command:?} {said}");
            assert!(
                said.contains("`ulimit -n 1024`"),
                "{files}: {command:?} {said}"
            );
            assert_eq!(out(&ended), "", "{files}: {command:?}");
        }
        let ended = run_out(limited(&limit), &["doctor"]);
        assert_eq!(code(&ended), Some(1), "{}", err(&ended));
        let words = "too few to look at leftovers and instances; `ulimit -n 1024`";
        assert!(out(&ended).contains(words), "{files}: {}", out(&ended));
        assert!(
            !out(&ended).contains("no daemon"),
            "{files}: {}",
            out(&ended)
        );
    }
    // The number that the message names as enough is enough.
    let enough = sweepd::limits::CLIENT_FILES_LEAST + 12;
    let limit = format!("ulimit -n {enough}");
    for command in &commands {
        // A second feed would fail because the source is taken.
        if command[0] != "feed" {
            let ended = run_out(limited(&limit), command);
            assert_eq!(code(&ended), Some(0), "{command:?} {}", err(&ended));
        }
    }
    assert_eq!(
        daemon.stderr().matches("ERROR").count(),
        0,
        "{}",
        daemon.stderr()
    );
}

#[test]
fn bug_open_files_that_ran_out_in_the_run_were_not_told_and_the_daemon_was_to_be_ended() {
    let desk = Desk::new();
    let mut daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    let rows = [at(1, 0.0), at(2, 3.0)];
    step(&mut client, &rows);
    let files = OpenFiles::of(daemon.pid()).unwrap();
    daemon.limit(Resource::Nofile, files.open + 5);
    let told = |daemon: &crate::live::Running| {
        let said = daemon.stderr();
        said.matches("a port of a client could not be opened or read")
            .count()
    };
    assert_eq!(told(&daemon), 0);
    // The client connects, but its port cannot be opened completely: its frames or its subscription have no effect.
    let late = Client::connect(&desk.instance, Some("sim"), SECOND_NS / 2).map(|mut late| {
        let _in_vain = late.subscribe(Topics::ALL);
        late
    });
    until("it is told", || told(&daemon) > 0);
    let said = daemon.stderr();
    let limit = format!("of the {} files open that it may", files.open + 5);
    assert!(
        said.contains(&limit) && said.contains("`ulimit -n 1024`"),
        "{said}"
    );
    // Existing clients are still served, and the message is logged only once.
    for _ in 0..50 {
        step(&mut client, &rows);
        assert!(client.view().pairs().is_some());
    }
    assert_eq!(told(&daemon), 1, "{}", daemon.stderr());
    let ended = output(&["doctor", "--instance", &desk.instance]);
    assert_eq!(code(&ended), Some(1), "{}", out(&ended));
    let looked = out(&ended);
    let line = looked.lines().find(|line| line.contains(&limit)).unwrap();
    assert!(
        line.starts_with("wrong ") && line.contains("serves the clients"),
        "{line}"
    );
    assert!(!looked.contains("kill"), "{looked}");
    // With the limit restored, new clients are served.
    drop(late);
    daemon.limit(Resource::Nofile, files.most);
    let mut next = desk.client(None);
    next.subscribe(Topics::ALL).unwrap();
    until("pairs", || {
        step(&mut client, &rows);
        next.latest().unwrap();
        next.view().pairs().is_some()
    });
    let ended = output(&["doctor", "--instance", &desk.instance]);
    assert!(
        !out(&ended).contains("files open that it may"),
        "{}",
        out(&ended)
    );
    assert_eq!(daemon.stop().0.code(), Some(0), "{}", daemon.stderr());
}

/// Sending the same `put` again was no edit, so the subscription could not be repaired.
#[cfg(feature = "ros2")]
#[test]
fn bug_a_body_whose_subscription_failed_was_not_heard_for_ever() {
    let desk = Desk::new();
    let spheres = TWO_SPHERES.replace("shape =", "source = \"sim\"\nshape =");
    let source = "[[source]]\nname = \"poses\"\nros2 = { type = \"pose\" }\n";
    let domain = (100 + std::process::id() % 100).to_string();
    let args = ["--ros2", "--ros-domain-id", &domain];
    let mut daemon = desk.run(&format!("{spheres}{source}"), &args);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 3.0)]);
    let mut put = |name: &str| {
        let shape = r#"{"type": "sphere", "radius": 0.5}"#;
        let body = format!(
            r#"{{"name": "{name}", "source": "poses", "ros_topic": "/{name}", "shape": {shape}}}"#
        );
        let edits = format!(r#"{{"edits": [{{"put": {body}}}]}}"#);
        let request = client.ask(&edits, &[]).unwrap();
        until("the answer", || {
            client
                .answer_text(request, SECOND_NS / 10)
                .unwrap()
                .is_some()
        });
    };
    // The first `put` also opens the files that answers need.
    put("early");
    let files = OpenFiles::of(daemon.pid()).unwrap();
    daemon.limit(Resource::Nofile, 3);
    put("late");
    let failed = "body late: no poses of it can come: ";
    until("it is told", || {
        daemon.stderr().contains("it has no subscription")
    });
    std::thread::sleep(std::time::Duration::from_secs(2));
    assert!(
        !daemon.stderr().contains("can come now"),
        "{}",
        daemon.stderr()
    );
    daemon.limit(Resource::Nofile, files.most);
    until("it is heard", || {
        daemon
            .stderr()
            .contains("body late: its poses can come now")
    });
    // Twice: once as a log line, once as a fault.
    assert_eq!(
        daemon.stderr().matches(failed).count(),
        2,
        "{}",
        daemon.stderr()
    );
    assert_eq!(daemon.stop().0.code(), Some(0), "{}", daemon.stderr());
}

#[test]
fn bug_a_limit_of_the_size_of_files_was_not_told_at_the_start() {
    let desk = Desk::new();
    let scene = desk.scene(TWO_SPHERES);
    let run = |limit: &str, more: &[&str]| {
        let args = [
            "run",
            scene.to_str().unwrap(),
            "--instance",
            &desk.instance,
            "--ticks",
            "2",
        ];
        run_out(limited(limit), &[&args, more].concat())
    };
    let ended = run("ulimit -f 2048", &[]);
    assert_eq!(code(&ended), Some(4), "{}", err(&ended));
    let said = err(&ended);
    for word in [
        "files of ",
        " MiB at most, and a daemon needs 32 MiB",
        "`ulimit -f unlimited`",
    ] {
        assert!(said.contains(word), "{word}: {said}");
    }
    assert_eq!(desk.files(), Vec::<std::path::PathBuf>::new());
    let ended = run("ulimit -f 262144", &[]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    assert!(!err(&ended).contains("ulimit"), "{}", err(&ended));
}

#[cfg(feature = "mcap")]
#[test]
fn a_recording_that_becomes_as_long_as_a_file_may_be_is_ended_and_told_and_the_daemon_goes_on() {
    let desk = Desk::new();
    let (scene, file) = (desk.dir.join("pool.toml"), desk.dir.join("run.mcap"));
    let (scene, tape) = (scene.to_str().unwrap(), file.to_str().unwrap());
    let made = output(&["feed", "--write-scene", scene, "--count", "100"]);
    assert_eq!(code(&made), Some(0), "{}", err(&made));
    // The limit is reported at the start of a recording.
    let args = [
        "run",
        scene,
        "--instance",
        &desk.instance,
        "--ticks",
        "2",
        "--record",
        tape,
    ];
    let ended = run_out(limited("ulimit -f 262144"), &args);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    let said = err(&ended);
    assert!(
        said.contains(tape) && said.contains(" MiB long, for a file"),
        "{said}"
    );

    // Otherwise the length of this file would be taken for that of the next recording.
    std::fs::remove_file(&file).unwrap();
    let args = [scene, "--record", tape, "--budget", "none"];
    let mut daemon = desk.start("run", &args);
    let mut client = desk.client(None);
    let mut feed = desk.start("feed", &[scene, "--rate", "200"]);
    let bytes = || std::fs::metadata(&file).map_or(0, |meta| meta.len());
    // A chunk has 1 MiB, and its length may be visible while it is being written; beyond 2 MB the first one is
    // complete.
    until("a chunk is written", || bytes() > 2_000_000);
    let most = bytes() + 500_000;
    daemon.limit(Resource::Fsize, most);
    until("its end is told", || {
        daemon
            .stderr()
            .contains("the recording ends, the daemon goes on")
    });
    let said = daemon.stderr();
    assert!(
        said.contains("as long as a file of this process may be: `ulimit -f unlimited`"),
        "{said}"
    );
    assert!(bytes() <= most, "{} of {most}", bytes());
    let tick = crate::live::tick_until(&mut client, "a tick", |_| true)
        .header
        .tick;
    crate::live::tick_until(&mut client, "ticks after it", |row| {
        row.header.tick > tick + 100
    });
    assert_eq!(feed.stop().0.code(), Some(0), "{}", feed.stderr());
    assert_eq!(daemon.stop().0.code(), Some(0), "{}", daemon.stderr());
    assert_eq!(daemon.stderr().matches("the recording ends").count(), 1);

    let ended = output(&["replay", tape, "--json"]);
    // There is no difference, but the recording ends early, hence code 1.
    assert_eq!(code(&ended), Some(1), "{} {}", out(&ended), err(&ended));
    let json: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(json["ending"], "early", "{json}");
    let why = json["why"].as_str().unwrap();
    assert!(why.contains("`ulimit -f unlimited`"), "{json}");
    assert_eq!(json["difference"], serde_json::Value::Null);
    let ticks = json["ticks"].as_u64().unwrap();
    // Everything before the limit is in the file, except for the chunk that did not fit.
    assert!(ticks > 20 && json["ticks_exact"] == ticks, "{json}");
}

#[test]
fn bug_a_log_that_could_not_be_written_ended_the_daemon() {
    let desk = Desk::new();
    let scene = desk.scene(TWO_SPHERES);
    let scene = scene.to_str().unwrap();
    let run = [
        "-v",
        "run",
        scene,
        "--instance",
        &desk.instance,
        "--ticks",
        "3",
    ];
    let ended = run_out(limited("exec 2>/dev/full"), &run);
    assert_eq!(code(&ended), Some(0));
}

/// The files were read only after the daemon had taken its name, and `/dev/zero` until the memory was full.
#[cfg(feature = "ros2")]
#[test]
fn bug_files_of_parameters_are_read_to_a_limit_and_before_the_name_is_taken() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let (scene, name) = (desk.dir.join("scene.toml"), desk.instance.as_str());
    let deep = desk.write("deep.yaml", &"- ".repeat(100_000));
    for (file, words) in [
        ("/dev/zero", "more than 1048576 bytes"),
        ("/nowhere.yaml", "cannot be read"),
        (deep.to_str().unwrap(), "tables and lists"),
    ] {
        let args = ["run", scene.to_str().unwrap(), "--instance", name];
        let args = [&args[..], &["--ros-args", "--params-file", file]].concat();
        let ended = run_out(limited("ulimit -v 4000000"), &args);
        let said = err(&ended);
        assert_eq!(code(&ended), Some(2), "{file}: {said}");
        assert!(said.contains(file) && said.contains(words), "{said}");
    }
}
