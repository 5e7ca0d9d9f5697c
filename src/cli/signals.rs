//! Signals that end a command: the first raises a flag, a later one ends the process at once.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::error::{Error, Result};
use crate::time::{Clock as _, SystemClock};

/// Exit code of a process that is signalled a second time.
pub(super) const EXIT_SIGNALS: i32 = 4;
/// A signal within this time after the first does not count as a second one, nanoseconds: `timeout` signals both the
/// process and its group, and a terminal's Ctrl-C also reaches a process to which a script forwards it.
const ECHO_NS: u64 = 200_000_000;

/// A flag that SIGINT, SIGTERM and SIGHUP raise. A signal [`ECHO_NS`] or more after the first ends the process at once.
///
/// # Errors
/// `Error::Io` if signals cannot be watched.
pub(super) fn stop() -> Result<Arc<AtomicBool>> {
    let stop = stop_at_first()?;
    let mut signals = Signals::new(asking()).map_err(failed)?;
    let watch = move || {
        let mut asked = Asked::default();
        for _ in signals.forever() {
            if asked.again(SystemClock.monotonic_ns()) {
                signal_hook::low_level::exit(EXIT_SIGNALS);
            }
        }
    };
    let thread = std::thread::Builder::new().name("sweepd-signals".to_owned());
    thread.spawn(watch).map_err(failed)?;
    Ok(stop)
}

/// A flag that SIGINT, SIGTERM and SIGHUP raise; the caller handles a second signal.
///
/// # Errors
/// `Error::Io` if signals cannot be watched.
pub(super) fn stop_at_first() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in asking() {
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(failed)?;
    }
    // With a handler for SIGXFSZ, a write beyond the limit of the file size fails with an error instead of ending the
    // process.
    let too_large = rustix::process::Signal::XFSZ.as_raw();
    signal_hook::flag::register(too_large, Arc::default()).map_err(failed)?;
    Ok(stop)
}

/// The signals that ask for an end. SIGHUP, which a closing terminal sends, is left out under `nohup`.
pub(super) fn asking() -> impl Iterator<Item = i32> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let hup = (!is_ignored(&status, SIGHUP)).then_some(SIGHUP);
    [SIGINT, SIGTERM].into_iter().chain(hup)
}

/// Whether a process was started with a signal ignored, by its `/proc/PID/status`.
fn is_ignored(status: &str, signal: i32) -> bool {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

fn failed(e: std::io::Error) -> Error {
    Error::io("cannot listen for signals", e)
}

/// Time of the first signal that asks for an end.
#[derive(Debug, Default)]
pub(super) struct Asked {
    first_ns: Option<u64>,
}

impl Asked {
    /// Notes a signal; returns whether it is a second request.
    pub(super) fn again(&mut self, now_ns: u64) -> bool {
        let first_ns = *self.first_ns.get_or_insert(now_ns);
        now_ns.saturating_sub(first_ns) >= ECHO_NS
    }
}

#[cfg(test)]
mod tests {
    use super::{Asked, ECHO_NS, SIGHUP, SIGTERM, is_ignored};

    #[test]
    fn a_signal_is_ignored_where_the_kernel_says_so() {
        let status = "Name:\tsweepd\nSigBlk:\t0000000000000001\nSigIgn:\t0000000000001001\nSigCgt:\t0000000000004000\n";
        assert!(is_ignored(status, SIGHUP) && !is_ignored(status, SIGTERM));
        assert!(!is_ignored("", SIGHUP) && !is_ignored("SigIgn:\tx", SIGHUP));
    }

    #[test]
    fn what_comes_at_once_is_an_echo_and_what_comes_later_asks_again() {
        let mut asked = Asked::default();
        let heard = [0, 1, ECHO_NS - 1, ECHO_NS, ECHO_NS + 1].map(|after| asked.again(7 + after));
        assert_eq!(heard, [false, false, false, true, true]);
    }
}
