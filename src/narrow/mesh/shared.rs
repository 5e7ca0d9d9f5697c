//! The intersection of two triangles: one cut by the plane of the other and by the planes through its sides.

use super::triangle::Triangle;
use crate::math::{Point, Vec3};
use crate::narrow::approx::Spot;

/// Most corners of a triangle cut by five planes.
const CORNERS: usize = 8;
/// Planes are moved out by this share of the size of the two triangles: far above rounding.
const MARGIN: f64 = 1e-9;
/// A triangle lower than this share of its longest side has no usable plane.
const NEEDLE: f64 = 1e-6;

/// A convex polygon.
struct Polygon {
    corners: [Point; CORNERS],
    len: usize,
}

impl Polygon {
    fn corners(&self) -> &[Point] {
        &self.corners[..self.len]
    }

    /// The part of it where `normal . (x - at) <= reach`.
    fn cut(&self, normal: &Vec3, at: &Point, reach: f64) -> Self {
        let mut left = Self {
            corners: self.corners,
            len: 0,
        };
        let height = |p: &Point| normal.dot(&(p - at)) - reach;
        let mut put = |p: Point| {
            // A plane adds one corner to a convex polygon; rounding may duplicate one.
            if left.len < CORNERS {
                left.corners[left.len] = p;
                left.len += 1;
            }
        };
        for (k, p) in self.corners().iter().enumerate() {
            let q = &self.corners[(k + 1) % self.len];
            let (x, y) = (height(p), height(q));
            if x <= 0.0 {
                put(*p);
            }
            if (x < 0.0 && y > 0.0) || (x > 0.0 && y < 0.0) {
                put(p + (q - p) * (x / (x - y)));
            }
        }
        left
    }
}

/// What two triangles share, both in one frame; `Some(None)`: nothing; `None`: the other one is a needle, and this
/// method does not apply.
pub(super) fn shared(a: &Triangle, b: &Triangle, slop_m: f64) -> Option<Option<Spot>> {
    let sides = [b[1] - b[0], b[2] - b[1], b[0] - b[2]];
    let size_b = sides.iter().map(Vec3::norm).fold(0.0, f64::max);
    let cross = sides[0].cross(&sides[1]);
    if cross.norm() <= NEEDLE * size_b * size_b {
        return None;
    }
    let normal = cross.normalize();
    let size_a = (a[1] - a[0]).norm().max((a[2] - a[0]).norm());
    let margin = MARGIN * (size_a + size_b) + 4.0 * slop_m;
    let mut polygon = Polygon {
        corners: [a[0]; CORNERS],
        len: 3,
    };
    polygon.corners[..3].copy_from_slice(a);
    polygon = polygon.cut(&normal, &b[0], margin);
    polygon = polygon.cut(&-normal, &b[0], margin);
    for (side, from) in sides.iter().zip(b) {
        let outward = side.cross(&normal).try_normalize(f64::MIN_POSITIVE)?;
        polygon = polygon.cut(&outward, from, margin);
        if polygon.len == 0 {
            return Some(None);
        }
    }
    Some(Some(Spot::round(polygon.corners(), margin)))
}
