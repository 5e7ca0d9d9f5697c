//! `sweepd query A B`, `--touching`: bodies of a running daemon, as text and as JSON, and the reasons for no answer.

use rustix::process::Signal;
use serde_json::Value;

use super::{code, err, head, out};
use crate::live::{Desk, TWO_SPHERES, at, output, step, until};

fn ask(desk: &Desk, args: &[&str]) -> std::process::Output {
    let mut all = vec!["query"];
    all.extend_from_slice(args);
    all.extend_from_slice(&["--instance", &desk.instance]);
    output(&all)
}

fn json(desk: &Desk, args: &[&str]) -> Value {
    let ended = ask(desk, args);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    let text = out(&ended);
    assert_eq!(text.lines().count(), 1, "{text}");
    serde_json::from_str(&text).unwrap()
}

#[test]
fn a_running_daemon_is_asked_and_says_what_the_batch_says_offline() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 3.0)]);
    let header = client.view().tick().header;
    let live = json(&desk, &["a", "b", "--json"]);
    let sphere = r#"{"type": "sphere", "radius": 0.5}"#;
    let case = format!(
        r#"{{"id": 1, "a": {sphere}, "pose_a": {{"t": [0,0,0], "q": [1,0,0,0]}}, "b": {sphere}, "pose_b": {{"t": [3,0,0], "q": [1,0,0,0]}}}}"#
    );
    let cases = desk.write("case.jsonl", &format!("{case}\n"));
    let ended = output(&["query", "--batch", cases.to_str().unwrap()]);
    let offline: Value = serde_json::from_slice(&ended.stdout).unwrap();
    for key in ["gap_m", "normal", "point_a", "point_b", "colliding"] {
        assert_eq!(live[key], offline[key], "{key}: {live} {offline}");
    }
    let ends = ["gap_min_m", "gap_max_m"].map(|key| live[key].as_f64().unwrap());
    assert!(ends[0] <= 2.0 && 2.0 <= ends[1] && ends[1] - ends[0] < 1e-9);
    assert_eq!((&live["a"], &live["b"]), (&"a".into(), &"b".into()));
    assert_eq!(
        (&live["verdict"], &live["touching"]),
        (&"apart".into(), &false.into())
    );
    assert!(live["tick"].as_u64().unwrap() >= header.tick);
    assert_eq!(live["boot_id"], format!("{:016x}", header.boot_id));
    assert_eq!(live["scene_rev"], header.scene_rev);
    assert_eq!(live["warnings"], serde_json::json!([]));
    // The poses were sent before the query, and are younger than the longest duration of this test.
    let age_ns = live["age_ns"].as_u64().unwrap();
    assert!((1..60_000_000_000).contains(&age_ns), "{age_ns}");
    let turned = json(&desk, &["b", "a", "--json"]);
    assert_eq!(turned["normal"], serde_json::json!([-1.0, 0.0, 0.0]));
    assert_eq!(turned["point_a"], live["point_b"]);

    let ended = ask(&desk, &["a", "b"]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    let text = out(&ended);
    for word in ["apart", "gap [m]     2\n", "1.99999", "2.5 0 0", " old"] {
        assert!(text.contains(word), "`{word}` in {text}");
    }
    step(&mut client, &[at(1, 0.0), at(2, 1.0)]);
    let ended = ask(&desk, &["a", "b"]);
    assert!(
        out(&ended).contains("colliding (touching)"),
        "{}",
        out(&ended)
    );
    for lines in [0, 1] {
        let args = ["query", "a", "b", "--instance", &desk.instance];
        assert_eq!(code(&head(&args, lines)), Some(0), "{lines}");
    }
}

