//! Radix sort for pair keys: by digits, the lowest first, with no branch that depends on a key.
//!
//! Results are in the order of ids. Usually ids ascend with slots, and keys can be sorted as they are. Once a slot was
//! reused, or with ids chosen by the user, they do not: then each body gets a number in the order of ids, and keys made
//! of these numbers are sorted. The numbers stay valid until a slot gets another id.

use super::members::Members;
use super::order::give_back;
use crate::ids::{BodyId, BodySlot, PairKey, small};

/// Shorter lists are sorted by comparison.
const FEW: usize = 256;
/// Longer lists are sorted in place: a pass takes twice the memory of the list.
const MANY: usize = 1 << 23;
/// Most bits of a digit: the counts of a pass stay in the first-level cache.
const DIGIT_BITS_MAX: u32 = 12;

/// Memory of the sort, kept across calls.
#[derive(Clone, Debug, Default)]
pub(super) struct KeySort {
    /// The keys without the bits that no key uses; and the output of a pass.
    words: Vec<u64>,
    spare: Vec<u64>,
    /// By pass and digit: where the next key with that digit goes.
    ends: Vec<u32>,
}

impl KeySort {
    /// Sorts.
    pub(super) fn sort(&mut self, keys: &mut [PairKey]) {
        if !(FEW..=MANY).contains(&keys.len()) {
            keys.sort_unstable();
            return;
        }
        let used = keys.iter().fold([0, 0], |[lows, highs], key| {
            let (low, high) = key.slots();
            [lows | low.0, highs | high.0]
        });
        let [low_bits, high_bits] = used.map(|used| u32::BITS - used.leading_zeros());
        // Digits are no wider than log2 of the list's length: more counts than keys gain nothing.
        let bits = (low_bits + high_bits).max(1);
        let passes = bits.div_ceil(keys.len().ilog2().min(DIGIT_BITS_MAX));
        let digit_bits = bits.div_ceil(passes);
        let digits = 1_usize << digit_bits;
        let digit = |word: u64, pass: u32| {
            #[allow(clippy::cast_possible_truncation, reason = "a few bits are meant")]
            let low = (word >> (pass * digit_bits)) as usize;
            low & (digits - 1)
        };
        self.ends.clear();
        self.ends.resize(digits * passes as usize, 0);
        self.words.clear();
        self.words.extend(keys.iter().map(|key| {
            let (low, high) = key.slots();
            u64::from(low.0) << high_bits | u64::from(high.0)
        }));
        for word in &self.words {
            for (pass, ends) in (0..).zip(self.ends.chunks_exact_mut(digits)) {
                ends[digit(*word, pass)] += 1;
            }
        }
        self.spare.clear();
        self.spare.resize(keys.len(), 0);
        for (pass, ends) in (0..).zip(self.ends.chunks_exact_mut(digits)) {
            let mut from = 0;
            for end in &mut *ends {
                from += std::mem::replace(end, from);
            }
            for word in &self.words {
                let end = &mut ends[digit(*word, pass)];
                self.spare[*end as usize] = *word;
                *end += 1;
            }
            std::mem::swap(&mut self.words, &mut self.spare);
        }
        for (key, word) in keys.iter_mut().zip(&self.words) {
            #[allow(clippy::cast_possible_truncation, reason = "the two are taken apart")]
            let (low, high) = (
                (word >> high_bits) as u32,
                (word & ((1 << high_bits) - 1)) as u32,
            );
            *key = PairKey::new(BodySlot(low), BodySlot(high));
        }
    }

    /// Ends an update: gives back memory that it needed beyond what most updates do.
    pub(super) fn close_tick(&mut self, bodies: usize) {
        give_back(&mut self.words, bodies);
        give_back(&mut self.spare, bodies);
    }
}

/// Puts keys in the order of ids.
#[derive(Clone, Debug, Default)]
pub(super) struct IdSort {
    sort: KeySort,
    /// By slot: the body's number in the order of ids; and by number, the slot.
    numbers: Vec<u32>,
    slots: Vec<BodySlot>,
    /// Version of the slots' ids that the numbers were made from.
    named: u64,
    /// Version of the slots' ids in the last update, and keys sorted without numbers since that version.
    seen: u64,
    owed: usize,
    /// Keys with their ids, used while there are no numbers.
    ranked: Vec<((BodyId, BodyId), PairKey)>,
}

