//! A separating plane of two shapes, searched at each pose from the last one.
//!
//! In: two shapes of which at least one is a mesh, and successive poses. Out: a lower bound on their gap where a plane
//! separates them. The fronts only get pairs that reach into one another's hollows, or are closer than the tables'
//! resolution.
//!
//! The reach of a whole shape along a direction comes from a table or a support point (`Side::reach`), so that a
//! direction costs half of what a box against a pack does. `n . between` less the reach of both is a concave function
//! of `n`, except for the table's cells: if a separating plane exists, going uphill leads to one. So the climb is a
//! compass search in the plane orthogonal to `n`; it stops at the first direction that separates, or at a ridge that it
//! cannot follow. A new pair is tested along the line between its middles only: most pairs that touch are decided by
//! less work than a climb.
//!
//! Refused: the closest points of the two hulls (a query of its own, where only a sign is needed).

use super::lack::Lack;
use super::placed::Placed;
use super::retest::tree_of;
use super::side::Side;
use crate::math::{Pose, Vec3};
use crate::shape::Shape;
use crate::time::Meter;

/// Most directions tried in one climb: a warm one usually needs one.
const TRIES_MAX: u64 = 12;
/// First step of the compass, radians: what two bodies rotate by in a few ticks.
const STEP: f64 = 0.12;
/// Least step: a table is no finer.
const STEP_MIN: f64 = 0.01;
/// Cost of one direction, in quarters of a test of a box against a pack: decides when the clock is read. Each
/// `POINTS_A_QUARTER` points of a convex shape cost another quarter.
const TRY_COST_QUARTERS: u64 = 2;
/// As [`TRY_COST_QUARTERS`].
const POINTS_A_QUARTER: usize = 16;

/// The plane of one pair.
#[derive(Clone, Debug, Default)]
pub(super) struct Parting {
    /// Unit, A's frame, from A to B; `None`: never looked for.
    normal: Option<Vec3>,
    /// The last failed search, and how far its end was from a separating plane: a shorter motion cannot yield one
    /// there, so another climb is not worthwhile.
    lack: Lack,
}

impl Parting {
    /// A lower bound on the gap at a pose, positive and rounded down; `None`: no plane was found. One unit at most.
    pub(super) fn low(
        &mut self,
        a: &Shape,
        b: &Shape,
        pos12: &Pose,
        meter: &mut Meter<'_>,
    ) -> Option<f64> {
        let (side_a, side_b) = (Side::of(a)?, Side::of(b)?);
        if self.lack.holds(a, b, pos12) {
            return None;
        }
        let at = Placed::of(a, b, pos12);
        let (origin_a, origin_b) = (tree_of(a, side_a).1, tree_of(b, side_b).1);
        let between = at.to_a(&origin_b) - origin_a;
        let mut tries = 0;
        let mut low = |normal: &Vec3| {
            tries += 1;
            let reach_a = side_a.reach(normal, &origin_a);
            let reach_b = side_b.reach(&-at.turn_to_b(normal), &origin_b);
            normal.dot(&between) - reach_a - reach_b - at.slop
        };
        let new = self.normal.is_none();
        let middle = || between.try_normalize(at.slop).unwrap_or_else(Vec3::z);
        let mut normal = self.normal.unwrap_or_else(middle);
        let mut best = low(&normal);
        let (mut step, mut left) = (STEP, if new { 0 } else { TRIES_MAX - 1 });
        while best <= 0.0 && step >= STEP_MIN && left > 0 {
            let across = across(&normal);
            let mut higher = None;
            for turn in across {
                let tried = (normal + turn * step).normalize();
                let there = low(&tried);
                left = left.saturating_sub(1);
                if there > best {
                    higher = Some((there, tried));
                    break;
                }
            }
            match higher {
                Some(found) => (best, normal) = found,
                None => step *= 0.5,
            }
        }
        self.normal = Some(normal);
        self.lack = if new {
            Lack::default()
        } else {
            Lack::of(pos12, [a.shed_m(), b.shed_m()], -best)
        };
        let points = (side_a.points() + side_b.points()) / POINTS_A_QUARTER;
        let cost = tries * (TRY_COST_QUARTERS + points as u64) / 4 + 1;
        meter.charge_weighted(1, cost);
        (best > 0.0).then_some(best)
    }
}

/// A lower bound on the gap of two shapes of which one is a mesh, positive and rounded down, at a single pose; `None`:
/// no separating plane was found. Two units at most.
#[must_use]
pub fn parted((a, b): (&Shape, &Shape), pos12: &Pose, meter: &mut Meter<'_>) -> Option<f64> {
    a.mesh().or(b.mesh())?;
    let mut parting = Parting::default();
    let line = parting.low(a, b, pos12, meter);
    line.or_else(|| meter.open().then(|| parting.low(a, b, pos12, meter))?)
}

/// Four unit directions orthogonal to a unit vector.
fn across(normal: &Vec3) -> [Vec3; 4] {
    let one = normal.cross(&Vec3::ith(normal.iamin(), 1.0)).normalize();
    let other = normal.cross(&one);
    [one, other, -one, -other]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{Geometry, Mesh};
    use crate::time::ManualClock;

    fn sheet() -> Shape {
        let corners = at(0.0).map(|[x, y, z]| [x, y, z].map(f64::from).into());
        let mesh = Mesh::new(corners.to_vec(), vec![[0, 1, 2]], Some(false)).unwrap();
        let shape = Shape {
            aabb: mesh.aabb(),
            centre: mesh.centre(),
            radius: mesh.radius(),
            geometry: Geometry::Mesh(mesh),
        };
        shape.to_deforming().unwrap()
    }

    fn at(z: f32) -> [[f32; 3]; 3] {
        [[-1.0, -1.0, z], [1.0, -1.0, z], [0.0, 1.0, z]]
    }

    #[test]
    fn bug_a_plane_that_was_missed_once_is_looked_for_again_after_a_bend_at_the_same_pose() {
        let (mut a, b) = (sheet(), sheet());
        let clock = ManualClock::new(0);
        let mut meter = Meter::unlimited(&clock);
        let (mut parting, pose) = (Parting::default(), Pose::translation(0.0, 0.0, 0.1));
        a.bend(0, &at(0.5));
        a.bend(0, &[[-1.0, -1.0, -0.5]]);
        for _ in 0..3 {
            assert_eq!(parting.low(&a, &b, &pose, &mut meter), None);
        }
        a.bend(0, &at(-0.5));
        let low = parting.low(&a, &b, &pose, &mut meter);
        assert!(low.is_some_and(|low| low <= 0.6), "{low:?}");
    }

    /// The box was the obstacle, and it shrinks without any vertex moving.
    #[test]
    fn bug_a_plane_that_was_missed_is_looked_for_again_where_a_box_has_drawn_back() {
        let (mut a, b) = (sheet(), sheet());
        let clock = ManualClock::new(0);
        let mut meter = Meter::unlimited(&clock);
        let (mut parting, pose) = (Parting::default(), Pose::translation(0.0, 0.0, 0.1));
        for z in [5.0, 0.0] {
            a.bend(2, &[[0.0, 1.0, z]]);
        }
        for _ in 0..3 {
            assert_eq!(parting.low(&a, &b, &pose, &mut meter), None);
        }
        a.refit(usize::MAX);
        a.bend(2, &[[0.0, 1.0, 0.0]]);
        let low = parting.low(&a, &b, &pose, &mut meter);
        assert!(low.is_some_and(|low| low <= 0.1), "{low:?}");
    }
}
