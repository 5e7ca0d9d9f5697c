//! What two leaves share along a normal that does not come from their own query.
//!
//! In: a triangle of a mesh and a convex shape, and a normal; two triangles are clipped by `triangles`. Out: all
//! clipped points; which are kept is decided among those of all leaves.

use super::{Closest, Convex, FACING, Feature, Found, ManifoldPoint, Pair, clip_onto};
use crate::math::{Pose, Vec3};

/// As [`manifold`] for shapes that are leaves of meshes: all points that the two share along `normal`, regardless of
/// the answer of their own query.
///
/// * `normal` - unit, A's frame, from A to B.
/// * `base_is_b` - whose face the points are projected onto; `None`: the one whose face is closer to the normal.
/// * `take` - receives points on the surfaces in A's frame, the gap along `normal` and the feature.
///
/// Cost: below a microsecond; no allocation.
pub(in crate::narrow) fn shared_points(
    (a, b): (&Convex, &Convex),
    pos12: &Pose,
    normal: &Vec3,
    base_is_b: Option<bool>,
    prediction_m: f64,
    mut take: impl FnMut(&ManifoldPoint, bool),
) {
    let pair = Pair::new(a, b, pos12);
    let (of_a, of_b) = (Feature::of_a(&pair, normal), Feature::of_b(&pair, normal));
    let (side_a, side_b) = (of_a.facing(normal), of_b.facing(normal));
    let base_is_b = base_is_b.unwrap_or(side_b > side_a);
    if (if base_is_b { side_b } else { side_a }) < FACING {
        return;
    }
    let along = Closest {
        normal: *normal,
        ..Closest::unknown()
    };
    let mut found = Found::new(&pair, &along, prediction_m);
    let (base, incident) = if base_is_b {
        (&of_b, &of_a)
    } else {
        (&of_a, &of_b)
    };
    clip_onto(base, incident, normal, base_is_b, &mut found);
    for point in &found.points[..found.count] {
        take(point, base_is_b);
    }
}
