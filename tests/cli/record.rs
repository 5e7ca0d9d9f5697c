//! Goal: a run is recorded and replayed as a user does it, and recorded by a second process. Method: the real daemon
//! and the real source; the daemon ends by SIGTERM or `kill -9`, or does not start.

use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::process::Signal;

use super::live::{Desk, output, until};
use super::{code, err, out};

/// Writes the scene of a pool that a source moves; returns the path of its file and of a recording.
fn pool(desk: &Desk, count: &str) -> (PathBuf, PathBuf) {
    let scene = desk.dir.join("pool.toml");
    let made = output(&["feed", "--write-scene", path(&scene), "--count", count]);
    assert_eq!(code(&made), Some(0), "{}", err(&made));
    (scene, desk.dir.join("run.mcap"))
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Replays a file; returns its JSON and the exit code.
fn replayed(file: &Path, more: &[&str]) -> (serde_json::Value, Option<i32>) {
    let mut args = vec!["replay", path(file), "--json"];
    args.extend_from_slice(more);
    let ended = output(&args);
    let json = serde_json::from_str(&out(&ended));
    let json = json.unwrap_or_else(|e| panic!("{e}: {} {}", out(&ended), err(&ended)));
    (json, code(&ended))
}

/// Records while a source sends `frames` frames.
fn recorded(desk: &Desk, scene: &Path, file: &Path, flags: &[&str], frames: &str, end: Signal) {
    let mut args = vec![path(scene), "--record", path(file)];
    args.extend_from_slice(flags);
    let mut daemon = desk.start("run", &args);
    let mut feed = desk.start("feed", &[path(scene), "--frames", frames, "--rate", "200"]);
    let (fed, _) = feed.end();
    assert!(fed.success(), "{}\n{}", feed.stderr(), daemon.stderr());
    if end == Signal::KILL {
        // Everything written by now is in the file half a second later.
        std::thread::sleep(Duration::from_millis(1500));
        daemon.kill();
    } else {
        let (status, _) = daemon.stop();
        assert_eq!(status.code(), Some(0), "{}", daemon.stderr());
    }
}

#[test]
fn a_recorded_run_replays_bit_by_bit_with_code_0() {
    let desk = Desk::new();
    let (scene, file) = pool(&desk, "120");
    for flags in [
        &["--budget", "none"][..],
        &["--budget", "none", "--budget-units", "300", "--force"],
    ] {
        recorded(&desk, &scene, &file, flags, "300", Signal::TERM);
        // The replay needs no file but the recording.
        let kept = std::fs::read(&scene).unwrap();
        std::fs::remove_file(&scene).unwrap();
        let (json, code) = replayed(&file, &[]);
        std::fs::write(&scene, kept).unwrap();
        assert_eq!(code, Some(0), "{json}");
        assert_eq!(json["difference"], serde_json::Value::Null);
        assert_eq!(
            (&json["ending"], &json["ticks_by_law"]),
            (&"whole".into(), &0.into())
        );
        let ticks = json["ticks"].as_u64().unwrap();
        // On a busy machine some of the 300 frames are skipped.
        assert!(ticks > 100 && json["ticks_exact"] == ticks, "{json}");
        let (json, _) = replayed(&file, &["--from", "50", "--until", "99"]);
        assert_eq!(
            (&json["ticks"], &json["ticks_exact"]),
            (&99.into(), &50.into())
        );
        let boot = json["boot_id"].as_str().unwrap();
        assert!(
            boot.len() == 16 && u64::from_str_radix(boot, 16).is_ok(),
            "bug: {boot}"
        );
    }
    // A replay that compared nothing is not a success.
    let (json, code_of) = replayed(&file, &["--from", "99999"]);
    assert_eq!(
        (code_of, &json["ticks_exact"]),
        (Some(1), &0.into()),
        "bug: {json}"
    );
    let text = out(&output(&["replay", path(&file), "--from", "99999"]));
    assert!(text.contains("nothing was compared"), "{text}");
    let ended = output(&["replay", path(&file), "--until", "0"]);
    assert_eq!(code(&ended), Some(2), "bug: {}", err(&ended));
    assert!(err(&ended).contains("from 1 on"), "{}", err(&ended));
    let ended = output(&["replay", path(&file), "--from", "10", "--until", "5"]);
    assert_eq!(code(&ended), Some(2), "bug: {}", err(&ended));
    let text = out(&output(&["replay", path(&file)]));
    assert!(
        text.contains("compared bit by bit") && text.contains("no difference"),
        "{text}"
    );
}

#[test]
fn a_run_with_a_budget_of_time_is_held_against_the_law() {
    let desk = Desk::new();
    let (scene, file) = pool(&desk, "200");
    recorded(
        &desk,
        &scene,
        &file,
        &["--budget", "300us"],
        "200",
        Signal::TERM,
    );
    let (json, code) = replayed(&file, &[]);
    assert_eq!(code, Some(0), "{json}");
    assert_eq!(json["ticks_exact"], 0);
    assert!(json["ticks_by_law"].as_u64().unwrap() > 100, "{json}");
    assert!(json["rows_by_law"].as_u64().unwrap() > 1_000, "{json}");
}

#[test]
fn what_a_killed_daemon_has_written_is_replayed() {
    let desk = Desk::new();
    let (scene, file) = pool(&desk, "100");
    recorded(
        &desk,
        &scene,
        &file,
        &["--budget", "none"],
        "300",
        Signal::KILL,
    );
    let (json, code) = replayed(&file, &[]);
    assert_eq!(code, Some(0), "{json}");
    assert_eq!(json["ending"], "cut");
    assert!(json["ticks_exact"].as_u64().unwrap() > 100, "{json}");
    let text = out(&output(&["replay", path(&file)]));
    assert!(text.contains("the file is cut off"), "{text}");
}

#[test]
fn a_file_that_cannot_be_is_refused_before_the_daemon_runs() {
    let desk = Desk::new();
    let (scene, file) = pool(&desk, "10");
    let run = |file: &str, more: &[&str]| {
        let mut args = vec![
            "run",
            path(&scene),
            "--instance",
            &desk.instance,
            "--record",
            file,
        ];
        args.extend_from_slice(more);
        output(&args)
    };
    std::fs::write(&file, "mine").unwrap();
    let ended = run(path(&file), &[]);
    assert_eq!(code(&ended), Some(4));
    assert!(err(&ended).contains("--force"), "{}", err(&ended));
    assert_eq!(std::fs::read(&file).unwrap(), b"mine");
    let ended = run("/nowhere/run.mcap", &[]);
    assert_eq!(code(&ended), Some(4));
    assert!(err(&ended).contains("/nowhere/run.mcap"), "{}", err(&ended));
    // A device, and a folder.
    for (wrong, word) in [("/dev/full", "a device"), ("/tmp", "is a folder")] {
        let ended = run(wrong, &["--force"]);
        assert_eq!(code(&ended), Some(4));
        assert!(err(&ended).contains(word), "{}", err(&ended));
    }
    let ended = output(&["run", path(&scene), "--force"]);
    assert_eq!(code(&ended), Some(2), "{}", err(&ended));
}

#[test]
fn bug_a_recording_was_written_over_the_scene_and_the_meshes_it_is_of() {
    let desk = Desk::new();
    let mesh = desk.write("ball.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n");
    let body = r#"shape = { type = "convex", file = "ball.obj" }"#;
    let scene = desk
        .scene(&super::TWO_SPHERES.replace(r#"shape = { type = "sphere", radius = 0.5 }"#, body));
    let params = desk.write(
        "params.yaml",
        "sweepd:\n  ros__parameters:\n    budget_ms: 2.0\n",
    );
    let (linked, hard) = (desk.dir.join("link.mcap"), desk.dir.join("hard.mcap"));
    std::os::unix::fs::symlink("scene.toml", &linked).unwrap();
    std::fs::hard_link(&scene, &hard).unwrap();
    let spelt = desk.dir.join("../").join(desk.dir.file_name().unwrap());
    let read = [&scene, &mesh, &params].map(|file| std::fs::read(file).unwrap());
    let mut files = vec![
        scene.clone(),
        spelt.join("scene.toml"),
        linked,
        hard,
        mesh.clone(),
    ];
    let mut args = vec!["run", path(&scene), "--instance", &desk.instance, "--force"];
    if cfg!(feature = "ros2") {
        files.push(params.clone());
        args.splice(2..2, ["--ros-args", "--params-file", path(&params), "--"]);
    }
    for file in files {
        let mut all = args.clone();
        all.extend(["--ticks", "1", "--record", path(&file)]);
        let ended = output(&all);
        assert_eq!(code(&ended), Some(2), "{}", err(&ended));
        let said = err(&ended);
        let begin = format!("--record {}: this is ", path(&file));
        assert!(
            said.contains(&begin) && said.contains("name another file"),
            "{said}"
        );
        // The daemon did not start.
        assert_eq!(desk.files(), Vec::<PathBuf>::new());
        assert_eq!(
            [&scene, &mesh, &params].map(|file| std::fs::read(file).unwrap()),
            read
        );
    }
}

#[test]
fn a_daemon_whose_name_is_taken_touches_no_recording() {
    let desk = Desk::new();
    let (scene, file) = pool(&desk, "10");
    let mut daemon = desk.start("run", &[path(&scene)]);
    until("it runs", || daemon.stderr().contains("runs"));
    std::fs::write(&file, "mine").unwrap();
    let second = |file: &Path| {
        let (name, file) = (desk.instance.as_str(), path(file));
        output(&[
            "run",
            path(&scene),
            "--instance",
            name,
            "--record",
            file,
            "--force",
        ])
    };
    let ended = second(&file);
    assert_eq!(code(&ended), Some(4), "{}", err(&ended));
    assert_eq!(std::fs::read(&file).unwrap(), b"mine");
    let other = desk.dir.join("other.mcap");
    assert_eq!(code(&second(&other)), Some(4));
    assert!(!other.exists());
    let (status, _) = daemon.stop();
    assert_eq!(status.code(), Some(0), "{}", daemon.stderr());
}

#[test]
fn bug_what_is_no_recording_was_not_refused_as_bad_input_is() {
    let desk = Desk::new();
    let (scene, _) = pool(&desk, "10");
    for file in [path(&scene), "/nowhere/run.mcap", path(&desk.dir)] {
        let ended = output(&["replay", file]);
        assert_eq!(code(&ended), Some(2), "{}", err(&ended));
        assert!(err(&ended).contains(file), "{}", err(&ended));
    }
    let empty = scene.with_extension("mcap");
    std::fs::write(&empty, "").unwrap();
    let ended = output(&["replay", path(&empty)]);
    assert_eq!(code(&ended), Some(2), "{}", err(&ended));
    assert!(err(&ended).contains("is empty"), "{}", err(&ended));
}

#[test]
fn edits_of_a_running_scene_are_in_the_recording() {
    let desk = Desk::new();
    let file = desk.dir.join("run.mcap");
    let mut daemon = desk.run(super::TWO_SPHERES, &["--record", path(&file)]);
    let mut client = desk.source("sim");
    let rows = [super::live::at(1, 0.0), super::live::at(2, 0.8)];
    super::live::step(&mut client, &rows);
    let json = r#"{"edits": [{"put": {"name": "wall", "moves": false,
        "shape": {"type": "box", "half_extents": [0.1, 2, 2]}}}]}"#;
    let answer = client
        .request(json, &[], 30 * super::live::SECOND_NS)
        .unwrap();
    assert!(answer.ok, "{answer:?}");
    super::live::step(&mut client, &rows);
    assert_eq!(client.view().pairs().unwrap().rows.len(), 2);
    assert_eq!(daemon.stop().0.code(), Some(0));
    until("the recording", || file.exists());
    let (json, code) = replayed(&file, &[]);
    assert_eq!(
        (code, &json["difference"]),
        (Some(0), &serde_json::Value::Null),
        "{json}"
    );
    assert!(json["ticks_exact"].as_u64().unwrap() >= 3, "{json}");
}

