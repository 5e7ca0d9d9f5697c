//! Two leaves of a front: triangles, or a convex shape.

use super::store::FrontStore;
use super::{BoxId, CarriedFront, Crossing, LeafContact, Side};
use crate::math::Interval;
use crate::narrow::cover::{Group, Open};
use crate::narrow::exact::Closest;
use crate::narrow::mesh::{manifold, side};
use crate::shape::{Held, Obb};
use crate::time::Meter;

/// Cost of a proof that two leaves are apart, in tests of a box against a pack: decides when the clock is read.
const PROOF_COST: u64 = 4;
/// Cost of the distance of two leaves, in tests of a box against a pack: too low, a deadline is missed by more; too
/// high, the clock is read more often than needed. Contact points read the clock themselves.
pub(super) const LEAF_COST: u64 = 16;
/// Walks for contact points read the clock at every `ASKS_PER_READ`th check: at each, being interruptible costs a
/// contact set 6 % (`benches/time_critical`).
const ASKS_PER_READ: u32 = 2;
/// How often in a row the points of two leaves may be cut off; after that they are computed whatever it takes.
const CUTS_MAX: u32 = 8;

impl CarriedFront {
    /// Queries two leaves.
    ///
    /// * `known_m` - a bound on their gap that holds at this pose.
    /// * `exact` - their distance is wanted; otherwise any proof that they are apart is enough.
    pub(super) fn leaves(
        &mut self,
        store: &mut FrontStore,
        (id_a, id_b): (BoxId, BoxId),
        (a, b): (Side<'_>, Side<'_>),
        known_m: f64,
        exact: bool,
        meter: &mut Meter<'_>,
    ) {
        let (Held::Triangle(i), Held::Triangle(j)) = (a.held(id_a), b.held(id_b)) else {
            return meter.charge_weighted(1, PROOF_COST);
        };
        let (leaf_a, leaf_b) = ((a, i), (b, j));
        // Once the pair touches, only leaves that touch too matter.
        let exact = exact && !self.known.touches;
        let beyond_m = if exact { self.known.high.max(0.0) } else { 0.0 };
        let closest = match side::leaf(leaf_a, leaf_b, &self.at, beyond_m) {
            Ok(closest) => closest,
            Err(gap) => {
                // Farther than the nearest known pair: that is proof enough.
                self.keep_leaf(store, id_a, id_b, gap.max(known_m));
                return meter.charge_weighted(1, PROOF_COST);
            }
        };
        let low = closest.gap.min.max(known_m);
        self.known.leaf_low = self.known.leaf_low.min(low);
        let high = self.high_of(&closest);
        let better = self.known.high > high || self.last.is_none();
        self.known.high = self.known.high.min(high);
        let contact = contact(leaf_a, leaf_b, closest);
        if low > 0.0 {
            if better {
                (self.last, self.witness) = (Some((id_a, id_b)), Some(contact));
            }
            self.keep_leaf(store, id_a, id_b, low);
            return meter.charge_weighted(1, LEAF_COST);
        }
        let mut whole = true;
        // Certified, or zero within rounding: touching counts as colliding.
        if closest.gap.max <= 8.0 * self.at.slop || closest.finished {
            let deeper = |w: &LeafContact| closest.best_m < w.closest.best_m;
            if !self.known.touches || self.witness.as_ref().is_none_or(deeper) {
                (self.last, self.witness) = (Some((id_a, id_b)), Some(contact));
                let corners = side::triangles(leaf_a, leaf_b);
                self.crossing = corners.map(|corners| Crossing::at([i, j], corners));
            }
            self.known.touches = true;
            self.fathom_at([i, j], (a, b), meter);
            if self.known.points_wanted {
                let patches = (&mut self.contacts, &mut store.contacts);
                let walks = &mut store.walks;
                let patient = self.known.cuts >= CUTS_MAX;
                let mut asks = 0;
                let mut go_on = || goes_on(meter, &mut asks) || patient;
                whole = manifold::points(
                    leaf_a, leaf_b, &self.at, &contact, patches, walks, &mut go_on,
                );
            }
        } else {
            self.known.blurred = true;
        }
        let touching = Open {
            low: 0.0,
            a: id_a,
            b: id_b,
        };
        if whole {
            self.known.cuts = 0;
            self.cover.touch(&mut store.entries, touching);
        } else {
            // It must be queried for its points again.
            self.known.cuts += 1;
            self.cover.look_into(&mut store.entries, touching);
        }
        meter.charge_dear(1);
    }

