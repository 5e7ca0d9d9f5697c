//! Which bodies count as known.

use sweepd::config::OnStale;
use sweepd::math::Pose;
use sweepd::scene::BodySpec;
use sweepd::wire::{BodyStatus, EndCause, Reason, RejectReason, TransformRow};

use crate::support::{Bench, MS, TIMEOUT_NS, admitted, fixed, frame, moving, row, scene};

#[test]
fn law_3_7_a_start_pose_is_never_evidence() {
    let bench = Bench::of(vec![moving("a", 1), fixed("wall", 2, 3.0)]);
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
    assert!(!bench.body("a").in_broad);
    assert_eq!(bench.status("wall"), BodyStatus::Known);
    assert!(bench.inserted("wall") && !bench.inserted("a"));
    let counts = bench.world.counts();
    assert_eq!((counts.bodies, counts.unknown), (2, 1));
    assert!(bench.has_reason(Reason::NotReceived) && bench.has_reason(Reason::NoInput));
}

#[test]
fn law_3_7_the_first_admitted_pose_makes_a_body_known() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    assert_eq!(bench.send(MS, "sim", 1, &[row(1, 2.0)]), admitted(0, 1, 0));
    assert_eq!(bench.status("a"), BodyStatus::Known);
    assert!(bench.inserted("a"));
    assert_eq!(bench.body("a").pose.translation.vector.x, 2.0);
    let proxy = bench.body("a").proxy;
    assert!(proxy.min.x <= 1.5 && proxy.max.x >= 2.5 && proxy.max.x < 2.5 + 1e-9);
    assert_eq!(bench.world.counts().reasons, 0);
}

#[test]
fn law_3_7_nan_from_an_exploded_solver_makes_its_body_unknown_and_keeps_the_last_good_pose() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0), row(2, 5.0)]);
    let bad = TransformRow {
        position: [f64::NAN, 0.0, 0.0],
        ..row(1, 0.0)
    };
    // The valid row of the other body is still applied.
    assert_eq!(
        bench.send(MS, "sim", 2, &[bad, row(2, 6.0)]),
        admitted(0, 1, 1)
    );
    assert_eq!(bench.status("a"), BodyStatus::Rejected);
    assert_eq!(bench.body("a").reject, Some(RejectReason::NotFinite));
    assert_eq!(bench.body("a").pose.translation.vector.x, 0.0);
    assert_eq!(bench.body("b").pose.translation.vector.x, 6.0);
    assert_eq!(bench.rejects(RejectReason::NotFinite), 1);
    assert!(bench.has_reason(Reason::Rejected));
    assert!(bench.world.filters().keeps(bench.slot("a")));
    // The next valid pose makes the body known, even if it equals the last valid one.
    bench.send(MS, "sim", 3, &[row(1, 0.0), row(2, 6.0)]);
    assert_eq!(bench.status("a"), BodyStatus::Known);
    assert!(bench.world.changes().requery.contains(&bench.slot("a")));
    assert!(!bench.world.filters().keeps(bench.slot("a")));
}

#[test]
fn law_3_7_a_body_whose_first_pose_is_refused_has_no_place_at_all() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    let bad = TransformRow {
        orientation: [0.0; 4],
        ..row(1, 0.0)
    };
    bench.send(MS, "sim", 1, &[bad]);
    assert_eq!(bench.status("a"), BodyStatus::Rejected);
    assert!(!bench.body("a").in_broad);
}

#[test]
fn law_3_11_quaternions_off_by_more_than_a_hundredth_are_refused_others_normalised() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    let with = |w: f64| TransformRow {
        orientation: [0.0, 0.0, 0.0, w],
        ..row(1, 0.0)
    };
    for (seq, w, good) in [
        (1, 0.0, false),
        (2, 1.011, false),
        (3, 0.989, false),
        (4, 1e200, false),
        (5, f64::INFINITY, false),
        (6, 1.009, true),
        (7, -0.991, true),
    ] {
        bench.send(MS, "sim", seq, &[with(w)]);
        let known = bench.status("a") == BodyStatus::Known;
        assert_eq!(known, good, "{w}");
    }
    assert!((bench.body("a").pose.rotation.norm() - 1.0).abs() < 1e-15);
    assert_eq!(bench.rejects(RejectReason::BadQuaternion), 4);
    assert_eq!(bench.rejects(RejectReason::NotFinite), 1);
}

