//! The oracle: bounds of the gap of two shapes from their definitions.
//!
//! How far to trust it: `low` is proved (a direction that separates so far, or the exact distance of all triangles);
//! `high` is what a search or a polytope inside the shapes found: the truth is at most that for meshes, and for convex
//! pairs up to what the search of directions missed, which is searched again more densely before anything is accused.

use sweepd::math::{Point, Pose, Vec3};

use crate::kinds::Solid;
use crate::oracle::{Placed, Truth, crosses, least_overlap, triangle_distance};

/// The gap lies between.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    pub low: f64,
    pub high: f64,
}

impl Bounds {
    pub fn least(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.min(other.high),
        }
    }
}

/// A shape at its place.
pub type At<'a> = (&'a Solid, Pose);

/// Bounds of the gap of two shapes at poses in one frame.
pub fn bounds(a: At<'_>, b: At<'_>, samples: u32) -> Bounds {
    match (a.0, b.0) {
        (Solid::HalfSpace(normal, offset), _) => over(normal, *offset, &a.1, b),
        (_, Solid::HalfSpace(normal, offset)) => over(normal, *offset, &b.1, a),
        (Solid::Mesh(..), _) | (_, Solid::Mesh(..)) => of_meshes(a, b),
        _ => {
            let top = match (Core::of(a), Core::of(b)) {
                (Some(one), Some(other)) => exact(a, b, &one, &other),
                _ => greatest(a, b, samples),
            };
            Bounds {
                low: top,
                high: top,
            }
        }
    }
}

/// Above a plane: what reaches lowest.
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
        high: gap,
    }
}

fn of_meshes(a: At<'_>, b: At<'_>) -> Bounds {
    let from = a.1.translation.vector;
    for (round, other) in [(a, b), (b, a)] {
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
        let mut gap = f64::INFINITY;
        for t in &mesh.triangles {
            let d = if crosses(&axis, t) {
                0.0
            } else {
                triangle_distance(&axis, t)
            };
            gap = gap.min(d - radius);
        }
        let mut held = f64::INFINITY;
        for p in &axis[..2] {
            if mesh.holds(p) {
                held = held.min(-mesh.distance_from(p));
            }
        }
        let high = gap.min(held);
        return Bounds {
            low: if high <= 0.0 { f64::NEG_INFINITY } else { gap },
            high,
        };
    }
    let inside = truth(&placed(a, 0, &from), &placed(b, 0, &from));
    let high = match inside {
        Truth::Apart(d) => d,
        Truth::Overlap(gap) => gap,
    };
    let round = |s: &Solid| matches!(s, Solid::Cylinder(..) | Solid::Cone(..));
    let outside = if round(a.0) || round(b.0) {
        truth(&placed(a, 1, &from), &placed(b, 1, &from))
    } else {
        inside
    };
    let low = match outside {
        Truth::Apart(d) => d,
        Truth::Overlap(_) => f64::NEG_INFINITY,
    };
    Bounds { low, high }
}

