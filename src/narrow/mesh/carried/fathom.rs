//! The depth of an overlap whose leaves barely touch.
//!
//! Solids pushed into one another along coplanar faces cross nowhere: their leaves prove a touch within rounding, and
//! no overlap. So a bare touch is followed by a test of inner balls and of points in the boxes' intersection, and then
//! by a longer search of a bounded number of steps, for leaves that cross, or whose middle lies deep in the other
//! solid, or that are coplanar and face the same way, so that both solids are behind them. If no overlap is proved
//! then, the pair still counts as touching: of 4,800 random pairs of solids made of aligned cubes, one that overlaps.

use super::{CarriedFront, Search, Side};
use crate::math::{Point, ROUND, Vec3};
use crate::narrow::mesh::deep::overlap;
use crate::narrow::mesh::lack::Lack;
use crate::narrow::mesh::triangle::edges;
use crate::shape::{Mesh, Shape};
use crate::time::Meter;

/// Points in the intersection of the two boxes: its middle, and those of its eight parts.
const POINTS: u32 = 9;
/// Most steps of the longer search.
const STEPS_MAX: u32 = 64;
/// Most leaves whose middles are tested.
const PROBES_MAX: u32 = 16;
/// Most boxes of a mesh visited per point: this many to decide whether it is inside, and this many to measure how deep.
/// Fewer leave more depths unknown; more delay the next read of the clock.
const BOXES_MAX: usize = 256;
/// Cost of testing a point, in tests of a box against a pack: decides when the clock is read.
const PROBE_COST: u64 = 16;
/// Leaves count as coplanar below this sine: the middle of neither lies deep in the other. If they face the same way,
/// both solids are behind them.
const IN_LINE: f64 = 1e-6;
/// How far behind two coplanar leaves a point inside both solids is searched, as a share of the smaller one's size (the
/// root of twice its area).
const BELOW: f64 = 0.1;
/// After a failed search the next one runs once the two have moved by this share of the smaller one's radius.
const VAIN: f64 = 1e-4;

/// Work done at a pose.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fathomed {
    points: u32,
    steps: u32,
    probes: u32,
    /// By side, a bit per triangle number modulo 64: leaves whose middles were tested.
    asked: [u64; 2],
}

impl Fathomed {
    /// Whether the middles of two leaves were not tested yet; marks them as tested.
    fn is_new(&mut self, places: [u32; 2]) -> [bool; 2] {
        let bits = places.map(|place| 1 << (place % 64));
        let is_new = [0, 1].map(|k| self.asked[k] & bits[k] == 0);
        for k in 0..2 {
            self.asked[k] |= bits[k];
            self.probes += u32::from(is_new[k]);
        }
        is_new
    }
}

impl CarriedFront {
    /// Whether solids are known to touch, but not known to overlap.
    fn only_touches(&self) -> bool {
        self.solids && self.known.touches && self.known.high > 0.0
    }

    /// Whether the depth of their overlap is still being searched.
    pub(super) fn is_fathoming(&self) -> bool {
        let done = &self.known.fathomed;
        let more = || !self.cover.open.is_empty() || self.cover.has_expired();
        self.only_touches() && (done.points < POINTS || (done.steps < STEPS_MAX && more()))
    }

    /// Tests inner balls and one point between the two, and in later calls one more point each; false: it is not their
    /// turn.
    pub(super) fn fathom(&mut self, (a, b): (&Shape, &Shape), meter: &mut Meter<'_>) -> bool {
        let place = self.known.fathomed.points;
        if !self.only_touches() || place == POINTS {
            return false;
        }
        // For other shapes the depth of a point is not known: one unit is enough to see that.
        let tells = |shape: &Shape| {
            (shape.mesh()).is_some_and(|mesh| mesh.is_solid() && !mesh.is_deforming())
        };
        let points = if tells(a) && tells(b) {
            place + 1
        } else {
            POINTS
        };
        self.known.fathomed.points = points;
        let pos12 = self.at.pos12;
        let of_balls = match (place, self.search) {
            (0, Search::Carried) => self.deep.depth(a, b, &pos12, meter),
            (0, _) => overlap((a, b), &pos12, meter),
            _ => None,
        };
        let depth_m = of_balls.or_else(|| {
            meter.charge_weighted(1, PROBE_COST);
            self.depth_between((a, b), place)
        });
        match depth_m {
            Some(depth_m) => self.known.high = self.known.high.min(-depth_m),
            None if self.vain.holds(a, b, &pos12) => {
                (self.known.fathomed.points, self.known.fathomed.steps) = (POINTS, STEPS_MAX);
            }
            None => {}
        }
        true
    }

