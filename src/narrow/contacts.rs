//! Contacts of a pair, with ids that last as long as the contact.

mod choose;
mod patches;

use crate::ids::PairSlot;
use crate::math::{Interval, Point, Vec3};

use choose::choose;
use patches::reduce;

use super::arena::Linked;
use super::{NONE, Narrow};

/// One point of contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Constant while the contact lasts; 0: not named yet (see [`Narrow::name_contacts`]).
    pub id: u64,
    /// Place of the shape in A.
    pub shape_a: u32,
    /// Place of the shape in B.
    pub shape_b: u32,
    /// Triangle of A's shape, or `NO_INDEX`.
    pub triangle_a: u32,
    /// Triangle of B's shape, or `NO_INDEX`.
    pub triangle_b: u32,
    /// Which features of the shapes touch; equal features of two shapes are the same contact.
    pub feature: u64,
    /// Groups points of the shape pair that were found together: on one surface, with nearly the same normal.
    pub patch: u32,
    /// On A's surface, A's body frame, metres.
    pub point_a: Point,
    /// On B's surface, B's body frame, metres.
    pub point_b: Point,
    /// Unit, A's body frame, from A to B.
    pub normal: Vec3,
    /// Gap at this point, metres; negative: depth.
    pub gap_m: f64,
    /// Certified gap of the shape pair, metres.
    pub gap: Interval,
}

impl Linked for Contact {
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

/// The contacts of one pair.
#[derive(Clone, Debug, Default)]
pub struct ContactSet {
    /// Deepest first.
    contacts: Vec<Contact>,
}

/// Two points of one shape pair closer than this, as a share of the smaller body's radius, are the same contact if no
/// feature identifies them: larger, and distinct corners of a face would swap ids; smaller, and a rolling contact would
/// change its id in every tick.
const SAME_POINT: f64 = 0.05;

/// Cosine of 8 degrees: the most that normals of one patch differ by.
pub(super) const SAME_NORMAL: f64 = 0.99;
/// Contacts kept in the last tick count as this much farther away: without it, two equally good points would alternate,
/// and their ids with them.
const KEPT_BEFORE: f64 = 1.25;
/// Ticks for which ids outlive a collision whose bodies stay near: a body that trembles at rest keeps its ids, one that
/// comes back later gets new contacts.
pub(super) const TREMBLE_TICKS: u64 = 8;
/// Cosine of 45 degrees: a contact whose normal has turned by more is a new one.
const SAME_SIDE: f64 = 0.7;

impl ContactSet {
    pub(super) fn with_room(contacts: usize) -> Self {
        Self {
            contacts: Vec::with_capacity(contacts),
        }
    }

    /// The contacts, deepest first.
    #[must_use]
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Forgets all contacts, including ids.
    pub(super) fn clear(&mut self) {
        self.contacts.clear();
    }

    /// Keeps at most four points of each patch, and of those at most `most`: the deepest and those that span the most.
    /// Contacts that existed before keep their ids. `before` is scratch memory.
    ///
    /// `most` is shared by spread, not by quota: the deepest of all comes first, then the one farthest, in place and in
    /// normal, from those kept, so that no patch has a second point while another far from it has none.
    pub(super) fn replace(
        &mut self,
        found: &mut [Contact],
        most: usize,
        radius: f64,
        before: &mut Vec<Contact>,
    ) {
        before.clear();
        before.extend_from_slice(&self.contacts);
        self.contacts.clear();
        let was_kept = |contact: &Contact| before.iter().any(|old| old.key() == contact.key());
        let spanning = reduce(found, radius, was_kept);
        let found = &mut found[..spanning];
        found.sort_unstable_by(|x, y| x.gap_m.total_cmp(&y.gap_m).then(x.key().cmp(&y.key())));
        let kept = choose(found, most, radius, was_kept);
        self.contacts.extend_from_slice(&found[..kept]);
        // Equal keys first, so that no other contact takes their id.
        for contact in &mut self.contacts {
            let heir = |old: &Contact| old.id != 0 && old.key() == contact.key();
            if let Some(at) = before.iter().position(heir) {
                contact.id = std::mem::take(&mut before[at].id);
            }
        }
        for contact in self.contacts.iter_mut().filter(|contact| contact.id == 0) {
            // It has stayed in place on one of the two bodies: they slide on each other.
            let heir = |old: &Contact| {
                let moved = (old.point_a - contact.point_a).norm();
                let moved = moved.min((old.point_b - contact.point_b).norm());
                old.id != 0
                    && (old.shape_a, old.shape_b) == (contact.shape_a, contact.shape_b)
                    && old.normal.dot(&contact.normal) >= SAME_SIDE
                    && moved <= SAME_POINT * radius
            };
            if let Some(at) = before.iter().position(heir) {
                contact.id = std::mem::take(&mut before[at].id);
            }
        }
    }
}

impl Contact {
    /// Its key among the contacts of the pair, without triangles: a corner that slides over a mesh is the same contact
    /// on each of them.
    fn key(&self) -> (u32, u32, u64) {
        (self.shape_a, self.shape_b, self.feature)
    }
}

impl Narrow {
    /// The contacts of a pair, deepest first; empty when none were wanted, or the collision they belong to has ended.
    /// With them the tick of their poses.
    #[must_use]
    pub fn contacts(&self, slot: PairSlot) -> (&[Contact], u64) {
        let memo = self.memos.get(slot.index());
        let Some(memo) = memo.filter(|memo| !memo.contacts_are_over()) else {
            return (&[], 0);
        };
        let set = self.contact_sets.get(memo.contacts);
        (set.map_or(&[], ContactSet::contacts), memo.contacts_tick)
    }

    /// Gives ids to the pair's contacts that have none. Called in the order of publishing, so that ids do not depend on
    /// slots.
    pub fn name_contacts(&mut self, slot: PairSlot, next_id: &mut u64) {
        let Some(memo) = self
            .memos
            .get(slot.index())
            .filter(|memo| memo.contacts != NONE)
        else {
            return;
        };
        let Some(set) = self.contact_sets.get_mut(memo.contacts) else {
            return;
        };
        for contact in set.contacts.iter_mut().filter(|contact| contact.id == 0) {
            contact.id = *next_id;
            *next_id += 1;
        }
    }
}

/// A contact of two shapes of one pair, for tests: placed on A's upper side, identified by a number.
#[cfg(test)]
fn at_place(x: f64, y: f64, gap_m: f64, name: u32) -> Contact {
    Contact {
        id: 0,
        shape_a: 0,
        shape_b: 0,
        triangle_a: name,
        triangle_b: 0,
        feature: u64::from(name),
        patch: 0,
        point_a: Point::new(x, y, 0.0),
        point_b: Point::new(x, y, gap_m),
        normal: Vec3::z(),
        gap_m,
        gap: Interval::UNKNOWN,
    }
}
