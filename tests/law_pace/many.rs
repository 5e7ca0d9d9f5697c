//! Law 4.4: when many frames wait, none is dropped if it has information that no later frame contains.

use std::sync::Arc;

use sweepd::limits::FRAMES_WAITING_MAX;
use sweepd::scene::Scene;
use sweepd::wire::{BodyStatus, Frame, Reason, RejectReason, TransformRow, frame_flags};
use sweepd::world::{Body, Edit, Put};

use crate::support::{MS, TIMEOUT_NS, cube, frame, moving, row};
use crate::{Daemon, Tick, modes, ns, on_sim, robot, sim, two_bodies};

/// A scene with two bodies, `b` and `c` (ids 2 and 5), of the robot.
fn three() -> Scene {
    let mut scene = two_bodies(on_sim());
    let mut more = moving("c", 5);
    more.source = Some(1);
    scene.bodies.push(more);
    scene
}

fn partial(seq: u64, rows: &[TransformRow]) -> Frame {
    let mut frame = frame("robot", seq, 0, rows);
    frame.header.flags = frame_flags::PARTIAL;
    frame
}

fn pause(seq: u64) -> Frame {
    let mut frame = frame("robot", seq, 0, &[]);
    frame.header.flags = frame_flags::PAUSED;
    frame
}

fn body<'a>(daemon: &'a Daemon, name: &str) -> &'a Body {
    let slot = daemon.world.slot_named(name).unwrap();
    daemon.world.body(slot).unwrap()
}

fn x_of(daemon: &Daemon, name: &str) -> f64 {
    body(daemon, name).pose.translation.x
}

/// Puts a continuous body that the robot moves, while the daemon runs.
fn put_bullet(daemon: &mut Daemon) {
    let mut bullet = moving("bullet", 4);
    (bullet.source, bullet.continuous) = (Some(1), true);
    daemon.edits.push(Edit::Put(Put {
        body: Arc::new(bullet),
        shapes: cube(),
    }));
    daemon.run(3.0, Vec::new());
    for source in 0..2 {
        assert_eq!(daemon.world.is_followed(source), source == 1);
    }
}

#[test]
fn law_4_4_bug_a_partial_frame_of_a_source_that_does_not_lead_was_dropped_with_poses_no_later_one_has()
 {
    let mut daemon = Daemon::of_scene(&three());
    daemon.run(2.0, vec![(1.0, robot(1)), (1.0, sim(1))]);
    let slow = partial(2, &[row(2, 7.0), row(5, 8.0)]);
    let mut frames = vec![(10.0, slow)];
    frames.extend((0..100).map(|k| (11.0 + k as f64, partial(3 + k, &[row(5, 20.0 + k as f64)]))));
    frames.push((112.0, sim(2)));
    daemon.run(115.0, frames);
    assert_eq!((x_of(&daemon, "b"), x_of(&daemon, "c")), (7.0, 119.0));
    // Each body has its own stamps and age, and folded frames are counted.
    assert_eq!(body(&daemon, "b").since_ns, Some(ns(10.0)));
    assert_eq!(body(&daemon, "c").since_ns, Some(ns(110.0)));
    assert!(daemon.passed_of(1) >= 36);
    assert_eq!(daemon.world.rejects().iter().sum::<u64>(), 0);
    let timeout_ms = TIMEOUT_NS as f64 / MS as f64;
    let sim_goes_on = (1..60).map(|k| (115.0 + 10.0 * k as f64, sim(2 + k)));
    let frames = sim_goes_on.chain([(400.0, partial(103, &[row(5, 1.0)]))]);
    daemon.run(12.0 + timeout_ms, frames.collect());
    assert_eq!(body(&daemon, "b").status, BodyStatus::Stale);
    assert_eq!(body(&daemon, "c").status, BodyStatus::Known);
}

#[test]
fn law_4_3_bug_a_pause_behind_a_folded_frame_renewed_what_was_folded_into_it() {
    let mut daemon = Daemon::of_scene(&three());
    daemon.run(2.0, vec![(1.0, robot(1)), (1.0, sim(1))]);
    let mut frames = vec![(10.0, partial(2, &[row(2, 7.0)]))];
    for k in 0..100_u64 {
        let at_ms = 11.0 + k as f64;
        frames.push((at_ms, pause(3 + 2 * k)));
        frames.push((at_ms + 0.5, partial(4 + 2 * k, &[row(5, 20.0 + k as f64)])));
    }
    frames.push((112.0, sim(2)));
    daemon.run(115.0, frames);
    assert_eq!((x_of(&daemon, "b"), x_of(&daemon, "c")), (7.0, 119.0));
    // The pause at 11 ms is the last that covers `b`.
    assert!(body(&daemon, "b").since_ns <= Some(ns(11.0)));
    assert!(body(&daemon, "c").since_ns >= Some(ns(110.0)));
}

