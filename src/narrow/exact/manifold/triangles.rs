//! What two triangles share along a normal: one clipped by the other, without making a feature of either.
//!
//! In: six corners, a normal and whose face the points are projected onto. Out: the clipped points, at most six. A
//! fast `shared_points`, whose room for polygons of eight corners costs more than the clipping of three.

use super::clipped::{CUT, met};
use super::{FACING, ManifoldPoint, SAME};
use crate::math::{Point, Vec3};
use crate::narrow::exact::feature::RIM;

/// A triangle that is cut three times has six corners; if rounding bends it, some more.
const ROOM: usize = 8;

/// Corners of the rest of a triangle, and the origin of each.
#[derive(Clone, Copy)]
struct Rest {
    at: [Vec3; ROOM],
    features: [u32; ROOM],
    /// The line along which the ring continues from each.
    lines: [u32; ROOM],
    count: usize,
}

/// As [`super::shared_points`] for two triangles with an area, both in A's frame.
///
/// * `normal` - unit, A's frame, from A to B.
/// * `base_is_b` - whose face the points are projected onto; `None`: the one whose face is closer to the normal.
/// * `take` - receives points on the surfaces in A's frame, the gap along `normal` and the feature.
///
/// Cost: some 100 ns; no allocation.
pub(in crate::narrow) fn shared_by_triangles(
    [a, b]: [&[Point; 3]; 2],
    normal: &Vec3,
    base_is_b: Option<bool>,
    prediction_m: f64,
    mut take: impl FnMut(&ManifoldPoint, bool),
) {
    let [a, b] = [a, b].map(|corners| corners.map(|p| p.coords));
    let [across_a, across_b] = [&a, &b].map(|t| (t[1] - t[0]).cross(&(t[2] - t[0])));
    let [length_a, length_b] = [across_a, across_b].map(|across| across.norm());
    if length_a <= 0.0 || length_b <= 0.0 {
        return;
    }
    let (face_a, face_b) = (across_a / length_a, across_b / length_b);
    let (steep_a, steep_b) = (face_a.dot(normal), face_b.dot(normal));
    let base_is_b = base_is_b.unwrap_or(steep_b.abs() > steep_a.abs());
    let (base, face, steep, incident) = if base_is_b {
        (&b, face_b, steep_b, &a)
    } else {
        (&a, face_a, steep_a, &b)
    };
    if steep.abs() < FACING {
        return;
    }
    let (rest, plane) = clip(base, incident, normal);

    let reach = |t: &[Vec3; 3]| {
        let squares = t.map(|p| p.norm_squared());
        squares[0].max(squares[1]).max(squares[2]).sqrt()
    };
    let size = |t: &[Vec3; 3]| {
        let squares = [t[1] - t[0], t[2] - t[0]].map(|edge| edge.norm_squared());
        squares[0].max(squares[1])
    };
    let smaller = size(&a).min(size(&b)).sqrt();
    let same = SAME * smaller + 32.0 * f64::EPSILON * (reach(&a) + reach(&b));
    let side = if base_is_b { 1 << 31 } else { 0 };
    let (mut taken, mut count) = ([Vec3::zeros(); ROOM], 0);
    for (at, feature) in rest.at[..rest.count].iter().zip(rest.features) {
        // Along the normal onto the base's plane.
        let cast = at - normal * (face.dot(&(at - plane)) / steep);
        let (on_a, on_b) = if base_is_b { (at, &cast) } else { (&cast, at) };
        let gap_m = normal.dot(&(on_b - on_a));
        let known = |p: &Vec3| (p - on_a).norm_squared() <= same * same;
        if gap_m > prediction_m || taken[..count].iter().any(known) {
            continue;
        }
        (taken[count], count) = (*on_a, count + 1);
        let point = ManifoldPoint {
            point_a: Point::from(*on_a),
            point_b: Point::from(*on_b),
            gap_m,
            feature: side | feature,
        };
        take(&point, base_is_b);
    }
}

/// `incident`, cut by the planes along `normal` through the edges of `base`, and a point of `base`'s plane.
///
/// The base is enlarged by what rounding may take away at its rim (see `Feature::spread`).
fn clip(base: &[Vec3; 3], incident: &[Vec3; 3], normal: &Vec3) -> (Rest, Vec3) {
    let middle = |t: &[Vec3; 3]| (t[0] + t[1] + t[2]) / 3.0;
    let inner = middle(base);
    let base = base.map(|p| p + (p - inner) * RIM);
    let centre = middle(&base);
    let mut rest = Rest {
        at: [Vec3::zeros(); ROOM],
        features: [0, 1, 2, 0, 0, 0, 0, 0],
        lines: [0, 1, 2, 0, 0, 0, 0, 0],
        count: 3,
    };
    rest.at[..3].copy_from_slice(incident);
    for (edge, k) in (0_u32..).zip(0..3) {
        let mut outward = (base[(k + 1) % 3] - base[k]).cross(normal);
        if outward.dot(&(base[k] - centre)) < 0.0 {
            outward = -outward;
        }
        rest = rest.cut(&base[k], &outward, edge);
    }
    (rest, base[0])
}

impl Rest {
    /// Cuts off the part beyond the plane. Source: Sutherland and Hodgman 1974, Reentrant polygon clipping.
    ///
    /// * `edge` - the plane's index, from 0 on: part of a new corner's name, and the line that it lies on.
    fn cut(&self, on: &Vec3, outward: &Vec3, edge: u32) -> Self {
        let mut over = [0.0; ROOM];
        let (mut beyond, mut within) = (false, false);
        for (over, at) in over.iter_mut().zip(&self.at[..self.count]) {
            *over = outward.dot(&(at - on));
            beyond |= *over > 0.0;
            within |= *over <= 0.0;
        }
        if !beyond {
            return *self;
        }
        let mut kept = Self { count: 0, ..*self };
        if !within {
            return kept;
        }
        for k in 0..self.count {
            let next = if k + 1 == self.count { 0 } else { k + 1 };
            let (here, there) = (over[k], over[next]);
            // Where the ring leaves, it continues along the cut.
            let on = if there > 0.0 {
                CUT | edge
            } else {
                self.lines[k]
            };
            if here <= 0.0 {
                let line = if here == 0.0 { on } else { self.lines[k] };
                kept.put(self.at[k], self.features[k], line);
            }
            if (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0) {
                let along = self.at[next] - self.at[k];
                let at = self.at[k] + along * (here / (here - there));
                kept.put(at, met(self.lines[k], edge), on);
            }
        }
        kept
    }

    fn put(&mut self, at: Vec3, feature: u32, line: u32) {
        if self.count < ROOM {
            let k = self.count;
            (self.at[k], self.features[k], self.lines[k]) = (at, feature, line);
            self.count += 1;
        }
    }
}
