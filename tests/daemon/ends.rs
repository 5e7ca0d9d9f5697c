//! How daemons end and start: signals, kills, a second daemon on the same instance.

use rustix::process::Signal;
use std::io::Write as _;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::process::Stdio;
use std::time::Duration;

use sweepd::transport::client::{FrameInfo, Heard, Rows, StepError};
use sweepd::wire::{EndCause, Event};

use crate::live::{
    Desk, SECOND_NS, TWO_SPHERES, at, finish, output, step, sweepd, tick_until, until, with_hangups,
};

/// The entry of an instance in `sweepd list --json`.
fn listed(instance: &str) -> Option<serde_json::Value> {
    let text = output(&["list", "--json"]);
    assert_eq!(text.status.code(), Some(0));
    let text = String::from_utf8(text.stdout).unwrap();
    text.lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap())
        .find(|line| line["instance"] == instance)
}

#[test]
fn a_signal_ends_the_daemon_within_two_seconds_and_leaves_nothing() {
    for signal in [Signal::INT, Signal::TERM] {
        let desk = Desk::new();
        let mut daemon = desk.run(TWO_SPHERES, &[]);
        let mut client = desk.source("sim");
        step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
        assert_eq!(listed(&desk.instance).unwrap()["pid"], daemon.pid());
        let shared = daemon.shared();
        assert!(!shared.is_empty() && desk.files().len() > 5);
        drop(client);
        daemon.signal(signal);
        let (status, time) = daemon.end();
        assert_eq!(status.code(), Some(0), "{}", daemon.stderr());
        assert!(time < Duration::from_secs(2), "{time:?}");
        assert_eq!(desk.files(), Vec::<std::path::PathBuf>::new());
        let left: Vec<_> = shared.iter().filter(|path| path.exists()).collect();
        assert!(left.is_empty(), "{left:?}");
        assert_eq!(listed(&desk.instance), None);
    }
}

#[test]
fn a_terminal_that_closes_ends_the_daemon_but_under_nohup() {
    for ignored in [false, true] {
        let desk = Desk::new();
        let path = desk.scene(TWO_SPHERES);
        let mut daemon = desk.start_as(with_hangups(ignored), "run", &[path.to_str().unwrap()]);
        let mut client = desk.source("sim");
        step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
        daemon.signal(Signal::HUP);
        if ignored {
            // Without `nohup` it would end within these steps.
            for x in [0.6, 0.7] {
                std::thread::sleep(Duration::from_millis(500));
                step(&mut client, &[at(1, 0.0), at(2, x)]);
            }
            daemon.signal(Signal::TERM);
        }
        drop(client);
        assert_eq!(daemon.end().0.code(), Some(0), "{}", daemon.stderr());
        assert_eq!(desk.files(), Vec::<std::path::PathBuf>::new());
    }
}

