//! Oracles: brute force on small meshes with exact predicates, written independently of the library's narrow phase.
//!
//! Accuracy: `crosses` and `winds` are exact for the given corners (crate `robust`); `distance` is the least over all
//! features of all triangle pairs, with an error of about 1e-13 of the size; overlap depths of solids are lower bounds
//! (corners only).
#![allow(dead_code, reason = "each test binary uses its own part of the oracle")]

pub mod meshes;
pub mod rng;
pub mod shared;

use robust::Coord3D;
use sweepd::math::{Point, Pose, Vec3};

/// Corners of a triangle, all in one frame.
pub type Triangle = [Point; 3];

/// A mesh at a pose: triangles in a frame shared by both bodies of a pair.
pub struct Placed {
    pub triangles: Vec<Triangle>,
    pub corners: Vec<Point>,
    pub solid: bool,
}

impl Placed {
    /// Triangles relative to `from`, with world axes, so that positions far from the origin lose no precision.
    pub fn new(
        vertices: &[Point],
        faces: &[[u32; 3]],
        solid: bool,
        pose: &Pose,
        from: &Vec3,
    ) -> Self {
        let shift = pose.translation.vector - from;
        let at = |p: &Point| Point::from(pose.rotation * p.coords + shift);
        let triangles: Vec<_> = faces
            .iter()
            .map(|f| f.map(|i| at(&vertices[i as usize])))
            .collect();
        let corners = triangles.iter().flatten().copied().collect();
        Self {
            triangles,
            corners,
            solid,
        }
    }

    /// Winding number of the surface around `p`, from the signed crossings of a long segment that meets no edge.
    pub fn winds(&self, p: &Point) -> i64 {
        let far = 1.0
            + self
                .corners
                .iter()
                .map(|c| (c - p).norm())
                .fold(0.0, f64::max)
                * 3.0;
        // Pseudo-random directions; the first whose segment meets no edge or corner is used.
        let mut rng = rng::Rng::new(77);
        for _ in 0..40 {
            let q = p + rng.direction() * far;
            if let Some(count) = self.crossings(p, &q) {
                return count;
            }
        }
        0
    }

    fn crossings(&self, p: &Point, q: &Point) -> Option<i64> {
        let mut count = 0;
        for [a, b, c] in &self.triangles {
            let (sp, sq) = (orient(a, b, c, p), orient(a, b, c, q));
            let turns = [orient(p, q, a, b), orient(p, q, b, c), orient(p, q, c, a)];
            let positive = turns.iter().filter(|t| **t > 0.0).count();
            let negative = turns.iter().filter(|t| **t < 0.0).count();
            if positive > 0 && negative > 0 {
                continue;
            }
            if sp * sq > 0.0 {
                continue;
            }
            if positive + negative < 3 || sp == 0.0 || sq == 0.0 {
                // A degenerate triangle contributes nothing to the winding number.
                if (b - a).cross(&(c - a)).norm() == 0.0 {
                    continue;
                }
                return None;
            }
            // The segment leaves through the outward side: it goes from behind the face to its front.
            count += if sp < 0.0 { 1 } else { -1 };
        }
        Some(count)
    }

    pub fn holds(&self, p: &Point) -> bool {
        self.solid && self.winds(p) != 0
    }

    /// Least distance of a point from the surface.
    pub fn distance_from(&self, p: &Point) -> f64 {
        self.triangles
            .iter()
            .map(|t| point_triangle(p, t))
            .fold(f64::INFINITY, f64::min)
    }
}

/// Positive if `d` is in front of the face a, b, c (on the side of its normal); exact.
pub fn orient(a: &Point, b: &Point, c: &Point, d: &Point) -> f64 {
    let to = |p: &Point| Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    };
    -robust::orient3d(to(a), to(b), to(c), to(d))
}

/// The true relation of a pair.
#[derive(Debug, Clone, Copy)]
pub enum Truth {
    /// The surfaces are this far apart, and neither body contains the other.
    Apart(f64),
    /// They overlap; the gap is at most this (<= 0).
    Overlap(f64),
}

/// The truth for a pair of meshes, by brute force over all features.
pub fn truth(a: &Placed, b: &Placed) -> Truth {
    let mut crossing = false;
    let mut distance = f64::INFINITY;
    let mut gap = 0.0f64;
    for s in &a.triangles {
        for t in &b.triangles {
            if crosses(s, t) {
                crossing = true;
                if !a.solid && !b.solid {
                    gap = gap.min(-least_overlap(s, t));
                }
            } else if !crossing {
                distance = distance.min(triangle_distance(s, t));
            }
        }
    }
    let mut held = false;
    for (of, within) in [(a, b), (b, a)] {
        if !within.solid {
            continue;
        }
        for p in &of.corners {
            if within.holds(p) {
                held = true;
                gap = gap.min(-within.distance_from(p));
            }
        }
    }
    if crossing || held {
        Truth::Overlap(gap)
    } else {
        Truth::Apart(distance)
    }
}

