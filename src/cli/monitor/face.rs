//! Output of the monitor: JSON lines, or the screen.
//!
//! A build without the feature `tui` has no screen and refuses it.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::Names;
use super::json;
use crate::cli::args::MonitorArgs;
use crate::cli::out::Out;
#[cfg(feature = "tui")]
use crate::cli::screen::Screen;
use crate::error::Result;
use crate::transport::client::{Restarted, View};

/// JSON lines, or the screen.
pub(super) enum Face {
    /// One line of JSON per tick.
    Lines,
    /// Drawn in place on a terminal.
    #[cfg(feature = "tui")]
    Screen(Screen),
}

impl Face {
    /// The requested output.
    #[cfg(feature = "tui")]
    #[allow(
        clippy::unnecessary_wraps,
        reason = "without the feature it may be refused"
    )]
    pub(super) fn of(args: &MonitorArgs) -> Result<Self> {
        if args.json {
            return Ok(Self::Lines);
        }
        let screen = Screen::new(args.which.instance.clone(), args.pairs);
        Ok(Self::Screen(screen))
    }

    /// The requested output; refuses the screen, which this build does not have.
    #[cfg(not(feature = "tui"))]
    pub(super) fn of(args: &MonitorArgs) -> Result<Self> {
        use crate::error::Error;

        if args.json {
            return Ok(Self::Lines);
        }
        Err(Error::Usage(
            "this sweepd was built without the screen of `monitor`: add --json for one line per tick, or build it with the feature `tui` (it is on by default)"
                .to_owned(),
        ))
    }

    /// The flag that SIGINT, SIGTERM and SIGHUP raise.
    pub(super) fn stop(&mut self) -> Result<Arc<AtomicBool>> {
        match self {
            Self::Lines => crate::cli::stop(),
            #[cfg(feature = "tui")]
            Self::Screen(screen) => screen.stop(),
        }
    }

    /// Starts to read keys for the screen.
    pub(super) fn open(&mut self) {
        match self {
            Self::Lines => {}
            #[cfg(feature = "tui")]
            Self::Screen(screen) => screen.open(),
        }
    }

    /// Whether the key that ends the monitor was typed.
    pub(super) fn is_end_typed(&self) -> bool {
        match self {
            Self::Lines => false,
            #[cfg(feature = "tui")]
            Self::Screen(screen) => screen.is_end_typed(),
        }
    }

    pub(super) fn tick(
        &mut self,
        view: &View,
        names: &Names,
        args: &MonitorArgs,
        out: &mut Out,
    ) -> Result<()> {
        match self {
            Self::Lines => {
                out.line(&json::tick(view, names, args).to_string())?;
                out.flush()
            }
            #[cfg(feature = "tui")]
            Self::Screen(screen) => screen.show(view, names, out),
        }
    }

    /// Reports a restart of the daemon.
    pub(super) fn restart(&mut self, news: &Restarted, names: &Names, out: &mut Out) -> Result<()> {
        match self {
            Self::Lines => {
                out.line(&json::restart(news, names).to_string())?;
                out.flush()
            }
            #[cfg(feature = "tui")]
            Self::Screen(screen) => {
                screen.note_restart();
                Ok(())
            }
        }
    }

    /// Reports that nothing was received for `silent_ns`. JSON lines do not report silence.
    #[cfg_attr(
        not(feature = "tui"),
        expect(unused_variables, reason = "lines do not say it")
    )]
    pub(super) fn silence(&mut self, silent_ns: u64, out: &mut Out) -> Result<()> {
        match self {
            Self::Lines => Ok(()),
            #[cfg(feature = "tui")]
            Self::Screen(screen) => screen.show_silence(silent_ns, out),
        }
    }

    #[cfg_attr(
        not(feature = "tui"),
        expect(unused_variables, reason = "lines do not say it")
    )]
    pub(super) fn end(&self, out: &mut Out) -> Result<()> {
        match self {
            Self::Lines => Ok(()),
            #[cfg(feature = "tui")]
            Self::Screen(screen) => screen.end(out),
        }
    }
}
