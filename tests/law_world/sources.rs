//! Sources, sessions, epochs and frames.

use sweepd::ids::SourceSlot;
use sweepd::scene::BodySpec;
use sweepd::wire::{
    BodyStatus, EndCause, Frame, RejectReason, TransformRow, VertexFrame, VertexHeader,
    WIRE_VERSION, frame_flags, name_bytes, vertex_flags,
};
use sweepd::world::{Admission, Edit, Put};

use crate::support::{Bench, MS, TIMEOUT_NS, admitted, fixed, frame, moving, refused, row};

fn of_session(session: u64, frame: Frame) -> Frame {
    let mut frame = frame;
    frame.header.session = session;
    frame
}

/// Sends a frame of source `sim`, received just now and changed by `change`.
fn send_with(bench: &mut Bench, after_ns: u64, change: impl FnOnce(&mut Frame)) -> Admission {
    let now_ns = bench.now_ns + after_ns;
    let mut frame = frame("sim", 1, now_ns, &[row(1, 0.0)]);
    change(&mut frame);
    bench.tick_at(now_ns, &[], &[frame])[0]
}

#[test]
fn law_4_1_a_frame_that_does_not_fit_is_refused_as_a_whole_and_counted() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    let mut wrong = |change: &dyn Fn(&mut Frame)| {
        let admission = send_with(&mut bench, MS, |frame| change(frame));
        let Admission::Refused { reason, .. } = admission else {
            panic!("admitted");
        };
        reason
    };
    let bad = RejectReason::BadLayout;
    assert_eq!(wrong(&|f| f.header.schema = 99), bad);
    assert_eq!(wrong(&|f| f.header.session = 0), bad);
    assert_eq!(wrong(&|f| f.header.source = [0xff; 32]), bad);
    assert_eq!(wrong(&|f| f.header.flags = 0), bad);
    assert_eq!(wrong(&|f| f.header.flags = 3), bad);
    assert_eq!(wrong(&|f| f.header.flags = frame_flags::PAUSED), bad);
    assert_eq!(wrong(&|f| f.velocities.resize(2, [0.0; 6])), bad);
    let left_behind = |f: &mut Frame| f.refused = Some(RejectReason::OverLimit);
    assert_eq!(wrong(&left_behind), RejectReason::OverLimit);
    let nobody = |f: &mut Frame| f.header.source = name_bytes("nobody");
    assert_eq!(wrong(&nobody), RejectReason::UnknownSource);
    assert_eq!(bench.rejects(bad), 7);
    // A refused frame counts for the source that it names.
    assert_eq!(bench.world.sources()[0].to_row(0).refused, 7);
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
    // Refused frames do not affect a valid one, and none of them opened a session.
    assert_eq!(send_with(&mut bench, MS, |_| {}), admitted(0, 1, 0));
    assert_eq!(bench.world.sources()[0].session, 1);
}

#[test]
fn bug_ids_of_another_run_of_the_daemon_moved_other_bodies() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    bench.world.set_boot(0x1_0000_0007);
    let of_boot = |boot: u32| move |f: &mut Frame| f.header.boot = boot;
    let over = refused(0, RejectReason::SessionOver);
    assert_eq!(send_with(&mut bench, MS, of_boot(8)), over);
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
    // It ends no session: the client may continue with the new names. A frame without a boot id is accepted.
    assert_eq!(send_with(&mut bench, MS, of_boot(7)), admitted(0, 1, 0));
    assert_eq!(
        send_with(&mut bench, MS, |f| {
            f.header.seq = 2;
            f.header.boot = 0;
        }),
        admitted(0, 1, 0)
    );
}

#[test]
fn law_4_2_two_clients_of_one_source_the_second_is_refused_and_counted() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    for k in 0..5 {
        // Both sessions send; only the poses of the owner apply.
        bench.send(MS, "sim", 2 + k, &[row(1, 1.0)]);
        let second = of_session(2, frame("sim", 100 + k, bench.now_ns, &[row(1, 9.0)]));
        let admission = bench.tick_at(bench.now_ns, &[], &[second])[0];
        assert_eq!(admission, refused(0, RejectReason::SourceTaken));
    }
    assert_eq!(bench.rejects(RejectReason::SourceTaken), 5);
    assert_eq!(bench.world.sources()[0].to_row(bench.now_ns).refused, 5);
    assert_eq!(bench.body("a").pose.translation.vector.x, 1.0);
    assert_eq!(bench.status("a"), BodyStatus::Known);
}

