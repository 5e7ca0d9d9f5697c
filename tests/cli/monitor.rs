//! `sweepd monitor` with a pipe and with a terminal, with and without a daemon.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::process::Stdio;
use std::time::Instant;

use rustix::process::Signal;

use super::{code, err, out};
use crate::live::{Desk, TWO_SPHERES, at, finish, output, step, sweepd, until};

#[test]
fn without_a_daemon_it_ends_with_code_3_and_says_what_to_do() {
    let desk = Desk::new();
    for extra in [&[][..], &["--json"]] {
        let mut args = vec!["monitor", "--wait", "300ms", "--instance", &desk.instance];
        args.extend_from_slice(extra);
        let ended = output(&args);
        assert_eq!(code(&ended), Some(3), "{}", err(&ended));
        let text = err(&ended);
        assert!(
            text.contains(&desk.instance) && text.contains("sweepd run"),
            "{text}"
        );
        assert!(ended.stdout.is_empty());
    }
}

#[test]
fn one_line_of_json_is_whole_names_pairs_and_contacts() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &["--budget", "5ms"]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
    for _ in 0..5 {
        step(&mut client, &[at(1, 0.0), at(2, 0.6)]);
        let args = [
            "monitor",
            "--json",
            "--contacts",
            "--ticks",
            "1",
            "--instance",
            &desk.instance,
        ];
        let ended = output(&args);
        assert_eq!(code(&ended), Some(0), "{}", err(&ended));
        let text = out(&ended);
        assert_eq!(text.lines().count(), 1, "{text}");
        let line: serde_json::Value = serde_json::from_str(&text).unwrap();
        let pair = &line["pairs"][0];
        assert_eq!(
            (&pair["a"], &pair["b"]),
            (&"a".into(), &"b".into()),
            "{text}"
        );
        assert_eq!(line["worst"], serde_json::json!(["a", "b"]), "{text}");
        assert!(line["contacts"].is_array(), "{text}");
        assert_eq!(line["budget_ns"], 5_000_000);
        assert_eq!(line["sources"][0]["name"], "sim");
    }
}

#[test]
fn what_is_no_terminal_gets_no_escape_codes() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
    let ended = output(&["monitor", "--ticks", "2", "--instance", &desk.instance]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    let text = out(&ended);
    assert!(
        text.contains("COLLIDING") && text.contains("sim") && !text.contains('\x1b'),
        "{text}"
    );
    assert!(!err(&ended).contains('\x1b'));
}

