//! The contact set of a mesh pair: the deepest leaf pairs that touch or cross, a bounded number of them.

use super::Closest;

/// Leaf contacts kept of one shape pair; the shallowest makes room for a deeper one.
pub const LEAF_CONTACTS_MAX: usize = 64;

/// Two leaves that touch or cross.
#[derive(Clone, Copy, Debug)]
pub struct LeafContact {
    /// How, in A's frame.
    pub closest: Closest,
    /// Triangle of A; `u32::MAX` when A is no mesh.
    pub triangle_a: u32,
    /// Triangle of B; `u32::MAX` when B is no mesh.
    pub triangle_b: u32,
}

/// The deepest contacts met so far.
#[derive(Debug, Default)]
pub(super) struct Contacts {
    all: Vec<LeafContact>,
    /// How many there were that had no room.
    pub(super) left_out: u64,
}

impl Contacts {
    pub(super) fn clear(&mut self) {
        self.all.clear();
        self.left_out = 0;
    }

    pub(super) fn all(&self) -> &[LeafContact] {
        &self.all
    }

    pub(super) fn add(&mut self, contact: LeafContact) {
        if self.all.len() < LEAF_CONTACTS_MAX {
            self.all.push(contact);
            return;
        }
        self.left_out += 1;
        keep_deepest(&mut self.all, contact);
    }
}

/// Where there is no room for more: a contact takes the place of the shallowest, if it is deeper.
pub(super) fn keep_deepest(all: &mut [LeafContact], contact: LeafContact) {
    let depth = |c: &LeafContact| c.closest.best_m;
    let shallowest = (all.iter_mut()).max_by(|a, b| depth(a).total_cmp(&depth(b)));
    if let Some(shallowest) = shallowest
        && depth(&contact) < depth(shallowest)
    {
        *shallowest = contact;
    }
}