#[test]
fn law_4_2_a_stopped_owner_loses_its_source_and_is_refused_for_this_boot() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    bench.send(MS, "sim", 50, &[row(1, 0.0), row(2, 5.0)]);
    // The owner is stopped (SIGSTOP). Just before its timeout another session is refused; at the timeout it is
    // accepted.
    let now_ns = bench.now_ns + TIMEOUT_NS - MS;
    let early = of_session(2, frame("sim", 1, now_ns, &[row(1, 1.0)]));
    assert_eq!(
        bench.tick_at(now_ns, &[], &[early])[0],
        refused(0, RejectReason::SourceTaken)
    );
    let now_ns = now_ns + MS;
    // The restarted client numbers its frames from 1 again.
    let next = of_session(2, frame("sim", 1, now_ns, &[row(1, 1.0)]));
    assert_eq!(bench.tick_at(now_ns, &[], &[next])[0], admitted(0, 1, 0));
    // All pairs of the source's bodies end, and bodies that the new session has not sent are unknown.
    assert_eq!(bench.removed("a"), Some(EndCause::Reset));
    assert_eq!(bench.removed("b"), Some(EndCause::Reset));
    assert!(bench.inserted("a") && !bench.inserted("b"));
    assert_eq!(bench.status("b"), BodyStatus::NotReceived);
    // The owner continues (SIGCONT): its frames are refused, even long after the new owner has gone.
    for after_ns in [MS, 10 * TIMEOUT_NS] {
        let old = bench.send(after_ns, "sim", 51, &[row(1, 7.0)]);
        assert_eq!(old, refused(0, RejectReason::SessionOver));
    }
    assert_eq!(bench.body("a").pose.translation.vector.x, 1.0);
    assert_eq!(bench.status("a"), BodyStatus::Stale);
}

#[test]
fn law_4_2_a_dead_node_frees_its_source_at_once() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    bench.send(MS, "sim", 7, &[row(1, 0.0)]);
    bench.world.end_session(1);
    // The end of the session alone does not affect its bodies; they age.
    bench.wait(MS);
    assert_eq!(bench.status("a"), BodyStatus::Known);
    let next = of_session(2, frame("sim", 1, bench.now_ns, &[row(1, 1.0)]));
    let now_ns = bench.now_ns;
    assert_eq!(bench.tick_at(now_ns, &[], &[next])[0], admitted(0, 1, 0));
    assert_eq!(bench.removed("a"), Some(EndCause::Reset));
    let ghost = bench.send(MS, "sim", 8, &[row(1, 0.0)]);
    assert_eq!(ghost, refused(0, RejectReason::SessionOver));
    // The end of a session that is not in force changes nothing.
    bench.world.end_session(1);
    assert_eq!(bench.world.sources()[0].session, 2);
    bench.world.end_session(2);
    assert_eq!(bench.world.sources()[0].session, 0);
}

#[test]
fn law_4_2_frames_from_the_past_are_refused() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    bench.send(MS, "sim", 5, &[row(1, 1.0)]);
    for seq in [5, 4, 0] {
        let old = bench.send(MS, "sim", seq, &[row(1, 9.0)]);
        assert_eq!(old, refused(0, RejectReason::OldFrame));
    }
    assert_eq!(bench.body("a").pose.translation.vector.x, 1.0);
    assert_eq!(bench.rejects(RejectReason::OldFrame), 3);
    // Missing frames are allowed.
    assert_eq!(bench.send(MS, "sim", 9, &[row(1, 2.0)]), admitted(0, 1, 0));
}

