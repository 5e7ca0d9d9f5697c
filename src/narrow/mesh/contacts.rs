//! Leaves that touch or cross; for a walk, a bounded number of the deepest.

use super::Closest;
use crate::narrow::arena::{Arena, Linked, Run};

/// Most leaf contacts that a walk keeps of one shape pair; the shallowest is replaced by a deeper one.
pub const LEAF_CONTACTS_MAX: usize = 64;

/// Two leaves that touch or cross.
#[derive(Clone, Copy, Debug)]
pub struct LeafContact {
    /// The contact, in A's frame.
    pub closest: Closest,
    /// Triangle of A; `u32::MAX` when A is no mesh.
    pub triangle_a: u32,
    /// Triangle of B; `u32::MAX` when B is no mesh.
    pub triangle_b: u32,
    /// Which corners and edges of the shapes meet here; 0: not named.
    pub feature: u64,
    /// The surface that the normal belongs to; see [`LeafContact::SPARE`].
    pub patch: u32,
    /// How far out it lies in its patch, if it is kept for that (`patches`), metres.
    pub(super) out_m: f64,
}

impl LeafContact {
    /// Belongs to no patch: represents the pair if nothing else does.
    pub const SPARE: u32 = u32::MAX;
}

/// The deepest contacts of one pair found so far.
#[derive(Debug, Default)]
pub(super) struct Contacts {
    kept: Run,
    /// How many found no room.
    pub(super) left_out: u64,
}

impl Contacts {
    pub(super) fn clear(&mut self) {
        self.kept.clear();
        self.left_out = 0;
    }

    pub(super) fn all<'a>(&self, arena: &'a Arena<LeafContact>) -> &'a [LeafContact] {
        arena.all(&self.kept)
    }

    /// Adds a contact, or replaces the shallowest if it is deeper.
    pub(super) fn add(&mut self, arena: &mut Arena<LeafContact>, contact: LeafContact) {
        if self.kept.len() < LEAF_CONTACTS_MAX && arena.push(&mut self.kept, contact) {
            return;
        }
        self.left_out += 1;
        let depth = |c: &LeafContact| c.closest.best_m;
        let kept = arena.all_mut(&self.kept).iter_mut();
        if let Some(shallowest) = kept.max_by(|a, b| depth(a).total_cmp(&depth(b)))
            && depth(&contact) < depth(shallowest)
        {
            *shallowest = contact;
        }
    }
}

impl Linked for LeafContact {
    fn linked(self, next: u32) -> Self {
        Self {
            triangle_a: next,
            ..self
        }
    }

    fn next(&self) -> u32 {
        self.triangle_a
    }
}