    /// The depth at one point of the boxes' intersection, if it lies in both.
    fn depth_between(&self, (a, b): (&Shape, &Shape), place: u32) -> Option<f64> {
        let (one, other) = (a.mesh()?, b.mesh()?);
        let middle_b = self.at.to_a(&b.aabb.centre());
        let half_b = self.at.rotation.abs() * b.aabb.half_extents();
        let low = (middle_b - half_b).sup(&a.aabb.min);
        let high = (middle_b + half_b).inf(&a.aabb.max);
        let part = |k: usize| match place.checked_sub(1) {
            None => 0.5,
            Some(part) => 0.25 + 0.5 * f64::from(part >> k & 1),
        };
        let point = low + (high - low).component_mul(&Vec3::new(part(0), part(1), part(2)));
        self.depth_at([one, other], &point)
    }

    /// The depth at a point, A's frame.
    fn depth_at(&self, [a, b]: [&Mesh; 2], point: &Point) -> Option<f64> {
        let in_a = a.depth_of(point, BOXES_MAX)?;
        let in_b = b.depth_of(&self.at.to_b(point), BOXES_MAX)?;
        self.certain_depth(in_a.max(in_b))
    }

    /// The depth less the rounding between the two.
    fn certain_depth(&self, depth_m: f64) -> Option<f64> {
        let least_m = depth_m * (1.0 - 8.0 * ROUND) - 2.0 * self.at.slop;
        (least_m > 0.0).then_some(least_m)
    }

    /// Counts a step of the longer search.
    pub(super) fn note_fathoming(&mut self, (a, b): (Side<'_>, Side<'_>)) {
        if !self.only_touches() || self.known.fathomed.steps >= STEPS_MAX {
            return;
        }
        self.known.fathomed.steps += 1;
        if self.known.fathomed.steps == STEPS_MAX {
            let lack_m = VAIN * a.radius().min(b.radius());
            self.vain = Lack::of(&self.at.pos12, [a.shed_m(), b.shed_m()], lack_m);
        }
    }

    /// Tests whether the middle of one of two touching leaves lies deep in the other solid.
    pub(super) fn fathom_at(
        &mut self,
        places: [u32; 2],
        (a, b): (Side<'_>, Side<'_>),
        meter: &mut Meter<'_>,
    ) {
        let (Side::Mesh(one), Side::Mesh(other)) = (a, b) else {
            return;
        };
        let done = &self.known.fathomed;
        let is_done = done.steps >= STEPS_MAX || done.probes >= PROBES_MAX;
        if is_done || !self.only_touches() {
            return;
        }
        let at = &self.at;
        let corners = [
            one.triangle(places[0]),
            other.triangle(places[1]).map(|p| at.to_a(&p)),
        ];
        let normals = corners.map(|corners| {
            let edges = edges(&corners);
            edges[0].cross(&edges[1])
        });
        let middles = corners.map(|[p, q, r]| Point::from((p.coords + q.coords + r.coords) / 3.0));
        let sine = normals[0].cross(&normals[1]).norm();
        let meshes = [one, other];
        let depth_m = if sine > IN_LINE * normals[0].norm() * normals[1].norm() {
            let [of_a, of_b] = self.known.fathomed.is_new(places);
            if !of_a && !of_b {
                return;
            }
            let of_a = of_a.then(|| other.depth_of(&at.to_b(&middles[0]), BOXES_MAX));
            let of_b = of_b.then(|| one.depth_of(&middles[1], BOXES_MAX));
            let deepest_m = [of_a, of_b].into_iter().flatten().flatten();
            self.certain_depth(deepest_m.fold(0.0, f64::max))
        } else if normals[0].dot(&normals[1]) > 0.0 {
            self.known.fathomed.probes += 1;
            let below_m = BELOW * normals[0].norm().min(normals[1].norm()).sqrt();
            let below = normals[0].normalize() * below_m;
            let of = |middle: &Point| self.depth_at(meshes, &(middle - below));
            of(&middles[0]).or_else(|| of(&middles[1]))
        } else {
            return;
        };
        meter.charge_weighted(1, PROBE_COST);
        if let Some(depth_m) = depth_m {
            self.known.high = self.known.high.min(-depth_m);
        }
    }
}
