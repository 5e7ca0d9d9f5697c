//! The oracle: bounds on the gap of two shapes from their definitions; for convex shapes see `directions`.
//!
//! Accuracy: `low` is proved (by a separating direction, or as the exact distance of all triangles). `high` is from a
//! search, or a polytope inside the shapes: the truth is at most this for meshes, and for convex pairs up to the error
//! of the search for directions, which is repeated more densely before a fault is counted.

use std::cmp::Ordering;

use sweepd::math::{Point, Pose, Vec3};

use crate::directions::of_convex;
use crate::kinds::Solid;
use crate::oracle::{Placed, Triangle, crosses, least_overlap, triangle_distance};

/// Bounds on the gap, metres.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    pub low: f64,
    pub high: f64,
    /// Least translation that separates some two crossing triangles, metres; 0: no triangles cross.
    pub shared: f64,
    /// Unit direction of motion of the second shape in which `high` grows by as much as the shape moves; `None`:
    /// unknown.
    pub way: Option<Vec3>,
}

impl Bounds {
    /// Bounds for no shapes at all.
    pub const FAR: Self = Self::exactly(f64::INFINITY, None);

    const fn exactly(gap: f64, way: Option<Vec3>) -> Self {
        Self {
            low: gap,
            high: gap,
            shared: 0.0,
            way,
        }
    }

    /// The same for the two in reverse order.
    fn turned(self) -> Self {
        Self {
            way: self.way.map(|n| -n),
            ..self
        }
    }

    pub fn least(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.min(other.high),
            shared: self.shared.max(other.shared),
            way: if other.high < self.high {
                other.way
            } else {
                self.way
            },
        }
    }

    /// Positive if they overlap, by at least this, metres: the gap is negative, or triangles cross (two overlapping
    /// solids may have no vertex inside each other).
    pub fn depth(&self) -> f64 {
        self.shared.max(-self.high)
    }

    /// Whether they are proved to be apart or just touching, with a gap of at most `most` metres.
    pub fn is_within(&self, most: f64) -> bool {
        self.low >= 0.0 && self.high <= most
    }
}

/// A shape and its pose.
pub type At<'a> = (&'a Solid, Pose);

/// Bounds of the gap of two shapes at poses in one frame.
pub fn bounds(a: At<'_>, b: At<'_>, samples: u32) -> Bounds {
    match (a.0, b.0) {
        (Solid::HalfSpace(normal, offset), _) => over(normal, *offset, &a.1, b),
        (_, Solid::HalfSpace(normal, offset)) => over(normal, *offset, &b.1, a).turned(),
        (Solid::Mesh(..), _) | (_, Solid::Mesh(..)) => of_meshes(a, b),
        _ => {
            let ([low, high], n) = of_convex(a, b, samples);
            Bounds {
                low,
                ..Bounds::exactly(high, Some(n))
            }
        }
    }
}

/// A shape above a plane: its support point towards the plane decides.
fn over(normal: &Vec3, offset: f64, plane: &Pose, (solid, pose): At<'_>) -> Bounds {
    let n = plane.rotation * normal;
    let down = pose.rotation.inverse_transform_vector(&-n);
    let gap =
        n.dot(&(pose.translation.vector - plane.translation.vector)) - offset - solid.reach(&down);
    Bounds {
        low: if solid.filled() && gap < 0.0 && matches!(solid, Solid::Mesh(..)) {
            f64::NEG_INFINITY
        } else {
            gap
        },
        ..Bounds::exactly(gap, Some(n))
    }
}

