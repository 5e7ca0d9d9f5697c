//! The free slots of the set: one bit each, so that the lowest is found without keeping any order.

use crate::ids::{PairSlot, small};

/// Bits of a word.
const BITS: usize = u64::BITS as usize;

/// Free slots.
#[derive(Clone, Debug, Default)]
pub(super) struct Free {
    words: Vec<u64>,
    /// No word before this one has a free slot.
    from: usize,
    len: usize,
}

impl Free {
    /// Number of free slots.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Reserves room for `slots` slots.
    pub(super) fn cover(&mut self, slots: usize) {
        let words = slots.div_ceil(BITS);
        if words > self.words.len() {
            self.words.reserve_exact(words - self.words.len());
            self.words.resize(words, 0);
        }
    }

    /// Frees a slot that is not free.
    #[inline]
    pub(super) fn put(&mut self, slot: u32) {
        let at = slot as usize / BITS;
        self.cover(slot as usize + 1);
        debug_assert_eq!(self.words[at] >> (slot % u64::BITS) & 1, 0);
        self.words[at] |= 1 << (slot % u64::BITS);
        self.from = self.from.min(at);
        self.len += 1;
    }

    /// Takes the lowest free slot.
    #[inline]
    pub(super) fn take(&mut self) -> Option<u32> {
        let rest = self.words.get(self.from..)?;
        let ahead = rest.iter().position(|word| *word != 0);
        self.from += ahead.unwrap_or(rest.len());
        let word = self.words.get_mut(self.from)?;
        let bit = word.trailing_zeros();
        *word &= *word - 1;
        self.len -= 1;
        u32::try_from(self.from * BITS)
            .ok()
            .map(|first| first + bit)
    }

    /// Removes a free slot that no longer exists.
    pub(super) fn drop_slot(&mut self, slot: usize) {
        debug_assert!(self.has(slot));
        if let Some(word) = self.words.get_mut(slot / BITS) {
            *word &= !(1 << (slot % BITS));
            self.len -= 1;
        }
    }

    /// The slots below `slots` that are not free, ascending.
    pub(super) fn others(&self, slots: usize) -> impl Iterator<Item = PairSlot> + '_ {
        let words = (0..slots.div_ceil(BITS)).map(move |at| {
            let last = slots - at * BITS;
            let all = if last < BITS {
                (1 << last) - 1
            } else {
                u64::MAX
            };
            (at, all & !self.words.get(at).copied().unwrap_or(0))
        });
        words.flat_map(|(at, mut left)| {
            std::iter::from_fn(move || {
                let bit = left.trailing_zeros();
                (left != 0).then(|| {
                    left &= left - 1;
                    PairSlot(small(at * BITS) + bit)
                })
            })
        })
    }

    /// Makes none free.
    pub(super) fn clear(&mut self) {
        self.words.fill(0);
        (self.from, self.len) = (0, 0);
    }

    /// Returns whether a slot is free.
    pub(super) fn has(&self, slot: usize) -> bool {
        let word = self.words.get(slot / BITS);
        word.is_some_and(|word| word >> (slot % BITS) & 1 == 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_is_taken_first_whenever_it_was_freed() {
        let mut free = Free::default();
        assert_eq!(free.take(), None);
        for slot in [70, 3, 200, 64] {
            free.put(slot);
        }
        assert_eq!((free.take(), free.take()), (Some(3), Some(64)));
        free.put(5);
        assert!(free.has(5) && !free.has(64) && !free.has(1000));
        let left = [free.take(), free.take(), free.take(), free.take()];
        assert_eq!(left, [Some(5), Some(70), Some(200), None]);
        assert_eq!(free.len(), 0);
        free.put(1);
        free.put(66);
        let used = |slots| -> Vec<u32> { free.others(slots).map(|slot| slot.0).collect() };
        assert_eq!(
            (used(0), used(3), used(1000).len()),
            (vec![], vec![0, 2], 998)
        );
        assert_eq!(used(68)[62..], [63, 64, 65, 67]);
        free.drop_slot(66);
        assert_eq!((free.len(), free.has(66), free.has(1)), (1, false, true));
        free.clear();
        assert_eq!((free.take(), free.len()), (None, 0));
    }
}
