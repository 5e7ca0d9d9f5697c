//! `sweepd doctor` next to daemons that run, are stopped and were killed. Leftover nodes of killed daemons are tested
//! with separate files (`transport_iceoryx`): with the default ones any daemon on this machine cleans them up.

use std::fs::File;
use std::os::fd::AsFd as _;
use std::path::PathBuf;
use std::process::Command;

use rustix::fs::{FlockOperation, flock};
use rustix::process::Signal;
use serde_json::Value;
use sweepd::transport::client::Topics;

use super::{code, err, head, out};
use crate::live::{Desk, TWO_SPHERES, at, output, run_out, step};

/// Runs `doctor` and returns its findings; asserts that its exit code matches them.
fn look(desk: &Desk, args: &[&str]) -> Vec<Value> {
    let mut all = vec!["doctor", "--json", "--instance", &desk.instance];
    all.extend_from_slice(args);
    let ended = output(&all);
    let findings: Vec<Value> = out(&ended)
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let wrong = findings.iter().any(|f| f["level"] == "wrong");
    let text = out(&ended);
    assert_eq!(
        code(&ended),
        Some(i32::from(wrong)),
        "{text} {}",
        err(&ended)
    );
    assert_eq!(err(&ended), "");
    for finding in &findings {
        let keys: Vec<&String> = finding.as_object().unwrap().keys().collect();
        assert_eq!(keys, ["check", "do", "level", "what"], "{finding}");
        assert_eq!(
            finding["do"].is_null(),
            finding["level"] == "ok",
            "{finding}"
        );
    }
    findings
}

/// The findings of a check whose text contains this word.
fn of<'a>(findings: &'a [Value], check: &str, word: &str) -> Vec<&'a Value> {
    let fits = |f: &&Value| f["check"] == check && f["what"].as_str().unwrap().contains(word);
    findings.iter().filter(fits).collect()
}

/// The lock file of the desk's instance.
fn lock(desk: &Desk) -> Option<PathBuf> {
    let mut files = desk.files().into_iter();
    files.find(|path| path.to_string_lossy().ends_with(".lock"))
}

#[test]
fn every_check_says_a_line_and_text_says_the_same_as_json() {
    let desk = Desk::new();
    let findings = look(&desk, &[]);
    let mut checks = vec!["shared memory", "limits", "rights", "clocks", "instance"];
    if cfg!(feature = "ros2") {
        checks.push("ros2");
    }
    for check in checks {
        assert!(
            !of(&findings, check, "").is_empty(),
            "{check} in {findings:?}"
        );
    }
    let ended = output(&["doctor", "--instance", &desk.instance]);
    let text = out(&ended);
    assert!(
        text.lines().all(|line| ["ok ", "warning ", "wrong "]
            .iter()
            .any(|level| line.starts_with(level))),
        "{text}"
    );
    let ours = format!("no daemon runs as `{}`", desk.instance);
    assert_eq!(of(&findings, "instance", &ours).len(), 1);
    assert!(
        text.contains(&ours) && text.contains("sweepd run SCENE --instance"),
        "{text}"
    );
    for args in [&["doctor"][..], &["doctor", "--json"]] {
        assert_eq!(code(&head(args, 0)), Some(0), "{args:?}");
    }
}

#[test]
fn a_killed_daemon_is_seen_and_cleaned_and_one_that_lives_beside_it_is_left_alone() {
    let (dead, alive) = (Desk::new(), Desk::new());
    let living = alive.run(TWO_SPHERES, &[]);
    let mut client = alive.client(Some("sim"));
    // A client that missed messages of these topics reopens its port, with other files; the test compares the files.
    let topics = Topics {
        changes: false,
        contact_changes: false,
        ..Topics::ALL
    };
    client.subscribe(topics).unwrap();
    step(&mut client, &[at(1, 0.0), at(2, 3.0)]);
    let (boot_id, shared) = (client.hello().boot_id, living.shared());
    let mut killed = dead.run(TWO_SPHERES, &[]);
    drop(dead.client(None));
    killed.kill();
    let path = lock(&dead).unwrap();
    let free = format!("`{}` that nobody holds", dead.instance);
    for _ in 0..2 {
        // Without `--clean` nothing is changed.
        let findings = look(&dead, &[]);
        let seen = of(&findings, "leftovers", &free);
        assert_eq!((seen.len(), &seen[0]["level"]), (1, &"warning".into()));
        assert!(seen[0]["do"].as_str().unwrap().contains("--clean") && path.exists());
    }
    // `--clean` with the running instance does not remove the leftovers of another instance.
    look(&alive, &["--clean"]);
    assert!(path.exists());
    let findings = look(&dead, &["--clean"]);
    let gone = format!("removed: the lock of `{}`", dead.instance);
    assert_eq!(of(&findings, "leftovers", &gone).len(), 1, "{findings:?}");
    assert!(!path.exists());
    let findings = look(&dead, &["--clean"]);
    assert_eq!(
        of(&findings, "leftovers", &dead.instance).len(),
        0,
        "{findings:?}"
    );
    assert_eq!(
        of(&findings, "leftovers", "nothing to clean").len(),
        1,
        "{findings:?}"
    );
    assert_eq!(dead.files(), Vec::<PathBuf>::new());

    let findings = look(&alive, &[]);
    let answers = of(&findings, "instance", "it answers");
    assert_eq!(answers.len(), 1, "{findings:?}");
    assert_eq!(
        of(&findings, "sources", "hears source \"sim\"").len(),
        1,
        "{findings:?}"
    );
    step(&mut client, &[at(1, 0.0), at(2, 4.0)]);
    assert_eq!(client.view().tick().header.boot_id, boot_id, "no restart");
    let lost: Vec<_> = shared.iter().filter(|file| !file.exists()).collect();
    assert!(lost.is_empty(), "{lost:?} of {shared:?}");
}

