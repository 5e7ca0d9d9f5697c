//! Prefetching for lists of pairs to look up, remove or insert, a few pairs ahead.
//!
//! The pairs of a list are anywhere in the set; without prefetching each would cause several cache misses, one after
//! the other (measured: half the time of ticks in which most pairs change).

use super::{Ended, PairSet};
use crate::ids::PairKey;
use crate::simd::boxes::prefetch;

/// How many pairs ahead memory is prefetched: a pair takes some 30 ns, a memory access some 100.
const AHEAD: usize = 8;

impl PairSet {
    /// Prefetches the lookup of a key some positions ahead in a list: a lookup is two dependent reads at random
    /// addresses.
    #[inline]
    pub(super) fn prefetch_find(&self, keys: &[PairKey], at: usize) {
        if let Some(key) = keys.get(at + 2 * AHEAD) {
            self.index.prefetch(key.bits());
        }
        let next = keys.get(at + AHEAD);
        let guess = next.and_then(|key| self.index.guess(key.bits()));
        if let Some(key) = guess.and_then(|at| self.keys.get(at as usize)) {
            prefetch(key);
        }
    }

    /// Prefetches what the removal of a pair some positions ahead will touch in the lists of its bodies.
    #[inline]
    pub(super) fn prefetch_unlink(&self, ended: &[Ended], at: usize) {
        if let Some(next) = ended.get(at + 2 * AHEAD) {
            self.lists.prefetch_slot(next.slot);
        }
        if let Some(next) = ended.get(at + AHEAD) {
            self.lists.prefetch_unlink(next.slot, next.key);
        }
    }

    /// Prefetches what the insertion of a pair some positions ahead will touch.
    #[inline]
    pub(super) fn prefetch_insert(&self, keys: &[PairKey], at: usize) {
        let is_listed = self.lists.is_kept();
        if let Some(key) = keys.get(at + 2 * AHEAD) {
            self.index.prefetch(key.bits());
            if is_listed {
                self.lists.prefetch_heads(*key);
            }
        }
        // It is inserted before the first pair of each of the two bodies.
        if let Some(key) = keys.get(at + AHEAD).filter(|_| is_listed) {
            self.lists.prefetch_seconds(*key);
        }
    }
}
