//! Slots and memory of pairs that are gone.
//!
//! The lowest slots are used first, so that after a crowd the slots empty from the end: arrays parallel to the slots
//! are only as long as the present pairs need.

use super::{GROWTH, LEAST, PairKey, PairSet};
use crate::ids::PairSlot;

impl PairSet {
    /// Removes free slots from the end, right after a tick was opened, and gives their memory back if they have been
    /// very many for long.
    pub(super) fn cut(&mut self) {
        while self.keys.last() == Some(&PairKey::NOBODY) {
            self.keys.pop();
            self.free.drop_slot(self.keys.len());
        }
        if self.spare.is_over(self.keys.capacity(), self.keys.len()) {
            self.give_back();
        }
    }

    /// The slots of pairs, ascending: skips free ones by whole words.
    pub(crate) fn used_slots(&self) -> impl Iterator<Item = PairSlot> + '_ {
        let used = self.free.others(self.keys.len());
        used.filter(|slot| self.get(*slot).is_some())
    }

    /// Gives back memory for many more pairs than there are, right after a tick was opened. Slots of pairs stay.
    pub(crate) fn give_back(&mut self) {
        debug_assert!(
            self.resting.is_empty(),
            "a slot that rests is not to be used anew"
        );
        self.keys.shrink_to_fit();
        self.resting = Vec::new();
        (self.lists, self.index, self.free) = Default::default();
        self.free.cover(self.keys.len());
        let room = self.len + (self.len / GROWTH).max(LEAST);
        for (slot, key) in (0..).zip(&self.keys) {
            if *key == PairKey::NOBODY {
                self.free.put(slot);
            } else {
                self.index.insert(key.bits(), slot, room);
            }
        }
        self.truncated.shrink_to_fit();
        let last = self.truncated.iter().map(|body| body.index() + 1).max();
        self.is_truncated.truncate(last.unwrap_or(0));
        self.is_truncated.shrink_to_fit();
    }
}
