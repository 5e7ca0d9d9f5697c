//! For each body the list of its pairs: kept only while somebody reads them.
//!
//! In: pairs that come and go. Out: the pairs of one body, the youngest first. Where most bodies move, nobody asks for
//! the pairs of one, and to keep the lists in step would be half of what a pair that comes or goes costs. So they are
//! let go of once what they cost since the last question is as much as to make them anew, and made at the next one:
//! never more than twice the cost of knowing beforehand.

use crate::ids::{BodySlot, PairKey, PairSlot};
use crate::simd::boxes::prefetch;

/// No pair.
const NONE: u32 = u32::MAX;

/// One of the two places of a pair, by twice the pair's slot and one more for the higher body: the places before and
/// behind it in that body's list.
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

/// The first place of a body's list, and how many there are.
#[derive(Clone, Copy, Debug)]
struct Head {
    first: u32,
    len: u32,
}

impl Head {
    /// Of a body without pairs.
    const NEW: Self = Self {
        first: NONE,
        len: 0,
    };
}

/// The lists of all bodies.
#[derive(Clone, Debug, Default)]
pub(super) struct Lists {
    heads: Vec<Head>,
    halves: Vec<Half>,
    is_kept: bool,
    /// Pairs that came and went since the lists were last asked for.
    upkeep: usize,
}

impl Lists {
    /// Whether they are in step with the set.
    pub(super) fn is_kept(&self) -> bool {
        self.is_kept
    }

    /// They are read now: makes them if need be.
    ///
    /// * `pairs` - all pairs of the set.
    /// * `slots` - one more than the highest slot.
    /// * `room` - so many slots there may be before the set grows.
    pub(super) fn ask(
        &mut self,
        pairs: impl Iterator<Item = (PairSlot, PairKey)>,
        slots: usize,
        room: usize,
    ) {
        self.upkeep = 0;
        if self.is_kept {
            return;
        }
        self.is_kept = true;
        self.heads.clear();
        self.halves.clear();
        self.cover(room);
        self.halves.resize(2 * slots, Half::NEW);
        for (slot, key) in pairs {
            self.link(slot, key);
        }
    }

    /// So many pairs are about to come or to go, of so many: lists that nobody reads are let go of.
    pub(super) fn note_change(&mut self, changes: usize, pairs: usize) {
        if self.is_kept {
            self.upkeep += changes;
            self.is_kept = self.upkeep <= pairs;
        }
    }

    /// Room for so many slots.
    pub(super) fn cover(&mut self, room: usize) {
        if self.is_kept {
            let more = (2 * room).saturating_sub(self.halves.len());
            self.halves.reserve_exact(more);
        }
    }

    /// Empties every list.
    pub(super) fn clear(&mut self) {
        self.heads.clear();
        self.halves.clear();
    }

    /// Puts a pair at the head of the lists of its two bodies.
    #[inline]
    pub(super) fn link(&mut self, slot: PairSlot, key: PairKey) {
        if !self.is_kept {
            return;
        }
        let (low, high) = key.slots();
        if self.heads.len() <= high.index() {
            self.heads.resize(high.index() + 1, Head::NEW);
        }
        if self.halves.len() < 2 * slot.index() + 2 {
            self.halves.resize(2 * slot.index() + 2, Half::NEW);
        }
        for (at, body) in (2 * slot.0..).zip([low, high]) {
            let head = &mut self.heads[body.index()];
            let second = head.first;
            head.first = at;
            head.len += 1;
            self.halves[at as usize] = Half {
                next: second,
                prev: NONE,
            };
            if let Some(second) = self.halves.get_mut(second as usize) {
                second.prev = at;
            }
        }
    }

    /// Takes a pair out of the lists of its two bodies.
    #[inline]
    pub(super) fn unlink(&mut self, slot: PairSlot, key: PairKey) {
        if !self.is_kept {
            return;
        }
        let (low, high) = key.slots();
        for (at, body) in (2 * slot.index()..).zip([low, high]) {
            let Half { next, prev } = self.halves[at];
            let head = &mut self.heads[body.index()];
            head.len -= 1;
            match self.halves.get_mut(prev as usize) {
                Some(before) => before.next = next,
                None => head.first = next,
            }
            if let Some(behind) = self.halves.get_mut(next as usize) {
                behind.prev = prev;
            }
        }
    }

    /// The pairs of a body, the youngest first.
    #[inline]
    pub(super) fn of(&self, body: BodySlot) -> impl Iterator<Item = PairSlot> + '_ {
        let mut at = self.heads.get(body.index()).map_or(NONE, |h| h.first);
        std::iter::from_fn(move || {
            let half = self.halves.get(at as usize)?;
            let here = PairSlot(at / 2);
            at = half.next;
            Some(here)
        })
    }

    /// How many pairs a body has.
    pub(super) fn len_of(&self, body: BodySlot) -> usize {
        self.heads.get(body.index()).map_or(0, |h| h.len as usize)
    }

    /// Asks for what a pair that is to be taken out will touch to be brought near.
    #[inline]
    pub(super) fn prefetch_unlink(&self, slot: PairSlot, key: PairKey) {
        self.prefetch_heads(key);
        for half in self.halves.iter().skip(2 * slot.index()).take(2) {
            for at in [half.next, half.prev] {
                self.prefetch_half(at);
            }
        }
    }

    /// Asks for the heads of the lists of a pair's bodies to be brought near.
    #[inline]
    pub(super) fn prefetch_heads(&self, key: PairKey) {
        let (low, high) = key.slots();
        for head in [low, high].map(|body| self.heads.get(body.index())) {
            head.inspect(|head| prefetch(*head));
        }
    }

    /// Asks for what the pair behind a new one keeps to be brought near.
    #[inline]
    pub(super) fn prefetch_seconds(&self, key: PairKey) {
        let (low, high) = key.slots();
        for body in [low, high] {
            let first = self.heads.get(body.index()).map_or(NONE, |head| head.first);
            self.prefetch_half(first);
        }
    }

    /// Asks for the place of a slot to be brought near.
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

    /// Checks the links both ways and the counts.
    ///
    /// * `key_at` - the pair in a slot.
    /// * `pairs` - how many there are.
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
            let (mut half, mut before, mut count) = (head.first, NONE, 0);
            while half != NONE && count <= pairs {
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
                count += 1;
            }
            if count != head.len as usize {
                let told = head.len;
                return Err(format!("body slot {at} has {count} pairs, not {told}"));
            }
            seen += count;
        }
        if seen != 2 * pairs {
            return Err(format!("{seen} list entries for {pairs} pairs"));
        }
        Ok(())
    }
}
