//! Contacts of a pair, and the ids that stay while the contact does.

mod choose;

use crate::ids::PairSlot;
use crate::math::{Interval, Point, Vec3};

use choose::choose;

use super::arena::Linked;
use super::{NONE, Narrow};

/// One point of contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Stays while the contact does; 0: not named yet (see [`Narrow::name_contacts`]).
    pub id: u64,
    /// Place of the shape in A.
    pub shape_a: u32,
    /// Place of the shape in B.
    pub shape_b: u32,
    /// Triangle of A's shape, or `NO_INDEX`.
    pub triangle_a: u32,
    /// Triangle of B's shape, or `NO_INDEX`.
    pub triangle_b: u32,
    /// What of the shapes touches; equal features are the same contact.
    pub feature: u32,
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

/// Two points of one shape pair this close, as a share of the smaller body's radius, are the same contact when no
/// feature says so: larger, and distinct corners of a face would trade ids; smaller, and a rolling contact would
/// change its id in every tick.
const SAME_POINT: f64 = 0.05;

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

    /// Forgets all contacts, ids too.
    pub(super) fn clear(&mut self) {
        self.contacts.clear();
    }

    /// Takes the deepest of `found` and those that span the most, at most `most`; contacts that were there before keep their ids. `before` is scratch memory.
    pub(super) fn replace(
        &mut self,
        found: &mut [Contact],
        most: usize,
        radius: f64,
        before: &mut Vec<Contact>,
    ) {
        found.sort_unstable_by(|x, y| x.gap_m.total_cmp(&y.gap_m).then(x.key().cmp(&y.key())));
        before.clear();
        before.extend_from_slice(&self.contacts);
        self.contacts.clear();
        let kept = choose(found, most, radius, |contact| {
            before.iter().any(|old| old.key() == contact.key())
        });
        self.contacts.extend_from_slice(&found[..kept]);
        for contact in &mut self.contacts {
            let heir = before
                .iter()
                .position(|old| old.id != 0 && old.key() == contact.key());
            let heir = heir.or_else(|| {
                before.iter().position(|old| {
                    old.id != 0
                        && (old.shape_a, old.shape_b) == (contact.shape_a, contact.shape_b)
                        && (old.point_a - contact.point_a).norm() <= SAME_POINT * radius
                })
            });
            if let Some(at) = heir {
                contact.id = std::mem::take(&mut before[at].id);
            }
        }
    }
}

impl Contact {
    fn key(&self) -> [u32; 5] {
        [
            self.shape_a,
            self.shape_b,
            self.triangle_a,
            self.triangle_b,
            self.feature,
        ]
    }
}

impl Narrow {
    /// The contacts of a pair, deepest first; empty when none were asked for. With them the tick of their poses.
    #[must_use]
    pub fn contacts(&self, slot: PairSlot) -> (&[Contact], u64) {
        let Some(memo) = self.memos.get(slot.index()) else {
            return (&[], 0);
        };
        let set = self.contact_sets.get(memo.contacts);
        (set.map_or(&[], ContactSet::contacts), memo.contacts_tick)
    }

    /// Names the contacts of a pair that have no id yet. Called in the order of publishing, so that ids do not depend
    /// on slots.
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
