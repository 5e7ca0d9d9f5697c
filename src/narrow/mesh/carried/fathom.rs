//! How deep two overlap whose leaves only just touch.
//!
//! Solids pushed into one another along faces that are in line cross nowhere: their leaves prove a touch within
//! rounding, and no overlap. So a touch that is no more is followed by a look at the balls within the two and at the
//! middle of what their boxes share, and then by a search that goes on for a bounded number of steps, to leaves that
//! cross, or the middle of one of which lies deep in the other solid. What then is no overlap still touches.

use super::{CarriedFront, Search, Side};
use crate::math::{Point, ROUND};
use crate::narrow::mesh::deep::overlap;
use crate::narrow::mesh::lack::Lack;
use crate::narrow::mesh::triangle::edges;
use crate::shape::Shape;
use crate::time::Meter;

/// Steps of the search that goes on, at most.
const STEPS_MAX: u32 = 32;
/// Pairs of leaves the middles of which are looked at, at most, ...
const PROBES_MAX: u32 = 8;
/// ... in how many boxes twice, at most, ...
const BOXES_MAX: usize = 256;
/// ... and what that costs, in tests of a box against a pack: when the clock is to be read.
const PROBE_COST: u64 = 16;
/// Leaves are in line below this sine: the middle of neither lies deep in the other.
const IN_LINE: f64 = 1e-6;
/// After a search in vain the next is made where the two have moved by this share of the smaller one's radius.
const VAIN: f64 = 1e-4;

/// What was done about it at a pose.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fathomed {
    balls: bool,
    steps: u32,
    probes: u32,
}

impl CarriedFront {
    /// Whether solids are known to touch, and not to overlap.
    fn only_touches(&self) -> bool {
        self.solids && self.known.touches && self.known.high > 0.0
    }

    /// Whether it is still looked for how deep they overlap.
    pub(super) fn is_fathoming(&self) -> bool {
        let done = &self.known.fathomed;
        let more = || !self.cover.open.is_empty() || self.cover.has_expired();
        self.only_touches() && (!done.balls || (done.steps < STEPS_MAX && more()))
    }

    /// Asks the balls within the two, and then one point between them, once a pose; false: it is not their turn.
    pub(super) fn fathom(&mut self, (a, b): (&Shape, &Shape), meter: &mut Meter<'_>) -> bool {
        if !self.only_touches() || std::mem::replace(&mut self.known.fathomed.balls, true) {
            return false;
        }
        let pos12 = self.at.pos12;
        let depth_m = if self.search == Search::Carried {
            self.deep.depth(a, b, &pos12, meter)
        } else {
            overlap((a, b), &pos12, meter)
        };
        let depth_m = depth_m.or_else(|| {
            meter.charge_weighted(1, PROBE_COST);
            self.depth_between((a, b))
        });
        match depth_m {
            Some(depth_m) => self.known.high = self.known.high.min(-depth_m),
            None if self.vain.holds(a, b, &pos12) => self.known.fathomed.steps = STEPS_MAX,
            None => {}
        }
        true
    }

    /// The same of the middle of what the boxes around the two share, where it lies in both.
    fn depth_between(&self, (a, b): (&Shape, &Shape)) -> Option<f64> {
        let (one, other) = (a.mesh()?, b.mesh()?);
        let middle_b = self.at.to_a(&b.aabb.centre());
        let half_b = self.at.rotation.abs() * b.aabb.half_extents();
        let low = (middle_b - half_b).sup(&a.aabb.min);
        let high = (middle_b + half_b).inf(&a.aabb.max);
        let middle = nalgebra::center(&low, &high);
        let in_a = one.depth_of(&middle, BOXES_MAX)?;
        let in_b = other.depth_of(&self.at.to_b(&middle), BOXES_MAX)?;
        self.certain_depth(in_a.max(in_b))
    }

    /// Less what is rounded between the two.
    fn certain_depth(&self, depth_m: f64) -> Option<f64> {
        let least_m = depth_m * (1.0 - 8.0 * ROUND) - 2.0 * self.at.slop;
        (least_m > 0.0).then_some(least_m)
    }

    /// Counts a step of the search that goes on.
    pub(super) fn note_fathoming(&mut self, (a, b): (Side<'_>, Side<'_>)) {
        if !self.only_touches() || self.known.fathomed.steps >= STEPS_MAX {
            return;
        }
        self.known.fathomed.steps += 1;
        if self.known.fathomed.steps == STEPS_MAX {
            self.vain = Lack::of(&self.at.pos12, VAIN * a.radius().min(b.radius()));
        }
    }

    /// Looks whether the middle of one of two leaves that touch lies deep in the other solid.
    pub(super) fn fathom_at(
        &mut self,
        places: [u32; 2],
        (a, b): (Side<'_>, Side<'_>),
        meter: &mut Meter<'_>,
    ) {
        let (Side::Mesh(one), Side::Mesh(other)) = (a, b) else {
            return;
        };
        let done = &mut self.known.fathomed;
        if done.steps >= STEPS_MAX || done.probes >= PROBES_MAX {
            return;
        }
        let corners = [one.triangle(places[0]), other.triangle(places[1])];
        let normals = corners.map(|corners| {
            let edges = edges(&corners);
            edges[0].cross(&edges[1])
        });
        let turned = self.at.rotation * normals[1];
        let sine = normals[0].cross(&turned).norm();
        if !self.only_touches() || sine <= IN_LINE * normals[0].norm() * turned.norm() {
            return;
        }
        self.known.fathomed.probes += 1;
        let middle = corners.map(|[p, q, r]| Point::from((p.coords + q.coords + r.coords) / 3.0));
        let of_a = other.depth_of(&self.at.to_b(&middle[0]), BOXES_MAX);
        let of_b = one.depth_of(&self.at.to_a(&middle[1]), BOXES_MAX);
        meter.charge_weighted(1, PROBE_COST);
        let deepest_m = of_a.unwrap_or(0.0).max(of_b.unwrap_or(0.0));
        if let Some(depth_m) = self.certain_depth(deepest_m) {
            self.known.high = self.known.high.min(-depth_m);
        }
    }
}
