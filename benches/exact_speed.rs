//! Nanoseconds a query, against parry3d-f64's `contact` and `contact_manifolds` on the same pairs.
//!
//! Run by hand: `cargo test --release --test exact_speed -- --ignored --nocapture`.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a timing by hand"
)]

use std::time::Instant;

use nalgebra::UnitQuaternion;
use parry3d_f64::query::{self, ContactManifold};
use parry3d_f64::shape::{self as parry, Shape};
use sweepd::math::{Point, Pose, Vec3};
use sweepd::narrow::exact::{Manifold, Warm, convex_gap, manifold};
use sweepd::shape::Convex;

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit() - 0.5, self.unit() - 0.5, self.unit() - 0.5)
    }
}

fn hull_points(r: &mut Random, count: usize) -> Vec<Vec3> {
    (0..count).map(|_| r.vector().normalize() * 0.5).collect()
}

fn to_parry(pose: &Pose) -> glamx::DPose3 {
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

/// A name, the shape, and the same of parry.
type Both = (&'static str, Convex, Box<dyn Shape>);

fn shapes() -> Vec<Both> {
    let mut r = Random(5);
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

/// Random poses with gaps between `low` and `high`.
fn poses_of(r: &mut Random, a: &Both, b: &Both, low: f64, high: f64) -> Vec<Pose> {
    let mut poses = Vec::new();
    while poses.len() < 1000 {
        let rotation = UnitQuaternion::from_scaled_axis(r.vector() * 6.0);
        let mut at = r.vector().normalize();
        let target = low + (high - low) * r.unit();
        for _ in 0..2 {
            let pose = Pose::from_parts(at.into(), rotation);
            let c = convex_gap(&a.1, &b.1, &pose, &mut Warm::default());
            at += c.normal * (target - c.best_m);
        }
        poses.push(Pose::from_parts(at.into(), rotation));
    }
    poses
}

/// Cold, warm, manifold.
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

/// Distance, contact, manifold cold and warm.
fn parrys(a: &Both, b: &Both, poses: &[Pose]) -> [f64; 4] {
    let parry_poses: Vec<_> = poses.iter().map(to_parry).collect();
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

#[test]
#[ignore = "timing; SWEEPD_CI_SLOW=1 .ci/run runs it"]
fn nanoseconds_a_query() {
    let mut r = Random(5);
    let shapes = shapes();
    println!(
        "pair               regime    cold    warm  manifold | parry distance contact manifold-cold manifold-warm"
    );
    for (i, j) in [
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
    ] {
        let (a, b) = (&shapes[i], &shapes[j]);
        for (regime, low, high) in [
            ("apart", 0.05, 0.6),
            ("touch", -0.01, 0.01),
            ("deep", -0.25, -0.05),
        ] {
            let poses = poses_of(&mut r, a, b, low, high);
            let [cold, warm, points] = ours(a, b, &poses);
            let [distance, contact, cold_m, warm_m] = parrys(a, b, &poses);
            println!(
                "{:8} {:8} {regime:6} {cold:7.0} {warm:7.0} {points:7.0}   | {distance:7.0} {contact:7.0} {cold_m:7.0} {warm_m:7.0}",
                a.0, b.0
            );
        }
    }
}
