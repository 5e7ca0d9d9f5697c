//! Bounds on the gap of two bodies from their bounding boxes and balls: what holds before any work is done.

use crate::math::{Interval, ROUND};
use crate::world::Body;

/// Bounds on the gap of two bodies from their boxes (or a half-space's plane) alone.
///
/// Lower: along each axis, what separates the boxes, or how deep they overlap. It holds for every kind of gap: a
/// translation by the overlap separates convex pieces, and a point of A under B's surface leaves B's box within the
/// overlap. Upper: no two points of the bodies are farther apart than this.
pub(super) fn box_bounds(a: &Body, b: &Body) -> Interval {
    if a.unbounded || b.unbounded {
        return Interval::UNKNOWN;
    }
    let least = |k: usize| (b.proxy.min[k] - a.proxy.max[k]).max(a.proxy.min[k] - b.proxy.max[k]);
    let low = least(0).max(least(1)).max(least(2));
    let (between, rounding) = between_centres(a, b);
    let high = (between + a.radius + b.radius + rounding).next_up();
    Interval {
        min: low.next_down().min(high),
        max: high,
    }
}

/// Bounds on the gap from the balls around the two bodies: what holds before any work is done.
///
/// The lower end holds for overlapping bodies too: a translation by the balls' overlap separates convex pieces, and no
/// point of one lies deeper under the surface of the other.
pub(super) fn whole_bounds(a: &Body, b: &Body) -> Interval {
    if a.unbounded || b.unbounded {
        return Interval::UNKNOWN;
    }
    let ((between, rounding), radii) = (between_centres(a, b), a.radius + b.radius);
    Interval {
        min: (between - radii - rounding).next_down(),
        max: (between + radii + rounding).next_up(),
    }
}

/// Radii of the balls around two bodies; where both have half-spaces, around their other shapes alone. Metres, about
/// their centres; infinite where there is nothing but half-spaces.
pub(super) fn radii_m(a: &Body, b: &Body) -> [f64; 2] {
    if !(a.unbounded && b.unbounded) {
        return [a.radius, b.radius];
    }
    // The centre of a body that has a half-space is its origin.
    [a, b].map(|body| match body.shapes.tree() {
        Some(tree) if tree.boxes.is_some() => tree.reach_m * (1.0 + 8.0 * ROUND),
        _ => f64::INFINITY,
    })
}

/// Distance of the centres of two bodies, and the error bound of it and of its sums with their radii, metres.
///
/// A centre is the sum of two numbers that may both be far larger than it.
fn between_centres(a: &Body, b: &Body) -> (f64, f64) {
    let far =
        |body: &Body| body.pose.translation.vector.amax() + body.centre.coords.amax() + body.radius;
    let between = (b.pose * b.centre - a.pose * a.centre).norm();
    (between, 32.0 * f64::EPSILON * (far(a) + far(b)))
}
