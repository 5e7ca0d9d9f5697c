//! Curved pairs that may be apart by less than their methods end at, separated by cutting planes.
//!
//! In: a pair, and a gap across zero that is wider than rounding. Out: that gap, with a greater lower end and its
//! normal if a direction separates the two.
//!
//! The directions that separate are a convex set: those whose product with every point of the difference is positive.
//! So a polygon of candidates, seen in the plane across the best normal so far, is cut by the support point at its
//! centroid until that separates or none are left. Each cut takes at least a third of the area, and is the deeper the
//! farther the centroid is from separating. A climb from normal to normal instead ends on ridges: with a body a million
//! times as large as the other a separating direction is a millionth of a radian wide.

use super::pair::{CoreGap, Pair, frame};
use crate::math::Vec3;

/// Most cuts on one face: they leave some billionths of a radian in each direction. Shapes at rest that just touch take
/// far fewer, 3 us in all.
const CUTS_MAX: u32 = 96;
/// Corners of a polygon; it rarely has more than ten.
const CORNERS_MAX: usize = 32;

/// A polygon of directions: a corner `(x, y)` stands for `normal + x * across[0] + y * across[1]`.
struct Polygon {
    corners: [[f64; 2]; CORNERS_MAX],
    count: usize,
}

impl Polygon {
    /// All directions up to 45 degrees from the normal, and some more.
    fn first() -> Self {
        let mut corners = [[0.0; 2]; CORNERS_MAX];
        corners[..4].copy_from_slice(&[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]);
        Self { corners, count: 4 }
    }

    fn centroid(&self) -> [f64; 2] {
        let corners = &self.corners[..self.count];
        let first = corners[0];
        let from_first = |[x, y]: [f64; 2]| [x - first[0], y - first[1]];
        let (mut area, mut sum) = (0.0, [0.0; 2]);
        for two in corners[1..].windows(2) {
            let (one, other) = (from_first(two[0]), from_first(two[1]));
            let part = one[0] * other[1] - one[1] * other[0];
            area += part;
            sum = [0, 1].map(|axis| sum[axis] + part * (one[axis] + other[axis]));
        }
        if area > 0.0 {
            return [0, 1].map(|axis| first[axis] + sum[axis] / (3.0 * area));
        }
        // All on a line.
        let mean = |axis: usize| corners.iter().map(|corner| corner[axis]).sum::<f64>();
        [0, 1].map(|axis| mean(axis) / self.count as f64)
    }

    /// Keeps the part where a linear function is positive.
    fn cut(&mut self, at_normal: f64, slope: [f64; 2]) {
        let value = |[x, y]: [f64; 2]| at_normal + slope[0] * x + slope[1] * y;
        let old = std::mem::replace(&mut self.count, 0);
        let from = self.corners;
        for at in 0..old {
            let (one, other) = (from[at], from[(at + 1) % old]);
            let (of_one, of_other) = (value(one), value(other));
            if of_one > 0.0 {
                self.put(one);
            }
            if (of_one > 0.0) != (of_other > 0.0) {
                let share = of_one / (of_one - of_other);
                self.put([0, 1].map(|axis| one[axis] + share * (other[axis] - one[axis])));
            }
        }
    }

    /// Adds a corner. One too many is left out: what is lost is a corner of the candidates.
    fn put(&mut self, corner: [f64; 2]) {
        if self.count < CORNERS_MAX {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }
}

/// Separates the shapes, if a direction does that is less than 90 degrees from the normal.
///
/// * `margins_m` - what the gap of the cores exceeds that of the shapes by.
/// * `pad_m` - the rounding allowance: a direction counts from twice that on.
///
/// Cost: one support per cut; for shapes that overlap the fewer the deeper they do.
pub(super) fn separate(pair: &Pair<'_>, gap: CoreGap, margins_m: f64, pad_m: f64) -> CoreGap {
    let mut best = gap;
    let (x, y) = frame(&gap.normal);
    // The faces of a cube, but for the one behind: directions across a rim are up to 90 degrees off.
    for face in [gap.normal, x, -x, y, -y] {
        if separate_on(pair, &face, margins_m, pad_m, &mut best) {
            break;
        }
    }
    best.upper = best.upper.max(best.lower);
    best
}

/// Looks among the directions of one face of a cube. Returns whether one separates.
fn separate_on(
    pair: &Pair<'_>,
    face: &Vec3,
    margins_m: f64,
    pad_m: f64,
    best: &mut CoreGap,
) -> bool {
    let across: [Vec3; 2] = frame(face).into();
    let mut polygon = Polygon::first();
    for _ in 0..CUTS_MAX {
        let [x, y] = polygon.centroid();
        let dir = face + across[0] * x + across[1] * y;
        let normal = dir / dir.norm();
        let support = pair.support(&normal).w;
        let value = normal.dot(&support);
        if value > best.lower {
            (best.lower, best.normal) = (value, normal);
        }
        if value - margins_m > 2.0 * pad_m {
            return true;
        }
        let inflated = support - normal * margins_m;
        let slope = across.map(|across| inflated.dot(&across));
        polygon.cut(inflated.dot(face), slope);
        if polygon.count < 3 {
            break;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polygon_is_cut_to_the_part_where_a_function_is_positive() {
        let mut polygon = Polygon::first();
        let is_at = |polygon: &Polygon, wanted: [f64; 2]| {
            let centroid = polygon.centroid();
            [0, 1]
                .iter()
                .all(|&axis| (centroid[axis] - wanted[axis]).abs() < 1e-12)
        };
        assert!(is_at(&polygon, [0.0, 0.0]));
        // x > -0.5, then x + y < 0.5.
        polygon.cut(0.5, [1.0, 0.0]);
        assert!(is_at(&polygon, [0.25, 0.0]));
        polygon.cut(0.5, [-1.0, -1.0]);
        let corners = &polygon.corners[..polygon.count];
        for corner in [[-0.5, -1.0], [1.0, -1.0], [1.0, -0.5], [-0.5, 1.0]] {
            assert!(corners.contains(&corner), "{corner:?} in {corners:?}");
        }
        polygon.cut(-5.0, [1.0, 0.0]);
        assert_eq!(polygon.count, 0);
    }
}
