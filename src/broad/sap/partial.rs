//! Pairs that overlap on the two kept axes, while the third is skipped.
//!
//! In: pairs that began to overlap on both. Out: those whose boxes overlap on the third as well. Filters are not
//! applied here: these are pairs of boxes, not of the pair set.

use crate::broad::members::{ASKED, MOVED, Members};
use crate::ids::{BodySlot, PairKey, PairSlot};
use crate::pairs::PairSet;

/// The two-axis pairs.
#[derive(Clone, Debug)]
pub(super) struct Partial {
    pairs: PairSet,
    /// By pair: whether the boxes overlapped on all axes at the last test. Only a hint that saves lookups.
    whole: Vec<bool>,
    keys: Vec<PairKey>,
    parted: Vec<PairSlot>,
}

impl Default for Partial {
    fn default() -> Self {
        Self {
            pairs: PairSet::new(usize::MAX),
            whole: Vec::new(),
            keys: Vec::new(),
            parted: Vec::new(),
        }
    }
}

impl Partial {
    /// Number of pairs kept.
    pub(super) fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Removes all.
    pub(super) fn clear(&mut self) {
        self.pairs.clear();
    }

    /// Removes the pairs of a body that left.
    pub(super) fn leave(&mut self, slot: BodySlot) {
        self.pairs.list(1);
        self.parted.extend(self.pairs.pairs_of(slot));
        for pair in self.parted.drain(..) {
            self.pairs.remove(pair);
        }
    }

    /// Adds pairs, without duplicates.
    pub(super) fn add(&mut self, met: &mut Vec<(BodySlot, BodySlot)>) {
        self.pairs.open_tick();
        self.keys.clear();
        self.keys
            .extend(met.drain(..).map(|(a, b)| PairKey::new(a, b)));
        self.keys.sort_unstable();
        self.keys.dedup();
        for key in &self.keys {
            if self.pairs.find(*key).is_none()
                && let Some(slot) = self.pairs.insert(*key)
            {
                if self.whole.len() <= slot.index() {
                    self.whole.resize(slot.index() + 1, false);
                }
                self.whole[slot.index()] = false;
            }
        }
    }

    /// Tests the pairs of all touched bodies: drops those that parted on a kept axis, reports those that now overlap on
    /// all axes, and all overlapping pairs of bodies that are queried.
    pub(super) fn walk(
        &mut self,
        kept: [usize; 2],
        skipped: usize,
        members: &Members,
        began: &mut Vec<PairKey>,
    ) -> u64 {
        let mut tests = 0;
        self.pairs.list(members.touched().len());
        for slot in members.touched() {
            let mine = members.bounds(*slot);
            let asked = members.has(*slot, ASKED);
            for (pair, other) in self.pairs.partners(*slot) {
                let theirs = members.bounds(other);
                tests += 1;
                if !mine.meets(theirs, kept[0]) || !mine.meets(theirs, kept[1]) {
                    // If both bodies are touched, the lower slot drops the pair.
                    if *slot < other || !members.has(other, MOVED | ASKED) {
                        self.parted.push(pair);
                    }
                    continue;
                }
                let whole = mine.meets(theirs, skipped);
                if whole && (asked || !self.whole[pair.index()]) {
                    began.push(PairKey::new(*slot, other));
                }
                self.whole[pair.index()] = whole;
            }
        }
        for pair in self.parted.drain(..) {
            self.pairs.remove(pair);
        }
        tests
    }

    /// Checks the set against the boxes: each pair overlaps on both kept axes.
    pub(super) fn validate(&self, kept: [usize; 2], members: &Members) -> Result<(), String> {
        self.pairs.validate()?;
        for (slot, key) in self.pairs.iter() {
            let (low, high) = key.slots();
            let inside = members.is_bounded(low) && members.is_bounded(high);
            let meets = |k: usize| members.bounds(low).meets(members.bounds(high), k);
            if !inside || !meets(kept[0]) || !meets(kept[1]) {
                return Err(format!("{slot:?} of the two axes should be gone: {key:?}"));
            }
        }
        Ok(())
    }
}