#[test]
fn what_has_no_gap_is_refused_with_what_to_change() {
    let desk = Desk::new();
    let scene = TWO_SPHERES.replace("\"b\"", "\"arm/hand\"");
    let _daemon = desk.run(&scene, &[]);
    let mut client = desk.source("sim");
    // Neither body has a pose yet.
    let ended = ask(&desk, &["a", "arm/hand", "--json"]);
    assert_eq!(code(&ended), Some(4), "{}", err(&ended));
    assert!(err(&ended).contains("not_received"), "{}", err(&ended));
    assert!(ended.stdout.is_empty());
    step(&mut client, &[at(1, 0.0), at(2, 3.0)]);
    for (a, b, words) in [
        (
            "a",
            "arm/hnad",
            &["\"arm/hnad\"", "did you mean \"arm/hand\"?"][..],
        ),
        ("zeppelin", "a", &["\"zeppelin\"", "2 bodies"]),
        ("a", "a", &["itself"]),
    ] {
        let ended = ask(&desk, &[a, b]);
        assert_eq!(code(&ended), Some(2), "{a} {b}: {}", err(&ended));
        let text = err(&ended);
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
    }
}

#[test]
fn what_does_not_move_has_no_age() {
    let desk = Desk::new();
    let still = TWO_SPHERES.replace("shape =", "moves = false\nshape =");
    let _daemon = desk.run(&still, &[]);
    let live = json(&desk, &["a", "b", "--json", "--wait", "30s"]);
    assert!(live["age_ns"].is_null(), "{live}");
    assert_eq!(live["verdict"], "colliding");
    let ended = ask(&desk, &["a", "b"]);
    assert!(
        out(&ended).contains("neither body moves"),
        "{}",
        out(&ended)
    );
}

