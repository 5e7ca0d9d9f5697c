//! Overlaps proved by inner balls of the two shapes: never deeper than the true overlap, and found for deep pairs.

use crate::oracle::Truth;
use crate::oracle::meshes;
use crate::oracle::rng::Rng;
use crate::support::{
    CASES, KINDS, any_convex, any_mesh, convex, is_surface, place, shape, truth_of,
};
use sweepd::math::{Pose, Quat, Vec3, relative};
use sweepd::narrow::mesh::{CarriedFront, FrontStore, Goal, MeshQuery, Search, overlap};
use sweepd::shape::{Convex, Shape};
use sweepd::time::{ManualClock, Meter};

fn told(a: &Shape, b: &Shape, pos12: &Pose) -> Option<f64> {
    let clock = ManualClock::new(0);
    let mut meter = Meter::unlimited(&clock);
    let depth_m = overlap((a, b), pos12, &mut meter);
    assert!(meter.spent() <= 1, "{} units", meter.spent());
    depth_m
}

/// By law 3.2 the gap changes by at most the motion: two shapes that overlap by a depth still overlap after a shorter
/// motion.
#[test]
fn law_3_2_what_balls_tell_is_no_deeper_than_the_overlap() {
    let (mut deep, mut solid, mut found) = (0, 0, 0);
    for case in 0..6 * CASES {
        let seed = 30_000_000 + case;
        let mut rng = Rng::new(seed);
        let kinds = [rng.below(KINDS), rng.below(KINDS)];
        let (a, name_a) = any_mesh(&mut rng, kinds[0]);
        let (b, name_b) = if rng.below(3) == 0 {
            any_convex(&mut rng)
        } else {
            any_mesh(&mut rng, kinds[1])
        };
        let how = [1, 1, 0, 2][rng.below(4)];
        let (pose_a, pose_b) = place(&mut rng, &a, &b, how);
        let ((a, pose_a), (b, pose_b)) = if rng.below(2) == 0 {
            ((&a, pose_a), (&b, pose_b))
        } else {
            ((&b, pose_b), (&a, pose_a))
        };
        let depth_m = told(a, b, &relative(&pose_a, &pose_b));
        solid += u64::from(how == 1 && !is_surface(name_a) && !is_surface(name_b));
        let Some(depth_m) = depth_m else { continue };
        let what = format!("seed {seed} {name_a} - {name_b}, {depth_m} m");
        assert!(!is_surface(name_a) && !is_surface(name_b), "{what}");
        assert!(0.0 < depth_m && depth_m <= a.radius + b.radius, "{what}");
        found += u64::from(how == 1);
        for _ in 0..8 {
            let away = rng.direction() * (depth_m * rng.range(0.99, 0.999_999));
            let mut moved = pose_b;
            moved.translation.vector += away;
            let truth = truth_of(a, b, &pose_a, &moved);
            assert!(
                matches!(truth, Truth::Overlap(_)),
                "{what}: {truth:?} after {away:?}"
            );
        }
        deep += 1;
    }
    println!("{found} of {solid} deep poses of solids told, {deep} in all");
    assert!(deep > CASES && 2 * found > solid, "{found} of {solid}");
}

/// For two balls the truth is known: the depth from their meshes is close to it, and never greater.
#[test]
fn balls_within_round_meshes_tell_nearly_the_whole_depth() {
    let ball = shape(&meshes::bumpy_sphere(24, 48, 0.0), None);
    let sphere = convex(Convex::sphere(0.7));
    let mut rng = Rng::new(31_000_000);
    for _ in 0..200 {
        let way = rng.direction() * rng.range(0.0, 2.2);
        let pos12 = Pose::from_parts(way.into(), rng.rotation());
        for (other, radius) in [(&ball, 1.0), (&sphere, 0.7)] {
            // The greatest depth of a point of one ball in the other.
            let depth_m = (1.0 + radius - way.norm()).min(1.0);
            for depth in [
                told(&ball, other, &pos12),
                told(other, &ball, &pos12.inverse()),
            ] {
                let least_m = depth_m - 0.05;
                assert!(depth.unwrap_or(0.0) >= least_m, "{depth:?} of {depth_m}");
                assert!(
                    depth.is_none_or(|told| told <= depth_m + 1e-12),
                    "{depth:?} of {depth_m}"
                );
            }
        }
    }
}

