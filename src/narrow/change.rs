//! How much a gap may have changed since a test: from the relative pose then, and from deformation.

use crate::math::{Point, Pose, ROUND, Vec3, chord, displacement};
use crate::shape::Geometry;
use crate::world::Body;

use super::around::radii_m;
use super::bent::Bent;

/// An upper bound on how much the gap of two bodies changed since a test, from their relative pose and deformation at
/// the test, metres.
pub(super) fn changed_since(a: &Body, b: &Body, (then, bent): (&Pose, Bent), now: &Pose) -> f64 {
    let bent_m = Bent::of_bodies(a, b).since_m(&bent);
    let moved_m = relative_motion(a, b, then, now);
    if bent_m > 0.0 {
        (moved_m + bent_m) * (1.0 + 2.0 * ROUND)
    } else {
        moved_m
    }
}

/// An upper bound on how much the gap of two bodies changed between two relative poses, metres; deformation in between
/// is added on top.
///
/// The displacement of the smaller body's surface seen from the other; for a half-space the change of the centre's
/// height above its plane, plus what the relative rotation adds.
///
/// If one body has half-spaces and other shapes: the displacement of the bounded body seen from it. Every kind of gap
/// changes by no more. Proof: say no point of B moves by more than `d` as A sees it. The extent of a convex piece of B
/// along any direction then changes by at most `d`, and so do distance and least translation along it. A point of B
/// under the surface of a solid of A comes nearer to that surface by `d` at most. And a ball of radius `r` within a
/// solid of B about a point of A moves to a ball about a point within `d` of that one, so it still holds a ball of
/// radius `r - d` about it. The motion of A's own points seen from B is not used: far out it has no bound.
///
/// If both bodies have half-spaces, these are not paired with each other (law 3.2). In every other pair at least one
/// shape is bounded, and the above holds for it: the greater displacement of the two bodies' bounded shapes.
pub(super) fn relative_motion(a: &Body, b: &Body, then: &Pose, now: &Pose) -> f64 {
    if then == now {
        return 0.0;
    }
    if !(a.unbounded || b.unbounded) {
        return if a.radius < b.radius {
            displacement(&then.inverse(), &now.inverse(), &a.centre, a.radius)
        } else {
            displacement(then, now, &b.centre, b.radius)
        };
    }
    if a.unbounded && b.unbounded {
        return of_bounded_shapes(a, b, then, now);
    }
    match (half_space_of(a), half_space_of(b)) {
        (Some(normal), _) => plane_motion(&normal, then, now, &b.centre, b.radius),
        (None, Some(normal)) => plane_motion(
            &normal,
            &then.inverse(),
            &now.inverse(),
            &a.centre,
            a.radius,
        ),
        (None, None) if !b.unbounded => displacement(then, now, &b.centre, b.radius),
        (None, None) => displacement(&then.inverse(), &now.inverse(), &a.centre, a.radius),
    }
}

/// The greatest displacement of a bounded shape of one of two bodies, seen from the other.
fn of_bounded_shapes(a: &Body, b: &Body, then: &Pose, now: &Pose) -> f64 {
    let [of_a, of_b] = radii_m(a, b);
    let by_b = displacement(then, now, &b.centre, of_b);
    let by_a = displacement(&then.inverse(), &now.inverse(), &a.centre, of_a);
    match (of_a.is_finite(), of_b.is_finite()) {
        (true, true) => by_a.max(by_b),
        (true, false) => by_a,
        (false, true) => by_b,
        // Bodies of half-spaces alone are no pair.
        (false, false) => f64::INFINITY,
    }
}

fn plane_motion(normal: &Vec3, then: &Pose, now: &Pose, centre: &Point, radius: f64) -> f64 {
    let (from, to) = (then * centre, now * centre);
    let height = normal.dot(&(to - from)).abs();
    let magnitude = from.coords.amax().max(to.coords.amax()) + centre.coords.amax() + radius;
    (height + chord(&then.rotation, &now.rotation) * radius) * (1.0 + 8.0 * f64::EPSILON)
        + 16.0 * f64::EPSILON * magnitude
}

/// The outward normal in the body's frame, when the body is one half-space and nothing else.
fn half_space_of(body: &Body) -> Option<Vec3> {
    let [placed] = &*body.shapes else { return None };
    match &placed.shape.geometry {
        Geometry::HalfSpace { normal, .. } => Some(placed.pose.rotation * normal),
        Geometry::Convex(_) | Geometry::Mesh(_) => None,
    }
}
