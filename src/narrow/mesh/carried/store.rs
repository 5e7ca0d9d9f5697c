//! Where the fronts of all pairs keep their entries: three arenas of blocks, so that a tick at constant scene allocates
//! nothing and what ended pairs gave back serves the others.

use super::cover::{Group, Open};
use crate::narrow::arena::{Arena, Linked, Run};
use crate::narrow::mesh::LeafContact;
use crate::narrow::mesh::manifold::Walks;
use crate::shape::BoxId;
use crate::time::Meter;

/// Groups of all fronts together, 24 bytes each: some 10,000 pairs of 20,000-triangle meshes. Beyond it what is proved
/// apart is lumped together, pair by pair.
const GROUPS_MAX: usize = 1 << 22;
/// Open pairs of boxes of all fronts together, 16 bytes each; depth first has some hundred a pair. A pair that finds no
/// room is not decided in this tick and starts anew in the next.
const OPEN_MAX: usize = 1 << 24;
/// Contacts of leaves of all fronts together, some 200 bytes each; beyond it a pair keeps the deepest of what it has.
const CONTACTS_MAX: usize = 1 << 20;
/// The entries of all fronts. A [`super::CarriedFront`] is used with one store from its start to its release.
#[derive(Debug)]
pub struct FrontStore {
    pub(super) groups: Arena<Group>,
    pub(super) open: Arena<Open>,
    pub(in crate::narrow::mesh) contacts: Arena<LeafContact>,
    /// Of the search that is going on.
    pub(super) walks: Walks,
}

impl Default for FrontStore {
    fn default() -> Self {
        Self::with_room(GROUPS_MAX, OPEN_MAX)
    }
}

impl FrontStore {
    /// A store that holds at most so many groups and so many open pairs of all fronts.
    #[must_use]
    pub fn with_room(groups: usize, open: usize) -> Self {
        Self {
            groups: Arena::new(groups),
            open: Arena::new(open),
            contacts: Arena::new(CONTACTS_MAX),
            walks: Walks::default(),
        }
    }

    /// Has memory at hand for what the next work will keep.
    pub(in crate::narrow) fn touch_ahead(&mut self, meter: &mut Meter<'_>) {
        self.groups.touch_ahead(meter);
        self.open.touch_ahead(meter);
        self.contacts.touch_ahead(meter);
    }

    /// Bytes in use by blocks, free ones included.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.groups.bytes() + self.open.bytes() + self.contacts.bytes()
    }
}

/// The groups of one front, the one that expires soonest at hand.
#[derive(Debug)]
pub(super) struct Proved {
    pub(super) heap: Run,
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
    pub(super) fn soonest_m(&self) -> f64 {
        self.soonest_m
    }

    pub(super) fn len(&self) -> usize {
        self.heap.len()
    }

    /// False where there is no room.
    pub(super) fn push(&mut self, arena: &mut Arena<Group>, group: Group) -> bool {
        let pushed = arena.push_heap(&mut self.heap, group);
        self.note_top(arena);
        pushed
    }

    pub(super) fn pop(&mut self, arena: &mut Arena<Group>) -> Option<Group> {
        let top = arena.pop_heap(&mut self.heap);
        self.note_top(arena);
        top
    }

    pub(super) fn clear(&mut self) {
        self.heap.clear();
        self.soonest_m = f64::INFINITY;
    }

    pub(super) fn release(&mut self, arena: &mut Arena<Group>) {
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
