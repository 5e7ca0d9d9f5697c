//! What the daemon tells its recorder beside the ticks.

use super::{Daemon, Watchdog};
use crate::error::Result;
use crate::record::{Between, Origin, Recorder};
use crate::tick::EditBatch;

impl Daemon<'_> {
    /// Records everything from now on; to be called before the first tick.
    pub fn record(&mut self, recorder: Recorder) {
        self.recorder = Some(recorder);
    }

    /// Ends the recording, where there is one, after the last tick.
    ///
    /// * `watchdog` - ends first: nothing ticks any more, and a slow disk may take its time for what waits.
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

    /// An edit of the next tick, and what it was made of.
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
