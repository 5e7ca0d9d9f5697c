//! The pair set: overlapping, allowed pairs only, so O(n + k) memory.
//!
//! In: decisions of `broad`, its only writer. Out: [`PairSet`] (dense slots, the pairs of one body, lookup by key) and
//! [`PairDelta`] (what began and ended in this tick). While the pairs of single bodies are read, each pair is in the
//! lists of its two bodies (`set::lists`); a lookup by key uses a hash table of slots (`index`). A map of pairs that
//! every tick walks or refills made one known engine six times slower than its own tree; here only pairs that begin or
//! end are looked up.

use crate::ids::{BodySlot, PairKey, PairSlot};
use crate::wire::EndCause;

mod index;
mod set;
mod spare;

pub(crate) use index::Index;
pub use set::PairSet;
pub(crate) use spare::Spare;

/// Which pairs may be stored. Called before a pair is stored, and again for the bodies of `ChangeSet::requery`.
pub trait PairPolicy {
    /// Returns whether the filters, neighbours and rules let this pair be checked. Symmetric. When the answer changes,
    /// at least one of the two bodies must be in `ChangeSet::requery`.
    fn allows(&self, a: BodySlot, b: BodySlot) -> bool;

    /// Returns whether the body's box is meaningless because its place is unknown: its pairs stay even when the boxes
    /// part. When this ends, the body must be in `ChangeSet::requery`.
    fn keeps(&self, slot: BodySlot) -> bool {
        let _ = slot;
        false
    }

    /// Returns whether no new pairs are made from the box of a body that [`PairPolicy::keeps`] its own: its box covers
    /// no path either.
    fn bars(&self, slot: BodySlot) -> bool {
        self.keeps(slot)
    }
}

/// A pair that left the set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ended {
    /// The slot it had; not reused for another pair before the next tick.
    pub slot: PairSlot,
    /// Its bodies.
    pub key: PairKey,
    /// `Separated`: the boxes parted. `Filtered`: no longer allowed. Else the cause of the body's removal.
    pub cause: EndCause,
}

/// What one tick changed in the pair set. Reused: cleared and refilled by each update of the broad phase.
///
/// If a body left and came back in one tick, its pair is in both lists, with different slots. Both lists are in the
/// order of the bodies' ids (smaller id, larger id), never of slots.
#[derive(Clone, Debug, Default)]
pub struct PairDelta {
    /// Pairs that entered the set.
    pub began: Vec<PairSlot>,
    /// Pairs that left it.
    pub ended: Vec<Ended>,
}

impl PairDelta {
    /// Clears both lists, keeps the memory.
    pub fn clear(&mut self) {
        self.began.clear();
        self.ended.clear();
    }
}
