//! `changes` and `contact_changes`: their header, and what rows mean for a list that is kept from them.

use iceoryx2::prelude::ZeroCopySend;

use super::codes::{ContactKind, Verdict, pair_flags};
use super::rows::{ContactRow, MessageHeader, PairRow};
use crate::ids::BodyId;

/// User header of `changes` and `contact_changes`: what the rows are to be applied to, and what that makes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.ChangesHeader")]
pub struct ChangesHeader {
    /// As in every message.
    pub message: MessageHeader,
    /// The tick whose list these rows change; 0: they are the whole list.
    pub base_tick: u64,
    /// How many rows the list has with them.
    pub listed: u64,
}

// The layout is a promise: a change here is a new wire version.
const _: () = assert!(size_of::<ChangesHeader>() == 72);

impl PairRow {
    /// Whether this row of `changes` says that its pair is no longer listed; any other takes the place of the pair's
    /// row.
    #[must_use]
    pub fn has_left(&self) -> bool {
        let told = pair_flags::SWEPT_HIT | pair_flags::SWEPT_OPEN;
        self.verdict <= Verdict::Apart.code() && self.events == 0 && self.flags & told == 0
    }

    /// Brings the row of a pair that nothing was said of since to a later tick: what was certified is so again, by an
    /// older bound.
    ///
    /// * `ticks` - how many ticks later.
    pub fn age(&mut self, ticks: u64) {
        let more = u32::try_from(ticks).unwrap_or(u32::MAX);
        self.bound_age_ticks = self.bound_age_ticks.saturating_add(more);
        if self.verdict == Verdict::Near.code() || self.verdict == Verdict::Colliding.code() {
            self.certified_tick = self.certified_tick.saturating_add(ticks);
        }
    }
}

impl ContactRow {
    /// The row of `contact_changes` that says of a pair that it has no contacts any more.
    #[must_use]
    pub fn gone((body_a, body_b): (BodyId, BodyId)) -> Self {
        Self {
            body_a: body_a.0,
            body_b: body_b.0,
            kind: ContactKind::Gone.code(),
            ..Self::default()
        }
    }

    /// Whether this row of `contact_changes` says that its pair has no contacts any more; any others take the place of
    /// all that the pair had.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.kind == ContactKind::Gone.code()
    }
}
