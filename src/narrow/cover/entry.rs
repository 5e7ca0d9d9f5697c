//! The entries of a cover: pairs of boxes that may touch, and groups of pairs proved apart until the pair has moved far
//! enough.

use std::cmp::Ordering;

pub use crate::config::MeshSearch as Search;
use crate::narrow::arena::{Arena, Linked, Run};
use crate::shape::{BoxId, Held};

/// A box of one side against boxes of one pack of the other side, all proved apart.
///
/// One expiry for up to eight pairs: one test covers all of them.
#[derive(Clone, Copy, Debug)]
pub(in crate::narrow) struct Group {
    /// Path of the pair at which the proof ends: gap at the test plus the path until then, rounded down, metres.
    pub(in crate::narrow) expiry_m: f64,
    /// The single box.
    pub(in crate::narrow) one: BoxId,
    /// The pack of the other side.
    pub(in crate::narrow) pack: u32,
    /// The boxes of the pack that belong to it.
    pub(in crate::narrow) mask: u8,
    /// Whether the pack is B's.
    pub(in crate::narrow) pack_is_b: bool,
    /// A pair of leaves whose boxes touch and whose triangles do not.
    pub(in crate::narrow) leaf: bool,
}

impl Group {
    /// One pair of leaves.
    pub(in crate::narrow) fn of_leaves(a: BoxId, b: BoxId) -> Self {
        Self {
            expiry_m: 0.0,
            one: a,
            pack: b.pack(),
            mask: 1 << b.lane(),
            pack_is_b: true,
            leaf: true,
        }
    }

    /// The box that is kept and the pack that replaces the other, for two boxes of which at least one is no leaf: the
    /// larger is split, so that both shrink alike. The mask is set later.
    pub(in crate::narrow) fn parting(
        (id_a, held_a): (BoxId, Held),
        (id_b, held_b): (BoxId, Held),
        b_is_larger: impl FnOnce() -> bool,
    ) -> Self {
        let pack_is_b = match (held_a, held_b) {
            (Held::Pack(_), Held::Pack(_)) => b_is_larger(),
            (held_a, _) => matches!(held_a, Held::Triangle(_)),
        };
        let (one, parted) = if pack_is_b {
            (id_a, held_b)
        } else {
            (id_b, held_a)
        };
        let pack = match parted {
            Held::Pack(pack) => pack,
            // Not reached: of two leaves none is split.
            Held::Triangle(_) => 0,
        };
        Self {
            expiry_m: f64::NEG_INFINITY,
            one,
            pack,
            mask: 0,
            pack_is_b,
            leaf: false,
        }
    }

    /// The same group, no longer proved.
    pub(in crate::narrow) fn expired(self) -> Self {
        Self {
            expiry_m: f64::NEG_INFINITY,
            ..self
        }
    }

    /// The pair of one lane, A's box first.
    pub(in crate::narrow) fn pair(&self, lane: u32) -> (BoxId, BoxId) {
        let other = BoxId::new(self.pack, lane);
        if self.pack_is_b {
            (self.one, other)
        } else {
            (other, self.one)
        }
    }
}

/// The lanes of a mask, ascending.
pub(in crate::narrow) fn lanes(mask: u8) -> impl Iterator<Item = u32> {
    let mut rest = mask;
    std::iter::from_fn(move || {
        let lane = rest.trailing_zeros();
        rest &= rest.wrapping_sub(1);
        (lane < 8).then_some(lane)
    })
}

impl Ord for Group {
    /// The soonest expiry compares greatest, so that a heap yields it first; ties by place, for equal replays.
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
pub(in crate::narrow) struct Open {
    /// Approximate overlap of the boxes at their test, negative metres: only for the order.
    pub(in crate::narrow) low: f64,
    pub(in crate::narrow) a: BoxId,
    pub(in crate::narrow) b: BoxId,
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

/// The pairs of boxes of one pair that may touch, in the order of a search.
#[derive(Debug, Default)]
pub(in crate::narrow) struct OpenList {
    search: Search,
    /// A stack, a queue, or a heap.
    items: Run,
    /// Breadth first: the next item.
    head: usize,
}

impl OpenList {
    pub(in crate::narrow) fn clear(&mut self, search: Search) {
        self.search = search;
        self.items.clear();
        self.head = 0;
    }

    /// False if there is no room.
    pub(in crate::narrow) fn push(&mut self, arena: &mut Arena<Open>, open: Open) -> bool {
        if self.search == Search::Priority {
            arena.push_heap(&mut self.items, open)
        } else {
            arena.push(&mut self.items, open)
        }
    }

    pub(in crate::narrow) fn pop(&mut self, arena: &mut Arena<Open>) -> Option<Open> {
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

    pub(in crate::narrow) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(in crate::narrow) fn len(&self) -> usize {
        self.items.len() - self.head
    }

    /// The pairs, unordered.
    pub(in crate::narrow) fn all<'a>(&self, arena: &'a Arena<Open>) -> &'a [Open] {
        &arena.all(&self.items)[self.head..]
    }

    /// Releases its memory.
    pub(in crate::narrow) fn release(&mut self, arena: &mut Arena<Open>) {
        arena.release(&mut self.items);
        self.head = 0;
    }
}

/// The groups of one pair; the one that expires soonest is accessible.
#[derive(Debug)]
pub(in crate::narrow) struct Proved {
    pub(in crate::narrow) heap: Run,
    /// Expiry of its top, as a path, metres; infinite when there is none.
    soonest_m: f64,
}

impl Default for Proved {
    fn default() -> Self {
        Self {
            heap: Run::default(),
            soonest_m: f64::INFINITY,
        }
    }
}

impl Proved {
    pub(in crate::narrow) fn soonest_m(&self) -> f64 {
        self.soonest_m
    }

    pub(in crate::narrow) fn len(&self) -> usize {
        self.heap.len()
    }

    /// False if there is no room.
    pub(in crate::narrow) fn push(&mut self, arena: &mut Arena<Group>, group: Group) -> bool {
        let pushed = arena.push_heap(&mut self.heap, group);
        self.note_top(arena);
        pushed
    }

    pub(in crate::narrow) fn pop(&mut self, arena: &mut Arena<Group>) -> Option<Group> {
        let top = arena.pop_heap(&mut self.heap);
        self.note_top(arena);
        top
    }

    pub(in crate::narrow) fn clear(&mut self) {
        self.heap.clear();
        self.soonest_m = f64::INFINITY;
    }

    pub(in crate::narrow) fn release(&mut self, arena: &mut Arena<Group>) {
        arena.release(&mut self.heap);
        self.soonest_m = f64::INFINITY;
    }

    fn note_top(&mut self, arena: &Arena<Group>) {
        self.soonest_m = (arena.peek(&self.heap)).map_or(f64::INFINITY, |g| g.expiry_m);
    }
}

impl Linked for Group {
    fn linked(self, next: u32) -> Self {
        Self { pack: next, ..self }
    }

    fn next(&self) -> u32 {
        self.pack
    }
}

impl Linked for Open {
    fn linked(self, next: u32) -> Self {
        Self {
            a: BoxId(next),
            ..self
        }
    }

    fn next(&self) -> u32 {
        self.a.0
    }
}

mod validate;

#[cfg(test)]
mod tests;