/// The number of messages of each topic in a file.
fn topics(file: &Path) -> std::collections::BTreeMap<String, usize> {
    let bytes = std::fs::read(file).unwrap();
    let mut counts = std::collections::BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        *counts
            .entry(message.unwrap().channel.topic.clone())
            .or_default() += 1;
    }
    counts
}

#[test]
fn a_client_records_what_it_hears_and_follows_a_daemon_that_starts_anew() {
    let desk = Desk::new();
    let (scene, file) = pool(&desk, "60");
    let mut daemon = desk.start("run", &[path(&scene)]);
    let mut feed = desk.start("feed", &[path(&scene), "--rate", "200"]);
    let mut recorder = desk.start("record", &[path(&file)]);
    until("what is heard", || {
        file.metadata().is_ok_and(|file| file.len() > 1_000_000)
    });
    daemon.kill();
    let mut daemon = desk.start("run", &[path(&scene)]);
    let before = file.metadata().unwrap().len();
    until("what the new one says", || {
        file.metadata().unwrap().len() > before + 1_000_000
    });
    assert_eq!(recorder.stop().0.code(), Some(0), "{}", recorder.stderr());
    let said = recorder.stdout();
    assert!(said.contains("ticks in"), "{said}");
    assert_eq!(
        (feed.stop().0.code(), daemon.stop().0.code()),
        (Some(0), Some(0))
    );
    let counts = topics(&file);
    let of = |topic: &str| {
        counts
            .get(&format!("/sweepd/{topic}"))
            .copied()
            .unwrap_or(0)
    };
    // Each boot sends its names once; after that each tick has all topics.
    assert!(of("names") >= 2, "{counts:?}");
    let ticks = of("tick");
    assert!(ticks > 50 && of("state") == ticks, "{counts:?}");
    for topic in ["pairs", "contacts", "bodies"] {
        assert!(of(topic) + 10 >= ticks, "{topic}: {counts:?}");
    }
    assert_eq!(of("record/input"), 0);
    let ended = output(&["replay", path(&file)]);
    assert_eq!(code(&ended), Some(2));
    assert!(
        err(&ended).contains("run SCENE --record"),
        "{}",
        err(&ended)
    );
}