#[test]
fn law_4_4_bug_folded_frames_say_what_each_of_them_said() {
    let with_speeds = |mut frame: Frame, speed: f64| {
        let speeds = frame.transforms.iter().map(|_| [speed; 6]);
        frame.velocities = speeds.collect();
        frame
    };
    for (slow_speaks, fast_speaks) in [(true, true), (true, false), (false, true)] {
        let mut daemon = Daemon::of_scene(&three());
        daemon.run(2.0, vec![(1.0, sim(1))]);
        let say = |frame, speaks: bool| {
            if speaks {
                with_speeds(frame, 2.0)
            } else {
                frame
            }
        };
        // The oldest frame is a full one; rows that the transport could not decode stay refused unless a newer pose
        // comes.
        let mut whole = frame("robot", 1, 0, &[row(2, 7.0)]);
        whole.refused_bodies = vec![(2, RejectReason::BadChain), (5, RejectReason::BadChain)];
        let mut frames = vec![(10.0, say(whole, slow_speaks))];
        let fast = |k: u64| say(partial(2 + k, &[row(5, 20.0 + k as f64)]), fast_speaks);
        frames.extend((0..100).map(|k| (11.0 + k as f64, fast(k))));
        frames.push((112.0, sim(2)));
        daemon.run(115.0, frames);
        assert_eq!((x_of(&daemon, "b"), x_of(&daemon, "c")), (7.0, 119.0));
        assert_eq!(body(&daemon, "b").status, BodyStatus::Rejected);
        let of_b = daemon.world.rejects()[usize::from(RejectReason::BadChain.code())];
        assert!(of_b <= 2, "each once: {of_b}");
        assert_eq!(body(&daemon, "c").status, BodyStatus::Known);
        assert_eq!(body(&daemon, "c").velocity.is_some(), fast_speaks);
        let both = slow_speaks && fast_speaks;
        assert_eq!(body(&daemon, "b").velocity.is_some(), both);
    }
}

#[test]
fn law_1_no_frame_of_a_source_that_moves_a_continuous_body_is_passed_over() {
    for mode in modes() {
        let mut daemon = Daemon::of(mode.clone());
        // The robot is not the lead, so it makes no tick by its frames.
        put_bullet(&mut daemon);
        let frames = (1..=200).map(|seq| (4.0 + 0.05 * seq as f64, robot(seq)));
        let frames = frames.chain([(15.0, sim(1))]).collect();
        let ticks = daemon.run(200.0, frames);
        let of_robot = |t: &Tick| {
            let frames = t.frames.iter().filter(|(name, _)| name == "robot");
            frames.map(|(_, seq)| *seq).collect::<Vec<u64>>()
        };
        let taken: Vec<u64> = ticks.iter().flat_map(of_robot).collect();
        assert_eq!(taken, (1..=200).collect::<Vec<u64>>(), "{mode:?}");
        assert_eq!(daemon.passed_of(1), 0, "{mode:?}");
    }
}

