//! Queries of shape pairs without meshes, and the change of frames around them.

use crate::math::{Interval, Pose, ROUND, relative};
use crate::shape::{Geometry, Shape};
use crate::wire::NO_INDEX;
use crate::world::{Body, PlacedShape};

use super::contacts::Contact;
use super::exact::{
    Closest, ManifoldPoint, Shell, Warm, convex_gap, convex_gap_along, gap_to_half_space,
    half_space_gap, points_on_plane, touching_points,
};
use super::memo::Witness;
use super::mesh::{LeafContact, retest_witness};
use super::widen::widened;

/// Whether one exact query decides the pair of shapes.
pub(super) fn is_simple(a: &Shape, b: &Shape) -> bool {
    !matches!(a.geometry, Geometry::Mesh(_)) && !matches!(b.geometry, Geometry::Mesh(_))
}

/// The pose of shape 2 seen from shape 1, from that of body 2 seen from body 1.
pub(super) fn shape_pose(a: &PlacedShape, b: &PlacedShape, bodies12: &Pose) -> Pose {
    relative(&a.pose, &(bodies12 * b.pose))
}

/// One exact query; `None` for a mesh or two half-spaces. The answer is in shape A's frame.
pub(super) fn shape_gap(a: &Shape, b: &Shape, pos12: &Pose, warm: &mut Warm) -> Option<Closest> {
    shape_gap_along(a, b, pos12, warm, None)
}

/// As [`shape_gap`].
///
/// * `shell` - see [`convex_gap_along`]; for a pair that is queried from tick to tick.
pub(super) fn shape_gap_along(
    a: &Shape,
    b: &Shape,
    pos12: &Pose,
    warm: &mut Warm,
    shell: Option<&mut Shell>,
) -> Option<Closest> {
    match (&a.geometry, &b.geometry) {
        (Geometry::Convex(one), Geometry::Convex(other)) => Some(match shell {
            Some(shell) => convex_gap_along(one, other, pos12, warm, shell),
            None => convex_gap(one, other, pos12, warm),
        }),
        (Geometry::HalfSpace { normal, offset }, Geometry::Convex(other)) => {
            Some(half_space_gap(normal, *offset, other, pos12))
        }
        (Geometry::Convex(one), Geometry::HalfSpace { normal, offset }) => {
            Some(gap_to_half_space(one, normal, *offset, pos12))
        }
        _ => None,
    }
}

/// The result for a shape pair as a witness of the body pair.
pub(super) fn witness_of(
    a: &PlacedShape,
    b: &PlacedShape,
    pos12: &Pose,
    closest: &Closest,
    places: (u32, u32),
) -> Witness {
    Witness {
        best_m: closest.best_m,
        point_a: a.pose * closest.point_a,
        point_b: b.pose * pos12.inverse_transform_point(&closest.point_b),
        normal: a.pose.rotation * closest.normal,
        ..Witness::of_shapes(places.0, places.1)
    }
}

/// Appends the contact points of a colliding shape pair to `found`: all of them; the pair's contact set keeps four.
///
/// * `gap` - the query's interval as it holds for the bodies: see [`sound`].
pub(super) fn add_manifold(
    (a, b): (&Body, &Body),
    (place_a, place_b): (u32, u32),
    pos12: &Pose,
    (closest, gap): (&Closest, Interval),
    found: &mut Vec<Contact>,
) {
    let (Some(one), Some(other)) = (
        a.shapes.get(place_a as usize),
        b.shapes.get(place_b as usize),
    ) else {
        return;
    };
    let contact = |point_a, point_b, gap_m, feature| Contact {
        id: 0,
        shape_a: place_a,
        shape_b: place_b,
        triangle_a: NO_INDEX,
        triangle_b: NO_INDEX,
        feature: u64::from(feature),
        patch: 0,
        point_a: one.pose * point_a,
        point_b: other.pose * pos12.inverse_transform_point(&point_b),
        normal: one.pose.rotation * closest.normal,
        gap_m,
        gap,
    };
    let before = found.len();
    let take = |p: &ManifoldPoint| {
        found.push(contact(p.point_a, p.point_b, p.gap_m, p.feature));
    };
    match (&one.shape.geometry, &other.shape.geometry) {
        (Geometry::Convex(first), Geometry::Convex(second)) => {
            touching_points(first, second, pos12, closest, take);
        }
        (Geometry::HalfSpace { .. }, Geometry::Convex(second)) => {
            points_on_plane(second, Some(pos12), closest, take);
        }
        (Geometry::Convex(first), Geometry::HalfSpace { .. }) => {
            points_on_plane(first, None, closest, take);
        }
        _ => {}
    }
    if found.len() == before {
        let (best_m, at) = (closest.best_m, (closest.point_a, closest.point_b));
        found.push(contact(at.0, at.1, best_m, NO_INDEX));
    }
}

