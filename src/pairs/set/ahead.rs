//! Memory asked for ahead: what lists of pairs that are looked up, taken out or put in will touch, a few pairs before.
//!
//! Pairs of a list stand anywhere in the set; without it each would wait for memory several times, one wait after the
//! other (measured: half the time of ticks in which most pairs change).

use super::PairSet;
use crate::ids::{BodySlot, PairKey, PairSlot};
use crate::simd::boxes::prefetch;

/// How many pairs ahead memory is asked for: one takes some 30 ns, memory some 100.
const AHEAD: usize = 8;

impl PairSet {
    /// Of a list of keys, asks for what the lookup of one a few places on will read to be brought near: a lookup is
    /// two reads anywhere, one after the other.
    #[inline]
    pub(crate) fn prefetch_find(&self, keys: &[PairKey], at: usize) {
        if let Some(key) = keys.get(at + 2 * AHEAD) {
            self.index.prefetch(key.bits());
        }
        let next = keys.get(at + AHEAD);
        let guess = next.and_then(|key| self.index.guess(key.bits()));
        if let Some(node) = guess.and_then(|at| self.nodes.get(at as usize)) {
            prefetch(node);
        }
    }

    /// Of a list of pairs to be taken out, asks for what that of one a few places on will touch to be brought near.
    #[inline]
    pub(crate) fn prefetch_remove(&self, slots: &[PairSlot], at: usize) {
        let node = |at: usize| self.nodes.get(slots.get(at)?.index());
        if let Some(node) = node(at + 2 * AHEAD) {
            prefetch(node);
        }
        let Some(next) = node(at + AHEAD) else { return };
        self.index.prefetch(next.key.bits());
        for body in next.bodies() {
            self.prefetch_head(body);
        }
        for at in next.next.into_iter().chain(next.prev) {
            self.prefetch_node(at);
        }
    }

    /// Of a list of pairs to be put in, asks for what that of one a few places on will touch to be brought near.
    #[inline]
    pub(crate) fn prefetch_insert(&self, keys: &[PairKey], at: usize) {
        if let Some(key) = keys.get(at + 2 * AHEAD) {
            self.index.prefetch(key.bits());
            let (low, high) = key.slots();
            self.prefetch_head(low);
            self.prefetch_head(high);
        }
        let Some(key) = keys.get(at + AHEAD) else {
            return;
        };
        let place = self.free.len().checked_sub(1 + AHEAD);
        let place = place.map(|at| self.free[at]);
        // It goes before the youngest pair of each of the two.
        let (low, high) = key.slots();
        let seconds = [low, high].map(|body| self.heads.get(body.index()).map(|head| head.first));
        for at in seconds.into_iter().chain([place]).flatten() {
            self.prefetch_node(at);
        }
    }

    #[inline]
    fn prefetch_node(&self, at: u32) {
        if let Some(node) = self.nodes.get(at as usize) {
            prefetch(node);
        }
    }

    #[inline]
    fn prefetch_head(&self, body: BodySlot) {
        if let Some(head) = self.heads.get(body.index()) {
            prefetch(head);
        }
    }
}
