//! Counter-examples of the laws on the meaning of results, one by one.

use crate::oracle::meshes;
use crate::oracle::rng::Rng;
use crate::support::{CASES, run, shape};
use sweepd::math::{Pose, Quat, Vec3};
use sweepd::narrow::mesh::Goal;

#[test]
fn law_3_3_a_torus_round_a_rod_is_no_collision() {
    let torus = shape(&meshes::torus(1.0, 0.3, 16, 8), None);
    let rod = shape(&meshes::cuboid(Vec3::new(0.2, 0.2, 3.0)), None);
    let mut rng = Rng::new(5);
    for case in 0..CASES {
        let tilt = Quat::from_scaled_axis(rng.vector(0.1));
        let pose = Pose::from_parts(rng.vector(0.1).into(), tilt);
        let end = run(
            &torus,
            &rod,
            &Pose::identity(),
            &pose,
            Goal::Gap,
            &format!("rod {case}"),
        );
        assert!(end.min > 0.0, "{end:?}");
        let end = run(
            &rod,
            &torus,
            &pose,
            &Pose::identity(),
            Goal::Verdict,
            "torus",
        );
        assert!(end.min > 0.0, "{end:?}");
    }
}

#[test]
fn law_3_3_a_solid_in_a_solid_collides_and_a_solid_in_a_cavity_does_not() {
    let one = Vec3::new(1.0, 1.0, 1.0);
    let small = shape(&meshes::cuboid(one * 0.3), None);
    let full = shape(&meshes::cuboid(one), None);
    let hollow = shape(
        &meshes::cuboid(one).and(meshes::cuboid(one * 0.7).inverted()),
        None,
    );
    let nested = shape(&meshes::cuboid(one).and(meshes::cuboid(one * 0.7)), None);
    let skin = shape(&meshes::cuboid(one), Some(false));
    let mut rng = Rng::new(6);
    for case in 0..CASES {
        let pose = rng.pose(Rng::new(case).vector(0.1));
        let at = Pose::identity();
        for (outer, collides) in [
            (&full, true),
            (&hollow, false),
            (&nested, true),
            (&skin, false),
        ] {
            for (end, way) in [
                (
                    run(outer, &small, &at, &pose, Goal::Gap, "out-in"),
                    "out-in",
                ),
                (
                    run(&small, outer, &pose, &at, Goal::Gap, "in-out"),
                    "in-out",
                ),
                (
                    run(&small, outer, &pose, &at, Goal::Contacts, "in-out"),
                    "contacts",
                ),
            ] {
                assert_eq!(end.max < 0.0, collides, "{way} {end:?}");
                assert_eq!(end.min > 0.0, !collides, "{way} {end:?}");
            }
        }
    }
}

#[test]
fn law_3_3_an_inverted_shell_is_a_solid_like_any_other() {
    let one = Vec3::new(1.0, 1.0, 1.0);
    let small = shape(&meshes::cuboid(one * 0.3), None);
    let inverted = shape(&meshes::cuboid(one).inverted(), None);
    let end = run(
        &inverted,
        &small,
        &Pose::identity(),
        &Pose::identity(),
        Goal::Verdict,
        "inverted",
    );
    assert!(end.max < 0.0);
}

#[test]
fn law_3_2_a_peg_turned_in_its_hole_is_apart_until_it_touches() {
    let block = shape(&meshes::block_with_hole(1.0, 0.5, 0.5), None);
    let mut rng = Rng::new(7);
    for case in 0..CASES {
        let clearance = [1e-2, 1e-3, 1e-4][rng.below(3)];
        let half = 0.5 - clearance;
        let peg = shape(&meshes::cuboid(Vec3::new(half, half, 1.0)), None);
        for angle in [0.0, 0.01, 0.5 * clearance] {
            let turn = Quat::from_scaled_axis(rng.direction() * angle);
            let pose = Pose::from_parts(rng.vector(0.2 * clearance).into(), turn);
            let what = format!("peg {case} {clearance} {angle}");
            let end = run(&block, &peg, &Pose::identity(), &pose, Goal::Gap, &what);
            if angle < 0.01 {
                assert!(end.min > 0.0, "{what} {end:?}");
            }
        }
    }
}

#[test]
fn coplanar_and_coincident_meshes_collide_by_touching() {
    let one = Vec3::new(1.0, 1.0, 1.0);
    let cuboid = shape(&meshes::cuboid(one), None);
    let sheet = shape(&meshes::cuboid(one), Some(false));
    let mut rng = Rng::new(8);
    for case in 0..CASES {
        let pose_a = rng.pose(Rng::new(case).vector(10.0));
        let lateral = Vec3::new(rng.range(-1.5, 1.5), rng.range(-1.5, 1.5), 0.0);
        for (offset, other) in [
            (Vec3::zeros(), &cuboid),
            (Vec3::zeros(), &sheet),
            (Vec3::z() * 2.0, &cuboid),
            (lateral + Vec3::z() * 2.0, &sheet),
        ] {
            let pose_b = pose_a * Pose::translation(offset.x, offset.y, offset.z);
            let end = run(&cuboid, other, &pose_a, &pose_b, Goal::Gap, "coplanar");
            assert!(end.min <= 0.0 && end.max <= 1e-12, "{offset:?} {end:?}");
            // A tiny gap is a gap.
            let pose_b = pose_a
                * Pose::translation(
                    offset.x * 1.001,
                    offset.y,
                    offset.z + offset.z.signum() * 1e-8,
                );
            if offset.z > 0.0 {
                let end = run(&cuboid, other, &pose_a, &pose_b, Goal::Gap, "hair");
                assert!(end.min > 0.0, "{end:?}");
            }
        }
    }
}
