//! For each body the list of its pairs: kept only while they are read.
//!
//! In: pairs that come and go. Out: the pairs of one body. Where most bodies move, nothing reads the lists, and their
//! upkeep would be half the cost of adding or removing a pair. So they are dropped once upkeep since the last read has
//! cost as much as a rebuild, and rebuilt once lookups by full scans have cost as much. In total at most about twice
//! the cost of knowing in advance. Their memory is kept.

use crate::ids::{BodySlot, PairKey, PairSlot};
use crate::simd::boxes::prefetch;

/// No pair.
const NONE: u32 = u32::MAX;

/// One of the two list nodes of a pair; its index is twice the pair's slot, plus one for the higher body. Holds the
/// neighbours in that body's list.
#[derive(Clone, Copy, Debug)]
struct Half {
    next: u32,
    prev: u32,
}

impl Half {
    /// In no list.
    const NEW: Self = Self {
        next: NONE,
        prev: NONE,
    };
}

/// Building the lists costs as much as this many full scans: some 10 ns per pair against 0.5 ns.
const LOOKS: usize = 16;

/// The lists of all bodies.
#[derive(Clone, Debug, Default)]
pub(super) struct Lists {
    /// By body: the first node of its list.
    heads: Vec<u32>,
    halves: Vec<Half>,
    is_kept: bool,
    /// Pairs added and removed since the lists were last read.
    upkeep: usize,
    /// Bodies looked up since the lists were dropped.
    asked: usize,
}

impl Lists {
    /// Returns whether the lists are in step with the set.
    pub(super) fn is_kept(&self) -> bool {
        self.is_kept
    }

    /// Announces lookups of `bodies` bodies: builds the lists if that pays.
    ///
    /// * `keys` - the set's keys, by slot.
    /// * `pairs` - the pairs of the set.
    pub(super) fn ask(
        &mut self,
        bodies: usize,
        keys: &Vec<PairKey>,
        pairs: impl Iterator<Item = (PairSlot, PairKey)> + Clone,
    ) {
        if bodies == 0 {
            return;
        }
        self.upkeep = 0;
        self.asked = self.asked.saturating_add(bodies);
        if self.is_kept || self.asked < LOOKS {
            return;
        }
        self.is_kept = true;
        self.cover(keys.capacity());
        self.halves.clear();
        self.halves.resize(2 * keys.len(), Half::NEW);
        let last = pairs.clone().map(|(_, key)| key.slots().1.index()).max();
        self.heads.clear();
        self.heads.resize(last.map_or(0, |last| last + 1), NONE);
        for (slot, key) in pairs {
            self.link(slot, key);
        }
        self.upkeep = 0;
    }

    /// Announces changes of pairs: drops lists that nothing reads.
    pub(super) fn weigh(&mut self, changes: usize, pairs: usize) {
        if self.is_kept && self.upkeep + changes > pairs {
            (self.is_kept, self.asked) = (false, 0);
        }
    }

    /// Reserves room for `room` slots.
    pub(super) fn cover(&mut self, room: usize) {
        if self.is_kept {
            let more = (2 * room).saturating_sub(self.halves.len());
            self.halves.reserve_exact(more);
        }
    }

    /// Clears every list.
    pub(super) fn clear(&mut self) {
        self.heads.clear();
        self.halves.clear();
    }

    /// Inserts a pair at the head of the lists of its two bodies.
    #[inline]
    pub(super) fn link(&mut self, slot: PairSlot, key: PairKey) {
        if !self.is_kept {
            return;
        }
        let (low, high) = key.slots();
        self.upkeep += 1;
        if self.heads.len() <= high.index() {
            self.heads.resize(high.index() + 1, NONE);
        }
        if self.halves.len() < 2 * slot.index() + 2 {
            self.halves.resize(2 * slot.index() + 2, Half::NEW);
        }
        for (at, body) in (2 * slot.0..).zip([low, high]) {
            let second = std::mem::replace(&mut self.heads[body.index()], at);
            self.halves[at as usize] = Half {
                next: second,
                prev: NONE,
            };
            if let Some(second) = self.halves.get_mut(second as usize) {
                second.prev = at;
            }
        }
    }

