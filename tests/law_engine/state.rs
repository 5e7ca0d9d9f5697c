//! Laws 3.6, the state in one word, and 3.7, unknown bodies.

use sweepd::math::{Pose, Vec3};
use sweepd::wire::{BodyStatus, Demand, Reason, RejectReason, State, Verdict};
use sweepd::world::Edit;

use crate::rig::{ALL, FRAME_NS, NONE, Rig, ball, body, scene};

#[test]
fn law_3_6_the_first_that_applies_of_colliding_unknown_possible_near_clear() {
    let near = "report_within_m = 0.5";
    let mut rig = Rig::new(&scene(
        "",
        &[ball(1, 0.0, near), ball(2, 1.5, ""), ball(3, 50.0, "")],
    ));
    rig.idle(FRAME_NS, ALL);
    assert_eq!(rig.state(), State::Unknown);
    assert!(rig.because(Reason::NotReceived));
    let third = rig.rows.pop().unwrap();
    rig.send(ALL);
    assert_eq!(
        rig.state(),
        State::Colliding,
        "unknown bodies hide no collision"
    );
    assert!(rig.because(Reason::NotReceived));
    // Every message of the tick has the same state.
    for message in [
        &rig.out.pairs_header,
        &rig.out.changes_header.message,
        &rig.out.contacts_header,
        &rig.out.regions_header,
        &rig.out.bodies_header,
    ] {
        assert_eq!(message.state, State::Colliding.code());
    }
    rig.move_x(2, 9.0);
    rig.send(ALL);
    assert_eq!(rig.state(), State::Unknown);
    rig.rows.push(third);
    rig.move_x(2, 1.5);
    rig.send(NONE);
    assert_eq!(rig.state(), State::Possible);
    assert!(rig.because(Reason::Undecided));
    rig.move_x(2, 2.3);
    rig.send(ALL);
    assert_eq!(rig.state(), State::Near);
    rig.move_x(2, 2.6);
    rig.send(ALL);
    assert_eq!(rig.state(), State::Clear);
    assert_eq!(rig.out.tick.reasons, 0);
    for message in [
        &rig.out.pairs_header,
        &rig.out.contacts_header,
        &rig.out.bodies_header,
    ] {
        assert_eq!(message.state, State::Clear.code());
    }
}

#[test]
fn law_3_6_a_scene_without_bodies_is_not_clear() {
    let mut rig = Rig::new(&scene("", &[ball(1, 0.0, "")]));
    rig.edit(
        vec![Edit::Remove {
            name: "b1".to_owned(),
        }],
        ALL,
    );
    assert_eq!(rig.state(), State::Unknown);
    assert!(rig.because(Reason::NoInput));
}

#[test]
fn law_3_6_held_and_removed_bodies_are_not_clear() {
    for (how, reason) in [
        ("hold", Reason::Held),
        ("remove", Reason::RemovedByAge),
        ("unknown", Reason::Stale),
    ] {
        let more = format!("on_stale = \"{how}\"");
        let mut rig = Rig::new(&scene("", &[ball(1, 0.0, &more), ball(2, 9.0, &more)]));
        rig.send(ALL);
        assert_eq!(rig.state(), State::Clear);
        rig.idle(499_000_000, ALL);
        assert_eq!(rig.state(), State::Clear);
        rig.idle(2_000_000, ALL);
        assert_eq!(rig.state(), State::Unknown, "{how}");
        assert!(rig.because(reason), "{how}");
        rig.send(ALL);
        assert_eq!(rig.state(), State::Clear, "{how}");
    }
}

#[test]
fn law_3_7_a_pair_that_was_proved_apart_is_possible_once_a_body_of_it_is_stale() {
    // The boxes overlap, the balls do not; nothing moves when the timeout expires.
    let ball = |id, at| body(id, at, "{ type = \"sphere\", radius = 1.0 }", "");
    let mut bodies = vec![ball(1, [0.0; 3]), ball(2, [1.5; 3])];
    // Enough other bodies that two changed bodies are few.
    bodies.extend((3..40).map(|id| ball(id, [10.0 * id as f64, 0.0, 0.0])));
    let mut rig = Rig::new(&scene("", &bodies));
    rig.send(ALL);
    assert_eq!(rig.out.tick.candidates, 1);
    assert_eq!(rig.state(), State::Clear);
    // Only the other bodies are sent from here on.
    rig.rows.retain(|row| row.body > 2);
    for _ in 0..60 {
        rig.send(ALL);
    }
    assert_eq!(rig.verdict(1, 2), Verdict::Possible);
    assert_eq!(rig.state(), State::Unknown);
    assert_eq!(rig.out.body_verdicts[..3], [3, 3, 1]);
}

