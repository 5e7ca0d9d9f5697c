//! The contact of two leaves where no feature of one lies over the other.
//!
//! In: the leaves and the result of their query. Out: one point on each, opposite each other along the normal.

use super::leaf::{Leaf, mix};
use crate::math::{Point, Vec3};
use crate::narrow::exact::Closest;
use crate::narrow::mesh::LeafContact;

/// Where the leaves themselves meet, opposite each other along their own normal.
pub(super) fn nearest(a: &Leaf<'_>, b: &Leaf<'_>, patch: u32, found: &LeafContact) -> LeafContact {
    let normal = found.closest.normal;
    let points = match crossing(a, b) {
        // Two triangles that cross have a depth, and the points of their query are no more than a corner at that depth.
        Some(middle) => edges_across(&a.corners, &b.corners, &normal).unwrap_or([middle; 2]),
        None => [found.closest.point_a, found.closest.point_b],
    };
    let triangles = u64::from(found.triangle_a) << 32 | u64::from(found.triangle_b);
    LeafContact {
        closest: Closest {
            best_m: normal.dot(&(points[1] - points[0])),
            point_a: points[0],
            point_b: points[1],
            ..found.closest
        },
        feature: mix(triangles, 3),
        patch,
        ..*found
    }
}

/// The opposite points of the two edges that lie deepest along a normal, on A's and on B's; `None`: they do not pass
/// each other there.
fn edges_across(a: &[Point; 3], b: &[Point; 3], normal: &Vec3) -> Option<[Point; 2]> {
    let deepest = |corners: &[Point; 3], outward: Vec3| {
        let mut by_depth = *corners;
        let height = |p: &Point| outward.dot(&p.coords);
        by_depth.sort_by(|p, q| height(q).total_cmp(&height(p)));
        (by_depth[0], by_depth[1] - by_depth[0])
    };
    let ((from_a, along_a), (from_b, along_b)) = (deepest(a, *normal), deepest(b, -normal));
    let cross = along_a.cross(&along_b);
    let (between, square) = (from_b - from_a, cross.norm_squared());
    let place_a = between.cross(&along_b).dot(&cross) / square;
    let place_b = between.cross(&along_a).dot(&cross) / square;
    let on = |place: f64| (0.0..=1.0).contains(&place);
    (on(place_a) && on(place_b)).then(|| [from_a + along_a * place_a, from_b + along_b * place_b])
}

/// The middle of the segment in which two triangles cross.
fn crossing(a: &Leaf<'_>, b: &Leaf<'_>) -> Option<Point> {
    let (normal_a, normal_b) = (a.normal?, b.normal?);
    let (of_a, of_b) = (a.corners, b.corners);
    let (mut sum, mut count) = (Vec3::zeros(), 0.0);
    for (plane, normal, other) in [(&of_a, &normal_a, &of_b), (&of_b, &normal_b, &of_a)] {
        for k in 0..3 {
            let (from, to) = (other[k], other[(k + 1) % 3]);
            let [x, y] = [from, to].map(|p| normal.dot(&(p - plane[0])));
            if (x > 0.0) == (y > 0.0) {
                continue;
            }
            let at = from + (to - from) * (x / (x - y));
            let within = (0..3).all(|i| {
                let along = plane[(i + 1) % 3] - plane[i];
                along.cross(&(at - plane[i])).dot(normal) >= 0.0
            });
            if within {
                sum += at.coords;
                count += 1.0;
            }
        }
    }
    (count > 0.0).then(|| Point::from(sum / count))
}
