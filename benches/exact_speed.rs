//! Nanoseconds per query, compared with parry3d-f64's `distance`, `contact` and `contact_manifolds` on the same pairs.
//!
//! `cargo bench --bench exact_speed`
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a bench"
)]

mod common;

use std::fmt::Write as _;
use std::time::Instant;

use common::{provenance, save};
use nalgebra::UnitQuaternion;
use parry3d_f64::query::{self, ContactManifold};
use parry3d_f64::shape::{self as parry, Shape};
use sweepd::builtin::Random;
use sweepd::math::{Point, Pose, Vec3};
use sweepd::narrow::exact::{Manifold, Warm, convex_gap, manifold};
use sweepd::shape::Convex;

/// A random vector within a cube of edge 1 about the origin.
fn vector(r: &mut Random) -> Vec3 {
    Vec3::from_fn(|_, _| r.range(-0.5, 0.5))
}

fn hull_points(r: &mut Random, count: usize) -> Vec<Vec3> {
    (0..count).map(|_| vector(r).normalize() * 0.5).collect()
}

/// Parry's capsules, cylinders and cones have their axis along y, ours along z.
fn upright(of: &Both) -> Pose {
    let turned = ["capsule", "cylinder", "cone"].contains(&of.0);
    let angle = if turned {
        std::f64::consts::FRAC_PI_2
    } else {
        0.0
    };
    Pose::rotation(Vec3::x() * angle)
}

/// The pose of the second shape in the frame of the first, for shapes with parry's axes.
fn to_parry(a: &Both, b: &Both, pose: &Pose) -> glamx::DPose3 {
    let pose = upright(a).inverse() * pose * upright(b);
    let (t, q) = (&pose.translation.vector, pose.rotation.as_vector());
    glamx::DPose3 {
        rotation: glamx::DQuat::from_xyzw(q.x, q.y, q.z, q.w),
        translation: glamx::DVec3::new(t.x, t.y, t.z),
    }
}

fn nanos(poses: &[Pose], mut each: impl FnMut(usize, &Pose)) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        for (k, pose) in poses.iter().enumerate() {
            each(k, pose);
        }
        best = best.min(start.elapsed().as_secs_f64() * 1e9 / poses.len() as f64);
    }
    best
}

/// The pairs that are measured, as indices into [`shapes`].
const PAIRS: [(usize, usize); 11] = [
    (0, 0),
    (0, 1),
    (1, 1),
    (2, 2),
    (1, 2),
    (5, 5),
    (6, 6),
    (3, 3),
    (1, 3),
    (4, 4),
    (1, 5),
];
/// Name of a regime and the range of gaps of its poses, metres.
const REGIMES: [(&str, f64, f64); 3] = [
    ("apart", 0.05, 0.6),
    ("touch", -0.01, 0.01),
    ("deep", -0.25, -0.05),
];

