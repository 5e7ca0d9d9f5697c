//! Goal: the Python client fulfils the contract of the Rust one. Method: the stand-in daemon here, `python_client.py`
//! as the client, run by the interpreter in `SWEEPD_PYTHON` or else `python3`, if it has numpy and iceoryx2 0.10.0.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "tests"
)]

mod transport_support;

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use transport_support::{Files, Manners, StandIn};

/// An interpreter that can run the client; if there is none, prints this and returns `None`, and the tests are skipped.
fn python() -> Option<String> {
    let named = std::env::var("SWEEPD_PYTHON");
    let python = named.clone().unwrap_or_else(|_| "python3".to_owned());
    let can = Command::new(&python)
        .args(["-c", "import iceoryx2, numpy"])
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success());
    assert!(
        can || named.is_err(),
        "{python} of SWEEPD_PYTHON has no iceoryx2 and numpy"
    );
    if !can {
        eprintln!("no python3 with iceoryx2 and numpy (SWEEPD_PYTHON): the client was not run");
    }
    can.then_some(python)
}

fn start(python: &str, files: &Files, part: &str) -> Child {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    Command::new(python)
        .arg(here.join("tests/python_client.py"))
        .args([files.root.to_str().unwrap(), &files.prefix, part])
        .env("PYTHONPATH", here.join("msgs/python"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn assert_done(child: Child) {
    let done = child.wait_with_output().unwrap();
    let errors = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{errors}");
}

#[test]
fn the_python_client_steps_reads_asks_and_leaves_nothing_behind() {
    let Some(python) = python() else { return };
    let files = Files::new();
    let daemon = StandIn::iceoryx(&files.place, Manners::default());
    assert_done(start(&python, &files, "all"));
    daemon.stop();
    assert_eq!(files.left(), Vec::<String>::new());
}

#[test]
fn the_python_client_says_that_there_is_no_daemon() {
    let Some(python) = python() else { return };
    let files = Files::new();
    assert_done(start(&python, &files, "alone"));
}

#[test]
fn the_python_client_passes_over_what_is_told_of_a_tick_that_is_under_way() {
    let Some(python) = python() else { return };
    let files = Files::new();
    let manners = Manners {
        long_ticks: true,
        heartbeat_ns: 500_000_000,
        ..Manners::default()
    };
    let _daemon = StandIn::iceoryx(&files.place, manners);
    assert_done(start(&python, &files, "long"));
}

#[test]
fn the_python_client_hears_of_a_restart_and_goes_on() {
    let Some(python) = python() else { return };
    let files = Files::new();
    let daemon = StandIn::iceoryx(&files.place, Manners::default());
    let mut child = start(&python, &files, "restart");
    let mut line = String::new();
    BufReader::new(child.stdout.as_mut().unwrap())
        .read_line(&mut line)
        .unwrap();
    if line.contains("STEPPED") {
        daemon.stop();
        let again = Manners {
            boot_id: 8,
            ..Manners::default()
        };
        let _daemon = StandIn::iceoryx(&files.place, again);
        child.stdin.as_mut().unwrap().write_all(b"\n").unwrap();
        assert_done(child);
    } else {
        assert_done(child);
        panic!("it ended before its step");
    }
}