#[test]
fn a_thin_ring_has_balls_most_of_the_way_round() {
    let ring = shape(&meshes::torus(1.0, 0.1, 48, 12), None);
    let bead = shape(
        &meshes::bumpy_sphere(8, 12, 0.0).scaled(Vec3::new(0.15, 0.15, 0.15)),
        None,
    );
    let told_at = |k: u32| {
        let angle = std::f64::consts::TAU * f64::from(k) / 90.0;
        let at = Vec3::new(angle.cos(), angle.sin(), 0.0);
        told(&ring, &bead, &Pose::from_parts(at.into(), Quat::identity())).is_some()
    };
    let found = (0..90).filter(|k| told_at(*k)).count();
    assert!(found > 70, "{found} of 90 places on the ring");
    assert!(
        told(&ring, &bead, &Pose::identity()).is_none(),
        "in the hole"
    );
}

#[test]
fn surfaces_and_meshes_that_deform_tell_nothing() {
    let skin = shape(&meshes::cuboid(Vec3::new(1.0, 1.0, 1.0)), Some(false));
    let solid = shape(&meshes::cuboid(Vec3::new(1.0, 1.0, 1.0)), None);
    assert!(told(&solid, &solid, &Pose::identity()).is_some());
    assert!(told(&skin, &solid, &Pose::identity()).is_none());
    assert!(told(&solid, &skin, &Pose::identity()).is_none());
    let triangle = convex(Convex::triangle([
        [0.0, 0.0, 0.0].into(),
        [0.1, 0.0, 0.0].into(),
        [0.0, 0.1, 0.0].into(),
    ]));
    assert!(told(&solid, &triangle, &Pose::identity()).is_none());
}

#[test]
fn balls_that_told_nothing_are_not_asked_again_before_the_pair_has_moved_enough() {
    let ball = shape(&meshes::bumpy_sphere(20, 40, 0.05), None);
    let clock = ManualClock::new(0);
    let mut meter = Meter::unlimited(&clock);
    let (mut store, mut front) = (FrontStore::default(), CarriedFront::default());
    let at = |x: f64| Pose::from_parts(Vec3::new(x, 0.0, 0.0).into(), Quat::identity());
    front.start(&mut store, &ball, &ball, &at(2.3), Search::Carried);
    let mut asked = |x: f64| {
        let before = meter.spent();
        let told = front.overlap(&ball, &ball, &at(x), &mut meter);
        (told.is_some(), meter.spent() - before)
    };
    assert_eq!(asked(2.3), (false, 1));
    assert_eq!(asked(2.2), (false, 0));
    assert_eq!(asked(1.5), (true, 1));
    assert_eq!(asked(1.51), (true, 1));
}

/// A corner that penetrates by a thousand rounding errors makes leaves cross by only that much: `gap_max` was only the
/// rounding error.
#[test]
fn bug_a_corner_that_reaches_in_by_more_than_is_rounded_overlaps() {
    let clock = ManualClock::new(0);
    let mut rng = Rng::new(32_000_000);
    for case in 0..CASES {
        let half = [0.02, 1.0, 60.0][rng.below(3)];
        let small = shape(&meshes::cuboid(Vec3::new(0.9, 1.0, 0.4) * half), None);
        let large = shape(&meshes::cuboid(Vec3::new(4.0, 4.0, 4.0) * half), None);
        let turn = rng.rotation();
        let corner = [1.0, -1.0].map(|z| turn * (Vec3::new(0.9, 1.0, 0.4 * z) * half));
        let out = corner[0].x.abs().max(corner[1].x.abs());
        let out = (turn * Vec3::new(0.9, -1.0, 0.4) * half).x.abs().max(out);
        let out = (turn * Vec3::new(-0.9, 1.0, 0.4) * half).x.abs().max(out);
        let depth = 1e-12 * half;
        let at = Vec3::new(4.0 * half + out - depth, 0.3 * half, -0.2 * half);
        let pos12 = Pose::from_parts(at.into(), turn);
        for (a, b, pos12) in [(&large, &small, pos12), (&small, &large, pos12.inverse())] {
            let (mut store, mut query) = (FrontStore::default(), MeshQuery::default());
            query.start(&mut store, a, b, &pos12);
            let mut meter = Meter::unlimited(&clock);
            assert!(query.advance(&mut store, (a, b), Goal::Contacts, u64::MAX, &mut meter));
            let gap = query.interval();
            assert!(gap.max <= 0.0, "case {case}: {gap:?} of {depth} m");
            assert!(gap.contains(-depth), "case {case}: {gap:?} of {depth} m");
        }
    }
}
