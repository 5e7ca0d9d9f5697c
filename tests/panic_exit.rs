//! Goal: a panic of the daemon unwinds, prints one line, ends with exit code 101 and leaves nothing in shared memory.
//! Method: this program runs again as the daemon, through the entry point that `main` uses, with a log that panics at
//! the first line that contains a given word: there is no way to make the daemon itself panic.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a test"
)]

mod live;

use std::process::{Command, ExitCode, Stdio};

use live::{Desk, TWO_SPHERES, finish};
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Metadata};

/// The daemon logs this word once it is ready.
const WORD: &str = "bodies";
/// First argument of this program when it hosts the daemon.
const HOST: &str = "run";

/// A log that panics.
struct Broken;

struct Reader;

impl Visit for Reader {
    fn record_debug(&mut self, _field: &Field, value: &dyn std::fmt::Debug) {
        let text = format!("{value:?}");
        assert!(!text.contains(WORD), "the log broke down");
    }
}

impl tracing::Subscriber for Broken {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target().starts_with("sweepd")
    }
    fn new_span(&self, _span: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }
    fn record(&self, _span: &Id, _values: &Record<'_>) {}
    fn record_follows_from(&self, _span: &Id, _follows: &Id) {}
    fn event(&self, event: &Event<'_>) {
        event.record(&mut Reader);
    }
    fn enter(&self, _span: &Id) {}
    fn exit(&self, _span: &Id) {}
}

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.first().map(String::as_str) {
        Some(HOST) => {
            tracing::subscriber::set_global_default(Broken).unwrap();
            return sweepd::cli::main();
        }
        // Arguments of the test runner: this program is one test, and it is not among the ignored ones.
        Some("--list" | "--ignored") => return ExitCode::SUCCESS,
        _ => {}
    }
    a_panic_is_one_line_and_code_101_and_leaves_nothing();
    println!("test a_panic_is_one_line_and_code_101_and_leaves_nothing ... ok");
    ExitCode::SUCCESS
}

fn a_panic_is_one_line_and_code_101_and_leaves_nothing() {
    let desk = Desk::new();
    let scene = desk.scene(TWO_SPHERES);
    let child = Command::new(std::env::current_exe().unwrap())
        .args([HOST, scene.to_str().unwrap(), "--instance", &desk.instance])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let ended = finish(child);
    let text = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(101), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
    assert!(
        text.contains("internal error at") && text.contains("the log broke down"),
        "{text}"
    );
    assert!(text.contains("please report it"), "{text}");
    assert!(ended.stdout.is_empty());
    assert_eq!(desk.files(), Vec::<std::path::PathBuf>::new());
    // The instance can be used again.
    let _daemon = desk.run(TWO_SPHERES, &[]);
    drop(desk.client(None));
}