#[test]
fn a_body_is_tried_at_a_pose_and_a_shape_anywhere() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    let lost = json(&desk, &["--touching", "a", "--at=0,0,0", "--json"]);
    assert_eq!(lost["complete"], false);
    assert_eq!(lost["unknown"][0]["body"], "b");
    assert_eq!(lost["unknown"][0]["status"], "not_received");
    step(&mut client, &[at(1, 0.0), at(2, -3.0)]);
    let there = json(
        &desk,
        &["--touching", "a", "--at", "-2.5,0,0,0,0,0,1", "--json"],
    );
    let row = &there["rows"][0];
    assert_eq!((&row["a"], &row["b"]), (&"a".into(), &"b".into()));
    assert_eq!(row["verdict"], "colliding");
    assert!(
        (row["gap_best_m"].as_f64().unwrap() + 0.5).abs() < 1e-12,
        "{row}"
    );
    assert_eq!(there["complete"], true);
    assert_eq!(there["tick"].as_u64().map(|tick| tick > 0), Some(true));
    let near = json(&desk, &["--touching", "a", "--within", "2.1m", "--json"]);
    assert_eq!(near["rows"][0]["verdict"], "near", "{near}");
    let none = json(&desk, &["--touching", "a", "--within", "199cm", "--json"]);
    assert_eq!(none["rows"], serde_json::json!([]));
    let sphere = r#"{"type": "sphere", "radius": 0.25}"#;
    let shape = json(&desk, &["--shape", sphere, "--at=-3,0,0", "--json"]);
    assert!(
        shape["rows"][0]["a"].is_null() && shape["rows"][0]["b"] == "b",
        "{shape}"
    );
    let ended = ask(&desk, &["--touching", "a", "--at=-2,0,0"]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    for words in [
        "colliding   a and b (touching)",
        "complete    yes",
        "tick        ",
    ] {
        assert!(out(&ended).contains(words), "`{words}` in {}", out(&ended));
    }
    for (args, words) in [
        (
            &["--touching", "zeppelin"][..],
            &["\"zeppelin\"", "2 bodies"][..],
        ),
        (&["--touching", "a", "--at=1,2"], &["2 numbers", "write 3"]),
        (&["--touching", "a", "--at=1,x,2"], &["`x`"]),
        (&["--touching", "a", "--within", "5"], &["not a length"]),
        (&["--touching", "a", "b"], &["cannot be used"]),
        (&["--shape", "{"], &["not JSON"]),
        (&["a", "b", "--at=0,0,0"], &["cannot be used"]),
    ] {
        let ended = ask(&desk, args);
        assert_eq!(code(&ended), Some(2), "{args:?}: {}", err(&ended));
        let text = err(&ended);
        assert!(
            words.iter().all(|word| text.contains(word)),
            "{args:?}: {text}"
        );
    }
    desk.write("bad.stl", "no mesh");
    for (file, words) in [("none.stl", "check the path"), ("bad.stl", "bad.stl: ")] {
        let shape = format!(r#"{{"type": "trimesh", "file": "{file}"}}"#);
        let ended = ask(&desk, &["--shape", &shape]);
        assert_eq!(code(&ended), Some(2), "bug: {}", err(&ended));
        assert!(
            err(&ended).contains("--shape: ") && err(&ended).contains(words),
            "{}",
            err(&ended)
        );
    }
    let ended = ask(&desk, &["--shape", r#"{"type": "sphere", "radius": -1}"#]);
    assert_eq!(code(&ended), Some(2), "{}", err(&ended));
    assert!(err(&ended).contains("radius is -1"), "{}", err(&ended));
}

#[test]
fn a_ray_is_followed_to_what_it_hits() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, -3.0)]);
    let hit = json(&desk, &["--ray", "-9,0,0,2,0,0", "--json"]);
    assert_eq!(
        (&hit["body"], &hit["verdict"]),
        (&"b".into(), &"colliding".into())
    );
    assert!(
        (hit["t_best_m"].as_f64().unwrap() - 5.5).abs() < 1e-9,
        "{hit}"
    );
    assert_eq!(
        (&hit["complete"], &hit["inside"]),
        (&true.into(), &false.into())
    );
    let none = json(&desk, &["--ray=-9,0,0,2,0,0", "--max", "5.4m", "--json"]);
    assert_eq!(
        (&none["body"], &none["verdict"]),
        (&Value::Null, &"apart".into())
    );
    let masked = json(&desk, &["--ray=-9,0,0,2,0,0", "--mask", "2", "--json"]);
    assert_eq!(
        (&masked["body"], &masked["ignored"]),
        (&Value::Null, &2.into())
    );
    let ended = ask(&desk, &["--ray=0,0,0,0,0,1"]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    for words in [
        "hits        a\n",
        "begins within",
        "complete    yes",
        " old",
    ] {
        assert!(out(&ended).contains(words), "`{words}` in {}", out(&ended));
    }
    for (args, words) in [
        (&["--ray", "1,2,3"][..], "3 numbers"),
        (&["--ray", "1,2,3,4,5,6", "a", "b"], "cannot be used"),
        (&["--mask", "1", "a", "b"], "cannot be used"),
    ] {
        let ended = ask(&desk, args);
        assert_eq!(code(&ended), Some(2), "{args:?}: {}", err(&ended));
        assert!(err(&ended).contains(words), "{args:?}: {}", err(&ended));
    }
    let ended = ask(&desk, &["--ray", "1,2,3,0,0,0"]);
    assert_eq!(code(&ended), Some(2), "{}", err(&ended));
    assert!(err(&ended).contains("all 0"), "{}", err(&ended));
}

