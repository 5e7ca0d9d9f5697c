//! The feature of a convex shape that touches a half-space.
//!
//! In: a shape and the exact answer of the pair. Out: the corners of its feature along the plane's normal that lie on
//! the plane or behind it, all of them: the caller knows which were kept before, and chooses.

use super::{Closest, Convex, Feature, Found, ManifoldPoint, PREDICTION, SAME, Surface};
use crate::math::{Pose, Vec3};

/// Passes on the contact points of a shape that touches a half-space, up to 9, in A's frame.
///
/// * `at` - pose of the shape in A's frame if it is B; `None`: it is A itself.
/// * `closest` - the answer of `half_space_gap` or `gap_to_half_space` for the two.
///
/// Cost: some 100 ns, for hulls as long as it takes to visit all faces; no allocation.
pub(in crate::narrow) fn points_on_plane(
    shape: &Convex,
    at: Option<&Pose>,
    closest: &Closest,
    take: impl FnMut(&ManifoldPoint),
) {
    let normal = closest.normal;
    let feature = match at {
        Some(pose) => Feature::seen(shape.core(), pose, &-normal),
        None => Feature::towards(shape.core(), &normal),
    };
    let rounding_m = closest.gap.max - closest.gap.min;
    let plane = Surface::Even(0.0);
    let surfaces = match at {
        Some(pose) => {
            let axis = pose.rotation * Vec3::z();
            [plane, Surface::new(shape, pose.translation.vector, axis)]
        }
        None => [Surface::own(shape), plane],
    };
    let mut found = Found::with(
        closest,
        surfaces,
        rounding_m.max(PREDICTION * shape.radius()),
        SAME * shape.radius() + rounding_m,
    );
    for (corner, id) in feature.used().iter().zip(0..) {
        let id = feature.id(id);
        // Vertically onto the plane.
        if at.is_some() {
            let height = normal.dot(&(corner - closest.point_a.coords));
            found.take(&(corner - normal * height), corner, id);
        } else {
            let height = normal.dot(&(closest.point_b.coords - corner));
            found.take(corner, &(corner + normal * height), id);
        }
    }
    found.all().iter().for_each(take);
}
