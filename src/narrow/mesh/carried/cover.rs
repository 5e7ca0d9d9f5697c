//! The entries of a front: pairs of boxes that may touch, and groups of pairs proved apart until the pair has moved so
//! far.

use std::cmp::Ordering;

pub use crate::config::MeshSearch as Search;
use crate::narrow::arena::{Arena, Run};
use crate::shape::BoxId;

/// A box of one side against boxes of one pack of the other side, all proved apart.
///
/// One expiry stands for up to eight pairs: what tests one of them tests all.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    /// Path of the pair at which the proof ends: gap at the test plus the path until then, rounded down, metres.
    pub(super) expiry_m: f64,
    /// The single box.
    pub(super) one: BoxId,
    /// The pack of the other side.
    pub(super) pack: u32,
    /// Which boxes of the pack.
    pub(super) mask: u8,
    /// Whether the pack is B's.
    pub(super) pack_is_b: bool,
    /// One pair of leaves whose boxes touch and whose triangles do not.
    pub(super) leaf: bool,
}

impl Group {
    /// The same, no longer proved.
    pub(super) fn expired(self) -> Self {
        Self {
            expiry_m: f64::NEG_INFINITY,
            ..self
        }
    }

    /// The pair of one lane, A's box first.
    pub(super) fn pair(&self, lane: u32) -> (BoxId, BoxId) {
        let other = BoxId::new(self.pack, lane);
        if self.pack_is_b {
            (self.one, other)
        } else {
            (other, self.one)
        }
    }
}

/// The lanes of a mask, ascending.
pub(in crate::narrow::mesh) fn lanes(mask: u8) -> impl Iterator<Item = u32> {
    let mut rest = mask;
    std::iter::from_fn(move || {
        let lane = rest.trailing_zeros();
        rest &= rest.wrapping_sub(1);
        (lane < 8).then_some(lane)
    })
}

impl Ord for Group {
    /// The soonest expiry is the greatest, so that a heap yields it first; ties by place, for equal replays.
    fn cmp(&self, other: &Self) -> Ordering {
        let place = |g: &Self| (g.one.0, g.pack, g.mask, g.pack_is_b);
        (other.expiry_m.total_cmp(&self.expiry_m)).then_with(|| place(other).cmp(&place(self)))
    }
}

impl PartialOrd for Group {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Group {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Group {}

/// A pair of boxes that may touch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Open {
    /// About how far the boxes overlap at their test, negative metres: for the order only.
    pub(super) low: f64,
    pub(super) a: BoxId,
    pub(super) b: BoxId,
}

impl Ord for Open {
    /// The deepest overlap first, ties by place.
    fn cmp(&self, other: &Self) -> Ordering {
        let place = |o: &Self| (o.a.0, o.b.0);
        (other.low.total_cmp(&self.low)).then_with(|| place(other).cmp(&place(self)))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Open {}

/// The pairs of one front that may touch, in the order of a search.
#[derive(Debug, Default)]
pub(super) struct OpenList {
    search: Search,
    /// A stack, a queue, or a heap.
    items: Run,
    /// Breadth first: the next to be taken.
    head: usize,
}

impl OpenList {
    pub(super) fn clear(&mut self, search: Search) {
        self.search = search;
        self.items.clear();
        self.head = 0;
    }

    /// False where there is no room.
    pub(super) fn push(&mut self, arena: &mut Arena<Open>, open: Open) -> bool {
        if self.search == Search::Priority {
            arena.push_heap(&mut self.items, open)
        } else {
            arena.push(&mut self.items, open)
        }
    }

    pub(super) fn pop(&mut self, arena: &mut Arena<Open>) -> Option<Open> {
        match self.search {
            Search::Priority => arena.pop_heap(&mut self.items),
            Search::BreadthFirst => {
                let next = arena.all(&self.items).get(self.head).copied();
                self.head += usize::from(next.is_some());
                if self.is_empty() {
                    self.items.clear();
                    self.head = 0;
                }
                next
            }
            Search::Carried | Search::Restart => arena.pop(&mut self.items),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(super) fn len(&self) -> usize {
        self.items.len() - self.head
    }

    /// The pairs, in no order.
    pub(super) fn all<'a>(&self, arena: &'a Arena<Open>) -> &'a [Open] {
        &arena.all(&self.items)[self.head..]
    }

    /// Gives its memory back.
    pub(super) fn release(&mut self, arena: &mut Arena<Open>) {
        arena.release(&mut self.items);
        self.head = 0;
    }
}
