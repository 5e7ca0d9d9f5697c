//! The command line: parsed and checked arguments, and the exit codes of the process.
//!
//! Exit codes: 0 done, 1 a check failed, 2 usage or bad input, 3 timed out, 4 refused or could not run, 5 watchdog, 101
//! panic. A closed pipe is a normal end, and so is a terminal that hung up. Results go to stdout, logs to stderr.

mod args;
mod args_query;
mod args_report;
mod args_tools;
mod check;
mod doctor;
mod feed;
mod figures;
mod files;
mod list;
mod manual;
mod monitor;
mod out;
mod progress;
mod query;
mod record;
#[cfg(feature = "mcap")]
mod replay;
mod report;
mod ros;
mod run;
#[cfg(feature = "tui")]
mod screen;
mod signals;
mod values;
mod worst;

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Parser;
use tracing::level_filters::LevelFilter;

use crate::error::{Error, Result};
use crate::time::{Clock as _, SystemClock};
use crate::transport::client::Client;
use args::{Cli, Command};
use out::Out;
use signals::stop;

/// Runs the command line of this process; returns its exit code.
#[must_use]
pub fn main() -> ExitCode {
    let (words, ros_words) = ros::split(std::env::args_os());
    let cli = match Cli::try_parse_from(words) {
        Ok(cli) => cli,
        Err(error) => {
            // A help text that a closed pipe cuts off is still a success.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    install_panic_line();
    start_log(cli.verbose, cli.quiet, ros::log_level(ros_words.as_deref()));
    match dispatch(cli.command, ros_words.as_deref()) {
        Ok(code) => code,
        Err(error) => {
            out::complain(&error.with_causes());
            ExitCode::from(error.exit_code())
        }
    }
}

fn dispatch(command: Command, ros_words: Option<&[String]>) -> Result<ExitCode> {
    if ros_words.is_some() && !matches!(command, Command::Run(_)) {
        let text = "--ros-args is for `sweepd run`: no other command is a ROS 2 node";
        return Err(Error::Usage(text.to_owned()));
    }
    let mut out = Out::stdout();
    let done = match command {
        Command::Run(args) => run::run(&args, ros_words, stop()?.as_ref()),
        Command::Check(args) => check::check(&args, &mut out),
        Command::Feed(args) => feed::feed(&args, &mut out, stop()?.as_ref()),
        Command::Monitor(args) => monitor::monitor(&args, &mut out),
        Command::Query(args) => query::query(&args, &mut out),
        Command::List(args) => list::list(&args, &mut out),
        Command::Doctor(args) => doctor::doctor(&args, &mut out),
        #[cfg(feature = "mcap")]
        Command::Record(args) => record::record(&args, &mut out, stop()?.as_ref()),
        #[cfg(not(feature = "mcap"))]
        Command::Record(_) => Err(record::unable("record")),
        #[cfg(feature = "mcap")]
        Command::Replay(args) => replay::replay(&args, &mut out, stop()?.as_ref()),
        #[cfg(not(feature = "mcap"))]
        Command::Replay(_) => Err(record::unable("replay")),
        Command::Report(args) => report::report(&args, &mut out, stop()?.as_ref()),
        Command::Completions(args) => manual::completions(&args, &mut out),
        Command::Man(args) => manual::man(&args, &mut out),
    };
    match done {
        Ok(true) => Ok(ExitCode::SUCCESS),
        Ok(false) => Ok(ExitCode::from(1)),
        Err(_) if out.closed() => Ok(ExitCode::SUCCESS),
        Err(error) => Err(error),
    }
}

/// Longest connection attempt between two checks of the stop flag, nanoseconds.
const CONNECT_LOOK_NS: u64 = 250_000_000;
/// A longer wait for a daemon is logged, nanoseconds.
const CONNECT_TELL_NS: u64 = 500_000_000;

/// Connects within `wait_ns`; `None`: stopped before there was a connection.
fn connect(
    instance: &str,
    source: Option<&str>,
    wait_ns: u64,
    stop: &AtomicBool,
) -> Result<Option<Client>> {
    let clock = SystemClock;
    let start_ns = clock.monotonic_ns();
    let until_ns = start_ns.saturating_add(wait_ns);
    let mut told = false;
    loop {
        let left_ns = until_ns.saturating_sub(clock.monotonic_ns());
        match Client::connect(instance, source, left_ns.min(CONNECT_LOOK_NS)) {
            // A signal also interrupts waits inside iceoryx2, with another error.
            Err(_) if stop.load(Ordering::Relaxed) => return Ok(None),
            Err(Error::TimedOut(_)) if left_ns > CONNECT_LOOK_NS => {
                let waited_ns = clock.monotonic_ns().saturating_sub(start_ns);
                if !told && waited_ns >= CONNECT_TELL_NS {
                    told = true;
                    tracing::info!("waiting for a daemon `{instance}`");
                }
            }
            done => return done.map(Some),
        }
    }
}

/// Makes a panic print one line. It still unwinds, so that transports close.
fn install_panic_line() {
    std::panic::set_hook(Box::new(|info| {
        let place = info.location().map(ToString::to_string).unwrap_or_default();
        let text = info.payload_as_str().unwrap_or("no message");
        out::complain(&format!(
            "internal error at {place}: {text}; please report it with the scene"
        ));
    }));
}

/// * `asked` - the level from `--ros-args`, which overrides both flags.
fn start_log(verbose: u8, quiet: bool, asked: Option<LevelFilter>) {
    let level = asked.unwrap_or(match (quiet, verbose) {
        (true, _) => LevelFilter::ERROR,
        (false, 0) => LevelFilter::INFO,
        (false, 1) => LevelFilter::DEBUG,
        (false, _) => LevelFilter::TRACE,
    });
    let log = tracing_subscriber::fmt()
        .with_max_level(level)
        .with_writer(std::io::stderr)
        .with_ansi(out::coloured_stderr())
        .with_target(false)
        // The log would report a failed write to stderr, which panics if stderr fails.
        .log_internal_errors(false)
        .finish();
    // A host program with its own log keeps it.
    let _ = tracing::subscriber::set_global_default(log);
}