#[test]
fn a_client_records_what_it_is_asked_to_and_touches_no_file_in_vain() {
    let desk = Desk::new();
    let (scene, file) = pool(&desk, "10");
    let record = |more: &[&str]| {
        let mut args = vec!["record", path(&file), "--instance", &desk.instance];
        args.extend_from_slice(more);
        output(&args)
    };
    let ended = record(&["--wait", "200ms"]);
    assert_eq!(code(&ended), Some(3), "{}", err(&ended));
    assert!(!file.exists());
    let mut daemon = desk.start("run", &[path(&scene)]);
    until("it runs", || daemon.stderr().contains("runs"));
    std::fs::write(&file, "mine").unwrap();
    let ended = record(&["--ticks", "1"]);
    assert_eq!(code(&ended), Some(4), "{}", err(&ended));
    assert!(err(&ended).contains("--force"), "{}", err(&ended));
    assert_eq!(std::fs::read(&file).unwrap(), b"mine");
    let ended = record(&["--ticks", "7", "--only", "pairs", "--force"]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    assert!(out(&ended).starts_with("7 ticks in"), "{}", out(&ended));
    let counts = topics(&file);
    assert_eq!(counts["/sweepd/tick"], 7, "{counts:?}");
    assert!(counts.contains_key("/sweepd/pairs"), "{counts:?}");
    let unasked = ["contacts", "bodies"].map(|topic| format!("/sweepd/{topic}"));
    assert!(
        unasked.iter().all(|topic| !counts.contains_key(topic)),
        "{counts:?}"
    );
    let ended = record(&["--for", "300ms", "--force"]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    let ended = record(&["--only", "everything", "--force"]);
    assert_eq!(code(&ended), Some(2), "{}", err(&ended));
    daemon.kill();
    let ended = record(&["--wait", "300ms", "--force"]);
    assert_eq!(code(&ended), Some(3), "{}", err(&ended));
}
