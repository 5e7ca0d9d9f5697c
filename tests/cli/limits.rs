//! Goal: a process that may make too small files says so, at its start or when it meets that; what works goes on.
//! Method: the real binary under `ulimit`, and running ones whose limits are lowered.

use rustix::process::Resource;

use super::{code, err, out};
use crate::live::{Desk, TWO_SPHERES, limited, output, run_out, until};

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
    // It is said beforehand.
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

    let args = [scene, "--record", tape, "--force", "--budget", "none"];
    let mut daemon = desk.start("run", &args);
    let mut client = desk.client(None);
    let mut feed = desk.start("feed", &[scene, "--rate", "200"]);
    let bytes = || std::fs::metadata(&file).map_or(0, |meta| meta.len());
    until("some of it is written", || bytes() > 300_000);
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
    assert_eq!(code(&ended), Some(0), "{} {}", out(&ended), err(&ended));
    let json: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(json["ending"], "cut", "{json}");
    assert_eq!(json["difference"], serde_json::Value::Null);
    let ticks = json["ticks"].as_u64().unwrap();
    // What was written before the limit is there, but for the chunk that did not fit.
    assert!(ticks > 20 && json["ticks_exact"] == ticks, "{json}");
}
