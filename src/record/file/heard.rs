//! What a client heard of a daemon is written: for people alone, and nothing that could be replayed.

use std::collections::BTreeMap;

use super::medium::Medium;
use super::shown::{self, Show, Shown};
use super::tape::Tape;
use super::{MISSED, WHY};
use crate::error::Result;
use crate::wire::{PairRow, TickRow};

/// Writes what was heard as MCAP.
#[derive(Debug)]
pub struct McapLog<W: Medium> {
    tape: Tape<W>,
    show: Show,
    since_1970_ns: u64,
}

impl<W: Medium> McapLog<W> {
    /// A file without ticks.
    ///
    /// * `name` - what messages call the file.
    /// * `frame_id` - the scene's frame.
    /// * `since_1970_ns` - what `CLOCK_BOOTTIME` is behind the time of day, nanoseconds.
    ///
    /// # Errors
    /// `Error::Io` when it cannot be written.
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
    /// * `has_ended` - whether this is the whole of it: a long tick is told of more than once.
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

    /// How many ticks that have ended the file has.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        self.tape.ticks()
    }

    /// The daemon has started anew: writes the ends that it means for pairs of the boot that is over.
    ///
    /// * `last` - the newest tick of it.
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

    /// Hands over what was written: it survives the end of this process.
    ///
    /// # Errors
    /// As [`McapLog::new`].
    pub fn flush(&mut self) -> Result<()> {
        self.tape.flush()
    }

    /// Closes the file; one that could not be written was closed then.
    ///
    /// * `missed` - ticks that were overtaken and are not in it.
    /// * `why` - nothing follows; empty: it was meant to end.
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