#[test]
fn law_3_7_two_poses_of_one_body_in_one_frame_make_it_unknown() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0), row(2, 5.0)]);
    let twice = [row(1, 1.0), row(2, 5.0), row(1, 2.0)];
    assert_eq!(bench.send(MS, "sim", 2, &twice), admitted(0, 1, 2));
    assert_eq!(bench.status("a"), BodyStatus::Rejected);
    // Neither of the duplicate rows is applied.
    assert_eq!(bench.body("a").pose.translation.vector.x, 0.0);
    assert_eq!(bench.rejects(RejectReason::Duplicate), 2);
    assert_eq!(bench.status("b"), BodyStatus::Known);
}

#[test]
fn law_3_7_a_stale_body_reaches_as_far_as_its_speed_and_age_say() {
    let fast = BodySpec {
        max_speed_mps: Some(0.5),
        ..moving("a", 1)
    };
    let mut bench = Bench::of(vec![fast]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    bench.wait(TIMEOUT_NS - MS);
    assert_eq!(bench.status("a"), BodyStatus::Known);
    assert_eq!(bench.body("a").reach_m, 0.0);
    bench.wait(MS);
    assert_eq!(bench.status("a"), BodyStatus::Stale);
    let reach_m = bench.body("a").reach_m;
    assert!((0.25..0.2501).contains(&reach_m), "{reach_m}");
    assert!(bench.body("a").proxy.max.x >= 0.75);
    assert!(bench.world.changes().moved.contains(&bench.slot("a")));
    assert!(bench.world.changes().restated.contains(&bench.slot("a")));
    assert!(bench.has_reason(Reason::Stale));
    // The reach grows with every tick up to `stale_reach_m` (1 m); beyond it the body may be anywhere.
    bench.wait(1000 * MS);
    let reach_m = bench.body("a").reach_m;
    assert!((0.75..0.7501).contains(&reach_m), "{reach_m}");
    assert!(!bench.world.filters().keeps(bench.slot("a")));
    bench.wait(1000 * MS);
    assert_eq!(bench.body("a").reach_m, f64::INFINITY);
    assert!(bench.world.filters().keeps(bench.slot("a")));
    assert!(bench.body("a").proxy.max.x < 2.0, "its box stays finite");
    bench.send(MS, "sim", 2, &[row(1, 0.0)]);
    assert_eq!(bench.body("a").reach_m, 0.0);
    assert!(bench.body("a").proxy.max.x < 0.5 + 1e-9);
    assert!(bench.world.changes().requery.contains(&bench.slot("a")));
}

#[test]
fn law_3_7_the_reaches_of_two_stale_bodies_that_approach_add() {
    let fast = |name, id| BodySpec {
        max_speed_mps: Some(1.0),
        ..moving(name, id)
    };
    let mut bench = Bench::of(vec![fast("a", 1), fast("b", 2)]);
    // The gap is 1 m. After 0.55 s each body may be 0.55 m nearer: one alone does not close the gap, both together do.
    bench.send(MS, "sim", 1, &[row(1, 0.0), row(2, 2.0)]);
    assert!(!bench.body("a").proxy.overlaps(&bench.body("b").proxy));
    bench.wait(550 * MS);
    let (a, b) = (bench.body("a"), bench.body("b"));
    assert!(a.reach_m < 1.0 && a.reach_m + b.reach_m >= 1.0);
    assert!(a.proxy.overlaps(&b.proxy));
}

#[test]
fn law_3_7_on_stale_hold_keeps_the_pose_and_says_so() {
    let held = BodySpec {
        on_stale: Some(OnStale::Hold),
        ..moving("a", 1)
    };
    let mut bench = Bench::of(vec![held]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    bench.wait(TIMEOUT_NS);
    assert_eq!(bench.status("a"), BodyStatus::Held);
    assert_eq!(
        (bench.body("a").reach_m, bench.body("a").in_broad),
        (0.0, true)
    );
    assert!(bench.has_reason(Reason::Held));
}

#[test]
fn law_3_7_on_stale_remove_takes_it_out_and_the_next_good_pose_brings_it_back() {
    let lost = BodySpec {
        on_stale: Some(OnStale::Remove),
        ..moving("a", 1)
    };
    let mut bench = Bench::of(vec![lost]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    bench.wait(TIMEOUT_NS);
    assert_eq!(bench.status("a"), BodyStatus::RemovedByAge);
    assert_eq!(bench.removed("a"), Some(EndCause::SourceLost));
    assert!(bench.has_reason(Reason::RemovedByAge));
    bench.send(MS, "sim", 2, &[row(1, 0.0)]);
    assert_eq!(bench.status("a"), BodyStatus::Known);
    assert!(bench.inserted("a"));
}

#[test]
fn law_3_7_on_stale_of_a_source_counts_for_its_bodies_that_do_not_say_it_themselves() {
    let own = BodySpec {
        on_stale: Some(OnStale::Unknown),
        ..moving("own", 2)
    };
    let other = BodySpec {
        source: Some(1),
        ..moving("other", 3)
    };
    let hung = BodySpec {
        attached_to: Some("a".to_owned()),
        ..moving("hung", 4)
    };
    let mut scene = scene(vec![moving("a", 1), own, other, hung], Vec::new());
    scene.sources[0].on_stale = OnStale::Hold;
    let mut bench = Bench::with(&scene);
    bench.send(MS, "sim", 1, &[row(1, 0.0), row(2, 5.0)]);
    bench.send(MS, "robot", 1, &[row(3, 10.0)]);
    bench.wait(TIMEOUT_NS);
    let all = ["a", "own", "other", "hung"].map(|name| bench.status(name));
    let (held, stale) = (BodyStatus::Held, BodyStatus::Stale);
    assert_eq!(all, [held, stale, stale, held]);
}

#[test]
fn law_3_8_a_suspended_machine_has_old_data() {
    let mut bench = Bench::of(vec![moving("a", 1), fixed("wall", 2, 3.0)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    bench.wait(3_600_000 * MS);
    assert_eq!(bench.status("a"), BodyStatus::Stale);
    assert_eq!(bench.status("wall"), BodyStatus::Known);
    assert!(!bench.world.sources()[0].alive());
}

#[test]
fn law_3_8_age_counts_from_sending_and_never_later_than_receipt() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    let now_ns = bench.now_ns + 1000 * MS;
    // Sent 499 ms before it is received.
    let old = frame("sim", 1, now_ns - 499 * MS, &[row(1, 0.0)]);
    let old = sweepd::wire::Frame {
        received_ns: now_ns,
        ..old
    };
    bench.tick_at(now_ns, &[], &[old]);
    assert_eq!(bench.status("a"), BodyStatus::Known);
    assert_eq!(bench.world.next_timeout(), Some(now_ns + MS));
    bench.wait(MS);
    assert_eq!(bench.status("a"), BodyStatus::Stale);
    // A stamp in the future does not extend the age limit.
    let now_ns = bench.now_ns + MS;
    let mut ahead = frame("sim", 2, now_ns, &[row(2, 0.0)]);
    ahead.header.sent_ns = now_ns + 10_000 * MS;
    bench.tick_at(now_ns, &[], &[ahead]);
    bench.wait(TIMEOUT_NS);
    assert_eq!(bench.status("b"), BodyStatus::Stale);
}

#[test]
fn law_3_8_rows_of_a_frame_may_have_ages_of_their_own() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    let now_ns = bench.now_ns + 1000 * MS;
    let mut mixed = frame("sim", 1, now_ns, &[row(1, 0.0), row(2, 5.0)]);
    mixed.since_ns = vec![now_ns - 499 * MS, now_ns + 10_000 * MS];
    bench.tick_at(now_ns, &[], &[mixed]);
    assert_eq!(bench.body("a").since_ns, Some(now_ns - 499 * MS));
    assert_eq!(
        bench.body("b").since_ns,
        Some(now_ns),
        "the future buys no time"
    );
    assert_eq!(bench.world.next_timeout(), Some(now_ns + MS));
    bench.wait(MS);
    assert_eq!(bench.status("a"), BodyStatus::Stale);
    assert_eq!(bench.status("b"), BodyStatus::Known);
}

#[test]
fn law_3_8_frames_that_waited_without_sent_ns_make_nothing_known() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    let now_ns = bench.now_ns + MS;
    let mut waited = frame("sim", 1, now_ns, &[row(1, 0.0)]);
    waited.waited = true;
    waited.header.sent_ns = 0;
    bench.tick_at(now_ns, &[], &[waited.clone()]);
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
    assert_eq!(bench.rejects(RejectReason::TooOld), 1);
    // A frame with a send time may have waited.
    waited.header.seq = 2;
    waited.header.sent_ns = now_ns;
    bench.tick_at(now_ns, &[], &[waited]);
    assert_eq!(bench.status("a"), BodyStatus::Known);
}

#[test]
fn a_body_that_does_not_move_costs_no_entry_in_any_list() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    bench.send(MS, "sim", 1, &[row(1, 0.5)]);
    bench.send(MS, "sim", 2, &[row(1, 0.5)]);
    let changes = bench.world.changes();
    assert!(changes.moved.is_empty() && changes.restated.is_empty());
    assert_eq!(bench.body("a").since_ns, Some(bench.now_ns));
    bench.send(MS, "sim", 3, &[row(1, 0.75)]);
    assert_eq!(bench.world.changes().moved, [bench.slot("a")]);
    assert_eq!(
        bench.body("a").motion.anchor,
        Pose::translation(0.5, 0.0, 0.0)
    );
    assert!(bench.body("a").motion.spent_m() >= 0.25);
}

#[test]
fn bug_a_time_out_that_was_set_and_the_ages_of_before_did_not_agree() {
    let gone = BodySpec {
        on_stale: Some(OnStale::Remove),
        ..moving("b", 2)
    };
    let mut bench = Bench::of(vec![moving("a", 1), gone]);
    bench.send(MS, "sim", 1, &[row(1, 0.0), row(2, 3.0)]);
    bench.wait(100 * MS);
    bench.world.set_timeout(0, 50 * MS);
    // Until the next tick all statuses stay as published.
    bench.world.validate().unwrap();
    assert_eq!(bench.status("a"), BodyStatus::Known);
    // The next tick applies the new timeout to earlier poses, but only after it has received its frames.
    let now_ns = bench.now_ns + MS;
    let mut some = frame("sim", 2, now_ns, &[row(2, 3.0)]);
    some.header.flags = sweepd::wire::frame_flags::PARTIAL;
    bench.tick_at(now_ns, &[], &[some]);
    assert_eq!(bench.status("a"), BodyStatus::Stale);
    assert_eq!(bench.status("b"), BodyStatus::Known);
    assert_eq!(bench.removed("b"), None);
    assert_eq!(bench.world.next_timeout(), Some(now_ns + 50 * MS));
    // With a longer timeout the body is known again, at its age.
    bench.world.set_timeout(0, TIMEOUT_NS);
    bench.wait(60 * MS);
    assert_eq!(bench.status("a"), BodyStatus::Known);
    assert_eq!(bench.status("b"), BodyStatus::Known);
}
