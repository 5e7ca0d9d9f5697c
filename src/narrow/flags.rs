//! One flag per pair, packed as bits, so that the flags of all pairs fit into a few cache lines.

use crate::ids::PairSlot;

/// Flags by `PairSlot`; the flag of a pair that was never written is set.
#[derive(Debug, Default)]
pub(super) struct Flags {
    /// A set bit means that the flag is cleared.
    clear: Vec<u64>,
}

impl Flags {
    #[inline]
    pub(super) fn has(&self, slot: PairSlot) -> bool {
        let (word, bit) = place(slot);
        self.clear.get(word).is_none_or(|clear| clear & bit == 0)
    }

    #[inline]
    pub(super) fn set(&mut self, slot: PairSlot) {
        let (word, bit) = place(slot);
        if let Some(clear) = self.clear.get_mut(word) {
            *clear &= !bit;
        }
    }

    pub(super) fn clear(&mut self, slot: PairSlot) {
        let (word, bit) = place(slot);
        if self.clear.len() <= word {
            self.clear.resize(word + 1, 0);
        }
        self.clear[word] |= bit;
    }
}

fn place(slot: PairSlot) -> (usize, u64) {
    (slot.index() / 64, 1 << (slot.index() % 64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flag_is_set_until_it_is_cleared() {
        let mut flags = Flags::default();
        let [one, other] = [PairSlot(70), PairSlot(71)];
        assert!(flags.has(one));
        flags.clear(one);
        assert!(!flags.has(one) && flags.has(other));
        flags.set(one);
        flags.set(PairSlot(5000));
        assert!(flags.has(one) && flags.has(PairSlot(5000)));
    }
}
