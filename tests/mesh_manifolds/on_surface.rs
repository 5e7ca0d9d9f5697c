//! Goal: every contact point lies on the surface of its body.
//!
//! Method: pairs of all kinds with random overlaps; the distance of a point from a surface comes from closed forms for
//! convex shapes and from brute force for meshes.

use std::collections::BTreeMap;

use crate::oracle::Placed;
use crate::oracle::meshes::{
    Soup, bumpy_sphere, cuboid, height_field, patch, tetrahedron, torus, trimesh,
};
use crate::oracle::rng::Rng;
use crate::support::{contacts, drive, normal, scene};
use sweepd::math::{Point, Pose, Vec3};
use sweepd::wire::pair_flags;

const SEEDS: u64 = 800;
/// Tolerance of the distance from the surface, metres: sizes are about 1, and a point up to 1e-6 of the size above the
/// surface counts as a contact.
const OFF_M: f64 = 2e-6;

/// The shape of a body, from which the distance of a point (body frame, metres) from its surface is computed.
enum Form {
    Sphere(f64),
    Cuboid(Vec3),
    /// Radius, half height.
    Capsule(f64, f64),
    /// Radius, half height.
    Cylinder(f64, f64),
    /// Radius, half height.
    Cone(f64, f64),
    Mesh(Soup),
}