#[test]
fn law_1_bug_a_way_that_was_cut_for_want_of_room_was_told_as_clear() {
    let mut daemon = Daemon::of(on_sim());
    let mut unsent = moving("unsent", 6);
    (unsent.source, unsent.continuous) = (Some(1), true);
    daemon.edits.push(Edit::Put(Put {
        body: Arc::new(unsent),
        shapes: cube(),
    }));
    put_bullet(&mut daemon);
    let at = |seq: u64, x: f64| frame("robot", seq, 0, &[row(2, 5.0), row(4, x)]);
    daemon.run(6.0, vec![(4.0, at(1, 0.0)), (5.0, sim(1))]);
    let cut = Reason::Truncated.bit();
    assert_eq!(daemon.world.counts().reasons & cut, 0);
    let bullet = daemon.world.slot_named("bullet").unwrap();
    let is_blurred = |daemon: &Daemon| {
        let path = daemon.world.body(bullet).unwrap().path.as_ref().unwrap();
        path.is_blurred() && daemon.world.travelled() == [bullet]
    };
    assert!(!is_blurred(&daemon));
    // Pauses take no place in the queue; a frame too many does, and the path is blurred.
    let many = FRAMES_WAITING_MAX as u64;
    let mut frames: Vec<_> = (2..=many + 2)
        .map(|seq| (7.0, at(seq, seq as f64)))
        .collect();
    frames.extend([
        (8.0, pause(many + 3)),
        (8.0, pause(many + 4)),
        (9.0, sim(2)),
    ]);
    daemon.run(10.0, frames);
    assert_eq!(x_of(&daemon, "bullet"), (many + 2) as f64);
    assert_eq!(daemon.passed_of(1), 3, "the oldest two, and a pause");
    assert!(is_blurred(&daemon));
    assert_eq!(daemon.world.counts().reasons & cut, cut);
    assert_eq!(body(&daemon, "bullet").status, BodyStatus::Known);
    let unsent = body(&daemon, "unsent");
    assert!(!unsent.in_broad, "a start pose is no evidence");
    // Reported once: the next path is complete.
    daemon.run(12.0, vec![(11.0, at(many + 5, 0.0)), (11.5, sim(3))]);
    assert!(!is_blurred(&daemon));
    assert_eq!(daemon.world.counts().reasons & cut, 0);
}

#[test]
fn law_1_bug_a_cut_way_behind_which_only_pauses_wait_is_open_until_the_next_pose() {
    let mut daemon = Daemon::of(on_sim());
    put_bullet(&mut daemon);
    let bullet = |seq: u64, x: f64| frame("robot", seq, 0, &[row(2, 5.0), row(4, x)]);
    let mut frame = pause(2);
    frame.cut = true;
    let frames = vec![
        (4.0, bullet(1, 0.0)),
        (5.0, sim(1)),
        (6.0, frame),
        (7.0, sim(2)),
    ];
    daemon.run(8.0, frames);
    assert_eq!(daemon.world.counts().reasons & Reason::Truncated.bit(), 0);
    daemon.run(11.0, vec![(9.0, bullet(3, 4.0)), (10.0, sim(3))]);
    assert_ne!(daemon.world.counts().reasons & Reason::Truncated.bit(), 0);
}

#[test]
fn law_4_3_bug_pauses_that_were_dropped_for_want_of_room_made_the_next_one_renew_nothing() {
    for followed in [false, true] {
        let mut daemon = Daemon::of(on_sim());
        if followed {
            put_bullet(&mut daemon);
        }
        let all = |seq| frame("robot", seq, 0, &[row(2, 5.0), row(4, 0.0)]);
        let first = if followed { all(1) } else { robot(1) };
        daemon.run(8.0, vec![(6.0, first), (7.0, sim(1))]);
        // The lead is silent for a while, but not for a whole timeout.
        let pauses = (0..200).map(|k| (10.0 + 2.0 * k as f64, pause(2 + k)));
        daemon.run(452.0, pauses.chain([(451.0, sim(2))]).collect());
        assert_eq!(body(&daemon, "b").since_ns, Some(ns(408.0)));
        assert_eq!(daemon.passed_of(1), 199);
        let more = (0..60).flat_map(|k| {
            let at_ms = 460.0 + 10.0 * k as f64;
            [(at_ms, pause(202 + k)), (at_ms + 1.0, sim(3 + k))]
        });
        daemon.run(1055.0, more.collect());
        assert_eq!(body(&daemon, "b").status, BodyStatus::Known);
        // After a lost frame a pause does not renew the poses that the lost frame may have held.
        daemon.run(1060.0, vec![(1056.0, pause(263)), (1057.0, sim(63))]);
        let since_ns = body(&daemon, "b").since_ns;
        assert_eq!(since_ns, Some(ns(1050.0)));
    }
}

#[test]
fn law_4_2_a_stranger_that_floods_costs_who_speaks_no_room() {
    let mut daemon = Daemon::of(on_sim());
    put_bullet(&mut daemon);
    daemon.run(6.0, vec![(4.0, robot(1)), (5.0, sim(1))]);
    let mut frames: Vec<_> = (2..=100).map(|seq| (7.0, robot(seq))).collect();
    frames.extend((1..=100).map(|seq| {
        let mut frame = robot(seq);
        frame.header.session = 77;
        (7.5, frame)
    }));
    frames.push((8.0, sim(2)));
    daemon.run(9.0, frames);
    let source = &daemon.world.sources()[1];
    assert_eq!((source.session, source.frames()), (1, 100));
    assert_eq!(daemon.passed_of(1), 36, "of the stranger's");
}
