//! The gap of two triangles, with its certificate.
//!
//! In: corners in one frame, and a bound on their rounding. Out: a [`Closest`]. Degenerate triangles (points, needles)
//! are allowed.
//!
//! Apart: the least distance is that of a corner to a triangle or of two edges' inner points; all are tried. The upper
//! end is the distance of the two points found, by whatever search; the lower end is the separation along an axis,
//! sound for any axis; so neither depends on the search being right. Crossing: decided by exact signs; the depth is the
//! least overlap along the axes of the two, and each axis is a sound bound by itself.

use std::cmp::Ordering;

use super::Closest;
use crate::math::{Interval, Point, ROUND, Vec3, greater, lesser};
use crate::shape::side;

/// Relative rounding allowed for when squares of two separations are compared: far more than there is.
const NEAR: f64 = 1e-12;

/// Three corners.
pub(super) type Triangle = [Point; 3];

/// Two points and the edges that meet in them: the axis must be orthogonal to these edges.
struct Candidate {
    square: f64,
    a: Point,
    b: Point,
    edges: [Vec3; 2],
}

impl Candidate {
    fn offer(&mut self, a: Point, b: Point, edges: [Vec3; 2]) {
        let square = (b - a).norm_squared();
        if square < self.square {
            *self = Self {
                square,
                a,
                b,
                edges,
            };
        }
    }
}

/// The gap of two triangles.
///
/// * `slop` - bound on the rounding of corners and of distances between them, metres.
/// * `beyond_m` - a gap that exceeds this does not matter; 0: only a touch matters.
///
/// # Errors
/// The proved lower bound on the gap, metres, more than `beyond_m`.
pub(super) fn gap(a: &Triangle, b: &Triangle, slop: f64, beyond_m: f64) -> Result<Closest, f64> {
    let (edges_a, edges_b) = (edges(a), edges(b));
    let (normal_a, normal_b) = (edges_a[0].cross(&edges_a[1]), edges_b[0].cross(&edges_b[1]));
    // Three cheap axes rule out most pairs.
    let middle = (b[0] - a[0]) + (b[1] - a[1]) + (b[2] - a[2]);
    let mut best = Best::of(a, b);
    for axis in [middle, normal_a, normal_b] {
        best.try_axis(&axis);
    }
    let proved = |best: &Best| best.apart - slop > beyond_m;
    if proved(&best) {
        return Err(best.apart - slop);
    }

    if best.apart <= slop && crossing(a, b) {
        // Crossing triangles are not coplanar: apart from the normals, only crosses of edges can give the depth.
        try_crosses(&mut best, &edges_a, &edges_b);
        return Ok(overlap(&best, a, b, slop));
    }
    if beyond_m <= 0.0 {
        // Where a proof is enough, axes are cheaper than points.
        try_all_axes(&mut best, a, b);
        if proved(&best) {
            return Err(best.apart - slop);
        }
    }
    let found = closest_points(a, b, &edges_a, &edges_b, &normal_a, &normal_b);
    let distance = found.square.sqrt();
    try_feature_axes(&mut best, &found);
    let size = edges_a[0].norm() + edges_b[0].norm() + edges_a[1].norm() + edges_b[1].norm();
    if best.apart < distance - 1e-13 * size - slop {
        try_all_axes(&mut best, a, b);
    }
    let low = (best.apart - slop).max(-slop).min(distance);
    let normal = (found.b - found.a).try_normalize(slop).unwrap_or(best.axis);
    Ok(Closest {
        gap: Interval::new(low, distance + slop),
        best_m: distance,
        normal,
        point_a: found.a,
        point_b: found.b,
        finished: best.apart >= distance - 1e-9 * size - slop,
    })
}

/// Whether an edge of one surely passes through the other, whatever rounding did to the corners.
///
/// * `slop` - no corner is farther from its true place, metres.
///
/// False proves nothing. About ten times cheaper than the full query.
pub(super) fn surely_crosses(a: &Triangle, b: &Triangle, slop: f64) -> bool {
    surely_pierces(a, b, slop) || surely_pierces(b, a, slop)
}

/// Whether an edge of `b` surely passes through `a`: its ends are on both sides of the plane, and all edges of `a` on
/// one side of it. Five volumes whose signs are certain; no normal is normalised, because that of a needle is noise.
fn surely_pierces(a: &Triangle, b: &Triangle, slop: f64) -> bool {
    let edges_a = edges(a);
    let normal = edges_a[0].cross(&edges_a[1]);
    let from = b.map(|p| p - a[0]);
    let longest = |v: &[Vec3; 3]| {
        let squares = v.map(|v| v.norm_squared());
        greater(greater(squares[0], squares[1]), squares[2]).sqrt() + 2.0 * slop
    };
    let (edge, far) = (longest(&edges_a), longest(&from));
    let over = from.map(|p| normal.dot(&p));
    let least = unsure(edge, edge, far, slop);
    (0..3).any(|k| {
        let (p, q) = (k, (k + 1) % 3);
        if !(over[p] > least && over[q] < -least || over[p] < -least && over[q] > least) {
            return false;
        }
        let along = b[q] - b[p];
        let least = unsure(edge, along.norm() + 2.0 * slop, far + edge, slop);
        let beside = |i: usize| along.dot(&edges_a[i].cross(&(b[p] - a[i])));
        // All signs must equal the first: one or two rule out most pairs.
        let first = beside(0);
        let sign = f64::copysign(1.0, first);
        first.abs() > least && sign * beside(1) > least && sign * beside(2) > least
    })
}

