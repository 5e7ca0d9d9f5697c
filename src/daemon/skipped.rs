//! Frames without their own tick: skipped for newer ones, or used up together. In: counts of the pacer and the world.
//! Out: the same, reported to engine and recorder.

use super::Daemon;
use crate::config::Mode;
use crate::ids::SourceSlot;
use crate::record::{Between, Recorder};
use crate::tick::Engine;

impl Daemon<'_> {
    /// Reports skipped frames to the engine.
    pub(super) fn tell_passed(&mut self) {
        let (engine, recorder) = (&mut self.engine, &mut self.recorder);
        self.pacer
            .drain_passed(|source, frames| tell_skipped(engine, recorder, source, frames));
    }

    /// The leading source in lockstep, and how many of its frames were taken; `None` for one whose frames are each part
    /// of a body's path.
    pub(super) fn taken_of_lead(&self) -> Option<(SourceSlot, u64)> {
        let Mode::OnFrame(lead) = &self.config.mode else {
            return None;
        };
        let world = self.engine.world();
        let slot = world.source_named(lead)?;
        let frames = world.sources().get(slot.index())?.frames();
        (!world.is_followed(slot.index())).then_some((slot, frames))
    }

    /// Reports frames of the leading source that waited together and were taken in one tick: all except the newest.
    pub(super) fn tell_used_up(&mut self, before: Option<(SourceSlot, u64)>) {
        if let (Some((slot, before)), Some((_, now))) = (before, self.taken_of_lead())
            && now > before + 1
        {
            let used_up = now - before - 1;
            tell_skipped(&mut self.engine, &mut self.recorder, Some(slot), used_up);
        }
    }
}
fn tell_skipped(
    engine: &mut Engine,
    recorder: &mut Option<Recorder>,
    source: Option<SourceSlot>,
    frames: u64,
) {
    engine.note_skipped(source, frames);
    if let Some(recorder) = recorder {
        let source = source.map(|slot| slot.0);
        recorder.note(Between::Skipped { source, frames });
    }
}
