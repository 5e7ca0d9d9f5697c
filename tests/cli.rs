//! Goal: the command line as users and scripts see it: exit codes, streams, closed pipes, texts. Method: the real
//! binary as a child; daemons with separate instances.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "tests"
)]

mod live;

#[path = "cli/doctor.rs"]
mod doctor;
#[path = "cli/feed.rs"]
mod feed;
#[path = "cli/limits.rs"]
mod limits;
#[path = "cli/manual.rs"]
mod manual;
#[path = "cli/monitor.rs"]
mod monitor;
#[path = "cli/query.rs"]
mod query;
#[cfg(feature = "mcap")]
#[path = "cli/record.rs"]
mod record;
#[path = "cli/report.rs"]
mod report;

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Output, Stdio};

use live::{Desk, TWO_SPHERES, finish, output, sweepd};

const GOOD: &str = r#"{"id": 1, "a": {"type": "sphere", "radius": 0.5}, "pose_a": {"t": [0,0,0], "q": [1,0,0,0]}, "b": {"type": "sphere", "radius": 0.5}, "pose_b": {"t": [3,0,0], "q": [1,0,0,0]}}"#;

fn code(output: &Output) -> Option<i32> {
    output.status.code()
}

fn out(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn err(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Starts the binary, reads this many lines, closes the pipe and waits for the end.
fn head(args: &[&str], lines: usize) -> Output {
    let mut child = sweepd()
        .args(args)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut pipe = BufReader::new(child.stdout.take().unwrap());
    let mut text = String::new();
    for _ in 0..lines {
        pipe.read_line(&mut text).unwrap();
    }
    drop(pipe);
    let mut ended = finish(child);
    ended.stdout = text.into_bytes();
    ended
}

#[test]
fn usage_is_refused_with_code_2_on_stderr_and_help_is_given_with_code_0_on_stdout() {
    let bad: [&[&str]; 18] = [
        &[],
        &["fly"],
        &["run"],
        &["run", "x.toml", "--budget", "2"],
        &["run", "x.toml", "--budget", "-2ms"],
        &["run", "x.toml", "--budget-units", "2.5"],
        &["run", "x.toml", "--mode", "rate=-1"],
        &["run", "x.toml", "--instance", "Not/AName"],
        &["monitor", "--ticks", "many"],
        &["monitor", "--instance", "UPPER"],
        &["feed"],
        &["query"],
        &["query", "a"],
        &["query", "a", "b", "--batch", "x.jsonl"],
        &["query", "--batch", "x.jsonl", "--instance", "cell"],
        &["doctor", "--instance", "UPPER"],
        &["completions", "csh"],
        &["man", "fly"],
    ];
    for args in bad {
        let ended = output(args);
        assert_eq!(code(&ended), Some(2), "{args:?} {}", err(&ended));
        assert!(
            ended.stdout.is_empty() && !ended.stderr.is_empty(),
            "{args:?}"
        );
    }
    for command in [
        "run",
        "check",
        "feed",
        "monitor",
        "query",
        "list",
        "doctor",
        "replay",
        "report",
        "completions",
        "man",
    ] {
        let ended = output(&[command, "--help"]);
        assert_eq!(code(&ended), Some(0), "{command}");
        assert!(ended.stderr.is_empty(), "{command}");
        assert!(out(&ended).contains("Usage: sweepd"), "{command}");
    }
    assert!(out(&output(&["--version"])).contains(env!("CARGO_PKG_VERSION")));
    let help = out(&output(&["--help"])).replace('\n', " ");
    let codes = "0 done, 1 a check failed, 2 usage or bad input, 3 timed out, 4 refused or could not run, 5 watchdog, 101";
    assert!(help.contains(codes), "{help}");
}

#[test]
fn help_names_units_and_defaults() {
    let help = |command: &str| out(&output(&[command, "--help"]));
    for (command, wanted) in [
        (
            "run",
            &[
                "2ms",
                "500us",
                "[default: default]",
                "rate=HZ",
                "scene's value",
                "at a signal",
            ][..],
        ),
        ("check", &["metres", "10,000"][..]),
        (
            "feed",
            &[
                "per second [default: 100]",
                "[default: 1]",
                "[default: 10s]",
                "[default: wander]",
                "[default: pool]",
                "at a signal",
                "default: all",
                "1 mm",
            ][..],
        ),
        (
            "monitor",
            &[
                "[default: 20]",
                "[default: 10s]",
                "metres",
                "nanoseconds",
                "at a signal",
            ][..],
        ),
        (
            "query",
            &["metres", "[w,x,y,z]", "[default: 5s]", "nanoseconds"][..],
        ),
        ("list", &["JSON"][..]),
        (
            "doctor",
            &["JSON", "one per line", "Nothing of living processes"][..],
        ),
        ("completions", &["bash-completion", "$fpath"][..]),
    ] {
        let text = help(command)
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        for word in wanted {
            assert!(text.contains(word), "{command}: `{word}` in {text}");
        }
    }
}

#[test]
fn a_scene_that_is_missing_or_wrong_is_code_2_with_its_place() {
    let desk = Desk::new();
    let wrong = desk.write(
        "wrong.toml",
        "frame_id = \"w\"\n[[body]]\nname = \"a\"\nmoves = false\nshape = { type = \"ball\" }\n",
    );
    let wrong = wrong.to_str().unwrap();
    for command in ["run", "check", "feed"] {
        let ended = output(&[command, "nowhere/none.toml"]);
        assert_eq!(code(&ended), Some(2), "{command}");
        assert!(err(&ended).contains("nowhere/none.toml"), "{}", err(&ended));
        let ended = output(&[command, wrong]);
        assert_eq!(code(&ended), Some(2), "{command}");
        let text = err(&ended);
        assert!(
            text.contains("wrong.toml:5") && text.contains("ball"),
            "{text}"
        );
        assert!(ended.stdout.is_empty());
    }
    let scene = desk.scene(TWO_SPHERES);
    let ended = output(&["run", scene.to_str().unwrap(), "--mode", "on_frame=ghost"]);
    assert_eq!(code(&ended), Some(2));
    assert!(err(&ended).contains("ghost"), "{}", err(&ended));
    // No message of a source of ROS 2 topics is a whole frame, which lockstep needs.
    let of_topics = TWO_SPHERES
        .replace("on_frame = \"sim\"", "rate = 100")
        .replace("timeout_ms = 3000", "ros2 = { type = \"tf\" }");
    let topics = desk.write("topics.toml", &of_topics);
    let ended = output(&["run", topics.to_str().unwrap(), "--mode", "on_frame=sim"]);
    assert_eq!(code(&ended), Some(2));
    let text = err(&ended);
    assert!(
        text.contains("--mode on_frame=sim: ") && text.contains("body by body"),
        "{text}"
    );
    let ended = output(&["feed", scene.to_str().unwrap(), "--source", "ghost"]);
    assert_eq!(code(&ended), Some(2));
    assert!(err(&ended).contains("it has: sim"), "{}", err(&ended));
}

#[test]
fn check_says_what_the_daemon_would_do_as_text_and_as_json() {
    let desk = Desk::new();
    let rule = "[[rule]]\naction = \"ignore\"\na = \"ghost\"\nb = \"a\"\nreason = \"r\"\n";
    let scene = desk.scene(&format!("{TWO_SPHERES}parent = \"a\"\n{rule}"));
    let scene = scene.to_str().unwrap();
    let ended = output(&["check", scene, "--ignored"]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    let text = out(&ended);
    assert!(
        text.contains("2 bodies, 1 source,") && text.contains("a - b:"),
        "{text}"
    );
    let ended = output(&["check", scene, "--json"]);
    let json: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert!(json["ignored"].is_null(), "bug: not asked for, and listed");
    let ended = output(&["check", scene, "--json", "--ignored"]);
    let json: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(
        (&json["bodies"], &json["ignored_pairs"]),
        (&2.into(), &1.into())
    );
    assert_eq!(json["ignored"][0][0], "a");
    assert_eq!(json["ignored_left_out"], 0);
    let odd = "rule 1: no body has the name \"ghost\"";
    assert!(text.contains(&format!("warning: {odd}")), "{text}");
    assert_eq!(json["warnings"], serde_json::json!([odd]));
}

#[test]
fn bug_check_counted_the_ignored_pairs_of_bodies_that_are_not_enabled_and_did_not_list_them() {
    let desk = Desk::new();
    let scene = desk.scene(&format!("{TWO_SPHERES}parent = \"a\"\nenabled = false\n"));
    let ended = output(&["check", scene.to_str().unwrap(), "--json", "--ignored"]);
    let json: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(json["ignored"][0][2], "neighbours", "{json}");
    assert_eq!(
        (&json["ignored_pairs"], &json["ignored_left_out"]),
        (&1.into(), &0.into())
    );
}

#[test]
fn a_closed_pipe_is_a_normal_end() {
    let desk = Desk::new();
    let scene = desk.scene(TWO_SPHERES);
    let ended = head(&["check", scene.to_str().unwrap()], 0);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    let cases = desk.write("cases.jsonl", &format!("{GOOD}\n").repeat(5000));
    let ended = head(&["query", "--batch", cases.to_str().unwrap()], 1);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    assert!(out(&ended).contains("\"gap_m\":2.0"), "{}", out(&ended));
    assert_eq!(err(&ended), "");
    for args in [
        &["--help"][..],
        &["run", "--help"],
        &["list"],
        &["list", "--json"],
    ] {
        assert_eq!(code(&head(args, 0)), Some(0), "{args:?}");
    }
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let _up = desk.client(None);
    for lines in [0, 1, 3] {
        let ended = head(&["monitor", "--json", "--instance", &desk.instance], lines);
        assert_eq!(code(&ended), Some(0), "{lines}: {}", err(&ended));
        assert_eq!(out(&ended).lines().count(), lines);
        let ended = head(&["monitor", "--instance", &desk.instance], lines);
        assert_eq!(code(&ended), Some(0), "{lines}: {}", err(&ended));
    }
}

#[test]
fn a_batch_with_a_line_that_cannot_be_read_answers_the_others_and_ends_with_code_1() {
    let mut child = sweepd()
        .args(["query", "--batch", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let input = format!("{GOOD}\nrubbish\n{GOOD}\n");
    child
        .stdin
        .take()
        .unwrap()
        .write_all(input.as_bytes())
        .unwrap();
    let ended = finish(child);
    assert_eq!(code(&ended), Some(1), "{}", err(&ended));
    let lines: Vec<serde_json::Value> = out(&ended)
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(
        (lines.len(), &lines[0]["gap_m"], &lines[2]["gap_m"]),
        (3, &2.0.into(), &2.0.into())
    );
    assert!(lines[1]["error"].as_str().unwrap().contains("line 2"));
    let ended = output(&["query", "--batch", "none.jsonl"]);
    assert_eq!(code(&ended), Some(2));
    assert!(err(&ended).contains("none.jsonl"));
    let desk = Desk::new();
    let ended = output(&["query", "--batch", desk.dir.to_str().unwrap()]);
    assert_eq!(code(&ended), Some(2), "bug: {}", err(&ended));
    assert!(err(&ended).contains("this is a folder"), "{}", err(&ended));
}

#[test]
fn bug_values_below_0_were_told_as_unknown_flags() {
    for (args, flag, words) in [
        (
            &["run", "x.toml", "--budget", "-1ms"][..],
            "--budget",
            "`-1ms` is not a time",
        ),
        (
            &["run", "x.toml", "--ticks", "-1"],
            "--ticks",
            "a whole number from 1 on",
        ),
        (&["feed", "x.toml", "--count", "-3"], "--count", "from 0 on"),
        (
            &["query", "a", "b", "--wait", "-1s"],
            "--wait",
            "`-1s` is not a time",
        ),
        (
            &["query", "--touching", "a", "--within", "-5cm"],
            "--within",
            "`-5cm` is not a length",
        ),
        (
            &["query", "--ray", "0,0,0,1,0,0", "--max", "-5m"],
            "--max",
            "`-5m` is not a length",
        ),
        (
            &["query", "a", "b", "--impact", "-1s"],
            "--impact",
            "`-1s` is not a time",
        ),
        (
            &["feed", "x.toml", "--rate", "-5"],
            "--rate",
            "frames per second",
        ),
        (
            &["monitor", "--wait", "-1s"],
            "--wait",
            "`-1s` is not a time",
        ),
        (
            &["report", "error", "x.toml", "--budgets", "-1ms"],
            "--budgets",
            "`-1ms` is not a time",
        ),
    ] {
        let ended = output(args);
        assert_eq!(code(&ended), Some(2), "{args:?}: {}", err(&ended));
        let said = err(&ended);
        assert!(
            said.contains(flag) && said.contains(words),
            "{args:?}: {said}"
        );
        assert!(!said.contains("tip: to pass"), "{args:?}: {said}");
    }
}

#[test]
fn bug_commands_that_were_to_do_nothing_did_that_and_ended_well() {
    for (args, flag) in [
        (&["run", "x.toml", "--ticks", "0"][..], "--ticks"),
        (&["monitor", "--ticks", "0"], "--ticks"),
        (&["record", "x.mcap", "--ticks", "0"], "--ticks"),
        (&["record", "x.mcap", "--for", "0s"], "--for"),
        (&["feed", "x.toml", "--frames", "0"], "--frames"),
        (&["replay", "x.mcap", "--until", "0"], "--until"),
    ] {
        let ended = output(args);
        assert_eq!(code(&ended), Some(2), "{args:?}: {}", err(&ended));
        assert!(err(&ended).contains(flag), "{args:?}: {}", err(&ended));
    }
}

#[test]
fn bug_flags_of_every_command_stood_in_the_midst_of_its_own_and_those_of_query_in_one_heap() {
    for command in ["run", "feed", "query", "monitor"] {
        let help = out(&output(&[command, "--help"]));
        let place = |flag: &str| help.find(flag).unwrap_or_else(|| panic!("{flag}: {help}"));
        let own = if command == "run" {
            "--force"
        } else {
            "--wait"
        };
        assert!(place("--verbose") > place(own), "{help}");
    }
    let help = out(&output(&["query", "--help"]));
    for heading in ["Touching:", "Ray:", "Time of impact:"] {
        assert!(help.contains(heading), "{heading}: {help}");
    }
    let options = help.split("Touching:").next().unwrap();
    assert!(options.contains("--instance") && !options.contains("--ray"));
}

#[test]
fn bug_what_is_wrong_was_told_by_keys_and_variables_that_nobody_wrote() {
    let desk = Desk::new();
    let file = desk.write("page", "mine");
    let scene = desk.scene(TWO_SPHERES);
    let (file, scene) = (file.to_str().unwrap(), scene.to_str().unwrap());
    let mut wrong = vec![
        (
            vec!["query", "a", "b", "--impact", "0s"],
            "--impact, in seconds, is 0: write",
        ),
        (
            vec!["query", "a", "b", "--impact", "200000s"],
            "--impact, in seconds, is 200000: write",
        ),
        (
            vec!["query", "--shape="],
            "--shape is empty: write a shape as",
        ),
        (vec!["man", "--out", file], "this is not a directory"),
    ];
    if cfg!(feature = "ros2") {
        let args = vec!["run", scene, "--ros2", "--ros-domain-id", "999"];
        wrong.push((args, "sweepd: --ros-domain-id 999: "));
        let args = vec!["run", scene, "--ros2", "--ros-domain-id", "-1"];
        wrong.push((args, "sweepd: --ros-domain-id -1: "));
    }
    for (args, words) in wrong {
        let ended = output(&args);
        assert_eq!(code(&ended), Some(2), "{args:?}: {}", err(&ended));
        assert!(err(&ended).contains(words), "{args:?}: {}", err(&ended));
    }
    assert_eq!(std::fs::read(file).unwrap(), b"mine");
}

#[test]
fn bug_a_plan_with_a_long_name_of_a_part_was_told_out_of_line() {
    let desk = Desk::new();
    let mesh = r#"{ type = "trimesh", vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces = [[0, 1, 2]] }"#;
    let scene = desk.scene(&format!(
        "[[source]]\nname = \"sim\"\n[[body]]\nname = \"a\"\nshape = {mesh}\n"
    ));
    let ended = output(&["check", scene.to_str().unwrap()]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    let text = out(&ended);
    assert!(text.contains(": 1 body, 1 source, frame"), "{text}");
    let part = "  search of mesh pairs ";
    assert!(text.contains(part), "{text}");
    let rows = text.lines().filter(|line| line.starts_with("  "));
    for row in rows {
        let (name, chosen) = row.split_at(part.len());
        assert!(name.ends_with(' ') && !chosen.starts_with(' '), "{text}");
    }
}