/// The triple product of three vectors no longer than these has a certain sign beyond this, whatever is rounded: the
/// corners by `slop`, and the products (Shewchuk 1997, as `shape::side`; their absolute values sum to less than 1.5
/// times the product of the lengths).
fn unsure(u: f64, v: f64, w: f64, slop: f64) -> f64 {
    16.0 * ROUND * (u * v * w) + 2.5 * slop * (u * v + v * w + w * u) + f64::MIN_POSITIVE
}

pub(super) fn edges(t: &Triangle) -> [Vec3; 3] {
    [t[1] - t[0], t[2] - t[1], t[0] - t[2]]
}

/// The axis along which the two are farthest apart (or overlap least), from A to B.
struct Best {
    apart: f64,
    axis: Vec3,
    /// Corners relative to the first one of A: the digits of a common offset are not lost.
    a: [Vec3; 2],
    b: [Vec3; 3],
}

impl Best {
    fn of(a: &Triangle, b: &Triangle) -> Self {
        Self {
            apart: f64::NEG_INFINITY,
            axis: Vec3::z(),
            a: [a[1] - a[0], a[2] - a[0]],
            b: b.map(|p| p - a[0]),
        }
    }

    /// How far B lies beyond A along an axis of any length, and A beyond B, in units of that length.
    #[inline(always)]
    fn parts(&self, axis: &Vec3) -> [f64; 2] {
        let ([a1, a2], [b0, b1, b2]) = (self.a.map(|p| axis.dot(&p)), self.b.map(|p| axis.dot(&p)));
        let (low_a, high_a) = (lesser(lesser(a1, a2), 0.0), greater(greater(a1, a2), 0.0));
        let (low_b, high_b) = (lesser(lesser(b0, b1), b2), greater(greater(b0, b1), b2));
        [low_b - high_a, low_a - high_b]
    }

    #[inline(always)]
    fn try_axis(&mut self, axis: &Vec3) {
        let square = axis.norm_squared();
        if square <= f64::MIN_POSITIVE {
            return;
        }
        // Most are no better; squares show that as well as lengths, up to rounding.
        let [one, other] = self.parts(axis);
        let farthest = greater(one, other);
        let [now, there] = [self.apart, farthest].map(|x| x * x.abs());
        if there <= now * square - NEAR * there.abs() {
            return;
        }
        let unit = axis / square.sqrt();
        let [one, other] = self.parts(&unit);
        if one > self.apart {
            (self.apart, self.axis) = (one, unit);
        }
        if other > self.apart {
            (self.apart, self.axis) = (other, -unit);
        }
    }
}

/// The axis between the points found, orthogonal to the edges that hold them.
fn try_feature_axes(best: &mut Best, found: &Candidate) {
    let square_away = |mut axis: Vec3| {
        // Twice: the second round removes what the first leaves for a nearly parallel pair of edges.
        for edge in found.edges.iter().chain(&found.edges) {
            let length = edge.norm_squared();
            if length > 0.0 {
                axis -= edge * (axis.dot(edge) / length);
            }
        }
        axis
    };
    let between = found.b - found.a;
    best.try_axis(&square_away(between));
    let cross = found.edges[0].cross(&found.edges[1]);
    if let Some(cross) = cross.try_normalize(f64::MIN_POSITIVE) {
        best.try_axis(&square_away(cross));
    }
}

/// All axes that can separate two triangles: face normals, crosses of edges, and edge normals within the planes.
fn try_all_axes(best: &mut Best, a: &Triangle, b: &Triangle) {
    let (edges_a, edges_b) = (edges(a), edges(b));
    for (edges, other) in [(&edges_a, &edges_b), (&edges_b, &edges_a)] {
        let normal = edges[0].cross(&edges[1]);
        best.try_axis(&normal);
        for edge in edges {
            best.try_axis(&edge.cross(&normal));
            // A needle has no useful normal; the other triangle's will do.
            best.try_axis(&edge.cross(&other[0].cross(&other[1])));
        }
    }
    try_crosses(best, &edges_a, &edges_b);
}