#[test]
fn law_3_7_the_reaches_of_two_stale_bodies_that_approach_add() {
    // The gap is 1 m. When the poses become stale each body can have moved 0.6 m, both together 1.2 m.
    for (speeds, possible) in [((1.2, 1.2), true), ((1.2, 0.1), false), ((0.9, 0.9), false)] {
        let more = |speed: f64| format!("max_speed_mps = {speed}");
        let bodies = [ball(1, 0.0, &more(speeds.0)), ball(2, 3.0, &more(speeds.1))];
        let mut rig = Rig::new(&scene("", &bodies));
        rig.send(ALL);
        rig.idle(490_000_000, ALL);
        assert_eq!(rig.verdict(1, 2), Verdict::Apart);
        rig.idle(20_000_000, ALL);
        let verdict = rig.verdict(1, 2);
        assert_eq!(verdict == Verdict::Possible, possible, "{speeds:?}");
        assert_eq!(rig.state(), State::Unknown);
        assert!(rig.because(Reason::Stale));
        // The reach grows while the silence lasts.
        rig.idle(140_000_000, ALL);
        let far = (speeds.0 + speeds.1) * 0.65 >= 1.0;
        assert_eq!(rig.verdict(1, 2) == Verdict::Possible, far, "{speeds:?}");
    }
}

#[test]
fn law_3_7_a_stale_pair_with_overlapping_boxes_widens_with_its_reach() {
    let ball = |id, at| {
        body(
            id,
            at,
            "{ type = \"sphere\", radius = 1.0 }",
            "max_speed_mps = 0.5",
        )
    };
    // The gap is 0.6 m, and the boxes overlap.
    let mut rig = Rig::new(&scene("", &[ball(1, [0.0; 3]), ball(2, [1.5, 1.5, 1.5])]));
    rig.send(ALL);
    assert_eq!(rig.out.tick.candidates, 1);
    rig.idle(510_000_000, ALL);
    assert_eq!(
        rig.verdict(1, 2),
        Verdict::Apart,
        "0.51 m of reach for 0.6 m of gap"
    );
    rig.idle(150_000_000, ALL);
    assert_eq!(
        rig.verdict(1, 2),
        Verdict::Possible,
        "0.66 m of reach for 0.6 m of gap"
    );
}

/// The published bound was the one that the verdict had needed, and the whole reach widened it again in each tick.
#[test]
fn bug_a_stale_mesh_was_possible_beyond_its_reach_and_its_interval_grew_from_tick_to_tick() {
    let cube = "{ type = \"trimesh\", vertices = [[-0.2, -0.2, -0.2], [0.2, -0.2, -0.2], [-0.2, 0.2, -0.2], \
                [0.2, 0.2, -0.2], [-0.2, -0.2, 0.2], [0.2, -0.2, 0.2], [-0.2, 0.2, 0.2], [0.2, 0.2, 0.2]], \
                faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], \
                [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]] }";
    let sphere = "{ type = \"sphere\", radius = 0.1 }";
    let several = format!("[{cube}, {sphere}]");
    let compound = body(1, [0.0; 3], &several, "max_speed_mps = 1.0");
    let single = body(1, [0.0; 3], cube, "max_speed_mps = 1.0");
    let plane = "{ type = \"half_space\", normal = [-1, 0, 0], offset = 0 }";
    for (first, is_plane, x) in [
        (&single, false, 0.6),
        (&single, false, 0.9),
        (&compound, false, 0.6),
        (&compound, false, 0.9),
        (&single, true, 0.6),
        (&single, true, 0.9),
    ] {
        let shape = if is_plane { plane } else { sphere };
        let second = body(2, [0.0; 3], shape, "max_speed_mps = 0.0");
        let mut rig = Rig::new(&scene("", &[first.clone(), second]));
        let turn =
            nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_4);
        rig.place(
            1,
            &Pose::from_parts(nalgebra::Translation3::identity(), turn),
        );
        rig.place(2, &Pose::translation(x, -0.3, 0.0));
        // A demand for contacts would compute the gap anyway.
        rig.demand = Demand {
            pairs: true,
            ..Demand::default()
        };
        rig.send(ALL);
        let seen = turn.inverse() * Vec3::new(x, -0.3, 0.0);
        let gap_m = if is_plane {
            x - 0.2 * std::f64::consts::SQRT_2
        } else {
            seen.abs().add_scalar(-0.2).map(|out| out.max(0.0)).norm() - 0.1
        };
        // A reach of a metre or more is no bound.
        for age in 1..100 {
            rig.idle(FRAME_NS, ALL);
            let reach_m = if age < 50 { 0.0 } else { f64::from(age) * 0.01 };
            let place = format!("{x}, age {age}: {:?}", rig.out.pairs);
            assert_eq!(
                rig.verdict(1, 2) == Verdict::Possible,
                reach_m >= gap_m,
                "{place}"
            );
            // The interval is as wide as the reach makes it, plus what the verdict left open if nothing else decides
            // it.
            let loose_m = if gap_m > 0.5 { 1e-8 } else { 0.5 };
            for row in &rig.out.pairs {
                assert!(row.gap_min_m >= gap_m - reach_m - loose_m, "{place}");
                assert!(row.gap_max_m <= gap_m + reach_m + 4.0 * loose_m, "{place}");
            }
        }
    }
}