#[test]
fn a_name_that_is_held_without_an_answer_is_wrong_and_says_by_whom() {
    let desk = Desk::new();
    let mut daemon = desk.run(TWO_SPHERES, &[]);
    drop(desk.client(None));
    daemon.signal(Signal::STOP);
    let findings = look(&desk, &[]);
    daemon.signal(Signal::CONT);
    let wrong = of(&findings, "instance", "which is stopped");
    assert_eq!(wrong.len(), 1, "{findings:?}");
    let mend = wrong[0]["do"].as_str().unwrap();
    assert!(
        mend.contains(&format!("kill -CONT {}", daemon.pid())),
        "{mend}"
    );
    let findings = look(&desk, &[]);
    assert_eq!(
        of(&findings, "instance", "it answers").len(),
        1,
        "{findings:?}"
    );
    let silent = of(&findings, "sources", "nothing of source \"sim\" yet");
    assert_eq!(silent.len(), 1, "{findings:?}");

    // A child process of a killed daemon can still hold its lock.
    daemon.kill();
    let path = lock(&desk).unwrap();
    let file = File::open(&path).unwrap();
    flock(file.as_fd(), FlockOperation::NonBlockingLockExclusive).unwrap();
    let findings = look(&desk, &["--clean"]);
    let held = of(&findings, "instance", "which is not there");
    assert_eq!((held.len(), &held[0]["level"]), (1, &"wrong".into()));
    assert!(
        held[0]["do"]
            .as_str()
            .unwrap()
            .contains("fuser -v /dev/shm/sweepd_")
    );
    assert!(path.exists(), "what is held is not cleaned");

    // Simulates the lock file of a daemon of another version.
    let text = std::fs::read_to_string(&path).unwrap();
    let newer = text.replace("\"wire_version\":1", "\"wire_version\":99");
    std::fs::write(&path, newer).unwrap();
    let findings = look(&desk, &[]);
    let other = of(&findings, "instance", "wire version 99");
    assert_eq!((other.len(), &other[0]["level"]), (1, &"wrong".into()));
    assert!(
        other[0]["what"]
            .as_str()
            .unwrap()
            .contains("wire version 1,")
    );
    std::fs::write(&path, "rubbish").unwrap();
    let findings = look(&desk, &[]);
    let nameless = of(&findings, "instance", "does not say which it is");
    assert_eq!(nameless.len(), 1, "{findings:?}");
    drop(file);
    look(&desk, &["--clean"]);
    assert!(!path.exists());
}

#[test]
fn bug_shared_memory_that_is_mounted_read_only_is_told_as_that() {
    let desk = Desk::new();
    let apart = |words: &str| {
        let mut command = Command::new("unshare");
        command.args(["--user", "--map-root-user", "--mount", "sh", "-c"]);
        command.arg(format!("mount -o remount,bind,ro /dev/shm && {words}"));
        command
    };
    if !apart("true").status().is_ok_and(|status| status.success()) {
        eprintln!("left out: this machine lets nobody mount in a namespace of his own");
        return;
    }
    let mut command = apart("exec \"$@\"");
    command.args(["sh", env!("CARGO_BIN_EXE_sweepd")]);
    let ended = run_out(command, &["doctor", "--json", "--instance", &desk.instance]);
    assert_eq!(code(&ended), Some(1), "{}", err(&ended));
    let lines = out(&ended);
    let findings = lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap());
    let findings: Vec<Value> = findings.collect();
    let shut = of(&findings, "shared memory", "may not make files in /dev/shm");
    assert_eq!((shut.len(), &shut[0]["level"]), (1, &"wrong".into()));
    let mend = shut[0]["do"].as_str().unwrap();
    assert!(mend.contains("mount -o remount,rw /dev/shm"), "{mend}");
    assert!(!mend.contains("chmod"), "{mend}");
}
