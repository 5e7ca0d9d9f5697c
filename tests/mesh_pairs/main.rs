//! Goal: walks over mesh pairs give sound intervals at every interruption and end with the right verdict (laws 1, 3.2,
//! 3.3). Method: random small meshes at random, nearly touching, deep, contained and far poses, compared with the
//! brute-force oracle of `tests/oracle`; thousands of pairs in release, hundreds in debug builds.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::cast_precision_loss,
    missing_docs,
    missing_debug_implementations,
    unreachable_pub,
    reason = "a test may; its helpers are nobody's interface"
)]

#[path = "../oracle/mod.rs"]
mod oracle;

mod apart;
mod contacts;
mod deep;
mod extremes;
mod fronts;
mod half_space;
mod holes;
mod in_line;
mod laws;
mod odd;
mod profile;
mod public_cases;
mod support;

use oracle::meshes;
use oracle::rng::Rng;
use support::{CASES, KINDS, any_convex, any_mesh, convex, place, placed, run, shape, sweep, way};
use sweepd::math::{Point, Pose, Vec3};
use sweepd::narrow::mesh::{Goal, Walk};
use sweepd::shape::Convex;
use sweepd::time::{ManualClock, Meter};

#[test]
fn law_1_generic_mesh_pairs_hold_the_truth_at_every_interruption() {
    sweep(1_000_000, 0, Goal::Gap);
}

#[test]
fn law_1_deep_mesh_pairs_hold_the_truth_at_every_interruption() {
    sweep(2_000_000, 1, Goal::Gap);
}

#[test]
fn law_1_nearly_touching_mesh_pairs_hold_the_truth_at_every_interruption() {
    sweep(3_000_000, 2, Goal::Gap);
}

#[test]
fn law_3_4_verdicts_of_nearly_touching_mesh_pairs_are_right() {
    sweep(4_000_000, 2, Goal::Verdict);
}

#[test]
fn law_3_4_verdicts_of_deep_mesh_pairs_are_right_when_contacts_are_wanted() {
    sweep(5_000_000, 1, Goal::Contacts);
}

#[test]
fn law_1_meshes_and_convex_shapes_hold_the_truth_at_every_interruption() {
    for case in 0..CASES * 3 {
        let mut rng = Rng::new(6_000_000 + case);
        let kind = rng.below(KINDS);
        let ((mesh, name_a), (other, name_b)) = (any_mesh(&mut rng, kind), any_convex(&mut rng));
        let (pose_a, pose_b) = place(&mut rng, &mesh, &other, way(case));
        let goal = [Goal::Verdict, Goal::Gap, Goal::Contacts][rng.below(3)];
        let what = format!("seed {} {name_a} - {name_b}", 6_000_000 + case);
        if rng.below(2) == 0 {
            run(&mesh, &other, &pose_a, &pose_b, goal, &what);
        } else {
            run(&other, &mesh, &pose_b, &pose_a, goal, &what);
        }
    }
}

#[test]
fn a_ball_is_its_centre_less_its_radius() {
    for case in 0..CASES {
        let mut rng = Rng::new(7_000_000 + case);
        let kind = rng.below(KINDS);
        let (mesh, name) = any_mesh(&mut rng, kind);
        let radius = rng.range(0.01, 0.5);
        let ball = convex(Convex::sphere(radius));
        let pose = Pose::from_parts(rng.vector(1.5).into(), rng.rotation());
        let about = placed(&mesh, &Pose::identity(), &Vec3::zeros());
        let centre = Point::from(pose.translation.vector);
        let held = about.holds(&centre);
        let apart = about.distance_from(&centre) - radius;
        let clock = ManualClock::new(0);
        let mut meter = Meter::unlimited(&clock);
        let mut walk = Walk::default();
        walk.start(&mesh, &ball, &pose);
        assert!(walk.advance(&mesh, &ball, Goal::Gap, u64::MAX, &mut meter));
        let end = walk.interval();
        if held || apart < 0.0 {
            assert!(end.max <= 1e-13 && end.min < 0.0, "{name} {end:?}");
            // The depth of a centre below the surface is its distance from it; the depth of the ball is at least this.
            assert!(!held || end.min <= -about.distance_from(&centre) + 1e-12);
        } else {
            assert!(end.widened(1e-11).contains(apart), "{name} {end:?} {apart}");
            assert!(end.width() < 1e-9);
        }
    }
}

#[test]
fn a_closed_meter_stops_the_walk_at_once_and_it_resumes_where_it_was() {
    let a = shape(&meshes::bumpy_sphere(12, 14, 0.1), None);
    let b = shape(&meshes::torus(1.0, 0.3, 12, 8), None);
    let pose = Pose::new(Vec3::new(2.3, 0.1, 0.2), Vec3::new(0.3, 0.2, 0.1));
    let clock = ManualClock::new(0);
    let mut whole = Walk::default();
    let mut meter = Meter::unlimited(&clock);
    whole.start(&a, &b, &pose);
    assert!(whole.advance(&a, &b, Goal::Gap, u64::MAX, &mut meter));
    let units = meter.spent();

    let mut sliced = Walk::default();
    sliced.start(&a, &b, &pose);
    let mut spent = 0;
    loop {
        // It exceeds the limit by at most one unit: the second of two node tests.
        let mut meter = Meter::new(&clock, None, Some(7));
        let done = sliced.advance(&a, &b, Goal::Gap, u64::MAX, &mut meter);
        assert!(meter.spent() <= 8);
        spent += meter.spent();
        if done {
            break;
        }
    }
    assert_eq!(spent, units);
    assert_eq!(sliced.interval(), whole.interval());

    let mut closed = Meter::new(&clock, None, Some(0));
    let mut walk = Walk::default();
    walk.start(&a, &b, &pose);
    assert!(!walk.advance(&a, &b, Goal::Verdict, u64::MAX, &mut closed));
    assert_eq!(closed.spent(), 0);
    assert!(walk.interval().max.is_finite());
}

#[test]
fn a_deadline_stops_the_walk_within_one_leaf_query() {
    let a = shape(&meshes::bumpy_sphere(12, 14, 0.1), None);
    let pose = Pose::new(Vec3::new(2.4, 0.1, 0.2), Vec3::new(0.3, 0.2, 0.1));
    for deadline_ns in [1, 50, 150] {
        let clock = ManualClock::new(0);
        // Every clock read takes 10 ns, so that one late read is 10 ns late.
        clock.step_each_read(10);
        let mut meter = Meter::new(&clock, Some(deadline_ns), None);
        let mut walk = Walk::default();
        walk.start(&a, &a, &pose);
        assert!(!walk.advance(&a, &a, Goal::Gap, u64::MAX, &mut meter));
        assert!(!meter.open());
        let late = sweepd::time::Clock::monotonic_ns(&clock).saturating_sub(deadline_ns);
        assert!(late <= 20, "{late} ns late");
        // The interval is sound at the interruption, and the walk can continue.
        assert!(walk.interval().min <= walk.interval().max);
        let mut meter = Meter::unlimited(&clock);
        assert!(walk.advance(&a, &a, Goal::Gap, u64::MAX, &mut meter));
    }
}
