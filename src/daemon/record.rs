//! What the daemon records in addition to the ticks.

use super::{Daemon, Watchdog};
use crate::error::Result;
use crate::record::{Between, Origin, Recorder};
use crate::tick::EditBatch;

impl Daemon<'_> {
    /// Records everything from now on; must be called before the first tick.
    pub fn record(&mut self, recorder: Recorder) {
        self.recorder = Some(recorder);
    }

    /// Ends the recording, if there is one, after the last tick.
    ///
    /// * `watchdog` - ended first: there are no more ticks, and a slow disk may need time for the rest.
    ///
    /// # Errors
    /// As [`Recorder::finish`].
    pub fn end_record(&mut self, watchdog: Option<Watchdog>) -> Result<()> {
        drop(watchdog);
        self.recorder.take().map_or(Ok(()), Recorder::finish)
    }

    pub(super) fn note(&mut self, between: Between) {
        if let Some(recorder) = &mut self.recorder {
            recorder.note(between);
        }
    }

    /// Adds an edit for the next tick, with its origin.
    pub(super) fn edit(&mut self, batch: EditBatch, origin: Origin) {
        self.ready.push(batch);
        let unused = match &mut self.recorder {
            Some(recorder) => recorder.note_edit(origin),
            None => Some(origin),
        };
        if let Some(origin) = unused {
            self.builder.forget(origin);
        }
    }
}