    /// Removes a pair from the lists of its two bodies.
    #[inline]
    pub(super) fn unlink(&mut self, slot: PairSlot, key: PairKey) {
        if !self.is_kept {
            return;
        }
        self.upkeep += 1;
        let (low, high) = key.slots();
        for (at, body) in (2 * slot.index()..).zip([low, high]) {
            let Half { next, prev } = self.halves[at];
            match self.halves.get_mut(prev as usize) {
                Some(before) => before.next = next,
                None => self.heads[body.index()] = next,
            }
            if let Some(behind) = self.halves.get_mut(next as usize) {
                behind.prev = prev;
            }
        }
    }

    /// The pairs of a body.
    #[inline]
    pub(super) fn of(&self, body: BodySlot) -> impl Iterator<Item = PairSlot> + '_ {
        let mut at = self.heads.get(body.index()).copied().unwrap_or(NONE);
        std::iter::from_fn(move || {
            let half = self.halves.get(at as usize)?;
            let here = PairSlot(at / 2);
            at = half.next;
            Some(here)
        })
    }

    /// Prefetches what the removal of a pair will touch.
    #[inline]
    pub(super) fn prefetch_unlink(&self, slot: PairSlot, key: PairKey) {
        self.prefetch_heads(key);
        for half in self.halves.iter().skip(2 * slot.index()).take(2) {
            for at in [half.next, half.prev] {
                self.prefetch_half(at);
            }
        }
    }

    /// Prefetches the list heads of a pair's bodies.
    #[inline]
    pub(super) fn prefetch_heads(&self, key: PairKey) {
        let (low, high) = key.slots();
        for head in [low, high].map(|body| self.heads.get(body.index())) {
            head.inspect(|head| prefetch(*head));
        }
    }

    /// Prefetches the first nodes of the lists of a pair's bodies.
    #[inline]
    pub(super) fn prefetch_seconds(&self, key: PairKey) {
        let (low, high) = key.slots();
        for body in [low, high] {
            let first = self.heads.get(body.index());
            self.prefetch_half(first.copied().unwrap_or(NONE));
        }
    }

    /// Prefetches the nodes of a slot.
    #[inline]
    pub(super) fn prefetch_slot(&self, slot: PairSlot) {
        self.prefetch_half(2 * slot.0);
    }

    #[inline]
    fn prefetch_half(&self, at: u32) {
        if let Some(half) = self.halves.get(at as usize) {
            prefetch(half);
        }
    }

    /// Checks the links both ways, and that each pair is in two lists.
    ///
    /// * `key_at` - the pair in a slot.
    /// * `pairs` - number of pairs.
    pub(super) fn validate(
        &self,
        key_at: impl Fn(PairSlot) -> Option<PairKey>,
        pairs: usize,
    ) -> Result<(), String> {
        if !self.is_kept {
            return Ok(());
        }
        let mut seen = 0;
        for (at, head) in (0_u32..).zip(&self.heads) {
            let body = BodySlot(at);
            let (mut half, mut before) = (*head, NONE);
            while half != NONE && seen <= 2 * pairs {
                let slot = PairSlot(half / 2);
                let place = self.halves.get(half as usize);
                let mine = key_at(slot).is_some_and(|key| {
                    let (low, high) = key.slots();
                    [low, high][half as usize % 2] == body
                });
                let Some(place) = place.filter(|place| mine && place.prev == before) else {
                    return Err(format!("the list of body slot {at} is broken at {slot:?}"));
                };
                (before, half) = (half, place.next);
                seen += 1;
            }
        }
        if seen != 2 * pairs {
            return Err(format!("{seen} list entries for {pairs} pairs"));
        }
        Ok(())
    }
}
