//! A progress line on stderr for long work, if stderr is a terminal; nothing otherwise.

use std::io::{IsTerminal as _, Write as _};

use crate::error::Result;
use crate::scene::Scene;
use crate::shape::Library;
use crate::tick::build::{Shapes, build_shapes_in};
use crate::time::{Clock as _, SystemClock};

/// Least time between two updates of the line, nanoseconds.
const LINE_NS: u64 = 100_000_000;
/// Columns of the line.
const COLUMNS: usize = 76;

/// A progress line. It is erased when this is dropped.
pub(super) struct Progress {
    shown: bool,
    next_ns: u64,
    drawn: bool,
}

impl Progress {
    pub(super) fn new() -> Self {
        Self {
            shown: std::io::stderr().is_terminal(),
            next_ns: 0,
            drawn: false,
        }
    }

    /// Shows the progress, at most once per `LINE_NS`.
    pub(super) fn tell(&mut self, done: u64, all: u64, what: &str) {
        let now_ns = SystemClock.monotonic_ns();
        if !self.shown || now_ns < self.next_ns {
            return;
        }
        self.next_ns = now_ns.saturating_add(LINE_NS);
        self.drawn = true;
        let percent = (100 * done).checked_div(all).unwrap_or(0);
        let line: String = format!("{percent:3} %  {done} of {all}  {what}")
            .chars()
            .take(COLUMNS)
            .collect();
        let _ = write!(std::io::stderr(), "\r{line:<COLUMNS$}");
    }
}

/// Builds the shapes of a scene and shows the progress: meshes may take a while.
///
/// # Errors
/// As [`build_shapes_in`].
pub(super) fn shapes_of(scene: &Scene, library: Library) -> Result<Shapes> {
    let mut progress = Progress::new();
    build_shapes_in(scene, library, |done, all| {
        progress.tell(done as u64, all as u64, "bodies built");
    })
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.drawn {
            let _ = write!(std::io::stderr(), "\r{:<COLUMNS$}\r", "");
        }
    }
}