#[test]
fn law_4_2_a_raised_epoch_ends_the_pairs_and_forgets_the_poses() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2), fixed("wall", 3, 9.0)]);
    bench.send(MS, "sim", 5, &[row(1, 0.0), row(2, 5.0)]);
    let raised = |f: &mut Frame| f.header.epoch = 1;
    // A new epoch with a partial frame: bodies that it does not contain stay not received.
    let admission = send_with(&mut bench, MS, |f| {
        raised(f);
        f.header.flags = frame_flags::PARTIAL;
    });
    assert_eq!(admission, admitted(0, 1, 0));
    assert_eq!(bench.removed("a"), Some(EndCause::Reset));
    assert_eq!(bench.removed("b"), Some(EndCause::Reset));
    assert_eq!(bench.removed("wall"), None);
    assert_eq!(bench.status("a"), BodyStatus::Known);
    for _ in 0..20 {
        bench.wait(MS);
        assert_eq!(bench.status("b"), BodyStatus::NotReceived);
        assert!(!bench.body("b").in_broad);
    }
    // Frames of the old epoch are refused, however high their numbers.
    let old = bench.send(MS, "sim", 1000, &[row(1, 1.0)]);
    assert_eq!(old, refused(0, RejectReason::OldFrame));
}

#[test]
fn law_4_2_a_new_epoch_whose_first_frame_is_useless_still_forgets_the_poses() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    let admission = send_with(&mut bench, MS, |f| {
        f.header.epoch = 1;
        f.header.sent_ns = 0;
        f.waited = true;
    });
    assert_eq!(admission, refused(0, RejectReason::TooOld));
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
}

#[test]
fn law_4_3_a_body_absent_from_its_own_full_frames_is_unknown_at_the_time_out() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0), row(2, 5.0)]);
    let last_ns = bench.now_ns;
    for seq in 2..60 {
        // Frames of its own source without it, and rows for it from another source, do not renew it.
        let now_ns = last_ns + (seq - 1) * 10 * MS;
        let own = frame("sim", seq, now_ns, &[row(1, 0.0)]);
        let other = frame("robot", seq, now_ns, &[row(2, 5.0)]);
        bench.tick_at(now_ns, &[], &[own, other]);
        let young = now_ns < last_ns + TIMEOUT_NS;
        assert_eq!(bench.status("b") == BodyStatus::Known, young, "{seq}");
        assert_eq!(bench.status("a"), BodyStatus::Known);
    }
    assert_eq!(bench.rejects(RejectReason::WrongSource), 58);
}

#[test]
fn law_4_3_a_body_sent_by_two_sources_belongs_to_its_own() {
    let mut robot = moving("b", 2);
    robot.source = Some(1);
    let mut bench = Bench::of(vec![moving("a", 1), robot]);
    let now_ns = bench.now_ns + MS;
    let frames = [
        frame("sim", 1, now_ns, &[row(1, 1.0), row(2, 7.0)]),
        frame("robot", 1, now_ns, &[row(1, 7.0), row(2, 2.0)]),
    ];
    let admissions = bench.tick_at(now_ns, &[], &frames);
    assert_eq!(admissions, [admitted(0, 1, 1), admitted(1, 1, 1)]);
    assert_eq!(bench.body("a").pose.translation.vector.x, 1.0);
    assert_eq!(bench.body("b").pose.translation.vector.x, 2.0);
    assert_eq!(bench.rejects(RejectReason::WrongSource), 2);
    assert_eq!(bench.world.counts().unknown, 0);
}

#[test]
fn law_4_3_a_paused_frame_renews_what_was_in_the_last_pose_frame_for_one_time_out() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0), row(2, 5.0)]);
    bench.send(100 * MS, "sim", 2, &[row(1, 0.0)]);
    let pause = |bench: &mut Bench, after_ns, seq| {
        send_with(bench, after_ns, |f| {
            f.header.flags = frame_flags::PAUSED;
            f.header.seq = seq;
            f.transforms.clear();
        })
    };
    assert_eq!(pause(&mut bench, 300 * MS, 3), admitted(0, 0, 0));
    assert_eq!(bench.world.sources()[0].to_row(bench.now_ns).paused, 1);
    // `b` was not in the last pose frame: its age counts from its own last pose.
    bench.wait(100 * MS);
    assert_eq!(bench.status("b"), BodyStatus::Stale);
    assert_eq!(bench.status("a"), BodyStatus::Known);
    bench.wait(TIMEOUT_NS - 100 * MS - 1);
    assert_eq!(bench.status("a"), BodyStatus::Known);
    bench.wait(1);
    assert_eq!(bench.status("a"), BodyStatus::Stale);
    // A pause renews poses, but does not make a rejected pose valid.
    let bad = TransformRow {
        position: [f64::NAN; 3],
        ..row(1, 0.0)
    };
    bench.send(MS, "sim", 4, &[bad]);
    pause(&mut bench, MS, 5);
    assert_eq!(bench.status("a"), BodyStatus::Rejected);
}

