//! What two leaves share along a normal that was found otherwise than by their own query.
//!
//! In: a triangle of a mesh and a convex shape, or two triangles, and a normal. Out: the clipped points, all of them:
//! which are kept is decided among those of all leaves.

use super::{Closest, Convex, FACING, Feature, Found, ManifoldPoint, Pair, clip_onto};
use crate::math::{Point, Pose, Vec3};

/// As [`manifold`] for shapes that are leaves of meshes: all points that the two share along `normal`, whatever the
/// answer of their own query was.
///
/// * `normal` - unit, A's frame, from A to B.
/// * `base_is_b` - whose face the points are cast onto; `None`: whose faces the normal more.
/// * `take` - is given points on the surfaces in A's frame, the gap along `normal` and the feature.
///
/// Cost: below a microsecond; no allocation.
pub(in crate::narrow) fn shared_points(
    (a, b): (&Convex, &Convex),
    pos12: &Pose,
    normal: &Vec3,
    base_is_b: Option<bool>,
    prediction_m: f64,
    take: impl FnMut(&ManifoldPoint, bool),
) {
    let pair = Pair::new(a, b, pos12);
    let shown = [Feature::of_a(&pair, normal), Feature::of_b(&pair, normal)];
    let margins = [a.margin(), b.margin()];
    let found = |closest: &Closest| Found::with(margins, pair.scale, closest, prediction_m);
    clip(&shown, normal, base_is_b, found, take);
}

/// The same for two triangles with an area, both in A's frame, without a convex shape made of either.
pub(in crate::narrow) fn shared_by_triangles(
    [a, b]: [&[Point; 3]; 2],
    normal: &Vec3,
    base_is_b: Option<bool>,
    prediction_m: f64,
    take: impl FnMut(&ManifoldPoint, bool),
) {
    let [a, b] = [a, b].map(|corners| corners.map(|p| p.coords));
    let (Some(of_a), Some(of_b)) = (Feature::of_triangle(&a), Feature::of_triangle(&b)) else {
        return;
    };
    let reach = |corners: &[Vec3; 3]| corners.iter().map(Vec3::norm).fold(0.0, f64::max);
    let scale = reach(&a) + reach(&b);
    let found = |closest: &Closest| Found::with([0.0; 2], scale, closest, prediction_m);
    clip(&[of_a, of_b], normal, base_is_b, found, take);
}

/// What A and B show, the one clipped by the other.
fn clip(
    [of_a, of_b]: &[Feature; 2],
    normal: &Vec3,
    base_is_b: Option<bool>,
    found: impl Fn(&Closest) -> Found,
    mut take: impl FnMut(&ManifoldPoint, bool),
) {
    let (side_a, side_b) = (of_a.facing(normal), of_b.facing(normal));
    let base_is_b = base_is_b.unwrap_or(side_b > side_a);
    if (if base_is_b { side_b } else { side_a }) < FACING {
        return;
    }
    let mut found = found(&Closest {
        normal: *normal,
        ..Closest::unknown()
    });
    let (base, incident) = if base_is_b {
        (of_b, of_a)
    } else {
        (of_a, of_b)
    };
    clip_onto(&base.spread(), incident, normal, base_is_b, &mut found);
    for point in &found.points[..found.count] {
        take(point, base_is_b);
    }
}
