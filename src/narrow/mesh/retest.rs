//! Last tick's contact first: one leaf pair, queried again at a new pose.

use super::half_space;
use super::placed::Placed;
use super::side::{Side, leaf};
use crate::math::{Point, Pose};
use crate::narrow::exact::Closest;
use crate::shape::{Geometry, Node, Shape};

/// The root box of a side and the origin it refers to, own frame.
pub(super) fn tree_of(shape: &Shape, side: Side<'_>) -> (Node, Point) {
    match side {
        Side::Mesh(mesh) => (mesh.whole(), mesh.centre()),
        Side::Convex(_) => {
            let origin = shape.aabb.centre();
            let (low, high) = (shape.aabb.min - origin, shape.aabb.max - origin);
            (Node::leaf(&low, &high, 0), origin)
        }
    }
}

/// Greatest distance of a point from the local origin, metres.
pub(super) fn reach_of(shape: &Shape) -> f64 {
    shape.centre.coords.norm() + shape.radius
}

/// Queries the leaf pair of last tick's contact again: one unit. `None` if the two have no such leaves.
///
/// The upper end of its interval holds for the two shapes. If one is a solid mesh it proves an overlap, but not its
/// depth: the depth of a solid is that of a point, and the translation that separates two leaves can be more. Over a
/// half-space it is the depth of the triangle's lowest corner.
///
/// * `triangle_a`, `triangle_b` - of a [`super::Witness`] or [`super::LeafContact`]; `u32::MAX` for a side that is no
///   mesh.
#[must_use]
pub fn retest_witness(
    a: &Shape,
    b: &Shape,
    pos12: &Pose,
    triangle_a: u32,
    triangle_b: u32,
) -> Option<Closest> {
    let plane = |shape: &Shape| match &shape.geometry {
        Geometry::HalfSpace { normal, offset } => Some((*normal, *offset)),
        Geometry::Convex(_) | Geometry::Mesh(_) => None,
    };
    if let (Some(mesh), Some((normal, offset))) = (a.mesh(), plane(b)) {
        return half_space::retest(mesh, (&normal, offset), pos12, true, triangle_a);
    }
    if let (Some((normal, offset)), Some(mesh)) = (plane(a), b.mesh()) {
        return half_space::retest(mesh, (&normal, offset), pos12, false, triangle_b);
    }
    let (side_a, side_b) = (Side::of(a)?, Side::of(b)?);
    let there = |side: Side<'_>, i: u32| match side {
        Side::Mesh(mesh) => (i as usize) < mesh.faces().len(),
        Side::Convex(_) => true,
    };
    if !there(side_a, triangle_a) || !there(side_b, triangle_b) {
        return None;
    }
    let at = Placed::of(a, b, pos12);
    if !at.slop.is_finite() {
        return None;
    }
    let (leaf_a, leaf_b) = ((side_a, triangle_a), (side_b, triangle_b));
    let mut closest = leaf(leaf_a, leaf_b, &at, f64::INFINITY).ok()?;
    if side_a.solid().or(side_b.solid()).is_some() {
        closest.gap.max = closest.gap.max.max(0.0);
    }
    Some(closest)
}