/// Runs the monitor in a terminal of 24 lines and `columns` columns; `None`: there is no `script` program.
fn on_a_terminal(desk: &Desk, columns: u32, environment: &str, ticks: u32) -> Option<String> {
    let binary = env!("CARGO_BIN_EXE_sweepd");
    let command = format!(
        "stty rows 24 cols {columns}; TERM=xterm {environment} {binary} monitor --ticks {ticks} --instance {}",
        desk.instance
    );
    let child = std::process::Command::new("script")
        .args(["-qec", &command, "/dev/null"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    // The `script` program provides the terminal; where it is not installed the test is skipped.
    let ended = finish(child.ok()?);
    assert_eq!(code(&ended), Some(0), "{} {}", out(&ended), err(&ended));
    Some(out(&ended))
}

#[test]
fn a_terminal_is_drawn_on_in_place_and_never_below_its_last_line() {
    let desk = Desk::new();
    let scene = desk.dir.join("pile.toml");
    let scene = scene.to_str().unwrap();
    output(&[
        "feed",
        "--write-scene",
        scene,
        "--kind",
        "pile",
        "--count",
        "60",
    ]);
    let _daemon = desk.start("run", &[scene, "--budget", "5ms"]);
    let _feed = desk.start("feed", &[scene]);
    let _up = desk.client(None);
    let Some(text) = on_a_terminal(&desk, 80, "", 40) else {
        return;
    };
    assert!(
        text.contains("\x1b[H") && text.contains("\x1b[3"),
        "drawn in place, in colours"
    );
    for drawing in text.split("\x1b[H").skip(1) {
        assert!(drawing.lines().count() <= 24, "{drawing}");
    }
    assert!(text.ends_with("\x1b[?7h"), "lines wrap again at the end");
    let plain = on_a_terminal(&desk, 80, "NO_COLOR=1", 2).unwrap();
    assert!(
        !plain.contains("\x1b[3") && !plain.contains("\x1b[1m"),
        "{plain}"
    );
    for columns in [60, 80, 100, 130] {
        let text = on_a_terminal(&desk, columns, "NO_COLOR=1", 40).unwrap();
        for line in text.split(['\n', '\r']) {
            let shown = line
                .split("\x1b[")
                .skip(1)
                .map(|part| part.split_once(['H', 'J', 'K', 'h', 'l']));
            let shown: usize = shown.flatten().map(|(_, shown)| shown.len()).sum();
            let before = line.split('\x1b').next().unwrap_or_default().len();
            assert!(
                shown + before < columns as usize,
                "bug: {columns}: {line:?}"
            );
        }
        let last = text.rsplit("\x1b[H").next().unwrap();
        for word in ["  missed ", "  rest ", "from [m]", "  event"] {
            assert!(last.contains(word), "{columns}: `{word}` in {last}");
        }
        assert_eq!(last.contains(" closing "), columns > 60, "{last}");
    }
}

#[test]
fn keys_end_the_screen_and_the_terminal_is_as_it_was() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
    let binary = env!("CARGO_BIN_EXE_sweepd");
    let [before, after] = ["before", "after"].map(|name| desk.dir.join(name));
    // Ctrl-C reaches the shell as well, which without a trap could end before it prints the code.
    let command = format!(
        "trap : INT; stty rows 24 cols 80; stty -a > {}; TERM=xterm {binary} monitor --instance {}; echo code $?; stty -a > {}",
        before.display(),
        desk.instance,
        after.display()
    );
    for (keys, codes) in [("xq", &[0][..]), ("\x03", &[0]), ("\x03\x03", &[0, 4])] {
        let child = std::process::Command::new("script")
            .args(["-qec", &command, "/dev/null"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        let Ok(mut child) = child else { return };
        let mut screen = BufReader::new(child.stdout.take().unwrap());
        let mut text = String::new();
        while !text.contains("q ends") {
            assert!(screen.read_line(&mut text).unwrap() > 0, "{text}");
        }
        let mut typed = child.stdin.take().unwrap();
        typed.write_all(keys.as_bytes()).unwrap();
        screen.read_to_string(&mut text).unwrap();
        let ended = finish(child);
        let ends = codes.iter().map(|code| format!("code {code}"));
        assert!(
            ends.into_iter().any(|end| text.contains(&end)),
            "{keys:?}: {text}"
        );
        let [before, after] = [&before, &after].map(|file| std::fs::read_to_string(file).unwrap());
        assert_eq!(before, after, "{keys:?}: {}", err(&ended));
        assert!(
            before.contains(" icanon ") && before.contains(" echo "),
            "{before}"
        );
    }
}

#[test]
fn a_silent_daemon_is_told_and_a_restarted_one_is_gone_on_with() {
    let desk = Desk::new();
    let mut daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
    let monitor = desk.start("monitor", &["--json", "--wait", "60s"]);
    let screen = desk.start("monitor", &["--wait", "60s"]);
    let mut impatient = desk.start("monitor", &["--json", "--wait", "2s"]);
    until("lines", || {
        !monitor.stdout().is_empty()
            && !screen.stdout().is_empty()
            && !impatient.stdout().is_empty()
    });
    daemon.kill();
    let (status, _) = impatient.end();
    assert_eq!(status.code(), Some(3), "{}", impatient.stderr());
    assert!(
        impatient.stderr().contains("no tick for"),
        "{}",
        impatient.stderr()
    );
    until("silence", || screen.stdout().contains("SILENT"));
    let _next = desk.run(TWO_SPHERES, &[]);
    until("the restart", || monitor.stdout().contains("\"restarted\""));
    let text = monitor.stdout();
    let line = text
        .lines()
        .find(|line| line.contains("\"restarted\""))
        .unwrap();
    let news: serde_json::Value = serde_json::from_str(line).unwrap();
    let end = &news["restarted"]["ends"][0];
    assert_eq!(
        (&end["a"], &end["end_cause"]),
        (&"a".into(), &"restart".into()),
        "{line}"
    );
    let before = text.lines().count();
    until("more lines", || {
        monitor.stdout().lines().count() > before + 3
    });
}

#[test]
fn a_signal_ends_it_with_code_0_also_while_it_waits_for_a_daemon() {
    let desk = Desk::new();
    let mut waiting = desk.start("monitor", &["--wait", "60s"]);
    std::thread::sleep(std::time::Duration::from_millis(300));
    waiting.signal(Signal::INT);
    let start = Instant::now();
    assert_eq!(waiting.end().0.code(), Some(0), "{}", waiting.stderr());
    assert!(start.elapsed().as_secs() < 5);
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut running = desk.start("monitor", &["--json"]);
    until("a line", || !running.stdout().is_empty());
    running.signal(Signal::TERM);
    assert_eq!(running.end().0.code(), Some(0), "{}", running.stderr());
}

/// A second signal ended it with code 4 even if it came together with the first, as `timeout` sends them.
#[test]
fn bug_two_signals_at_once_are_one_and_a_later_one_ends_what_is_stuck() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    // Nobody reads the pipe, and it is full.
    let (full, _unread) = std::os::unix::net::UnixStream::pair().unwrap();
    full.set_nonblocking(true).unwrap();
    while (&full).write(&[b' '; 4096]).is_ok() {}
    full.set_nonblocking(false).unwrap();
    let mut client = desk.source("sim");
    let readers = || {
        let listed = out(&output(&["list", "--json"]));
        let all = listed
            .lines()
            .map(|line| serde_json::from_str(line).unwrap());
        let mut ours = all.filter(|one: &serde_json::Value| one["instance"] == *desk.instance);
        ours.next().map(|one| one["readers"].as_u64())
    };
    let before = readers();
    let mut stuck = std::process::Command::new(env!("CARGO_BIN_EXE_sweepd"))
        .args(["monitor", "--json", "--instance", &desk.instance])
        .stdout(Stdio::from(std::os::fd::OwnedFd::from(full)))
        .spawn()
        .unwrap();
    let pid = rustix::process::Pid::from_child(&stuck);
    // The monitor handles signals before it connects.
    until("it is connected", || readers() > before);
    step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
    let wait = || std::thread::sleep(std::time::Duration::from_millis(400));
    wait();
    for signal in [Signal::TERM, Signal::TERM, Signal::INT] {
        rustix::process::kill_process(pid, signal).unwrap();
    }
    wait();
    let ended = stuck.try_wait().unwrap();
    rustix::process::kill_process(pid, Signal::TERM).unwrap();
    assert_eq!(stuck.wait().unwrap().code(), Some(4));
    assert_eq!(ended, None, "these were one");
}

#[test]
fn stdout_that_is_closed_from_the_start_is_a_normal_end() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let _up = desk.client(None);
    let mut child = sweepd()
        .args(["monitor", "--json", "--instance", &desk.instance])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let ended = finish(child);
    assert_eq!((code(&ended), err(&ended).as_str()), (Some(0), ""));
}

/// The window was closed, or the connection was lost.
#[test]
fn bug_a_terminal_that_hung_up_is_a_normal_end() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    let binary = env!("CARGO_BIN_EXE_sweepd");
    for mode in ["", "--json"] {
        let code = desk.dir.join(format!("code{mode}"));
        let command = format!(
            "trap '' HUP; TERM=xterm {binary} monitor {mode} --instance {}; echo $? > {}",
            desk.instance,
            code.display()
        );
        let terminal = std::process::Command::new("script")
            .args(["-qec", &command, "/dev/null"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let Ok(mut terminal) = terminal else { return };
        let mut shown = [0; 64];
        let mut screen = terminal.stdout.take().unwrap();
        assert!(screen.read(&mut shown).unwrap() > 0);
        terminal.kill().unwrap();
        terminal.wait().unwrap();
        let ended = || std::fs::read_to_string(&code).unwrap_or_default();
        until("its end", || {
            step(&mut client, &[at(1, 0.0), at(2, 0.5)]);
            !ended().is_empty()
        });
        assert_eq!(ended().trim(), "0", "{mode}");
    }
}