fn of_meshes(a: At<'_>, b: At<'_>) -> Bounds {
    let from = a.1.translation.vector;
    for (round, other, is_a) in [(a, b, true), (b, a, false)] {
        let (radius, half) = match round.0 {
            Solid::Sphere(r) => (*r, 0.0),
            Solid::Capsule(r, h) => (*r, *h),
            _ => continue,
        };
        let end = |z: f64| {
            Point::from(
                round.1.rotation * Vec3::new(0.0, 0.0, z) + (round.1.translation.vector - from),
            )
        };
        let axis = [end(-half), end(half), end(half)];
        let mesh = placed(other, 0, &from);
        let (mut distance, mut nearest) = (f64::INFINITY, None);
        for t in &mesh.triangles {
            let d = if crosses(&axis, t) {
                0.0
            } else {
                triangle_distance(&axis, t)
            };
            if d < distance {
                (distance, nearest) = (d, Some(t));
            }
        }
        let gap = distance - radius;
        let mut held = f64::INFINITY;
        for p in &axis[..2] {
            if mesh.holds(p) {
                held = held.min(-mesh.distance_from(p));
            }
        }
        let high = gap.min(held);
        // A contained shape does not get out by a motion away from the nearest point.
        let nearest = nearest.filter(|_| held == f64::INFINITY);
        let found = Bounds {
            low: if high <= 0.0 { f64::NEG_INFINITY } else { gap },
            ..Bounds::exactly(high, nearest.and_then(|t| away(&axis, t, distance)))
        };
        return if is_a { found } else { found.turned() };
    }
    let inside = truth(&placed(a, 0, &from), &placed(b, 0, &from));
    let round = |s: &Solid| matches!(s, Solid::Cylinder(..) | Solid::Cone(..));
    if !(round(a.0) || round(b.0)) {
        return inside;
    }
    let outside = truth(&placed(a, 1, &from), &placed(b, 1, &from));
    Bounds {
        low: outside.low,
        ..inside
    }
}

/// Direction of motion of the second triangle that increases the distance of the two: the gradient of their distance,
/// which is smooth.
fn away(s: &Triangle, t: &Triangle, distance: f64) -> Option<Vec3> {
    let step = 1e-5 * distance;
    let mut slope = Vec3::zeros();
    for k in 0..3 {
        let mut by = Vec3::zeros();
        by[k] = step;
        let at = |by: Vec3| triangle_distance(s, &t.map(|p| p + by));
        slope[k] = at(by) - at(-by);
    }
    slope.try_normalize(0.0)
}

/// As the oracle's `truth`, but skips pairs of triangles whose boxes are farther apart than the known distance, and
/// vertices outside the other's box.
fn truth(a: &Placed, b: &Placed) -> Bounds {
    let of = |t: &[Point]| {
        let ends = (t[0], t[0]);
        t.iter().fold(ends, |(l, h), p| (l.inf(p), h.sup(p)))
    };
    let boxes: Vec<_> = b.triangles.iter().map(|t| of(t)).collect();
    let (mut crossing, mut distance, mut gap) = (false, f64::INFINITY, 0.0_f64);
    let (mut shared, mut nearest) = (0.0_f64, None);
    for s in &a.triangles {
        let (low, high) = of(s);
        for (t, (from, to)) in b.triangles.iter().zip(&boxes) {
            let apart = (from - high).sup(&(low - to)).sup(&Vec3::zeros()).norm() * (1.0 - 1e-12);
            if apart > distance || (apart > 0.0 && crossing) {
                continue;
            }
            if apart == 0.0 && crosses(s, t) {
                crossing = true;
                let depth = least_overlap(s, t);
                shared = shared.max(depth);
                if !a.solid && !b.solid {
                    gap = gap.min(-depth);
                }
            } else if !crossing {
                let d = triangle_distance(s, t);
                if d < distance {
                    (distance, nearest) = (d, Some((s, t)));
                }
            }
        }
    }
    let mut held = false;
    for (from, within) in [(a, b), (b, a)] {
        if !within.solid {
            continue;
        }
        let (low, high) = of(&within.corners);
        for p in &each_once(&from.corners) {
            if (0..3).all(|k| low[k] < p[k] && p[k] < high[k]) && within.holds(p) {
                held = true;
                gap = gap.min(-within.distance_from(p));
            }
        }
    }
    if crossing || held {
        return Bounds {
            low: f64::NEG_INFINITY,
            high: gap,
            shared,
            way: None,
        };
    }
    Bounds::exactly(distance, nearest.and_then(|(s, t)| away(s, t, distance)))
}

/// Vertices of the triangles, without duplicates.
fn each_once(corners: &[Point]) -> Vec<Point> {
    let mut all = corners.to_vec();
    all.sort_unstable_by(|p, q| {
        let places = p.coords.iter().zip(q.coords.iter());
        places.fold(Ordering::Equal, |so_far, (x, y)| {
            so_far.then(x.total_cmp(y))
        })
    });
    all.dedup();
    all
}

fn placed((solid, pose): At<'_>, which: usize, from: &Vec3) -> Placed {
    let soup = &solid.between()[which];
    Placed::new(&soup.vertices, &soup.faces, solid.filled(), &pose, from)
}