/// A name, our shape, and the same shape of parry.
type Both = (&'static str, Convex, Box<dyn Shape>);

fn shapes() -> Vec<Both> {
    let mut r = Random::new(5);
    let (h1, h2) = (hull_points(&mut r, 12), hull_points(&mut r, 64));
    let hull = |p: &[Vec3]| {
        let points: Vec<Point> = p.iter().map(|v| Point::from(*v)).collect();
        Convex::hull(&points).unwrap()
    };
    let parry_hull = |p: &[Vec3]| -> Box<dyn Shape> {
        let points: Vec<_> = p.iter().map(|v| glamx::DVec3::new(v.x, v.y, v.z)).collect();
        Box::new(parry::ConvexPolyhedron::from_convex_hull(&points).unwrap())
    };
    vec![
        (
            "sphere",
            Convex::sphere(0.5),
            Box::new(parry::Ball::new(0.5)),
        ),
        (
            "box",
            Convex::cuboid(Vec3::new(0.5, 0.4, 0.3)),
            Box::new(parry::Cuboid::new(glamx::DVec3::new(0.5, 0.4, 0.3))),
        ),
        (
            "capsule",
            Convex::capsule(0.3, 0.4),
            Box::new(parry::Capsule::new_y(0.4, 0.3)),
        ),
        (
            "cylinder",
            Convex::cylinder(0.3, 0.4),
            Box::new(parry::Cylinder::new(0.4, 0.3)),
        ),
        (
            "cone",
            Convex::cone(0.3, 0.4),
            Box::new(parry::Cone::new(0.4, 0.3)),
        ),
        ("hull12", hull(&h1), parry_hull(&h1)),
        ("hull64", hull(&h2), parry_hull(&h2)),
    ]
}

/// Random poses with gaps between `low` and `high`, metres.
fn poses_of(r: &mut Random, a: &Both, b: &Both, low: f64, high: f64) -> Vec<Pose> {
    let mut poses = Vec::new();
    while poses.len() < 1000 {
        let rotation = UnitQuaternion::from_scaled_axis(vector(r) * 6.0);
        let mut at = vector(r).normalize();
        let target = low + (high - low) * r.range(0.0, 1.0);
        for _ in 0..2 {
            let pose = Pose::from_parts(at.into(), rotation);
            let c = convex_gap(&a.1, &b.1, &pose, &mut Warm::default());
            at += c.normal * (target - c.best_m);
        }
        poses.push(Pose::from_parts(at.into(), rotation));
    }
    poses
}

/// Times of the cold query, the warm query and the manifold, nanoseconds.
fn ours(a: &Both, b: &Both, poses: &[Pose]) -> [f64; 3] {
    let cold = nanos(poses, |_, p| {
        std::hint::black_box(convex_gap(&a.1, &b.1, p, &mut Warm::default()));
    });
    let mut warms = vec![Warm::default(); poses.len()];
    let warm = nanos(poses, |k, p| {
        std::hint::black_box(convex_gap(&a.1, &b.1, p, &mut warms[k]));
    });
    let closest: Vec<_> = poses
        .iter()
        .map(|p| convex_gap(&a.1, &b.1, p, &mut Warm::default()))
        .collect();
    let mut out = Manifold::default();
    let points = nanos(poses, |k, p| {
        manifold(&a.1, &b.1, p, &closest[k], 0.02, &mut out);
        std::hint::black_box(&out);
    });
    [cold, warm, points]
}

/// Times of distance, contact, cold manifold and warm manifold, nanoseconds.
fn parrys(a: &Both, b: &Both, poses: &[Pose]) -> [f64; 4] {
    let parry_poses: Vec<_> = poses.iter().map(|pose| to_parry(a, b, pose)).collect();
    let distance = nanos(poses, |k, _| {
        let _ = std::hint::black_box(query::distance(
            &glamx::DPose3::IDENTITY,
            &*a.2,
            &parry_poses[k],
            &*b.2,
        ));
    });
    let contact = nanos(poses, |k, _| {
        let _ = std::hint::black_box(query::contact(
            &glamx::DPose3::IDENTITY,
            &*a.2,
            &parry_poses[k],
            &*b.2,
            1.0,
        ));
    });
    let dispatcher = query::DefaultQueryDispatcher;
    let cold_m = nanos(poses, |k, _| {
        let mut manifolds: Vec<ContactManifold<(), ()>> = Vec::new();
        let _ = query::PersistentQueryDispatcher::contact_manifolds(
            &dispatcher,
            &parry_poses[k],
            &*a.2,
            &*b.2,
            0.02,
            &mut manifolds,
            &mut None,
        );
        std::hint::black_box(&manifolds);
    });
    let mut kept: Vec<Vec<ContactManifold<(), ()>>> = vec![Vec::new(); poses.len()];
    let warm_m = nanos(poses, |k, _| {
        let _ = query::PersistentQueryDispatcher::contact_manifolds(
            &dispatcher,
            &parry_poses[k],
            &*a.2,
            &*b.2,
            0.02,
            &mut kept[k],
            &mut None,
        );
    });
    [distance, contact, cold_m, warm_m]
}

/// Checks that both libraries get the same distances for separated pairs.
fn agree(a: &Both, b: &Both, poses: &[Pose]) {
    for pose in poses {
        let gap = convex_gap(&a.1, &b.1, pose, &mut Warm::default());
        let distance = query::distance(
            &glamx::DPose3::IDENTITY,
            &*a.2,
            &to_parry(a, b, pose),
            &*b.2,
        )
        .unwrap();
        let off = (gap.best_m - distance.distance).abs();
        assert!(off < 1e-4, "{} {}: {off} m apart", a.0, b.0);
    }
}

fn main() {
    let mut r = Random::new(5);
    let shapes = shapes();
    let from = provenance();
    let mut csv = String::from(
        "machine,commit,compiler,seed,shapes,regime,cold_ns,warm_ns,manifold_ns,parry_distance_ns,parry_contact_ns,\
         parry_manifold_cold_ns,parry_manifold_warm_ns\n",
    );
    for (i, j) in PAIRS {
        let (a, b) = (&shapes[i], &shapes[j]);
        for (regime, low, high) in REGIMES {
            let poses = poses_of(&mut r, a, b, low, high);
            if regime == "apart" {
                agree(a, b, &poses);
            }
            let [cold, warm, points] = ours(a, b, &poses);
            let [distance, contact, cold_m, warm_m] = parrys(a, b, &poses);
            let _ = writeln!(
                csv,
                "{from},5,{}-{},{regime},{cold:.0},{warm:.0},{points:.0},{distance:.0},{contact:.0},{cold_m:.0},{warm_m:.0}",
                a.0, b.0
            );
        }
    }
    save("exact_speed.csv", &csv);
}