/// Distance of a point from a polyline, in the half-plane of distance from the axis and height along it.
fn off_line(p: [f64; 2], line: &[[f64; 2]]) -> f64 {
    let piece = |w: &[[f64; 2]]| {
        let (d, q) = (
            [w[1][0] - w[0][0], w[1][1] - w[0][1]],
            [p[0] - w[0][0], p[1] - w[0][1]],
        );
        let t = ((d[0] * q[0] + d[1] * q[1]) / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
        (q[0] - d[0] * t).hypot(q[1] - d[1] * t)
    };
    line.windows(2).map(piece).fold(f64::INFINITY, f64::min)
}

impl Form {
    fn shape(&self) -> String {
        match self {
            Self::Sphere(r) => format!("{{ type = \"sphere\", radius = {r:?} }}"),
            Self::Cuboid(h) => format!(
                "{{ type = \"box\", half_extents = [{:?}, {:?}, {:?}] }}",
                h.x, h.y, h.z
            ),
            Self::Capsule(r, h) => {
                format!("{{ type = \"capsule\", radius = {r:?}, half_height = {h:?} }}")
            }
            Self::Cylinder(r, h) => {
                format!("{{ type = \"cylinder\", radius = {r:?}, half_height = {h:?} }}")
            }
            Self::Cone(r, h) => {
                format!("{{ type = \"cone\", radius = {r:?}, half_height = {h:?} }}")
            }
            Self::Mesh(soup) => trimesh(soup, None),
        }
    }

    fn off(&self, pose: &Pose, p: &Point) -> f64 {
        let local = pose.inverse_transform_point(p);
        let around = [local.x.hypot(local.y), local.z];
        match self {
            Self::Sphere(r) => (local.coords.norm() - r).abs(),
            Self::Cuboid(half) => {
                let out = local.coords.abs() - half;
                let beyond = out.map(|x| x.max(0.0)).norm();
                if beyond > 0.0 { beyond } else { -out.max() }
            }
            Self::Capsule(r, h) => {
                let z = local.z - local.z.clamp(-h, *h);
                (around[0].hypot(z) - r).abs()
            }
            Self::Cylinder(r, h) => off_line(around, &[[0.0, -h], [*r, -h], [*r, *h], [0.0, *h]]),
            Self::Cone(r, h) => off_line(around, &[[0.0, -h], [*r, -h], [0.0, *h]]),
            Self::Mesh(soup) => {
                Placed::new(&soup.vertices, &soup.faces, false, pose, &Vec3::zeros())
                    .distance_from(p)
            }
        }
    }
}

fn form(rng: &mut Rng) -> (&'static str, Form) {
    let size = |rng: &mut Rng| rng.range(0.2, 0.6);
    match rng.below(11) {
        10 => ("sphere", Form::Sphere(size(rng))),
        0 => (
            "box",
            Form::Cuboid(Vec3::new(size(rng), size(rng), size(rng))),
        ),
        1 => ("capsule", Form::Capsule(size(rng) / 2.0, size(rng))),
        2 => ("cylinder", Form::Cylinder(size(rng), size(rng))),
        3 => ("cone", Form::Cone(size(rng), size(rng))),
        4 => (
            "box of triangles",
            Form::Mesh(cuboid(Vec3::new(size(rng), size(rng), size(rng)))),
        ),
        5 => ("torus", Form::Mesh(torus(0.5, 0.2, 10, 6))),
        6 => (
            "bumpy sphere",
            Form::Mesh(bumpy_sphere(6, 8, 0.2).scaled(Vec3::repeat(0.6))),
        ),
        7 => (
            "ground",
            Form::Mesh(height_field(rng, 5, 1.0).scaled(Vec3::new(1.0, 1.0, 0.3))),
        ),
        8 => ("sheet", Form::Mesh(patch(rng, 5))),
        _ => ("tetrahedron", Form::Mesh(tetrahedron(rng))),
    }
}

#[test]
fn contact_points_lie_on_the_surfaces_of_their_bodies() {
    let mut off = BTreeMap::<(&str, &str), (usize, usize, f64)>::new();
    let mut apart = 0;
    for seed in 0..SEEDS {
        let mut rng = Rng::new(seed);
        let ((name_a, a), (name_b, b)) = (form(&mut rng), form(&mut rng));
        let mut drive = drive(&scene(&a.shape(), &b.shape(), true));
        let base = Pose::identity();
        for _ in 0..4 {
            let (at, pull) = (rng.direction() * rng.range(0.1, 1.2), rng.unit());
            let at = if pull < 0.3 {
                Vec3::new(0.1, 0.2, at.norm())
            } else {
                at
            };
            let pose = rng.pose(at);
            for row in contacts(&mut drive, &pose) {
                let worst = a
                    .off(&base, &Point::from(row.point_a))
                    .max(b.off(&pose, &Point::from(row.point_b)));
                if row.gap_m > OFF_M {
                    println!("{seed} {name_a} and {name_b}: apart by {:.2e}", row.gap_m);
                    apart += 1;
                }
                let entry = off.entry((name_a, name_b)).or_default();
                entry.0 += 1;
                if worst > OFF_M {
                    entry.1 += 1;
                    if worst > entry.2 {
                        entry.2 = worst;
                    }
                }
            }
        }
    }
    let mut bad = 0;
    for ((a, b), (rows, wrong, worst)) in &off {
        if *wrong > 0 {
            println!("{a} and {b}: {wrong} of {rows} off, up to {worst:.2e} m");
            bad += wrong;
        }
    }
    assert!(
        bad == 0 && apart == 0,
        "{bad} points off their surfaces, {apart} of nothing that touches"
    );
}

/// The depth of a ball in flat ground is that of its lowest point, whether it crosses the surface or lies wholly below
/// it, and the normal points out of the ground: as for a box as the ground.
#[test]
fn bug_a_ball_whose_centre_is_below_the_ground_was_pushed_further_down() {
    let radius = 0.12;
    let ball = Form::Sphere(radius).shape();
    let ground = "{ type = \"height_field\", heights = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], \
                  size = [2.0, 2.0], base_m = 1.0 }";
    let slab = trimesh(
        &cuboid(Vec3::new(1.0, 1.0, 0.5)).moved(Vec3::new(0.0, 0.0, -0.5)),
        None,
    );
    for shape in [ground, &slab] {
        for first in [true, false] {
            let mut drive = drive(&scene(shape, &ball, first));
            for height in [0.119, 0.05, 0.001, -0.001, -0.05, -0.11, -0.13, -0.3] {
                let pose = Pose::translation(0.05, 0.03, height);
                let rows = contacts(&mut drive, &pose);
                let truth = height - radius;
                let deepest = rows
                    .iter()
                    .map(|row| row.gap_m)
                    .fold(f64::INFINITY, f64::min);
                assert!((deepest - truth).abs() < 1e-9, "{height}: {rows:?}");
                assert!(
                    rows.iter().all(|row| normal(row, first).z > 0.999_999),
                    "{height}: {rows:?}"
                );
                let pair = drive.out().pairs[0];
                assert!((pair.gap_best_m - truth).abs() < 1e-9, "{height}: {pair:?}");
                assert_eq!(pair.flags & pair_flags::TOUCHING, 0, "{height}: {pair:?}");
            }
        }
    }
}
