//! Puts keys of pairs in order: by digits, the lowest first, with no branch that depends on a key.

use super::order::give_back;
use crate::ids::{BodySlot, PairKey};

/// Fewer are sorted by comparing them.
const FEW: usize = 256;
/// Most bits of a digit: the counts of a pass stay in the first cache.
const DIGIT_BITS_MAX: u32 = 12;

/// Memory of the sort, kept over calls.
#[derive(Clone, Debug, Default)]
pub(super) struct KeySort {
    /// The keys without the bits that none has; and where a pass puts them.
    words: Vec<u64>,
    spare: Vec<u64>,
    /// By pass and digit: where the next key with that digit goes.
    ends: Vec<u32>,
}

impl KeySort {
    /// Sorts.
    pub(super) fn sort(&mut self, keys: &mut [PairKey]) {
        if keys.len() < FEW {
            keys.sort_unstable();
            return;
        }
        let used = keys.iter().fold([0, 0], |[lows, highs], key| {
            let (low, high) = key.slots();
            [lows | low.0, highs | high.0]
        });
        let [low_bits, high_bits] = used.map(|used| u32::BITS - used.leading_zeros());
        // As many passes as digits of the size of the list make: more counts than keys are no gain.
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

    /// Ends an update: what it needed more of than most do is given back.
    pub(super) fn close_tick(&mut self, bodies: usize) {
        give_back(&mut self.words, bodies);
        give_back(&mut self.spare, bodies);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
