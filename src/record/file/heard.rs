//! Writes what a client received from a daemon: for viewers only, since it cannot be replayed.

use std::collections::BTreeMap;

use super::medium::Medium;
use super::shown::{self, Show, Shown};
use super::tape::Tape;
use super::{MISSED, WHY};
use crate::error::Result;
use crate::wire::{PairRow, TickRow};

/// Writes received ticks as MCAP.
#[derive(Debug)]
pub struct McapLog<W: Medium> {
    tape: Tape<W>,
    show: Show,
    since_1970_ns: u64,
}

impl<W: Medium> McapLog<W> {
    /// Begins a file without ticks.
    ///
    /// * `name` - name of the file in messages.
    /// * `frame_id` - the scene's frame.
    /// * `since_1970_ns` - what to add to a time of `CLOCK_BOOTTIME` for the time since 1970, nanoseconds.
    ///
    /// # Errors
    /// `Error::Io` if it cannot be written.
    pub fn new(to: W, name: &str, frame_id: &str, since_1970_ns: u64) -> Result<Self> {
        let mut log = Self {
            tape: Tape::new(to, name, shown::TOPICS.into_iter())?,
            show: Show::new(frame_id),
            since_1970_ns,
        };
        log.tape.flush()?;
        Ok(log)
    }

    /// Writes a tick.
    ///
    /// * `has_ended` - whether the tick is complete: a long tick is received more than once.
    ///
    /// # Errors
    /// As [`McapLog::new`].
    pub fn tick(&mut self, shown: &Shown<'_>, has_ended: bool) -> Result<()> {
        let time_ns = shown.tick.sent_ns.saturating_add(self.since_1970_ns);
        self.show.rows(&mut self.tape, time_ns, shown)?;
        if has_ended {
            self.tape.count();
        }
        self.show.tick(&mut self.tape, time_ns, shown.tick)
    }

    /// Number of complete ticks in the file.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        self.tape.ticks()
    }

    /// Writes the ends that a restart of the daemon implies for pairs of the previous boot.
    ///
    /// * `last` - newest tick of the previous boot.
    ///
    /// # Errors
    /// As [`McapLog::new`].
    pub fn restart(&mut self, last: &TickRow, ends: &[PairRow]) -> Result<()> {
        let time_ns = last.sent_ns.saturating_add(self.since_1970_ns);
        if !ends.is_empty() {
            self.show
                .pairs(&mut self.tape, time_ns, &last.header, ends)?;
        }
        self.show.forget_names();
        Ok(())
    }

    /// Flushes what was written, which then survives the end of this process.
    ///
    /// # Errors
    /// As [`McapLog::new`].
    pub fn flush(&mut self) -> Result<()> {
        self.tape.flush()
    }

    /// Closes the file. A file that could not be written was closed then.
    ///
    /// * `missed` - number of ticks that newer ones overtook, so that the file lacks them.
    /// * `why` - reason for the end; empty: the end was requested.
    ///
    /// # Errors
    /// As [`McapLog::new`].
    pub fn end(&mut self, why: &str, missed: u64) -> Result<()> {
        self.tape.end(BTreeMap::from([
            (WHY.to_owned(), why.to_owned()),
            (MISSED.to_owned(), missed.to_string()),
        ]))
    }
}