    /// The upper bound on the gap that a query of two leaves proves, metres.
    pub(super) fn high_of(&self, closest: &Closest) -> f64 {
        // A solid's depth is that of a point, and the translation that separates two leaves can be more: their query
        // proves an overlap, but not its depth.
        let least = if self.solids { 0.0 } else { f64::NEG_INFINITY };
        closest.gap.max.max(least)
    }

    fn keep_leaf(&mut self, store: &mut FrontStore, id_a: BoxId, id_b: BoxId, gap: f64) {
        let group = Group::of_leaves(id_a, id_b);
        self.cover.keep(&mut store.entries, group, gap);
    }
}

pub(super) fn contact(a: (Side<'_>, u32), b: (Side<'_>, u32), closest: Closest) -> LeafContact {
    LeafContact {
        closest,
        triangle_a: a.0.triangle_name(a.1),
        triangle_b: b.0.triangle_name(b.1),
        feature: 0,
        patch: LeafContact::SPARE,
        out_m: 0.0,
    }
}

impl LeafContact {
    /// For surfaces that are apart while one shape is within the other: moving B towards A's nearest point leads out.
    pub(in crate::narrow::mesh) fn way_out(&self, gap: Interval) -> Self {
        let found = self.closest;
        let closest = Closest {
            gap,
            best_m: (-found.best_m).clamp(gap.min, gap.max),
            normal: -found.normal,
            ..found
        };
        Self { closest, ..*self }
    }
}

impl<'a> Side<'a> {
    /// What a box holds; a convex shape is one leaf.
    pub(in crate::narrow::mesh) fn held(self, id: BoxId) -> Held {
        match self {
            Self::Mesh(mesh) => mesh.obb().held(id),
            Self::Convex(_) => Held::Triangle(0),
        }
    }

    /// The pack of boxes that share a parent.
    pub(in crate::narrow::mesh) fn pack(self, pack: u32) -> Option<&'a crate::shape::ObbPack> {
        match self {
            Self::Mesh(mesh) => mesh.obb().packs().get(pack as usize),
            Self::Convex(_) => None,
        }
    }

    /// A single box; that of a convex shape is passed in.
    pub(in crate::narrow::mesh) fn obb(self, id: BoxId, whole: &Option<Obb>) -> Obb {
        match (self, whole) {
            (Self::Mesh(mesh), _) => mesh.obb().get(id),
            (Self::Convex(_), Some(whole)) => *whole,
            (Self::Convex(_), None) => Obb::EVERYWHERE,
        }
    }

    /// Size of a box for comparisons: the sum of its half sides' squares, square metres.
    pub(in crate::narrow::mesh) fn size(self, id: BoxId, whole: &Option<Obb>) -> f32 {
        match (self, whole) {
            (Self::Mesh(mesh), _) => {
                let half = &mesh.obb().packs()[id.pack() as usize].boxes.half;
                let lane = id.lane();
                half.iter().map(|row| row[lane] * row[lane]).sum()
            }
            (Self::Convex(_), Some(whole)) => whole.half.iter().map(|h| h * h).sum(),
            (Self::Convex(_), None) => f32::INFINITY,
        }
    }

    /// Name of a leaf in contacts: a convex shape has no triangles.
    fn triangle_name(self, i: u32) -> u32 {
        match self {
            Self::Mesh(_) => i,
            Self::Convex(_) => u32::MAX,
        }
    }
}

/// Whether the meter is open; the clock is read only at every few checks.
#[inline]
fn goes_on(meter: &mut Meter<'_>, asks: &mut u32) -> bool {
    *asks += 1;
    if (*asks).is_multiple_of(ASKS_PER_READ) {
        meter.refresh()
    } else {
        meter.open()
    }
}