#[test]
fn law_3_7_nan_from_an_exploded_solver_is_unknown_until_good_poses_come() {
    let mut rig = Rig::new(&scene(
        "",
        &[ball(1, 0.0, ""), ball(2, 1.5, ""), ball(3, 9.0, "")],
    ));
    rig.send(ALL);
    let good = *rig.row(2);
    rig.row(2).position = [f64::NAN; 3];
    rig.send(ALL);
    assert_eq!(rig.state(), State::Unknown);
    assert!(rig.because(Reason::Rejected));
    assert_eq!(rig.verdict(1, 2), Verdict::Possible);
    let shown = rig.out.bodies[1];
    assert_eq!(shown.status, BodyStatus::Rejected.code());
    assert_eq!(shown.position, good.position, "the last good pose is kept");
    assert_eq!(rig.out.body_verdicts, [3, 3, 1]);
    assert!(
        rig.out
            .pairs
            .iter()
            .all(|row| !row.gap_min_m.is_nan() && !row.gap_max_m.is_nan())
    );
    *rig.row(2) = good;
    rig.move_x(2, 2.5);
    rig.send(ALL);
    assert_eq!(rig.state(), State::Clear);
    assert_eq!(rig.verdict(1, 2), Verdict::Apart);
}

#[test]
fn law_4_2_after_a_new_epoch_a_partial_frame_makes_known_only_what_it_names() {
    let mut rig = Rig::new(&scene(
        "",
        &[ball(1, 0.0, ""), ball(2, 1.5, ""), ball(3, 9.0, "")],
    ));
    rig.send(ALL);
    assert_eq!(rig.state(), State::Colliding);
    rig.epoch = 2;
    rig.flags = sweepd::wire::frame_flags::PARTIAL;
    let all = rig.rows.clone();
    rig.rows.truncate(1);
    rig.send(ALL);
    assert_eq!(rig.state(), State::Unknown);
    assert!(rig.because(Reason::NotReceived));
    assert_eq!(rig.out.tick.unknown, 2);
    let row = rig.pair(1, 2).unwrap();
    assert_eq!(row.end_cause, sweepd::wire::EndCause::Reset.code());
    rig.rows = all;
    rig.send(ALL);
    assert_eq!(rig.state(), State::Colliding);
}

#[test]
fn budget_zero_is_sound_and_never_clear_while_boxes_overlap() {
    let mut rig = Rig::new(&scene("", &[ball(1, 0.0, ""), ball(2, 1.5, "")]));
    for _ in 0..5 {
        rig.send(NONE);
        assert_eq!(rig.state(), State::Possible);
        assert_eq!(rig.out.tick.units, 0);
    }
    assert_eq!(rig.out.tick.oldest_undecided_ticks, 5);
    rig.move_x(2, 2.5);
    rig.send(NONE);
    assert_eq!(rig.state(), State::Clear, "boxes alone prove it");
}

#[test]
fn law_4_2_bug_a_client_that_follows_one_that_has_just_gone_loses_no_frame() {
    let mut rig = Rig::new(&scene("", &[ball(1, 0.0, ""), ball(2, 9.0, "")]));
    rig.send(ALL);
    // The end of the old session and the first frame of the next one arrive in one tick.
    (rig.session, rig.ended) = (12, vec![11]);
    rig.move_x(2, 1.5);
    rig.send(ALL);
    assert_eq!(rig.rejects(RejectReason::SourceTaken), 0);
    assert_eq!(rig.out.tick.sources[0].session, 12);
    assert_eq!(rig.state(), State::Colliding);
    // While a session is active no other replaces it, and an ended session does not come back.
    (rig.session, rig.ended) = (13, vec![11]);
    rig.send(ALL);
    assert_eq!(rig.rejects(RejectReason::SourceTaken), 1);
    rig.session = 11;
    rig.send(ALL);
    assert_eq!(rig.rejects(RejectReason::SessionOver), 1);
}

#[test]
fn law_6_bug_the_row_of_a_new_session_has_no_number_of_the_one_before() {
    let mut rig = Rig::new(&scene("", &[ball(1, 0.0, ""), ball(2, 9.0, "")]));
    for _ in 0..5 {
        rig.send(ALL);
    }
    // The first frame of the next session waits for a scene revision.
    (rig.session, rig.ended, rig.scene_rev) = (12, vec![11], 99);
    rig.send(ALL);
    let row = rig.out.tick.sources[0];
    assert_eq!((row.session, row.epoch, row.seq, row.alive), (12, 0, 0, 0));
    assert_eq!(row.age_ns, u64::MAX);
    assert_eq!(rig.state(), State::Unknown);
}