/// Cross products of edges.
fn try_crosses(best: &mut Best, edges_a: &[Vec3; 3], edges_b: &[Vec3; 3]) {
    for u in edges_a {
        for v in edges_b {
            let cross = u.cross(v);
            if cross.norm_squared() > 1e-24 * u.norm_squared() * v.norm_squared() {
                best.try_axis(&cross);
            }
        }
    }
}

/// Whether an edge of one passes through the other; exact for the given corners. Coplanar triangles are not found here:
/// their distance is zero.
fn crossing(a: &Triangle, b: &Triangle) -> bool {
    pierces(a, b) || pierces(b, a)
}

/// Whether an edge of `b` passes through `a`.
fn pierces(a: &Triangle, b: &Triangle) -> bool {
    let sides = b.map(|p| side(&a[0], &a[1], &a[2], &p));
    if sides.iter().all(|s| *s == sides[0]) {
        return false;
    }
    (0..3).any(|k| {
        let (p, q) = (k, (k + 1) % 3);
        if sides[p] == sides[q] {
            return false;
        }
        let round = |i: usize| side(&b[p], &b[q], &a[i], &a[(i + 1) % 3]);
        let turns = [round(0), round(1), round(2)];
        !(turns.contains(&Ordering::Less) && turns.contains(&Ordering::Greater))
    })
}

/// Result for two crossing triangles: the least translation that separates them, and points on both along it.
fn overlap(best: &Best, a: &Triangle, b: &Triangle, slop: f64) -> Closest {
    let depth = (-best.apart).max(0.0);
    let deepest = |t: &Triangle, axis: Vec3| {
        let on = |p: &Point| axis.dot(&(p - a[0]));
        let mut at = t[0];
        for p in &t[1..] {
            if on(p) > on(&at) {
                at = *p;
            }
        }
        at
    };
    let size = (a[1] - a[0]).norm() + (a[2] - a[0]).norm();
    let point_b = deepest(b, -best.axis);
    // Rounding of the corners can separate only triangles that barely cross.
    let surely = depth > 1e-9 * size + 4.0 * slop || surely_crosses(a, b, slop);
    Closest {
        gap: Interval::new(-depth - slop, if surely { 0.0 } else { slop }),
        best_m: -depth,
        normal: best.axis,
        point_a: point_b + best.axis * depth,
        point_b,
        finished: true,
    }
}

fn closest_points(
    a: &Triangle,
    b: &Triangle,
    edges_a: &[Vec3; 3],
    edges_b: &[Vec3; 3],
    normal_a: &Vec3,
    normal_b: &Vec3,
) -> Candidate {
    let mut found = Candidate {
        square: f64::INFINITY,
        a: a[0],
        b: b[0],
        edges: [Vec3::zeros(); 2],
    };
    for p in b {
        corner(p, a, edges_a, normal_a, |on, edges| {
            found.offer(on, *p, edges)
        });
    }
    for p in a {
        corner(p, b, edges_b, normal_b, |on, edges| {
            found.offer(*p, on, edges)
        });
    }
    for i in 0..3 {
        for j in 0..3 {
            let (u, v) = (&edges_a[i], &edges_b[j]);
            let cross = u.cross(v);
            let square = cross.norm_squared();
            if square <= f64::MIN_POSITIVE {
                continue;
            }
            // From the cross product: for nearly parallel edges the usual difference of squares is noise.
            let from = b[j] - a[i];
            let s = from.cross(v).dot(&cross) / square;
            let t = from.cross(u).dot(&cross) / square;
            if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
                found.offer(a[i] + u * s, b[j] + v * t, [*u, *v]);
            }
        }
    }
    found
}

/// Offers the points of a triangle that can be nearest to a corner of the other: on its edges, and inside.
fn corner(
    p: &Point,
    t: &Triangle,
    edges: &[Vec3; 3],
    normal: &Vec3,
    mut offer: impl FnMut(Point, [Vec3; 2]),
) {
    let square = normal.norm_squared();
    if square > f64::MIN_POSITIVE {
        // Weights from areas: each is the share of the part opposite its corner. The third is 1 less the others, so
        // this is a point of the triangle even if its normal is noise.
        let weight = |k: usize| edges[k].cross(&(p - t[k])).dot(normal) / square;
        let (w2, w1) = (weight(0), weight(2));
        if w1 >= 0.0 && w2 >= 0.0 && w1 + w2 <= 1.0 {
            let on = t[0] + edges[0] * w1 - edges[2] * w2;
            offer(on, [edges[0], edges[1]]);
        }
    }
    for k in 0..3 {
        let length = edges[k].norm_squared();
        let along = edges[k].dot(&(p - t[k]));
        if along <= 0.0 || length <= f64::MIN_POSITIVE {
            offer(t[k], [Vec3::zeros(); 2]);
        } else if along < length {
            offer(
                t[k] + edges[k] * (along / length),
                [edges[k], Vec3::zeros()],
            );
        }
    }
}

#[cfg(test)]
mod tests;
