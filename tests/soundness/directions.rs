//! The gap of convex shapes: the greatest separation over all directions.

use sweepd::math::{Point, Vec3};

use crate::kinds::Solid;
use crate::oracle::{Triangle, crosses, triangle_distance};
use crate::truth::At;

/// Bounds on the gap of two shapes that are not meshes, and the direction that proves the lower one, from the first to
/// the second.
///
/// * `samples` - initial directions of a search, if not all candidate directions can be tried.
pub fn of_convex(a: At<'_>, b: At<'_>, samples: u32) -> ([f64; 2], Vec3) {
    let (Some(one), Some(other)) = (Core::of(a), Core::of(b)) else {
        let (gap, n) = greatest(a, b, samples);
        return ([gap; 2], n);
    };
    let (low, n) = exact(a, b, &one, &other);
    // The rounding error of a direction, times the size of the larger shape, reduces the separation that it proves; the
    // error grows as the distance of the cores shrinks. If neither core penetrates the other, the distance of their
    // surfaces is also the gap.
    let core_m = low + one.radius + other.radius;
    let (small, large) = (one.size.min(other.size), one.size.max(other.size));
    let blurred = large > LARGE * small || core_m.abs() < 1e-4 * large;
    let high = if blurred && core_m > -1e-3 * small {
        low.max(one.distance(&other))
    } else {
        low
    };
    ([low, high], n)
}

/// From this ratio of sizes on the distance of the surfaces is computed too.
const LARGE: f64 = 100.0;

/// The gap proved by direction `n`: the separation of the two along it.
fn f(a: At<'_>, b: At<'_>, n: &Vec3) -> f64 {
    let in_a = a.1.rotation.inverse_transform_vector(n);
    let in_b = b.1.rotation.inverse_transform_vector(&-n);
    n.dot(&(b.1.translation.vector - a.1.translation.vector)) - a.0.reach(&in_a) - b.0.reach(&in_b)
}

/// Vertices, edges and face normals of a polytope with a radius, in the axes of the common frame.
struct Core {
    corners: Vec<Vec3>,
    edges: Vec<(Vec3, Vec3)>,
    normals: Vec<Vec3>,
    /// Its surface, or degenerate triangles for a point or a segment.
    triangles: Vec<Triangle>,
    radius: f64,
    /// Greatest distance of a vertex from the first one, plus the radius.
    size: f64,
}

impl Core {
    fn of((solid, pose): At<'_>) -> Option<Self> {
        let at = |p: Vec3| pose.rotation * p + pose.translation.vector;
        let soup = match solid {
            Solid::Sphere(radius) => return Some(Self::line(vec![at(Vec3::zeros())], *radius)),
            Solid::Capsule(radius, h) => {
                let ends = vec![at(-Vec3::z() * *h), at(Vec3::z() * *h)];
                return Some(Self::line(ends, *radius));
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
        let triangle = |face: &[u32; 3]| face.map(|i| Point::from(corner(i)));
        Some(Self {
            edges,
            normals,
            triangles: soup.faces.iter().map(triangle).collect(),
            radius: 0.0,
            size: spread(&corners),
            corners,
        })
    }

    fn line(corners: Vec<Vec3>, radius: f64) -> Self {
        let [first, last] = [corners[0], corners[corners.len() - 1]].map(Point::from);
        Self {
            edges: corners.windows(2).map(|w| (w[0], w[1])).collect(),
            normals: Vec::new(),
            triangles: vec![[first, last, last]],
            radius,
            size: spread(&corners) + radius,
            corners,
        }
    }

    /// The distance of two cores, exact up to the rounding of their vertices; 0 if they cross.
    fn distance(&self, other: &Self) -> f64 {
        let pairs =
            (self.triangles.iter()).flat_map(|s| other.triangles.iter().map(move |t| (s, t)));
        let least = pairs.map(|(s, t)| {
            if crosses(s, t) {
                0.0
            } else {
                triangle_distance(s, t)
            }
        });
        least.fold(f64::INFINITY, f64::min) - self.radius - other.radius
    }
}

/// Greatest distance of a vertex from the first one.
fn spread(corners: &[Vec3]) -> f64 {
    let from = |corner: &Vec3| (corner - corners[0]).norm();
    corners.iter().map(from).fold(0.0, f64::max)
}

/// The gap of two polytopes with radii, and its direction: the greatest `f` is at a face normal, across two edges, or
/// along the line between two vertices or from a vertex to an edge; all of these are tried.
fn exact(a: At<'_>, b: At<'_>, one: &Core, other: &Core) -> (f64, Vec3) {
    let mut top = (f64::NEG_INFINITY, Vec3::z());
    let mut offer = |n: Vec3| {
        let Some(n) = n.try_normalize(1e-300) else {
            return;
        };
        for n in [n, -n] {
            let value = f(a, b, &n);
            if value > top.0 {
                top = (value, n);
            }
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
            // For parallel edges of flat shapes: perpendicular to the edges, within their plane.
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
    // For intersecting lines: any direction perpendicular to both.
    [Vec3::x(), Vec3::y(), Vec3::z()]
        .into_iter()
        .for_each(offer);
    top
}

/// The greatest `f` found by sampling and hill climbing, and its direction: the gap of convex shapes is the maximum.
fn greatest(a: At<'_>, b: At<'_>, samples: u32) -> (f64, Vec3) {
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
        .fold((f64::NEG_INFINITY, Vec3::z()), |best, top| {
            if top.0 > best.0 { top } else { best }
        })
}

fn climb(a: At<'_>, b: At<'_>, mut top: (f64, Vec3), fine: u32) -> (f64, Vec3) {
    let mut step = 0.1;
    let mut turn = 0.0;
    for _ in 0..600 {
        if step < 1e-15 {
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
        // Along a ridge only a narrow wedge of directions leads up: if eight directions find none, many are tried.
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
    top
}
