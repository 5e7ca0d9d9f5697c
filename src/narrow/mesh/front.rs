//! The front of a walk: every pair of boxes that is still open, those that may touch on a stack, the others in a heap.
//!
//! In: pairs with lower bounds. Out: the next pair to open, and the least bound of all.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Most entries of the heap, 16 bytes each; beyond it pairs go to the stack, which is slower but just as sound.
const FRONT_MAX: usize = 1 << 20;

/// A pair of nodes, and a lower bound on the gap of their contents.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) low: f64,
    pub(super) a: u32,
    pub(super) b: u32,
}

impl Ord for Entry {
    /// The least bound compares greatest, so that a heap yields it first; ties by place, for equal replays.
    fn cmp(&self, other: &Self) -> Ordering {
        let places = |e: &Self| (e.a, e.b);
        (other.low.total_cmp(&self.low)).then_with(|| places(other).cmp(&places(self)))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Entry {}

/// All open pairs. Reuses its memory.
#[derive(Debug, Default)]
pub(super) struct Front {
    /// Pairs of boxes that may touch.
    stack: Vec<Entry>,
    /// Pairs of boxes proved apart.
    heap: BinaryHeap<Entry>,
}

impl Front {
    pub(super) fn clear(&mut self) {
        self.stack.clear();
        self.heap.clear();
    }

    pub(super) fn put(&mut self, entry: Entry) {
        if entry.low > 0.0 && self.heap.len() < FRONT_MAX {
            self.heap.push(entry);
        } else {
            self.stack.push(entry);
        }
    }

    /// The newest pair that may touch; if there is none, the nearest of the others.
    pub(super) fn take(&mut self) -> Option<Entry> {
        self.stack.pop().or_else(|| self.heap.pop())
    }

    /// Whether no pair is left that may touch.
    pub(super) fn is_apart(&self) -> bool {
        self.stack.is_empty()
    }

    /// The least bound of all; infinite when none is open.
    ///
    /// Cost: the depth of the two trees.
    pub(super) fn least(&self) -> f64 {
        let top = self.heap.peek().map_or(f64::INFINITY, |e| e.low);
        (self.stack.iter()).fold(top, |low, entry| low.min(entry.low))
    }
}
