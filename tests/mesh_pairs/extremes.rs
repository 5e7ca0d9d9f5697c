//! Extreme values: needles, nearly parallel edges, tiny next to huge, invalid poses, reused memory.

use crate::oracle::meshes;
use crate::oracle::rng::Rng;
use crate::support::{CASES, KINDS, any_mesh, any_two, place, run, shape, way};
use sweepd::math::{Interval, Pose, Quat, Vec3, relative};
use sweepd::narrow::mesh::{FrontStore, Goal, MeshQuery, Walk};
use sweepd::time::{ManualClock, Meter};

#[test]
fn edges_that_cross_at_a_hair_of_an_angle_keep_their_distance() {
    let bar = shape(&meshes::cuboid(Vec3::new(1.0, 0.1, 0.1)), None);
    let diamond = Quat::from_axis_angle(&Vec3::x_axis(), std::f64::consts::FRAC_PI_4);
    let high = 0.1 * 2.0_f64.sqrt();
    for case in 0..CASES * 2 {
        let mut rng = Rng::new(11_000_000 + case);
        let angle = 10.0_f64.powf(rng.range(-12.0, -1.0));
        let gap = 10.0_f64.powf(rng.range(-8.0, -1.0)) * if rng.below(3) == 0 { -1.0 } else { 1.0 };
        let pose_a = Pose::from_parts(rng.vector(1.0).into(), rng.rotation());
        let turn = Quat::from_axis_angle(&Vec3::z_axis(), angle);
        let shift = Vec3::new(rng.range(-0.5, 0.5), 0.0, 2.0 * high + gap);
        let edge_up = Pose::from_parts(Vec3::zeros().into(), diamond);
        let edge_down = Pose::from_parts(shift.into(), turn * diamond);
        let (pose_a, pose_b) = (pose_a * edge_up, pose_a * edge_down);
        let end = run(
            &bar,
            &bar,
            &pose_a,
            &pose_b,
            Goal::Gap,
            &format!("edges {case} {angle} {gap}"),
        );
        assert_eq!(end.min > 0.0, gap > 0.0, "{angle} {gap} {end:?}");
    }
}

#[test]
fn needles_of_a_billionth_of_their_length_are_legal() {
    for case in 0..CASES {
        let mut rng = Rng::new(12_000_000 + case);
        let thin = Vec3::new(
            1.0,
            10.0_f64.powf(rng.range(-9.0, -3.0)),
            10.0_f64.powf(rng.range(-9.0, -3.0)),
        );
        let needle = shape(&meshes::cuboid(thin), None);
        let kind = rng.below(KINDS);
        let (other, name) = any_mesh(&mut rng, kind);
        let (pose_a, pose_b) = place(&mut rng, &needle, &other, way(case));
        run(
            &needle,
            &other,
            &pose_a,
            &pose_b,
            Goal::Gap,
            &format!("needle {case} {name}"),
        );
    }
}

#[test]
fn a_micrometre_beside_a_kilometre_keeps_the_right_side() {
    for case in 0..CASES {
        let mut rng = Rng::new(13_000_000 + case);
        let one = Vec3::new(1.0, 1.0, 1.0);
        let tiny = shape(&meshes::bumpy_sphere(5, 6, 0.1).scaled(one * 1e-6), None);
        let huge = shape(&meshes::cuboid(one * 500.0), None);
        let pose_a = Pose::from_parts(rng.vector(10.0).into(), rng.rotation());
        let gap = [1e-6, 1e-3, -1e-4, -300.0][rng.below(4)];
        let local = Vec3::new(
            rng.range(-400.0, 400.0),
            rng.range(-400.0, 400.0),
            500.0 + 1.2e-6 + gap,
        );
        let pose_b = pose_a * Pose::from_parts(local.into(), rng.rotation());
        let end = run(
            &huge,
            &tiny,
            &pose_a,
            &pose_b,
            Goal::Gap,
            &format!("tiny {case} {gap}"),
        );
        assert_eq!(end.min > 0.0, gap > 0.0, "{gap} {end:?}");
    }
}

#[test]
fn a_walk_used_again_answers_as_a_new_one() {
    let clock = ManualClock::new(0);
    let mut old = Walk::default();
    for case in 0..CASES {
        let mut rng = Rng::new(14_000_000 + case);
        let (a, b, [pose_a, pose_b], _) = any_two(&mut rng, way(case));
        let pos12 = relative(&pose_a, &pose_b);
        let mut new = Walk::default();
        let spent = [&mut old, &mut new].map(|walk| {
            let mut meter = Meter::unlimited(&clock);
            walk.start(&a, &b, &pos12);
            walk.advance(&a, &b, Goal::Gap, rng.bits() % 7, &mut meter);
            assert!(walk.advance(&a, &b, Goal::Contacts, u64::MAX, &mut meter));
            meter.spent()
        });
        assert_eq!(spent[0], spent[1]);
        assert_eq!(old.interval(), new.interval());
        assert_eq!(old.contacts().len(), new.contacts().len());
        assert!(old.is_certain());
    }
}

#[test]
fn a_pose_that_is_not_finite_leaves_everything_open() {
    let a = shape(&meshes::cuboid(Vec3::new(1.0, 1.0, 1.0)), None);
    let clock = ManualClock::new(0);
    let mut meter = Meter::unlimited(&clock);
    let mut walk = Walk::default();
    walk.start(&a, &a, &Pose::translation(f64::NAN, 0.0, 0.0));
    assert!(!walk.advance(&a, &a, Goal::Verdict, 100, &mut meter));
    assert_eq!(walk.interval(), Interval::UNKNOWN);
    let (mut store, mut query) = (FrontStore::default(), MeshQuery::default());
    query.start(
        &mut store,
        &a,
        &a,
        &Pose::translation(0.0, 0.0, f64::INFINITY),
    );
    assert!(!query.advance(&mut store, (&a, &a), Goal::Verdict, 100, &mut meter));
    assert_eq!(query.interval(), Interval::UNKNOWN);
}
