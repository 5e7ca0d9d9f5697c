//! Puts keys of pairs in order: dealt by their lower slots first, so that what is left to sort are handfuls.

use super::order::give_back;
use crate::ids::PairKey;

/// Fewer are sorted without being dealt.
const FEW: usize = 64;
/// Most bits of the slot that they are dealt by: the counts stay in the first cache.
const BITS_MAX: u32 = 12;

/// Memory of the sort, kept over calls.
#[derive(Clone, Debug, Default)]
pub(super) struct KeySort {
    dealt: Vec<PairKey>,
    /// Where the next key of each deal goes.
    ends: Vec<u32>,
}

impl KeySort {
    /// Sorts.
    pub(super) fn sort(&mut self, keys: &mut [PairKey]) {
        if keys.len() < FEW {
            keys.sort_unstable();
            return;
        }
        let low = |key: &PairKey| key.slots().0.index();
        let used = keys.iter().fold(0, |all, key| all | low(key));
        let deals = 1_usize << keys.len().ilog2().min(BITS_MAX);
        let shift = (usize::BITS - used.leading_zeros()).saturating_sub(deals.ilog2());
        self.ends.clear();
        self.ends.resize(deals, 0);
        for key in &*keys {
            self.ends[low(key) >> shift] += 1;
        }
        let mut from = 0;
        for end in &mut self.ends {
            from += std::mem::replace(end, from);
        }
        self.dealt.clear();
        self.dealt.resize(keys.len(), PairKey::NOBODY);
        for key in &*keys {
            let end = &mut self.ends[low(key) >> shift];
            self.dealt[*end as usize] = *key;
            *end += 1;
        }
        let mut from = 0;
        for end in &self.ends {
            let to = *end as usize;
            if to - from > 1 {
                self.dealt[from..to].sort_unstable();
            }
            from = to;
        }
        // Not exchanged: the list of the caller keeps the room that was made for it.
        keys.copy_from_slice(&self.dealt);
    }

    /// Ends an update: what it needed more of than most do is given back.
    pub(super) fn close_tick(&mut self, bodies: usize) {
        give_back(&mut self.dealt, bodies);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::BodySlot;

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
            (63, 9),
            (64, 1),
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