#[test]
fn law_4_3_a_frame_for_a_later_revision_waits_for_it() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    let later = |f: &mut Frame| f.header.scene_rev = 2;
    let waiting = Admission::Waiting {
        source: SourceSlot(0),
    };
    assert_eq!(send_with(&mut bench, MS, later), waiting);
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
    assert_eq!(bench.world.sources()[0].to_row(bench.now_ns).seq, 0);
    bench.wait(MS);
    bench.edit(Edit::Put(Put {
        body: std::sync::Arc::new(fixed("wall", 0, 9.0)),
        shapes: crate::support::cube(),
    }));
    assert_eq!(bench.world.scene_rev(), 2);
    assert_eq!(bench.status("a"), BodyStatus::Known);
    assert_eq!(bench.world.sources()[0].to_row(bench.now_ns).seq, 1);
}

#[test]
fn law_4_3_a_frame_for_a_revision_that_does_not_come_is_refused_after_one_time_out() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    send_with(&mut bench, MS, |f| f.header.scene_rev = 9);
    assert_eq!(bench.world.next_timeout(), Some(bench.now_ns + TIMEOUT_NS));
    bench.wait(TIMEOUT_NS - 1);
    assert_eq!(bench.rejects(RejectReason::SceneRevision), 0);
    bench.wait(1);
    assert_eq!(bench.rejects(RejectReason::SceneRevision), 1);
    assert_eq!(bench.world.next_timeout(), None);
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
}

#[test]
fn bug_a_stream_for_a_revision_that_does_not_come_is_refused_each_time_out() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    let mut waits = 0;
    // At 50 Hz for slightly more than two timeouts: far more frames than there are timeouts.
    for seq in 1..=52 {
        let now_ns = bench.now_ns + 20 * MS;
        let mut next = frame("sim", seq, now_ns, &[row(1, 0.0)]);
        next.header.scene_rev = 9 + seq;
        let admission = bench.tick_at(now_ns, &[], &[next])[0];
        waits += u64::from(matches!(admission, Admission::Waiting { .. }));
    }
    assert_eq!(waits, 52);
    assert_eq!(bench.rejects(RejectReason::SceneRevision), 2);
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
    // A frame of a new epoch starts a new wait.
    let now_ns = bench.now_ns + MS;
    let mut next = frame("sim", 1, now_ns, &[row(1, 0.0)]);
    next.header.epoch = 1;
    next.header.scene_rev = 9;
    bench.tick_at(now_ns, &[], &[next]);
    assert_eq!(bench.world.next_timeout(), Some(now_ns + TIMEOUT_NS));
}

#[test]
fn bug_a_pose_without_a_stamp_is_not_the_oldest() {
    let robots = BodySpec {
        source: Some(1),
        ..moving("b", 2)
    };
    let mut bench = Bench::of(vec![moving("a", 1), robots]);
    let now_ns = bench.now_ns + MS;
    let mut unstamped = frame("robot", 1, now_ns, &[row(2, 9.0)]);
    unstamped.header.stamp_ns = 0;
    bench.tick_at(now_ns, &[], std::slice::from_ref(&unstamped));
    assert_eq!(bench.world.stamps(), (0, 0));
    unstamped.header.seq = 2;
    let stamped = frame("sim", 1, now_ns, &[row(1, 0.0)]);
    bench.tick_at(now_ns, &[], &[unstamped, stamped]);
    assert_eq!(bench.world.stamps(), (now_ns, now_ns));
}

#[test]
fn law_4_3_a_newer_frame_ends_the_wait_of_an_older_one() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    send_with(&mut bench, MS, |f| f.header.scene_rev = 9);
    assert_eq!(bench.send(MS, "sim", 2, &[row(1, 3.0)]), admitted(0, 1, 0));
    assert_eq!(bench.world.sources()[0].to_row(bench.now_ns).skipped, 1);
    bench.wait(10 * TIMEOUT_NS);
    assert_eq!(bench.rejects(RejectReason::SceneRevision), 0);
}

