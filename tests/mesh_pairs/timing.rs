//! Timing, by hand: walks against parry's distance in one run.

use crate::oracle::meshes;
use crate::support::{mesh_of, shape};
use sweepd::math::{Pose, Vec3};
use sweepd::narrow::mesh::{Goal, Walk};
use sweepd::time::Meter;

#[test]
#[ignore = "timing; SWEEPD_CI_SLOW=1 .ci/run runs it"]
fn timing_of_bumpy_spheres_against_parry() {
    let clock = sweepd::time::SystemClock;
    let now = || sweepd::time::Clock::monotonic_ns(&clock);
    println!(
        "triangles,gap,sweepd_verdict_us,sweepd_gap_us,units,aabb_ns,parry_distance_us,difference"
    );
    for (rows, columns) in [(26, 50), (51, 100)] {
        let soup = meshes::bumpy_sphere(rows, columns, 0.1);
        let a = shape(&soup, None);
        let vertices = soup
            .vertices
            .iter()
            .map(|p| parry3d_f64::math::Vector::new(p.x, p.y, p.z));
        let parry =
            parry3d_f64::shape::TriMesh::new(vertices.collect(), soup.faces.clone()).unwrap();
        for gap in [0.3, 0.12, -0.2] {
            let pose = Pose::new(
                Vec3::new(1.2, 1.1, 1.0).normalize() * (2.05 + gap),
                Vec3::new(0.4, 0.5, 0.6),
            );
            let rounds = 20;
            let mut walk = Walk::default();
            let mut meter = Meter::unlimited(&clock);
            let start = now();
            for _ in 0..rounds {
                walk.start(&a, &a, &pose);
                walk.advance(&a, &a, Goal::Verdict, u64::MAX, &mut meter);
            }
            let verdict = now() - start;
            let mut meter = Meter::unlimited(&clock);
            let start = now();
            for _ in 0..rounds {
                walk.start(&a, &a, &pose);
                walk.advance(&a, &a, Goal::Gap, u64::MAX, &mut meter);
            }
            let exact = now() - start;
            let start = now();
            for _ in 0..rounds {
                std::hint::black_box(mesh_of(&a).aabb_at(std::hint::black_box(&pose)));
            }
            let boxes = now() - start;
            let (t, q) = (pose.translation.vector, pose.rotation.into_inner().coords);
            let there = parry3d_f64::math::Pose {
                rotation: parry3d_f64::math::Rotation::from_xyzw(q.x, q.y, q.z, q.w),
                translation: parry3d_f64::math::Vector::new(t.x, t.y, t.z),
            };
            let start = now();
            let theirs = parry3d_f64::query::distance(
                &parry3d_f64::math::Pose::IDENTITY,
                &parry,
                &there,
                &parry,
            )
            .unwrap();
            let their_time = now() - start;
            let us = |ns: u64| ns as f64 / 1e3 / f64::from(rounds);
            println!(
                "{},{gap},{:.1},{:.1},{},{},{:.1},{:e}",
                soup.faces.len(),
                us(verdict),
                us(exact),
                meter.spent() / u64::try_from(rounds).unwrap(),
                boxes / u64::try_from(rounds).unwrap(),
                their_time as f64 / 1e3,
                walk.interval().max - theirs.distance
            );
        }
    }
}
