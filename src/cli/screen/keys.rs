//! Keys on the terminal that `sweepd monitor` draws on. In: typed keys, and signals. Out: whether `q` was typed. The
//! terminal is restored at the end, by `q`, by a signal or by a panic, and while the process is stopped.

use std::io::IsTerminal as _;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rustix::termios::{LocalModes, OptionalActions, SpecialCodeIndex, Termios};
use signal_hook::consts::{SIGCONT, SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP};
use signal_hook::iterator::{Handle, Signals};

use crate::cli::signals::{Asked, EXIT_SIGNALS, asking, stop_at_first};
use crate::error::{Error, Result};
use crate::time::{Clock as _, SystemClock};

/// Reads single keys after [`Keys::open`].
#[derive(Debug)]
pub(super) struct Keys {
    terminal: Arc<Terminal>,
    signals: Handle,
}

impl Keys {
    /// Watches signals, so that none leaves the terminal changed. Also returns the flag that SIGINT, SIGTERM and SIGHUP
    /// raise.
    ///
    /// # Errors
    /// `Error::Io` if signals cannot be watched.
    pub(super) fn watch() -> Result<(Self, Arc<AtomicBool>)> {
        let failed = |e| Error::io("cannot listen for signals", e);
        let stop = stop_at_first()?;
        let terminal = Arc::<Terminal>::default();
        let all = asking().chain([SIGQUIT, SIGTSTP, SIGCONT]);
        let mut signals = Signals::new(all).map_err(failed)?;
        let keys = Self {
            terminal: Arc::clone(&terminal),
            signals: signals.handle(),
        };
        let watch = move || {
            let mut asked = Asked::default();
            for signal in signals.forever() {
                terminal.take(signal, &mut asked);
            }
        };
        let thread = std::thread::Builder::new().name("sweepd-keys".to_owned());
        thread.spawn(watch).map_err(failed)?;
        Ok((keys, stop))
    }

    /// Switches the terminal to single keys without echo; `false`: there is no terminal to type on.
    pub(super) fn open(&self) -> bool {
        self.terminal.open()
    }

    /// Whether `q` was typed since the last call.
    pub(super) fn is_end_typed(&self) -> bool {
        self.terminal.is_typed(b'q')
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        self.signals.close();
        self.terminal.close();
    }
}

/// The terminal behind standard input.
#[derive(Debug, Default)]
struct Terminal {
    modes: Mutex<Modes>,
}

#[derive(Debug, Default)]
struct Modes {
    is_open: bool,
    /// The modes to restore; `None`: nothing was changed.
    before: Option<Termios>,
}

impl Terminal {
    fn lock(&self) -> MutexGuard<'_, Modes> {
        self.modes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn open(&self) -> bool {
        let mut modes = self.lock();
        modes.is_open = true;
        modes.change();
        modes.before.is_some()
    }

    fn close(&self) {
        let mut modes = self.lock();
        modes.is_open = false;
        modes.restore();
    }

    fn take(&self, signal: i32, asked: &mut Asked) {
        match signal {
            SIGINT | SIGTERM | SIGHUP if asked.again(SystemClock.monotonic_ns()) => {
                self.close();
                std::process::exit(EXIT_SIGNALS);
            }
            SIGQUIT | SIGTSTP => {
                self.lock().restore();
                let _ends_or_stops = signal_hook::low_level::emulate_default_handler(signal);
            }
            SIGCONT => self.lock().change(),
            _ => {}
        }
    }

    fn is_typed(&self, key: u8) -> bool {
        // The kernel stops a process that reads in the background.
        if self.lock().before.is_none() || !is_in_front() {
            return false;
        }
        let mut typed = [0; 64];
        let len = rustix::io::read(std::io::stdin(), &mut typed).unwrap_or_default();
        typed[..len].contains(&key)
    }
}

impl Modes {
    /// Makes a read return at once with the keys typed so far, without echo; keys that send signals still do.
    fn change(&mut self) {
        if !self.is_open || self.before.is_some() || !is_in_front() {
            return;
        }
        let Ok(before) = rustix::termios::tcgetattr(std::io::stdin()) else {
            return;
        };
        let mut own = before.clone();
        own.local_modes
            .remove(LocalModes::ICANON | LocalModes::ECHO);
        own.special_codes[SpecialCodeIndex::VMIN] = 0;
        own.special_codes[SpecialCodeIndex::VTIME] = 0;
        if rustix::termios::tcsetattr(std::io::stdin(), OptionalActions::Now, &own).is_ok() {
            self.before = Some(before);
        }
    }

    fn restore(&mut self) {
        // In the background the terminal belongs to another process.
        if let Some(before) = self.before.take()
            && is_in_front()
        {
            let _gone = rustix::termios::tcsetattr(std::io::stdin(), OptionalActions::Now, &before);
        }
    }
}

/// Whether keys typed on the terminal behind standard input go to this process.
fn is_in_front() -> bool {
    let stdin = std::io::stdin();
    stdin.is_terminal()
        && rustix::termios::tcgetpgrp(&stdin).is_ok_and(|group| group == rustix::process::getpgrp())
}