#[test]
fn law_4_3_rows_that_name_no_body_or_one_that_cannot_move_are_counted_alone() {
    let mut bench = Bench::of(vec![moving("a", 1), fixed("wall", 2, 9.0)]);
    let rows = [row(77, 0.0), row(2, 0.0), row(1, 1.0), row(0, 0.0)];
    assert_eq!(bench.send(MS, "sim", 1, &rows), admitted(0, 1, 3));
    assert_eq!(bench.rejects(RejectReason::UnknownBody), 2);
    assert_eq!(bench.rejects(RejectReason::NotSteerable), 1);
    assert_eq!(bench.status("wall"), BodyStatus::Known);
    assert_eq!(bench.body("wall").pose.translation.vector.x, 9.0);
}

#[test]
fn law_4_3_coordinates_beyond_all_use_are_refused() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    bench.send(MS, "sim", 1, &[row(1, 1.1e12)]);
    assert_eq!(bench.status("a"), BodyStatus::Rejected);
    assert_eq!(bench.rejects(RejectReason::OverLimit), 1);
}

#[test]
fn law_4_8_stamps_are_carried_and_never_trusted() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0), row(2, 5.0)]);
    send_with(&mut bench, MS, |f| {
        f.header.seq = 2;
        f.header.stamp_ns = u64::MAX;
        f.header.clock_id = 7;
    });
    // A stamp far in the future does not slow down ageing.
    assert_eq!(bench.body("a").stamp_ns, u64::MAX);
    assert_eq!(bench.world.sources()[0].to_row(bench.now_ns).clock_id, 7);
    let (oldest_ns, newest_ns) = bench.world.stamps();
    assert_eq!(oldest_ns, bench.now_ns - MS);
    assert!(newest_ns > bench.now_ns);
    bench.wait(TIMEOUT_NS);
    assert_eq!(bench.status("a"), BodyStatus::Stale);
}

#[test]
fn rows_in_any_order_and_number_find_their_bodies() {
    let bodies = (1..=40).map(|id| moving(&format!("b{id}"), id)).collect();
    let mut bench = Bench::of(bodies);
    let mut seed = 7_u64;
    for seq in 1..200 {
        // A new selection and order each time, so that the guess of the slot by position is mostly wrong.
        let mut ids: Vec<u64> = (1..=40).collect();
        for at in (1..ids.len()).rev() {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            ids.swap(at, usize::try_from(seed >> 33).unwrap() % (at + 1));
        }
        ids.truncate(1 + usize::try_from(seed >> 40).unwrap() % 40);
        let rows: Vec<_> = ids.iter().map(|&id| row(id, (id * seq) as f64)).collect();
        let all = u64::try_from(rows.len()).unwrap();
        assert_eq!(bench.send(MS, "sim", seq, &rows), admitted(0, all, 0));
        for id in ids {
            let x = bench.body(&format!("b{id}")).pose.translation.vector.x;
            assert_eq!(x, (id * seq) as f64);
        }
    }
}

/// Vertices may be the first messages of a new epoch.
#[test]
fn bug_a_frame_that_waits_is_void_once_vertices_of_a_later_epoch_have_come() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    send_with(&mut bench, MS, |f| {
        f.header.scene_rev = 2;
        f.header.epoch = 1;
    });
    let mut vertices = VertexFrame {
        header: VertexHeader {
            session: 1,
            epoch: 2,
            body: 1,
            version: 1,
            source: name_bytes("sim"),
            flags: vertex_flags::FULL,
            schema: WIRE_VERSION,
            ..VertexHeader::default()
        },
        ..VertexFrame::default()
    };
    vertices.received_ns = bench.now_ns;
    bench.world.admit_vertices(&vertices, bench.now_ns);
    bench.edit(Edit::Put(Put {
        body: std::sync::Arc::new(fixed("wall", 0, 9.0)),
        shapes: crate::support::cube(),
    }));
    assert_eq!(bench.world.scene_rev(), 2);
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
    assert_eq!(bench.world.sources()[0].to_row(bench.now_ns).skipped, 1);
}