#[test]
fn a_daemon_that_ends_under_a_client_leaves_nothing_once_the_client_left_too() {
    let desk = Desk::new();
    let mut daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
    assert_eq!(daemon.stop().0.code(), Some(0));
    assert_eq!(client.wait_tick(SECOND_NS / 5).unwrap(), Heard::Silence);
    drop(client);
    assert_eq!(desk.files(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn two_signals_at_once_end_the_daemon_and_the_next_one_starts() {
    let desk = Desk::new();
    for _ in 0..2 {
        let mut daemon = desk.run(TWO_SPHERES, &[]);
        drop(desk.source("sim"));
        daemon.signal(Signal::INT);
        let _ended_meanwhile = rustix::process::kill_process(
            rustix::process::Pid::from_raw(i32::try_from(daemon.pid()).unwrap()).unwrap(),
            Signal::INT,
        );
        // Code 0 after an orderly end; code 4 if the second signal came during it and ended the process at once.
        let code = daemon.end().0.code();
        assert!(matches!(code, Some(0 | 4)), "{code:?} {}", daemon.stderr());
    }
}

#[test]
fn a_second_daemon_on_an_instance_is_refused_and_the_first_goes_on() {
    let desk = Desk::new();
    let first = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
    let mut second = desk.run(TWO_SPHERES, &[]);
    assert_eq!(second.end().0.code(), Some(4));
    let text = second.stderr();
    let wanted = format!("taken by process {}", first.pid());
    assert!(
        text.contains(&wanted) && text.contains("--instance"),
        "{text}"
    );
    assert_eq!(second.stdout(), "");
    step(&mut client, &[at(1, 0.0), at(2, 0.6)]);
    assert_eq!(listed(&desk.instance).unwrap()["pid"], first.pid());
}

#[test]
fn a_killed_daemon_started_again_is_told_to_the_client_with_the_ends_of_its_pairs() {
    let desk = Desk::new();
    let mut daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
    let old_boot = client.view().tick().header.boot_id;
    daemon.kill();
    assert_eq!(
        listed(&desk.instance).map_or(serde_json::Value::Null, |l| l["pid"].clone()),
        serde_json::Value::Null
    );
    let mut daemon = desk.run(TWO_SPHERES, &[]);
    // Frames sent while there is no daemon are lost; the client reconnects by itself.
    let mut told = None;
    until("the restart", || {
        let rows = [at(1, 0.0), at(2, 0.5)];
        match client.step(&FrameInfo::default(), Rows::Poses(&rows), SECOND_NS) {
            Err(StepError::Restarted(news)) => told = Some(news),
            Err(StepError::TimedOut(_)) => {}
            other => panic!("{other:?}"),
        }
        told.is_some()
    });
    let told = told.unwrap();
    assert_eq!(told.old_boot, old_boot);
    assert_ne!(told.new_boot, old_boot);
    let [end] = &told.ends[..] else {
        panic!("{:?}", told.ends)
    };
    assert_eq!(
        (end.body_a, end.body_b, end.events),
        (1, 2, Event::End.bit())
    );
    assert_eq!(end.end_cause, EndCause::Restart.code());
    step(&mut client, &[at(1, 0.0), at(2, 0.4)]);
    assert_eq!(client.view().tick().header.boot_id, told.new_boot);
    let pairs = &client.view().pairs().unwrap().rows;
    assert!((pairs[0].gap_best_m + 0.6).abs() < 1e-9);
    assert_eq!(daemon.stop().0.code(), Some(0), "{}", daemon.stderr());
    drop(client);
    // One daemon was killed and the next one ended; neither leaves files.
    let next = desk.run(TWO_SPHERES, &[]);
    tick_until(&mut desk.client(None), "the next", |_| true);
    drop(next);
    assert_eq!(desk.files(), Vec::<std::path::PathBuf>::new());
}

/// A full pipe: its read end, which nobody reads, and its write end.
fn full_pipe() -> (std::io::PipeReader, std::io::PipeWriter) {
    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    let (reader, mut writer) = std::io::pipe().unwrap();
    let flags = fcntl_getfl(&writer).unwrap();
    fcntl_setfl(&writer, flags | OFlags::NONBLOCK).unwrap();
    for piece in [&[b'.'; 4096][..], b"."] {
        while writer.write(piece).is_ok() {}
    }
    fcntl_setfl(&writer, flags).unwrap();
    (reader, writer)
}

#[test]
fn a_daemon_whose_tick_thread_is_stuck_ends_with_code_5_and_the_next_one_starts() {
    let desk = Desk::new();
    let scene = desk.scene(TWO_SPHERES);
    // Its first log line is never read, so the thread that writes it is stuck for ever.
    let (_unread, log) = full_pipe();
    let child = sweepd()
        .args(["run", scene.to_str().unwrap(), "--watchdog", "2s"])
        .args(["--instance", &desk.instance])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(log)
        .spawn()
        .unwrap();
    assert_eq!(finish(child).status.code(), Some(5));
    let mut next = desk.run(TWO_SPHERES, &[]);
    step(&mut desk.source("sim"), &[at(1, 0.0), at(2, 0.5)]);
    assert_eq!(next.stop().0.code(), Some(0), "{}", next.stderr());
    assert_eq!(desk.files(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn bug_the_watchdog_ended_a_daemon_without_a_word_where_the_log_was_held_up() {
    let desk = Desk::new();
    let scene = desk.scene(TWO_SPHERES);
    let (mut log, unread) = full_pipe();
    let child = sweepd()
        .args(["run", scene.to_str().unwrap(), "--watchdog", "2s"])
        .args(["--instance", &desk.instance])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(unread)
        .spawn()
        .unwrap();
    let threads = format!("/proc/{}/task", child.id());
    let is_ending = || {
        let threads = std::fs::read_dir(&threads).unwrap();
        let name = |thread: std::fs::DirEntry| std::fs::read_to_string(thread.path().join("comm"));
        let mut names = threads.flatten().flat_map(name);
        names.any(|name| name.trim_end() == "sweepd-last")
    };
    until("the watchdog ends it", is_ending);
    // From here on the log is read; the stuck thread holds the lock on it until its line is written.
    let reader = std::thread::spawn(move || {
        let mut text = String::new();
        std::io::Read::read_to_string(&mut log, &mut text).unwrap();
        text
    });
    assert_eq!(finish(child).status.code(), Some(5));
    let text = reader.join().unwrap();
    // The thread that was stuck may log more lines after this one before the process ends.
    let last = "sweepd: the tick thread makes no progress: the daemon ends, start it again";
    let text = text.trim_start_matches('.');
    assert!(text.lines().any(|line| line == last), "{text}");
}

#[test]
fn bug_a_signal_while_a_start_waits_for_shared_memory_was_told_as_a_failure() {
    let desk = Desk::new();
    let mut daemon = desk.run(TWO_SPHERES, &[]);
    drop(desk.client(None));
    let files = desk.files();
    let service = files
        .iter()
        .find(|path| path.extension().is_some_and(|ending| ending == "service"))
        .unwrap();
    assert_eq!(daemon.stop().0.code(), Some(0), "{}", daemon.stderr());
    // iceoryx2 waits for the creator of a half-made service to complete it. It does not remove a service that is a
    // symbolic link.
    let elsewhere = desk.dir.join("half_made");
    let half_made = std::fs::File::create(&elsewhere).unwrap();
    let owner = std::fs::Permissions::from_mode(0o600);
    half_made.set_permissions(owner).unwrap();
    std::os::unix::fs::symlink(&elsewhere, service).unwrap();
    let mut waiting = desk.run(TWO_SPHERES, &["--verbose"]);
    until("it takes the instance", || {
        let files = desk.files();
        files.iter().any(|path| path.starts_with("/dev/shm"))
    });
    waiting.signal(Signal::INT);
    let status = waiting.end().0;
    std::fs::remove_file(service).unwrap();
    let log = waiting.stderr();
    assert_eq!(status.code(), Some(0), "{log}");
    assert!(!log.contains(" runs "), "it did not wait: {log}");
}

#[test]
fn a_watchdog_that_would_take_an_idle_daemon_for_a_stuck_one_is_refused() {
    let desk = Desk::new();
    for (scene, watchdog, least) in [
        (TWO_SPHERES.to_owned(), "50ms", "1100 ms"),
        (
            TWO_SPHERES.replace("[run]", "[run]\nheartbeat_ms = 9500"),
            "10s",
            "10500 ms",
        ),
    ] {
        let mut daemon = desk.run(&scene, &["--watchdog", watchdog]);
        assert_eq!(daemon.end().0.code(), Some(2), "{}", daemon.stderr());
        let text = daemon.stderr();
        assert!(
            text.contains("--watchdog") && text.contains(least),
            "{text}"
        );
    }
}

/// The default watchdog was refused, although no `--watchdog` was given.
#[test]
fn bug_a_long_heartbeat_is_no_reason_to_refuse_the_default_watchdog() {
    let desk = Desk::new();
    let scene = TWO_SPHERES.replace("[run]", "[run]\nheartbeat_ms = 20000");
    let mut daemon = desk.run(&scene, &[]);
    until("it runs", || daemon.stderr().contains(" runs "));
    assert_eq!(daemon.stop().0.code(), Some(0), "{}", daemon.stderr());
}

#[test]
fn a_number_of_ticks_ends_the_daemon() {
    let desk = Desk::new();
    let mut daemon = desk.run(TWO_SPHERES, &["--ticks", "3"]);
    assert_eq!(daemon.end().0.code(), Some(0));
    assert!(
        daemon.stderr().contains("ended after 3 ticks"),
        "{}",
        daemon.stderr()
    );
}

#[test]
fn a_killed_daemon_without_clients_is_not_listed() {
    let desk = Desk::new();
    let mut daemon = desk.run(TWO_SPHERES, &[]);
    drop(desk.client(None));
    assert_eq!(listed(&desk.instance).unwrap()["pid"], daemon.pid());
    daemon.kill();
    assert_eq!(listed(&desk.instance), None);
    let next = desk.run(TWO_SPHERES, &[]);
    drop(desk.client(None));
    assert_eq!(next.stdout(), "", "logs go to stderr");
}

#[test]
fn a_client_of_another_user_is_refused_with_exit_4_and_told_whose_it_is() {
    const NOBODY: u32 = 65_534;
    if !rustix::process::geteuid().is_root() {
        println!("skipped: only root can run a client as another user");
        return;
    }
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    // A copy, because other users may have no access to the build folder.
    let binary = desk.dir.join("sweepd");
    std::fs::copy(env!("CARGO_BIN_EXE_sweepd"), &binary).unwrap();
    std::fs::set_permissions(&desk.dir, std::fs::Permissions::from_mode(0o755)).unwrap();
    let child = std::process::Command::new(&binary)
        .args(["monitor", "--json", "--instance", &desk.instance])
        .uid(NOBODY)
        .gid(NOBODY)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let output = finish(child);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{stderr}");
    assert!(stderr.contains("user id 0"), "{stderr}");
    assert!(stderr.contains("65534"), "{stderr}");
}
