//! Refused input: counted by reason, with the source of the last refusal for each reason.

use super::World;
use crate::ids::{BodyId, BodySlot, SourceSlot};
use crate::wire::{REJECTS_LEN, RejectReason, SOURCE_NAME_LEN, name_str};

/// Refusals in this boot.
#[derive(Clone, Debug, Default)]
pub(super) struct Refusals {
    counts: [u64; REJECTS_LEN],
    last: [Option<SourceSlot>; REJECTS_LEN],
    /// The body whose pose or vertices were refused last, by reason; `None`: it was a frame.
    bodies: [Option<BodyId>; REJECTS_LEN],
    /// The source name in the last frame from an unknown source.
    stranger: [u8; SOURCE_NAME_LEN],
}

impl World {
    /// Refusals in this boot, by `RejectReason`.
    #[must_use]
    pub fn rejects(&self) -> &[u64; REJECTS_LEN] {
        &self.refusals.counts
    }

    /// The source of the last refusal for a reason, as far as known; for frames from an unknown source the name in
    /// them.
    #[must_use]
    pub fn refused_of(&self, reason: RejectReason) -> Option<&str> {
        let refusals = &self.refusals;
        match refusals.last[usize::from(reason.code())] {
            Some(source) => self.sources.get(source.index()).map(|s| s.name.as_str()),
            None if reason == RejectReason::UnknownSource => name_str(&refusals.stranger),
            None => None,
        }
    }

    /// Counts a refusal.
    ///
    /// * `source` - the sender; `None`: not a source of the scene, or unknown.
    pub fn note_reject(&mut self, reason: RejectReason, source: Option<SourceSlot>) {
        let place = usize::from(reason.code());
        self.refusals.counts[place] += 1;
        self.refusals.last[place] = source;
        self.refusals.bodies[place] = None;
    }

    /// Records the body whose pose or vertices caused the last counted refusal for a reason.
    pub(super) fn note_refused_body(&mut self, reason: RejectReason, slot: BodySlot) {
        self.refusals.bodies[usize::from(reason.code())] = self.body(slot).map(|body| body.id);
    }

    /// The body whose pose or vertices were refused last for a reason, if it still exists and no frame was refused
    /// since.
    #[must_use]
    pub fn refused_body(&self, reason: RejectReason) -> Option<&str> {
        let id = self.refusals.bodies[usize::from(reason.code())]?;
        let body = self.body(self.slot_of(id)?)?;
        Some(body.name.as_str())
    }

    /// Counts a message that is refused as a whole.
    pub(super) fn note_refused(
        &mut self,
        reason: RejectReason,
        source: Option<SourceSlot>,
        name: &[u8; SOURCE_NAME_LEN],
    ) {
        self.note_reject(reason, source);
        match source {
            Some(source) => self.sources[source.index()].refused += 1,
            None => self.refusals.stranger = *name,
        }
    }
}
