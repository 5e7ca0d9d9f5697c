//! Splitting regions is work like any other: with budget 0 there is none, it is counted, and it makes regions smaller.

use sweepd::limits::REGION_TESTS_PER_PAIR;
use sweepd::math::{Pose, Vec3};
use sweepd::time::Budget;
use sweepd::wire::Demand;

use super::oracle::rng::Rng;
use super::{ASKED, CASES, Part, Run, Thing, meshes, moved, place, things, widest};

#[test]
fn at_budget_0_no_test_is_done_and_the_union_still_holds_all_that_is_shared() {
    let mut points = 0;
    for case in 0..CASES / 4 {
        let mut rng = Rng::new(60_000 + case);
        let kind = [0, 1, 2, 4, 6, 7][rng.below(6)];
        let things = things(&mut rng, kind);
        let mut run = Run::new(&things, &place(&mut rng, &things));
        // Gives the front some depth, at other poses.
        let units = [0, 10, 100, 1_000_000][rng.below(4)];
        run.send(Budget::units(units));
        for tick in 0..4 {
            run.poses[1] = moved(&mut rng, &run.poses[1], run.things[1].radius);
            let out = run.send(Budget::units(0));
            assert_eq!(out.tick.units, 0, "seed {} tick {tick}", 60_000 + case);
            points += run.check(&out, &format!("seed {} tick {tick}", 60_000 + case));
        }
    }
    assert!(points as u64 > 10 * CASES, "{points} points");
}

/// A bumpy ball cut by a floor: only splitting makes its regions smaller.
fn on_a_floor() -> ([Thing; 2], [Pose; 2]) {
    let ball = Part::Mesh(meshes::bumpy_sphere(12, 16, 0.1));
    let one = |part| Thing::new(vec![(part, Vec3::zeros())]);
    let at = Pose::translation(0.0, 0.0, 0.8);
    ([one(Part::Floor), one(ball)], [Pose::identity(), at])
}

#[test]
fn splitting_is_counted_and_is_done_only_while_somebody_reads_regions() {
    let (things, poses) = on_a_floor();
    let nobody = Demand {
        regions: false,
        ..ASKED
    };
    let units = |demand: Demand| {
        let mut run = Run::new(&things, &poses);
        run.drive.set(0, &poses[1]);
        let out = run.drive.send(Budget::UNLIMITED, demand);
        (out.tick.units, out.regions.len())
    };
    let ((plain, none), (split, some)) = (units(nobody), units(ASKED));
    assert!(none == 0 && some > 0);
    let tests = split - plain;
    assert!(
        (1..=u64::from(REGION_TESTS_PER_PAIR)).contains(&tests),
        "{tests} tests"
    );
}

#[test]
fn regions_tighten_with_the_budget_and_never_take_more_than_it() {
    const MOST: u64 = REGION_TESTS_PER_PAIR as u64;
    let mut sums = [0.0; 5];
    let mut rng = Rng::new(80_000);
    for _ in 0..CASES / 4 {
        let (things, mut poses) = on_a_floor();
        let height = rng.range(0.3, 0.9);
        poses[1] = rng.pose(Vec3::z() * height);
        let whole = Run::new(&things, &poses).send(Budget::UNLIMITED).tick.units;
        // With this many units everything except splitting is done.
        let rest = whole.saturating_sub(MOST);
        for (sum, extra) in sums.iter_mut().zip([0, MOST / 8, MOST / 4, MOST / 2, MOST]) {
            let units = if extra == 0 { 0 } else { rest + extra };
            let out = Run::new(&things, &poses).send(Budget::units(units));
            assert!(out.tick.units <= units, "{} of {units}", out.tick.units);
            *sum += widest(&out, &things);
        }
    }
    // In the end the radius of eight spheres that cover a disc no longer decreases.
    assert!(sums.is_sorted_by(|x, y| 1.01 * x >= *y), "{sums:?}");
    assert!(sums[1] < 0.7 * sums[0], "{sums:?}");
}

#[test]
fn of_a_budget_that_does_not_reach_for_the_verdict_an_eighth_goes_to_regions() {
    let (mut cut, mut whole) = (0.0, 0.0);
    for case in 0..CASES / 8 {
        let mut rng = Rng::new(70_000 + case);
        let ball = || {
            let ball = Part::Mesh(meshes::bumpy_sphere(20, 24, 0.1));
            Thing::new(vec![(ball, Vec3::zeros())])
        };
        let things = [ball(), ball()];
        let away = Pose::translation(rng.range(1.5, 1.9), rng.range(0.0, 0.3), 0.1);
        let poses = [Pose::identity(), away];
        let radius = |units| {
            widest(
                &Run::new(&things, &poses).send(Budget::units(units)),
                &things,
            )
        };
        // An eighth of 7 units is 0, so that nothing is split.
        (cut, whole) = (cut + radius(7), whole + radius(64));
    }
    assert!(whole < 0.9 * cut, "{whole} against {cut}");
}

#[test]
fn a_pair_at_rest_keeps_what_splitting_has_made_when_there_is_no_budget_left() {
    let (things, poses) = on_a_floor();
    let mut run = Run::new(&things, &poses);
    let fine = run.send(Budget::UNLIMITED).regions;
    let out = run.send(Budget::units(0));
    assert_eq!((out.regions, out.tick.units), (fine.clone(), 0));
    // Everything is done: no further units are spent.
    let out = run.send(Budget::UNLIMITED);
    assert_eq!((out.regions, out.tick.units), (fine, 0));
}