/// As the oracle's `truth`, with pairs of triangles passed over whose boxes alone keep them farther apart than what is
/// known, and corners outside the other's box.
fn truth(a: &Placed, b: &Placed) -> Truth {
    let of = |t: &[Point]| {
        let ends = (t[0], t[0]);
        t.iter().fold(ends, |(l, h), p| (l.inf(p), h.sup(p)))
    };
    let boxes: Vec<_> = b.triangles.iter().map(|t| of(t)).collect();
    let (mut crossing, mut distance, mut gap) = (false, f64::INFINITY, 0.0_f64);
    for s in &a.triangles {
        let (low, high) = of(s);
        for (t, (from, to)) in b.triangles.iter().zip(&boxes) {
            let apart = (from - high).sup(&(low - to)).sup(&Vec3::zeros()).norm() * (1.0 - 1e-12);
            if apart > distance || (apart > 0.0 && crossing) {
                continue;
            }
            if apart == 0.0 && crosses(s, t) {
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
    for (from, within) in [(a, b), (b, a)] {
        if !within.solid {
            continue;
        }
        let (low, high) = of(&within.corners);
        for p in &from.corners {
            if (0..3).all(|k| low[k] < p[k] && p[k] < high[k]) && within.holds(p) {
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

fn placed((solid, pose): At<'_>, which: usize, from: &Vec3) -> Placed {
    let soup = &solid.between()[which];
    Placed::new(&soup.vertices, &soup.faces, solid.filled(), &pose, from)
}

/// The gap that direction `n` proves: how far the planes across it keep the two apart.
fn f(a: At<'_>, b: At<'_>, n: &Vec3) -> f64 {
    let in_a = a.1.rotation.inverse_transform_vector(n);
    let in_b = b.1.rotation.inverse_transform_vector(&-n);
    n.dot(&(b.1.translation.vector - a.1.translation.vector)) - a.0.reach(&in_a) - b.0.reach(&in_b)
}

/// Corners, edges and face normals of a shape that is a polytope with a radius, as directions in the common frame.
struct Core {
    corners: Vec<Vec3>,
    edges: Vec<(Vec3, Vec3)>,
    normals: Vec<Vec3>,
}

impl Core {
    fn of((solid, pose): At<'_>) -> Option<Self> {
        let at = |p: Vec3| pose.rotation * p + pose.translation.vector;
        let soup = match solid {
            Solid::Sphere(_) => return Some(Self::line(vec![at(Vec3::zeros())])),
            Solid::Capsule(_, h) => {
                return Some(Self::line(vec![at(-Vec3::z() * *h), at(Vec3::z() * *h)]));
            }
            Solid::Cylinder(..) | Solid::Cone(..) => return None,
            _ => solid.between()[0].clone(),
        };
        let corners: Vec<Vec3> = soup.vertices.iter().map(|v| at(v.coords)).collect();
        let corner = |i: u32| corners[i as usize];
        let edges = soup
            .faces
            .iter()
            .flat_map(|&[i, j, k]| [(i, j), (j, k), (k, i)]);
        let edges = edges.map(|(i, j)| (corner(i), corner(j))).collect();
        let normals = soup
            .faces
            .iter()
            .map(|&[i, j, k]| (corner(j) - corner(i)).cross(&(corner(k) - corner(i))))
            .collect();
        Some(Self {
            corners,
            edges,
            normals,
        })
    }

    fn line(corners: Vec<Vec3>) -> Self {
        let edges = corners.windows(2).map(|w| (w[0], w[1])).collect();
        Self {
            corners,
            edges,
            normals: Vec::new(),
        }
    }
}

/// The gap of two polytopes with radii: the greatest `f` is at a face normal, across two edges, or along the line
/// between two corners or from a corner to an edge; all are tried.
fn exact(a: At<'_>, b: At<'_>, one: &Core, other: &Core) -> f64 {
    let mut top = f64::NEG_INFINITY;
    let mut offer = |n: Vec3| {
        if let Some(n) = n.try_normalize(1e-300) {
            top = top.max(f(a, b, &n)).max(f(a, b, &-n));
        }
    };
    one.normals
        .iter()
        .chain(&other.normals)
        .for_each(|n| offer(*n));
    for p in &one.corners {
        other.corners.iter().for_each(|q| offer(q - p));
    }
    for (from, to) in [(one, other), (other, one)] {
        for p in &from.corners {
            for (q, r) in &to.edges {
                let along = (r - q).normalize();
                offer((p - q) - along * along.dot(&(p - q)));
            }
        }
    }
    for (p, q) in &one.edges {
        for (r, s) in &other.edges {
            offer((q - p).cross(&(s - r)));
            // Parallel edges of flat shapes: across them, within their plane.
            offer((q - p).cross(&(q - p).cross(&(r - p))));
        }
    }
    for (core, edges) in [
        (one, &other.edges),
        (one, &one.edges),
        (other, &one.edges),
        (other, &other.edges),
    ] {
        for n in &core.normals {
            edges.iter().for_each(|(p, q)| offer(n.cross(&(q - p))));
        }
    }
    // Lines that meet: any direction across both.
    [Vec3::x(), Vec3::y(), Vec3::z()]
        .into_iter()
        .for_each(offer);
    top
}

/// The greatest `f` that sampling and climbing finds: the gap of convex shapes is the greatest of all.
fn greatest(a: At<'_>, b: At<'_>, samples: u32) -> f64 {
    let mut tops: Vec<(f64, Vec3)> = (0..samples)
        .map(|k| {
            let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(samples);
            let angle = f64::from(k) * 2.399_963_229_728_653;
            let off = (1.0 - z * z).sqrt();
            Vec3::new(off * angle.cos(), off * angle.sin(), z)
        })
        .chain((b.1.translation.vector - a.1.translation.vector).try_normalize(1e-300))
        .map(|n| (f(a, b, &n), n))
        .collect();
    tops.sort_by(|x, y| y.0.total_cmp(&x.0));
    tops.truncate((samples as usize / 60).clamp(4, 60));
    tops.into_iter()
        .map(|top| climb(a, b, top, if samples > 1000 { 720 } else { 48 }))
        .fold(f64::NEG_INFINITY, f64::max)
}

fn climb(a: At<'_>, b: At<'_>, mut top: (f64, Vec3), fine: u32) -> f64 {
    let mut step = 0.1;
    let mut turn = 0.0;
    for _ in 0..600 {
        if step < 1e-12 {
            break;
        }
        let across = if top.1.x.abs() < 0.6 {
            Vec3::x()
        } else {
            Vec3::y()
        };
        let u = top.1.cross(&across).normalize();
        let v = top.1.cross(&u);
        let mut moved = false;
        turn += 0.37;
        // Along a ridge only a narrow wedge of directions leads up: where eight find none, many look for it.
        for count in [8, fine] {
            let start = top.1;
            for k in 0..count {
                let angle = turn + std::f64::consts::TAU * f64::from(k) / f64::from(count);
                let n = (start + (u * angle.cos() + v * angle.sin()) * step).normalize();
                let value = f(a, b, &n);
                if value > top.0 {
                    top = (value, n);
                    moved = true;
                }
            }
            if moved {
                break;
            }
        }
        step *= if moved { 1.3 } else { 0.6 };
    }
    top.0
}
