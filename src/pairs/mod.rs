//! The pair set: overlapping, allowed pairs only, so O(n + k) memory.
//!
//! In: what `broad` decides, its only writer. Out: [`PairSet`] (dense slots, the pairs of one body, lookup by key)
//! and [`PairDelta`] (what began and ended in this tick). While somebody asks for the pairs of single bodies, each pair
//! stands in the lists of its two (`set::lists`); a lookup by key goes through a table of places (`index`). A map of
//! pairs that every tick walks or fills anew is what made one known engine six times slower than its own tree; here
//! only what begins and ends is looked up.

use crate::ids::{BodySlot, PairKey, PairSlot};
use crate::wire::EndCause;

mod index;
mod set;
mod spare;

pub(crate) use index::Index;
pub use set::PairSet;
pub(crate) use spare::Spare;

/// Which pairs may be stored. Asked before a pair is ever stored, and again for the bodies of `ChangeSet::requery`.
pub trait PairPolicy {
    /// Whether the filters, neighbours and rules let this pair be checked. Symmetric. A change of the answer is told
    /// by `ChangeSet::requery` with at least one of the two bodies.
    fn allows(&self, a: BodySlot, b: BodySlot) -> bool;

    /// Whether the body's box says nothing of where it is, because that is not known: its pairs stay even when the
    /// boxes part. When this ends, the body stands in `ChangeSet::requery`.
    fn keeps(&self, slot: BodySlot) -> bool {
        let _ = slot;
        false
    }

    /// Whether no new pairs are made from the box of a body that [`PairPolicy::keeps`] its own: the box does not tell
    /// of a way either.
    fn bars(&self, slot: BodySlot) -> bool {
        self.keeps(slot)
    }
}

/// A pair that left the set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ended {
    /// The slot it had; not given to another pair before the next tick.
    pub slot: PairSlot,
    /// Its bodies.
    pub key: PairKey,
    /// `Separated`: the boxes parted. `Filtered`: no longer allowed. Else the cause of the body's removal.
    pub cause: EndCause,
}

/// What one tick changed in the pair set. Reused: emptied and refilled by each update of the broad phase.
///
/// A pair whose body left and came back in one tick stands in both lists, with different slots. Both lists are in the
/// order of the bodies' ids (smaller id, larger id), never of slots.
#[derive(Clone, Debug, Default)]
pub struct PairDelta {
    /// Pairs that entered the set.
    pub began: Vec<PairSlot>,
    /// Pairs that left it.
    pub ended: Vec<Ended>,
}

impl PairDelta {
    /// Empties both lists, keeps the memory.
    pub fn clear(&mut self) {
        self.began.clear();
        self.ended.clear();
    }
}
