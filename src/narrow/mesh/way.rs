//! The way from two triangles of two surfaces to where the surfaces cross.
//!
//! In: two triangles that do not cross. Out: the sides over which to go on to the next ones. The planes of the two meet
//! in a line, which approximates where the surfaces cross (a step of Newton's method for two surfaces): a triangle that
//! the line misses is left over the side towards the line; if the line meets both, but in different places, one moves
//! along it towards the other. Nothing is proved here: the caller tests the triangles at the end of the walk.

use super::triangle::{Triangle, edges};
use crate::math::Vec3;

/// Planes with a smaller sine between them have no usable line: its place would be noise.
const SINE_MIN: f64 = 1e-4;

/// How a walk continues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// The two cross, up to rounding.
    Cross,
    /// Over these sides, A's and B's.
    Over([Option<u32>; 2]),
    /// No way is known.
    None,
}

/// The part of a line within a triangle, and the sides by which it enters and leaves.
#[derive(Clone, Copy)]
struct Span {
    low: (f64, u32),
    high: (f64, u32),
}

impl Span {
    fn is_empty(&self) -> bool {
        self.low.0 > self.high.0
    }

    fn length(&self) -> f64 {
        self.high.0 - self.low.0
    }
}

/// A triangle with its normal, and the inward directions of its sides.
struct Face {
    corners: [Vec3; 3],
    normal: Vec3,
    inward: [Vec3; 3],
}

impl Face {
    /// Corners relative to `origin`: the digits of a common offset are not lost.
    fn of(triangle: &Triangle, origin: &Vec3) -> Self {
        let edges = edges(triangle);
        let normal = edges[0].cross(&edges[1]);
        Self {
            corners: triangle.map(|p| p.coords - origin),
            normal,
            inward: edges.map(|edge| normal.cross(&edge)),
        }
    }

    /// The part of a line in the triangle's plane that lies in the triangle.
    fn span(&self, on: &Vec3, along: &Vec3) -> Span {
        let mut span = Span {
            low: (f64::NEG_INFINITY, 0),
            high: (f64::INFINITY, 0),
        };
        for (k, (inward, corner)) in (0..).zip(self.inward.iter().zip(&self.corners)) {
            let (depth, rise) = (inward.dot(&(on - corner)), inward.dot(along));
            let at = -depth / rise;
            if rise > 0.0 && at > span.low.0 {
                span.low = (at, k);
            } else if rise < 0.0 && at < span.high.0 {
                span.high = (at, k);
            } else if rise == 0.0 && depth < 0.0 {
                (span.low.0, span.high.0) = (f64::INFINITY, f64::NEG_INFINITY);
            }
        }
        span
    }

    /// The side beyond which a point in the triangle's plane lies farthest.
    fn beyond(&self, point: &Vec3) -> Option<u32> {
        let mut least = (0.0, None);
        for (k, (inward, corner)) in (0..).zip(self.inward.iter().zip(&self.corners)) {
            let depth = inward.dot(&(point - corner));
            if depth < least.0 {
                least = (depth, Some(k));
            }
        }
        least.1
    }
}

/// The way from two triangles, both in one frame.
///
/// Side `k` of a triangle runs from its corner `k` to the next one.
pub(super) fn way(a: &Triangle, b: &Triangle) -> Way {
    let origin = a[0].coords;
    let (a, b) = (Face::of(a, &origin), Face::of(b, &origin));
    let (aa, bb) = (a.normal.norm_squared(), b.normal.norm_squared());
    let ab = a.normal.dot(&b.normal);
    let det = aa * bb - ab * ab;
    // Also if one has no area, or a number is NaN.
    if det.is_nan() || det <= SINE_MIN * SINE_MIN * aa * bb {
        return Way::None;
    }
    // The point of both planes nearest to the middle of the two triangles.
    let middle = (a.corners.iter().sum::<Vec3>() + b.corners.iter().sum::<Vec3>()) / 6.0;
    let above_a = a.normal.dot(&(middle - a.corners[0]));
    let above_b = b.normal.dot(&(middle - b.corners[0]));
    let on = middle
        + a.normal * ((above_b * ab - above_a * bb) / det)
        + b.normal * ((above_a * ab - above_b * aa) / det);
    let along = a.normal.cross(&b.normal);
    let (in_a, in_b) = (a.span(&on, &along), b.span(&on, &along));
    match (in_a.is_empty(), in_b.is_empty()) {
        (true, true) => Way::Over([a.beyond(&on), b.beyond(&on)]),
        (true, false) => {
            let at = 0.0_f64.max(in_b.low.0).min(in_b.high.0);
            Way::Over([a.beyond(&(on + along * at)), None])
        }
        (false, true) => {
            let at = 0.0_f64.max(in_a.low.0).min(in_a.high.0);
            Way::Over([None, b.beyond(&(on + along * at))])
        }
        (false, false) => {
            let (apart, over_a, over_b) = if in_a.high.0 < in_b.low.0 {
                (in_b.low.0 - in_a.high.0, in_a.high.1, in_b.low.1)
            } else if in_b.high.0 < in_a.low.0 {
                (in_a.low.0 - in_b.high.0, in_a.low.1, in_b.high.1)
            } else {
                return Way::Cross;
            };
            // The step over the longer one gains more; if they are far apart, both move.
            let both = apart > in_a.length() + in_b.length();
            let a_goes = both || in_a.length() >= in_b.length();
            let b_goes = both || !a_goes;
            Way::Over([a_goes.then_some(over_a), b_goes.then_some(over_b)])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Point;
    use crate::narrow::mesh::triangle::{gap, surely_crosses};
    use proptest::prelude::*;

    fn triangle() -> impl Strategy<Value = Triangle> {
        proptest::array::uniform3(proptest::array::uniform3(-1.0..1.0))
            .prop_map(|corners| corners.map(Point::from))
    }

    proptest! {
        #[test]
        fn an_end_of_the_way_is_where_two_triangles_cross(a in triangle(), b in triangle()) {
            let end = way(&a, &b) == Way::Cross;
            if surely_crosses(&a, &b, 0.0) {
                prop_assert!(end);
            }
            if end {
                let found = gap(&a, &b, 0.0, f64::INFINITY).unwrap();
                prop_assert!(found.gap.min <= 1e-9, "{:?}", found.gap);
            }
        }
    }

    #[test]
    fn a_triangle_is_left_towards_where_the_planes_meet() {
        let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Point::from);
        // Upright at x = 5, crossing the plane of the flat one: leave the flat one over its side towards it.
        let upright = [[5.0, 0.0, -1.0], [5.0, 1.0, -1.0], [5.0, 0.5, 2.0]].map(Point::from);
        assert_eq!(way(&flat, &upright), Way::Over([Some(1), None]));
        assert_eq!(way(&upright, &flat), Way::Over([None, Some(1)]));
        // The same, but entirely above: leave it over its lower side too.
        let above = upright.map(|p| p + Vec3::z() * 2.0);
        assert_eq!(way(&flat, &above), Way::Over([Some(1), Some(0)]));
    }

    #[test]
    fn planes_that_do_not_meet_and_triangles_without_area_have_no_way() {
        let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Point::from);
        let above = flat.map(|p| p + Vec3::z());
        let line = [0.0, 1.0, 2.0].map(|x| Point::new(x, x, x));
        for other in [above, flat, line, [flat[0]; 3]] {
            assert_eq!(way(&flat, &other), Way::None);
            assert_eq!(way(&other, &flat), Way::None);
        }
    }
}