/// The place where two leaves of meshes touch, as a contact of the bodies. `patch`: equal for points found as one
/// patch.
pub(super) fn leaf_contact(
    (one, other): (&PlacedShape, &PlacedShape),
    places: (u32, u32),
    pos12: &Pose,
    (leaf, patch): (&LeafContact, u32),
    gap: Interval,
) -> Contact {
    let seen = witness_of(one, other, pos12, &leaf.closest, places);
    Contact {
        id: 0,
        shape_a: places.0,
        shape_b: places.1,
        triangle_a: leaf.triangle_a,
        triangle_b: leaf.triangle_b,
        feature: leaf.feature,
        patch,
        point_a: seen.point_a,
        point_b: seen.point_b,
        normal: seen.normal,
        gap_m: leaf.closest.best_m,
        gap,
    }
}

/// One exact query of the pair that touched last: two shapes, or two of their triangles.
pub(super) fn retest(a: &Shape, b: &Shape, pos12: &Pose, (ta, tb): (u32, u32)) -> Option<Closest> {
    if is_simple(a, b) {
        shape_gap(a, b, pos12, &mut Warm::default())
    } else {
        retest_witness(a, b, pos12, ta, tb)
    }
}

/// A lower bound on the gap of two placed shapes from their bounding spheres; minus infinity for a half-space.
pub(super) fn sphere_bound(a: &PlacedShape, b: &PlacedShape, bodies12: &Pose) -> f64 {
    let (ra, rb) = (a.shape.radius, b.shape.radius);
    if !(ra.is_finite() && rb.is_finite()) {
        return f64::NEG_INFINITY;
    }
    let (ca, cb) = (
        a.pose * a.shape.centre,
        bodies12 * (b.pose * b.shape.centre),
    );
    // The centres are sums of numbers that may be far larger than the centres themselves.
    let magnitude = bodies12.translation.vector.amax() + a.reach_m() + b.reach_m();
    (cb - ca).norm() - ra - rb - 32.0 * f64::EPSILON * magnitude
}

/// The certificate of a shape pair's result for the bodies: its ends in order, widened by what composing the poses may
/// have lost. A smaller overlap counts as touching.
pub(super) fn sound(gap: Interval, a: &PlacedShape, b: &PlacedShape, bodies12: &Pose) -> Interval {
    let ordered = Interval {
        min: gap.min.min(gap.max),
        max: gap.max.max(gap.min),
    };
    widened(ordered, lost_m(a, b, bodies12))
}

/// How far composing the poses may have displaced one shape seen from the other, metres: a shape a kilometre from its
/// body's origin has its place rounded there, which a query of the two shapes cannot know.
pub(super) fn lost_m(a: &PlacedShape, b: &PlacedShape, bodies12: &Pose) -> f64 {
    let off = |pose: &Pose| *pose != Pose::identity();
    if !(off(&a.pose) || off(&b.pose)) {
        return 0.0;
    }
    let reach = |pose: &Pose| pose.translation.vector.amax();
    let magnitude = reach(&a.pose) + reach(&b.pose) + reach(bodies12);
    32.0 * ROUND * magnitude
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::math::pose_from;
    use crate::shape::Convex;

    /// Two balls that overlap by 0.5 nm; one centre is the sum of two numbers a million times larger that cancel.
    #[test]
    fn bug_balls_are_not_farther_apart_than_rounding_lets_their_centres_be_known() {
        let ball = |at: [f64; 3]| PlacedShape {
            shape: Arc::new(Shape::of_convex(Convex::sphere(0.5))),
            pose: pose_from(at, [0.0, 0.0, 0.0, 1.0]).unwrap(),
        };
        let turn = [
            -0.321_370_151_461_328_8,
            -0.321_595_790_057_600_6,
            -0.855_836_712_590_430_6,
            0.246_659_471_639_252_56,
        ];
        let away = [
            671_759.856_526_740_4,
            215_497.413_553_353_43,
            -708_729.686_063_419_6,
        ];
        let bodies12 = pose_from(away, turn).unwrap();
        let bound = sphere_bound(&ball([0.0; 3]), &ball([1e6, 0.0, 0.0]), &bodies12);
        assert!(bound <= -5.2e-10, "{bound}");
        // The bound is useful all the same.
        let near = sphere_bound(&ball([0.0; 3]), &ball([3.0, 0.0, 0.0]), &Pose::identity());
        assert!((near - 2.0).abs() < 1e-12, "{near}");
    }
}
