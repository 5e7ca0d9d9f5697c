//! Memory asked for ahead: what lists of pairs that are looked up, taken out or put in will touch, a few pairs before.
//!
//! Pairs of a list stand anywhere in the set; without it each would wait for memory several times, one wait after the
//! other (measured: half the time of ticks in which most pairs change).

use super::{Ended, PairSet};
use crate::ids::PairKey;
use crate::simd::boxes::prefetch;

/// How many pairs ahead memory is asked for: one takes some 30 ns, memory some 100.
const AHEAD: usize = 8;

impl PairSet {
    /// Of a list of keys, asks for what the lookup of one a few places on will read to be brought near: a lookup is
    /// two reads anywhere, one after the other.
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

    /// Of a list of pairs to be taken out of the lists of their bodies, asks for what that of one a few places on will
    /// touch to be brought near.
    #[inline]
    pub(super) fn prefetch_unlink(&self, ended: &[Ended], at: usize) {
        if let Some(next) = ended.get(at + 2 * AHEAD) {
            self.lists.prefetch_slot(next.slot);
        }
        if let Some(next) = ended.get(at + AHEAD) {
            self.lists.prefetch_unlink(next.slot, next.key);
        }
    }

    /// Of a list of pairs to be put in, asks for what that of one a few places on will touch to be brought near.
    #[inline]
    pub(super) fn prefetch_insert(&self, keys: &[PairKey], at: usize) {
        let is_listed = self.lists.is_kept();
        if let Some(key) = keys.get(at + 2 * AHEAD) {
            self.index.prefetch(key.bits());
            if is_listed {
                self.lists.prefetch_heads(*key);
            }
        }
        // It goes before the first pair of each of the two.
        if let Some(key) = keys.get(at + AHEAD).filter(|_| is_listed) {
            self.lists.prefetch_seconds(*key);
        }
    }
}
