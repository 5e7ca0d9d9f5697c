//! Floors, bodies, and an engine with one of each.

use std::fmt::Write as _;

use crate::harness::Drive;
use crate::oracle::meshes::{Soup, cuboid, trimesh};
use crate::oracle::rng::Rng;
use sweepd::builtin::Pattern;
use sweepd::math::{Point, Pose, Vec3};
use sweepd::time::Budget;
use sweepd::wire::{ContactKind, ContactRow, Demand};

/// Half the extent of a floor, metres.
pub const FLOOR: f64 = 3.0;

/// The upper faces of a floor at height 0: `cells` by `cells` quads cut by random diagonals, with vertices moved within
/// the plane.
pub fn sheet(rng: &mut Rng, cells: usize, irregular: f64) -> Soup {
    let n = cells + 1;
    let step = 2.0 * FLOOR / cells as f64;
    let mut vertices = Vec::new();
    for i in 0..n {
        for j in 0..n {
            let inner = |k: usize| k > 0 && k < cells;
            let mut at = |k: usize, moves: bool| {
                let off = rng.range(-0.3, 0.3) * irregular * step;
                step * k as f64 - FLOOR + if moves { off } else { 0.0 }
            };
            let x = at(j, inner(j));
            vertices.push(Point::new(x, at(i, inner(i)), 0.0));
        }
    }
    let mut faces = Vec::new();
    for i in 0..cells {
        for j in 0..cells {
            let at = |i: usize, j: usize| u32::try_from(i * n + j).unwrap();
            let (a, b, c, d) = (at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
            if rng.below(2) == 0 {
                faces.extend([[a, b, c], [a, c, d]]);
            } else {
                faces.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    Soup::new(vertices, faces)
}

/// Tiles laid in a running bond: corners of one tile lie on sides of others, no vertex is shared, and there are gaps of
/// a nanometre.
pub fn tiles(rng: &mut Rng, cells: usize) -> Soup {
    let step = 2.0 * FLOOR / cells as f64;
    let mut all = Soup::new(Vec::new(), Vec::new());
    for i in 0..cells {
        let bond = rng.range(0.1, 0.9) * step;
        for j in 0..=cells {
            let (y, x) = (step * i as f64 - FLOOR, step * j as f64 - FLOOR - bond);
            let start = u32::try_from(all.vertices.len()).unwrap();
            for [u, v] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
                let crack = rng.vector(1e-9);
                let x = (x + u * step).clamp(-FLOOR, FLOOR);
                all.vertices
                    .push(Point::new(x + crack.x, y + v * step + crack.y, 0.0));
            }
            // The orientation of each tile is random: a sheet of tiles is not a solid.
            let faces = if rng.below(2) == 0 {
                [[0, 1, 2], [0, 2, 3]]
            } else {
                [[0, 3, 1], [1, 3, 2]]
            };
            all.faces
                .extend(faces.map(|f: [u32; 3]| f.map(|v| v + start)));
        }
    }
    all
}

/// A solid slab with a sheet as its top.
pub fn slab(top: &Soup, thick: f64) -> Soup {
    let count = u32::try_from(top.vertices.len()).unwrap();
    let mut all = top.clone();
    let below = top.vertices.iter().map(|v| v - Vec3::z() * thick);
    all.vertices.extend(below);
    for f in &top.faces {
        all.faces.push([f[0] + count, f[2] + count, f[1] + count]);
    }
    for f in &top.faces {
        for k in 0..3 {
            let (a, b) = (f[k], f[(k + 1) % 3]);
            let shared = |g: &[u32; 3]| (0..3).any(|j| (g[j], g[(j + 1) % 3]) == (b, a));
            if !top.faces.iter().any(shared) {
                all.faces.push([a, a + count, b + count]);
                all.faces.push([a, b + count, b]);
            }
        }
    }
    all
}

/// A box whose faces are divided into `cells` by `cells` squares.
pub fn fine_box(half: Vec3, cells: usize) -> Soup {
    let coarse = cuboid(half);
    let mut all = Soup::new(Vec::new(), Vec::new());
    for f in &coarse.faces {
        let [a, b, c] = f.map(|v| coarse.vertices[v as usize].coords);
        let at = |i: usize, j: usize| {
            let (u, v) = (i as f64 / cells as f64, j as f64 / cells as f64);
            // Rounded sums in a fixed order, so that neighbouring faces have bit-identical vertices.
            let p = a + (b - a) * u + (c - b) * v;
            Point::from(p.map(|x| (x * 1e9).round() / 1e9))
        };
        for i in 0..cells {
            for j in 0..=i {
                let start = u32::try_from(all.vertices.len()).unwrap();
                all.vertices
                    .extend([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                all.faces.push([start, start + 1, start + 2]);
                if j < i {
                    let start = u32::try_from(all.vertices.len()).unwrap();
                    all.vertices
                        .extend([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
                    all.faces.push([start, start + 1, start + 2]);
                }
            }
        }
    }
    all
}

/// A body: its name, its shape, the height of its origin above the support, and the area of its footprint (0: none).
pub struct Kind {
    pub name: &'static str,
    pub shape: String,
    pub height: f64,
    pub footprint: f64,
    /// Rotation onto the side it lies on.
    pub lying: Vec3,
}

pub fn kinds() -> Vec<Kind> {
    let half = Vec3::new(0.5, 0.35, 0.25);
    let kind = |name, shape: &str, height, footprint, lying: Vec3| Kind {
        name,
        shape: shape.to_owned(),
        height,
        footprint,
        lying,
    };
    let (upright, side) = (
        Vec3::zeros(),
        Vec3::new(0.0, std::f64::consts::FRAC_PI_2, 0.0),
    );
    let mut hull = "{ type = \"convex\", vertices = [".to_owned();
    for [x, y] in [
        [0.5, 0.1],
        [0.2, 0.5],
        [-0.4, 0.3],
        [-0.5, -0.2],
        [0.1, -0.5],
    ] {
        let _ = write!(
            hull,
            "[{x:?}, {y:?}, -0.2], [{:?}, {:?}, 0.3], ",
            0.6 * x,
            0.6 * y
        );
    }
    hull += "] }";
    let cylinder = "{ type = \"cylinder\", radius = 0.4, half_height = 0.3 }";
    let capsule = "{ type = \"capsule\", radius = 0.2, half_height = 0.4 }";
    vec![
        kind(
            "box",
            "{ type = \"box\", half_extents = [0.5, 0.35, 0.25] }",
            0.25,
            0.7,
            upright,
        ),
        kind(
            "sphere",
            "{ type = \"sphere\", radius = 0.4 }",
            0.4,
            0.0,
            upright,
        ),
        kind("capsule on its side", capsule, 0.2, 0.0, side),
        kind("capsule on end", capsule, 0.6, 0.0, upright),
        kind("cylinder", cylinder, 0.3, 0.45, upright),
        kind("cylinder on its side", cylinder, 0.4, 0.0, side),
        kind(
            "cone",
            "{ type = \"cone\", radius = 0.4, half_height = 0.3 }",
            0.3,
            0.45,
            upright,
        ),
        kind("hull", &hull, 0.2, 0.5, upright),
        kind(
            "mesh box",
            &trimesh(&cuboid(half), None),
            0.25,
            0.7,
            upright,
        ),
        kind(
            "fine mesh box",
            &trimesh(&fine_box(half, 5), None),
            0.25,
            0.7,
            upright,
        ),
    ]
}

/// A fixed floor and a moving body; the floor has the lower id if `floor_first`, else the higher one.
pub fn scene(floor: &str, body: &str, floor_first: bool) -> String {
    let (f, b) = if floor_first { (1, 2) } else { (2, 1) };
    format!(
        "frame_id = \"world\"\n[limits]\ncontacts_per_pair = 16\n[[source]]\nname = \"feed\"\n\
         [[body]]\nname = \"floor\"\nid = {f}\nmoves = false\nshape = {floor}\n\
         [[body]]\nname = \"body\"\nid = {b}\nmoves = true\nposition = [0.0, 0.0, 9.0]\nshape = {body}\n"
    )
}

pub fn drive(scene: &str) -> Drive {
    Drive::new(scene, Pattern::Wander, 1)
}

/// The contacts at a pose of the body.
pub fn contacts(drive: &mut Drive, pose: &Pose) -> Vec<ContactRow> {
    drive.set(0, pose);
    let out = drive.send(Budget::UNLIMITED, Demand::ALL);
    let rows = out.contacts.iter();
    assert!(
        rows.clone().all(|row| row.flags == 0),
        "of this tick's poses"
    );
    rows.filter(|row| row.kind == ContactKind::Contact.code())
        .copied()
        .collect()
}

/// The normal of a row, pointing away from the floor.
pub fn normal(row: &ContactRow, floor_first: bool) -> Vec3 {
    let normal = Vec3::from(row.normal);
    if floor_first { normal } else { -normal }
}

/// Angle between two unit vectors, degrees; accurate for small angles.
pub fn degrees(x: &Vec3, y: &Vec3) -> f64 {
    x.cross(y).norm().atan2(x.dot(y)).to_degrees()
}

/// Area of the hull of the points, seen from above.
pub fn area(rows: &[ContactRow]) -> f64 {
    let mut points: Vec<[f64; 2]> = rows.iter().map(|r| [r.point_a[0], r.point_a[1]]).collect();
    let centre = points
        .iter()
        .fold([0.0; 2], |s, p| [s[0] + p[0], s[1] + p[1]]);
    let centre = centre.map(|x| x / points.len().max(1) as f64);
    let angle = |p: &[f64; 2]| (p[1] - centre[1]).atan2(p[0] - centre[0]);
    points.sort_by(|p, q| angle(p).total_cmp(&angle(q)));
    let mut twice = 0.0;
    for (k, p) in points.iter().enumerate() {
        let q = points[(k + 1) % points.len()];
        twice += p[0] * q[1] - p[1] * q[0];
    }
    twice / 2.0
}