#[test]
fn a_time_of_impact_is_told_for_velocities_that_are_said() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 3.0)]);
    let args = ["a", "b", "--impact", "5s", "--linear-b", "-1,0,0", "--json"];
    let told = json(&desk, &args);
    assert_eq!(
        (&told["verdict"], &told["a"]),
        (&"colliding".into(), &"a".into())
    );
    let ends = ["t_min_s", "t_max_s"].map(|key| told[key].as_f64().unwrap());
    assert!(
        ends[0] <= 2.0 && 2.0 <= ends[1] && ends[1] - ends[0] < 1e-6,
        "{told}"
    );
    assert_eq!(told["linear_b"], serde_json::json!([-1.0, 0.0, 0.0]));
    let ended = ask(&desk, &["a", "b", "--impact", "500ms"]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    for words in [
        "touch [s]   never within 0.5",
        "verdict     apart",
        "taken to be at rest",
    ] {
        assert!(out(&ended).contains(words), "`{words}` in {}", out(&ended));
    }
    for (args, words) in [
        (
            &["a", "b", "--impact", "1s", "--linear-a", "1,2"][..],
            "2 numbers",
        ),
        (&["a", "b", "--linear-a", "1,2,3"], "--impact"),
        (&["--touching", "a", "--impact", "1s"], "cannot be used"),
        (&["a", "b", "--impact", "0s"], "--impact, in seconds, is 0"),
        (&["a", "zeppelin", "--impact", "1s"], "zeppelin"),
    ] {
        let ended = ask(&desk, args);
        assert_eq!(code(&ended), Some(2), "{args:?}: {}", err(&ended));
        assert!(err(&ended).contains(words), "{args:?}: {}", err(&ended));
    }
}

#[test]
fn without_a_daemon_that_answers_it_ends_in_time_with_code_3() {
    let desk = Desk::new();
    let ended = ask(&desk, &["a", "b", "--wait", "200ms"]);
    assert_eq!(code(&ended), Some(3), "{}", err(&ended));
    let text = err(&ended);
    assert!(
        text.contains(&desk.instance) && text.contains("sweepd run"),
        "{text}"
    );
    let daemon = desk.run(TWO_SPHERES, &[]);
    drop(desk.client(None));
    daemon.signal(Signal::STOP);
    let ended = ask(&desk, &["a", "b", "--wait", "300ms"]);
    daemon.signal(Signal::CONT);
    assert_eq!(code(&ended), Some(3), "{}", err(&ended));
}

#[test]
fn a_signal_ends_it_before_the_answer_and_that_is_no_success() {
    let desk = Desk::new();
    let mut query = desk.start("query", &["a", "b", "--wait", "600s"]);
    // The query handles signals before it looks for a daemon; before that a signal ends it without an exit code.
    let caught = || {
        let status = std::fs::read_to_string(format!("/proc/{}/status", query.pid())).unwrap();
        let line = status
            .lines()
            .find(|line| line.starts_with("SigCgt"))
            .unwrap();
        u64::from_str_radix(line.split_whitespace().nth(1).unwrap(), 16).unwrap() & 2 != 0
    };
    until("it listens for signals", caught);
    query.signal(Signal::INT);
    let (status, _) = query.end();
    assert_eq!(status.code(), Some(3), "{}", query.stderr());
    assert!(query.stderr().contains("signal"), "{}", query.stderr());
}

/// It printed nothing during its whole wait.
#[test]
fn bug_a_wait_for_a_daemon_is_told_once_and_not_with_quiet() {
    let desk = Desk::new();
    for (quiet, times) in [(&[][..], 1), (&["-q"], 0)] {
        let asked = ["a", "b", "--wait", "1500ms"];
        let ended = ask(&desk, &[&asked, quiet].concat());
        assert_eq!(code(&ended), Some(3), "{}", err(&ended));
        let line = format!("waiting for a daemon `{}`", desk.instance);
        assert_eq!(err(&ended).matches(&line).count(), times, "{}", err(&ended));
        assert!(ended.stdout.is_empty());
    }
}

#[test]
fn bug_a_query_of_nothing_is_told_all_that_can_be_asked() {
    for args in [&["query"][..], &["query", "--at", "1,2,3"]] {
        let ended = output(args);
        assert_eq!(code(&ended), Some(2), "{}", err(&ended));
        for flag in ["two bodies", "--touching", "--shape", "--ray", "--batch"] {
            assert!(err(&ended).contains(flag), "{flag}: {}", err(&ended));
        }
    }
}