/// Whether two triangles share a point, except for coplanar ones; exact.
pub fn crosses(s: &Triangle, t: &Triangle) -> bool {
    let pierced = |face: &Triangle, other: &Triangle| {
        (0..3).any(|k| {
            let (p, q) = (&other[k], &other[(k + 1) % 3]);
            let (sp, sq) = (
                orient(&face[0], &face[1], &face[2], p),
                orient(&face[0], &face[1], &face[2], q),
            );
            if sp * sq > 0.0 || (sp == 0.0 && sq == 0.0) {
                return false;
            }
            let turns: Vec<f64> = (0..3)
                .map(|i| orient(p, q, &face[i], &face[(i + 1) % 3]))
                .collect();
            turns.iter().all(|x| *x >= 0.0) || turns.iter().all(|x| *x <= 0.0)
        })
    };
    pierced(s, t) || pierced(t, s)
}

/// Least translation that separates two crossing triangles: the least over the face normals of their Minkowski
/// difference.
pub fn least_overlap(s: &Triangle, t: &Triangle) -> f64 {
    let edges = |t: &Triangle| [t[1] - t[0], t[2] - t[1], t[0] - t[2]];
    let (es, et) = (edges(s), edges(t));
    let mut axes = vec![es[0].cross(&es[1]), et[0].cross(&et[1])];
    for u in &es {
        for v in &et {
            axes.push(u.cross(v));
        }
    }
    let mut least = f64::INFINITY;
    for axis in axes {
        let Some(n) = axis.try_normalize(1e-14) else {
            continue;
        };
        let span = |t: &Triangle| {
            let on = t.map(|p| n.dot(&(p - s[0])));
            (on[0].min(on[1]).min(on[2]), on[0].max(on[1]).max(on[2]))
        };
        let ((s0, s1), (t0, t1)) = (span(s), span(t));
        least = least.min((s1 - t0).min(t1 - s0));
    }
    least.max(0.0)
}

/// Distance of two triangles that do not cross: each corner to the other's face, each edge to each edge.
pub fn triangle_distance(s: &Triangle, t: &Triangle) -> f64 {
    let mut least = f64::INFINITY;
    for p in s {
        least = least.min(point_triangle(p, t));
    }
    for p in t {
        least = least.min(point_triangle(p, s));
    }
    for i in 0..3 {
        for j in 0..3 {
            least = least.min(segment_segment(
                (&s[i], &s[(i + 1) % 3]),
                (&t[j], &t[(j + 1) % 3]),
            ));
        }
    }
    least
}

/// Distance of a point to a triangle, by its Voronoi regions (Ericson, Real-Time Collision Detection, 5.1.5).
pub fn point_triangle(p: &Point, [a, b, c]: &Triangle) -> f64 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    let edges = point_segment(p, a, b)
        .min(point_segment(p, b, c))
        .min(point_segment(p, c, a));
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if va > 0.0 && vb > 0.0 && vc > 0.0 {
        let whole = va + vb + vc;
        let on = a + ab * (vb / whole) + ac * (vc / whole);
        return edges.min((p - on).norm());
    }
    edges
}

fn point_segment(p: &Point, a: &Point, b: &Point) -> f64 {
    let ab = b - a;
    let square = ab.norm_squared();
    let t = if square > 0.0 {
        (ab.dot(&(p - a)) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (p - (a + ab * t)).norm()
}

/// Distance of two segments by clamped closest points (Ericson 5.1.9).
fn segment_segment((p1, q1): (&Point, &Point), (p2, q2): (&Point, &Point)) -> f64 {
    let (d1, d2, r) = (q1 - p1, q2 - p2, p1 - p2);
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    if a == 0.0 || e == 0.0 {
        return point_segment(p1, p2, q2).min(point_segment(p2, p1, q1));
    }
    let (b, c) = (d1.dot(&d2), d1.dot(&r));
    let denominator = a * e - b * b;
    if denominator < 1e-4 * a * e {
        // Nearly parallel: the formula below would be dominated by rounding. The distance from a point on the first
        // segment is a convex function of its parameter, so a ternary search finds the minimum.
        let at = |s: f64| point_segment(&(p1 + d1 * s), p2, q2);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..120 {
            let (m, n) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if at(m) < at(n) {
                high = n;
            } else {
                low = m;
            }
        }
        return at(0.5 * (low + high)).min(at(0.0)).min(at(1.0));
    }
    let s = if denominator > 0.0 {
        ((b * f - c * e) / denominator).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let t = ((b * s + f) / e).clamp(0.0, 1.0);
    let s = ((b * t - c) / a).clamp(0.0, 1.0);
    ((p1 + d1 * s) - (p2 + d2 * t)).norm()
}
