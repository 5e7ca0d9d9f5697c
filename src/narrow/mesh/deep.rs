//! Two shapes that overlap deeply enough for inner balls of a solid to prove it.
//!
//! In: two shapes of which one is a solid mesh and the other a solid mesh or convex, and a pose of B seen from A. Out:
//! a lower bound on the depth of their overlap. It costs less than a box against a pack, where a search for touching
//! triangles takes twenty of these; and since it proves a depth, not a touch, it holds until the two move by that much.
//! Cold, 200 pairs of meshes of which two thirds overlap: 1,930 units for all verdicts instead of 4,060
//! (`benches/time_critical`).

use super::lack::Lack;
use super::placed::Placed;
use super::side::Side;
use crate::math::{Point, Pose, ROUND, f32_near};
use crate::narrow::exact::{Warm, convex_gap};
use crate::shape::{Ball, Convex, Mesh, Shape};
use crate::time::Meter;

/// Cost of an exact query of a ball and a convex shape, in tests of a box against a pack: decides when the clock is
/// read.
const CONVEX_COST: u64 = 4;

/// The last ball test of one pair.
#[derive(Clone, Debug, Default)]
pub(super) struct Deep {
    /// How far it was from proving an overlap.
    lack: Lack,
}

impl Deep {
    /// A lower bound on the depth of a point of one under the surface of the other, metres, positive; `None`: the balls
    /// prove nothing. One unit at most.
    pub(super) fn depth(
        &mut self,
        a: &Shape,
        b: &Shape,
        pos12: &Pose,
        meter: &mut Meter<'_>,
    ) -> Option<f64> {
        let (side_a, side_b) = (Side::of(a)?, Side::of(b)?);
        if !(has_balls(side_a) && has_balls(side_b)) || self.lack.holds(a, b, pos12) {
            return None;
        }
        let at = Placed::of(a, b, pos12);
        let (overlap_m, cost) = match (side_a, side_b) {
            (Side::Mesh(one), Side::Mesh(other)) => (of_meshes(one, other, &at), 1),
            (Side::Mesh(mesh), Side::Convex(convex)) => (
                of_convex(mesh, (convex, b), &at.to_a(&b.centre), pos12),
                CONVEX_COST,
            ),
            (Side::Convex(convex), Side::Mesh(mesh)) => (
                of_convex(mesh, (convex, a), &at.to_b(&a.centre), &pos12.inverse()),
                CONVEX_COST,
            ),
            (Side::Convex(_), Side::Convex(_)) => return None,
        };
        meter.charge_weighted(1, cost);
        let overlap_m = overlap_m?;
        let depth_m = overlap_m - at.slop - 8.0 * ROUND * overlap_m.abs();
        self.lack = Lack::of(pos12, [a.shed_m(), b.shed_m()], -depth_m);
        (depth_m > 0.0).then_some(depth_m)
    }
}

/// A lower bound on the depth of the overlap of two shapes, metres, positive and rounded down, at a single pose;
/// `None`: inner balls prove none. One unit at most.
#[must_use]
pub fn overlap((a, b): (&Shape, &Shape), pos12: &Pose, meter: &mut Meter<'_>) -> Option<f64> {
    Deep::default().depth(a, b, pos12, meter)
}

/// Whether it has inner balls; a convex shape is tested as a whole.
fn has_balls(side: Side<'_>) -> bool {
    match side {
        Side::Mesh(mesh) => mesh.balls().is_some(),
        Side::Convex(convex) => convex.is_solid(),
    }
}

/// The depth that a ball of A and one of B prove, metres; negative: how far they are apart.
fn of_meshes(a: &Mesh, b: &Mesh, at: &Placed) -> Option<f64> {
    let way = at.to_a(&b.centre()) - a.centre();
    let turn = at.rotation.map(f32_near);
    let (one, other) = a.balls()?.closest(b.balls()?, &turn, &way.map(f32_near));
    let apart_m = (one.centre - at.to_a(&other.centre)).norm();
    let overlap_m = one.radius_m + other.radius_m - apart_m;
    // A point of one ball lies that deep in the other, or its centre does.
    Some(overlap_m.min(one.radius_m.max(other.radius_m)))
}

/// The same for a ball of a mesh and a whole convex shape.
///
/// * `middle` - the convex shape's, in the mesh's frame.
/// * `pos12` - of the convex shape, seen from the mesh.
fn of_convex(
    mesh: &Mesh,
    (convex, shape): (&Convex, &Shape),
    middle: &Point,
    pos12: &Pose,
) -> Option<f64> {
    let Ball { centre, radius_m } = mesh.balls()?.closest_to(middle);
    let apart_m = (centre - middle).norm() - radius_m - shape.radius;
    if apart_m > 0.0 {
        return Some(-apart_m);
    }
    let ball = Convex::sphere(radius_m);
    let way = pos12.translation.vector - centre.coords;
    let from_ball = Pose::from_parts(way.into(), pos12.rotation);
    let gap = convex_gap(&ball, convex, &from_ball, &mut Warm::default()).gap;
    // The convex shape contains a point that deep in the ball, or the ball's centre.
    Some((-gap.max).min(radius_m))
}