impl IdSort {
    /// Sorts: by the smaller id, then by the larger.
    pub(super) fn sort(&mut self, keys: &mut [PairKey], members: &Members) {
        if members.ids_ascend() {
            self.sort.sort(keys);
        } else if self.has_numbers(keys.len(), members) {
            let number = |slot: BodySlot| BodySlot(self.numbers[slot.index()]);
            for key in &mut *keys {
                let (low, high) = key.slots();
                *key = PairKey::new(number(low), number(high));
            }
            self.sort.sort(keys);
            for key in keys {
                let (low, high) = key.slots();
                *key = PairKey::new(self.slots[low.index()], self.slots[high.index()]);
            }
        } else {
            self.ranked.clear();
            (self.ranked).extend(keys.iter().map(|key| (members.rank(*key), *key)));
            self.ranked.sort_unstable();
            for (key, (_, ranked)) in keys.iter_mut().zip(&self.ranked) {
                *key = *ranked;
            }
        }
    }

    /// Returns whether there are numbers. They are made once as many keys were sorted without them as there are slots:
    /// where ids change in each tick and few pairs do, they would cost more than they save.
    fn has_numbers(&mut self, keys: usize, members: &Members) -> bool {
        let (named, ids) = (members.named(), members.ids());
        if self.named == named {
            return true;
        }
        if self.seen != named {
            (self.seen, self.owed) = (named, 0);
        }
        self.owed = self.owed.saturating_add(keys);
        if self.owed < ids.len() {
            return false;
        }
        self.named = named;
        self.slots.clear();
        self.slots.extend((0..ids.len()).map(BodySlot::at));
        // The id of a body that left may belong to another by now.
        (self.slots).sort_unstable_by_key(|slot| (ids[slot.index()], *slot));
        self.numbers.clear();
        self.numbers.resize(ids.len(), 0);
        for (number, slot) in self.slots.iter().enumerate() {
            self.numbers[slot.index()] = small(number);
        }
        true
    }

    /// Capacity in keys.
    pub(super) fn capacity(&self) -> usize {
        self.sort.words.capacity() + self.sort.spare.capacity() + self.ranked.capacity()
    }

    /// Ends an update: gives back memory that it needed beyond what most updates do.
    pub(super) fn close_tick(&mut self, bodies: usize) {
        self.sort.close_tick(bodies);
        give_back(&mut self.ranked, bodies);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::broad::Proxies;
    use crate::math::Aabb;

    /// Bodies by slot; only their ids are read.
    struct Named(Vec<u64>, Aabb);

    impl Proxies for Named {
        fn aabb(&self, _: BodySlot) -> &Aabb {
            &self.1
        }
        fn unbounded(&self, _: BodySlot) -> bool {
            true
        }
        fn id(&self, slot: BodySlot) -> BodyId {
            BodyId(self.0[slot.index()])
        }
    }

    #[test]
    fn keys_are_in_the_order_of_ids_with_numbers_and_without_whatever_slot_is_used_again() {
        let mut named = Named((0..40).map(|at| at * 7 % 40 + 1).collect(), Aabb::empty());
        let mut members = Members::new(false);
        for at in 0..40 {
            members.enter(BodySlot(at), &named);
        }
        let mut sort = IdSort::default();
        let mut numbered = 0;
        for round in 0..60_u64 {
            if round % 9 == 0 {
                let slot = BodySlot(small(usize::try_from(round).unwrap() % 40));
                members.leave(slot);
                named.0[slot.index()] = 41 + round;
                members.enter(slot, &named);
            }
            let keys = (0..9 + small(usize::try_from(round % 3).unwrap() * 200)).map(|at| {
                let (low, more) = (at * 11 % 40, 1 + at % 39);
                PairKey::new(BodySlot(low), BodySlot((low + more) % 40))
            });
            let mut keys: Vec<PairKey> = keys.collect();
            let mut wanted = keys.clone();
            wanted.sort_by_key(|key| members.rank(*key));
            sort.sort(&mut keys, &members);
            assert_eq!(keys, wanted, "round {round}");
            numbered += u32::from(sort.named == members.named());
        }
        assert!((20..60).contains(&numbered), "{numbered}");
    }

    #[test]
    fn any_keys_come_out_in_order_and_none_is_lost() {
        let mut sort = KeySort::default();
        let mut state = 1_u32;
        let mut next = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        for (count, low_below) in [
            (0, 5),
            (255, 9),
            (256, 1),
            (1000, 1),
            (5000, 3000),
            (9000, 1 << 20),
        ] {
            let mut keys: Vec<PairKey> = (0..count)
                .map(|_| {
                    let low = next(low_below);
                    PairKey::new(BodySlot(low), BodySlot(low + 1 + next(100)))
                })
                .collect();
            let mut wanted = keys.clone();
            wanted.sort_unstable();
            sort.sort(&mut keys);
            assert_eq!(keys, wanted, "{count} below {low_below}");
        }
    }
}
