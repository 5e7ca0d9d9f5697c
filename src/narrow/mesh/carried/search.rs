//! One step of work on a front: a box against a pack, two leaves, or a node of an inside test.

use super::leaves::{LEAF_COST, contact};
use super::store::FrontStore;
use super::{BoxId, CarriedFront, Containment, Goal, Side};
use crate::narrow::cover::{Group, Open};
use crate::narrow::mesh::side;
use crate::shape::Held;
use crate::simd::obb::LANES;
use crate::time::Meter;

impl CarriedFront {
    pub(super) fn step(
        &mut self,
        store: &mut FrontStore,
        (a, b): (Side<'_>, Side<'_>),
        goal: Goal,
        meter: &mut Meter<'_>,
    ) {
        let gap_wanted = goal > Goal::Verdict;
        self.wear.note_step();
        self.note_fathoming((a, b));
        if gap_wanted && !std::mem::replace(&mut self.known.asked_last, true) {
            self.bound_by_last(a, b);
            meter.charge_weighted(1, LEAF_COST);
        } else if let Some(open) = self.cover.open.pop(&mut store.entries.open) {
            self.expand(store, &open, (a, b), gap_wanted, meter);
        } else if self.cover.has_expired() {
            if let Some(group) = self.cover.proved.pop(&mut store.entries.groups) {
                self.retest(store, &group, (a, b), gap_wanted, meter);
            }
        } else if self.shells.state() == Containment::Open {
            self.shells.step(a, b, &self.at);
            meter.charge(1);
        } else {
            self.refine(store, (a, b), meter);
        }
        self.note_apart();
    }

    /// If the surfaces are apart, what is known of the insides, and what is tested of them at this pose, holds as long
    /// as they stay apart.
    fn note_apart(&mut self) {
        if self.known.touches {
            // At the next pose, whatever it is, the insides must be tested again.
            self.shells_expiry_m = f64::NEG_INFINITY;
            return;
        }
        let low = self.surfaces_low();
        if low <= 0.0 {
            return;
        }
        self.wear.note_settled(&self.cover);
        let expiry_m = self.cover.drift.expiry(low).unwrap_or(f64::NEG_INFINITY);
        self.shells_expiry_m = self.shells_expiry_m.max(expiry_m);
    }

    /// The leaves that were nearest last are probably near still: their distance rules out most others.
    fn bound_by_last(&mut self, a: Side<'_>, b: Side<'_>) {
        let Some((leaf_a, leaf_b)) = self.last else {
            return;
        };
        if let (Held::Triangle(i), Held::Triangle(j)) = (a.held(leaf_a), b.held(leaf_b))
            && let Ok(closest) = side::leaf((a, i), (b, j), &self.at, f64::INFINITY)
        {
            // Only as the distance of two points: the rest of the result is used when its entry's turn comes.
            self.known.high = self.known.high.min(closest.gap.max.max(0.0));
            self.witness = Some(contact((a, i), (b, j), closest));
        }
    }

    /// Replaces an open pair of boxes by smaller ones, or queries two leaves.
    fn expand(
        &mut self,
        store: &mut FrontStore,
        open: &Open,
        (a, b): (Side<'_>, Side<'_>),
        exact: bool,
        meter: &mut Meter<'_>,
    ) {
        let child = match (a.held(open.a), b.held(open.b)) {
            (Held::Triangle(held_a), Held::Triangle(held_b)) => {
                let places = (open.a, open.b);
                self.leaves(store, places, (a, b), f64::NEG_INFINITY, exact, meter);
                if !exact && !self.known.touches {
                    self.seek([held_a, held_b], (a, b), meter);
                }
                return;
            }
            (held_a, held_b) => self.children((open.a, held_a), (open.b, held_b), (a, b)),
        };
        self.test(store, &child, (a, b), f64::NEG_INFINITY);
        meter.charge(1);
    }

    /// The box that is kept and the pack that replaces the other: the larger is split, so that both shrink alike.
    fn children(
        &self,
        (id_a, held_a): (BoxId, Held),
        (id_b, held_b): (BoxId, Held),
        (a, b): (Side<'_>, Side<'_>),
    ) -> Group {
        let group = Group::parting((id_a, held_a), (id_b, held_b), || {
            b.size(id_b, &self.whole[1]) > a.size(id_a, &self.whole[0])
        });
        let side = if group.pack_is_b { b } else { a };
        let mask = side.pack(group.pack).map_or(0, |p| p.mask);
        Group { mask, ..group }
    }

    /// The gaps of a group's pairs at this pose.
    fn gaps(&self, group: &Group, (a, b): (Side<'_>, Side<'_>)) -> [f64; LANES] {
        let (one, other) = if group.pack_is_b {
            (a.obb(group.one, &self.whole[0]), b)
        } else {
            (b.obb(group.one, &self.whole[1]), a)
        };
        match other.pack(group.pack) {
            Some(pack) => self.at.gaps(&one, pack, group.pack_is_b),
            None => [f64::NEG_INFINITY; LANES],
        }
    }

    /// Tests a group at this pose.
    ///
    /// * `known_m` - a bound that holds for the whole group at this pose.
    fn test(
        &mut self,
        store: &mut FrontStore,
        group: &Group,
        sides: (Side<'_>, Side<'_>),
        known_m: f64,
    ) {
        let gaps = self.gaps(group, sides);
        (self.cover).take(&mut store.entries, group, gaps, known_m);
    }

    /// Tests a group whose proof has expired.
    fn retest(
        &mut self,
        store: &mut FrontStore,
        group: &Group,
        sides: (Side<'_>, Side<'_>),
        exact: bool,
        meter: &mut Meter<'_>,
    ) {
        if group.leaf {
            let pair = group.pair(group.mask.trailing_zeros());
            self.leaves(store, pair, sides, f64::NEG_INFINITY, exact, meter);
        } else {
            self.test(store, group, sides, f64::NEG_INFINITY);
            meter.charge(1);
        }
    }

    /// Opens the nearest of all groups: best first.
    fn refine(
        &mut self,
        store: &mut FrontStore,
        sides: (Side<'_>, Side<'_>),
        meter: &mut Meter<'_>,
    ) {
        let Some(group) = self.cover.proved.pop(&mut store.entries.groups) else {
            return;
        };
        // The stored bound holds at this pose; a new test may be lower by rounding.
        let known_m = self.cover.drift.left_m(group.expiry_m);
        if group.leaf {
            let pair = group.pair(group.mask.trailing_zeros());
            return self.leaves(store, pair, sides, known_m, true, meter);
        }
        let gaps = self.gaps(&group, sides).map(|gap| gap.max(known_m));
        let ((id_a, id_b), known_m) = (self.cover).part_nearest(&mut store.entries, &group, &gaps);
        match (sides.0.held(id_a), sides.1.held(id_b)) {
            (Held::Triangle(_), Held::Triangle(_)) => {
                self.leaves(store, (id_a, id_b), sides, known_m, true, meter);
                meter.charge(1);
            }
            (held_a, held_b) => {
                let child = self.children((id_a, held_a), (id_b, held_b), sides);
                self.test(store, &child, sides, known_m);
                meter.charge(2);
            }
        }
    }
}
