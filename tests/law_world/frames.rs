//! Frames that wait, are refused or are lost, and pauses after them.

use sweepd::ids::SourceSlot;
use sweepd::wire::{BodyStatus, Frame, RejectReason, TransformRow, frame_flags};
use sweepd::world::{Admission, Edit, Put};

use crate::support::{Bench, MS, TIMEOUT_NS, admitted, fixed, frame, moving, row};

const WAITING: Admission = Admission::Waiting {
    source: SourceSlot(0),
};

/// Runs a tick `after_ns` later with one frame of `sim`, changed by `change`.
fn send(
    bench: &mut Bench,
    after_ns: u64,
    (seq, rows): (u64, &[TransformRow]),
    change: impl FnOnce(&mut Frame),
) -> Admission {
    let now_ns = bench.now_ns + after_ns;
    let mut frame = frame("sim", seq, now_ns, rows);
    change(&mut frame);
    bench.tick_at(now_ns, &[], &[frame])[0]
}

fn pause(bench: &mut Bench, after_ns: u64, seq: u64) -> Admission {
    send(bench, after_ns, (seq, &[]), |f| {
        f.header.flags = frame_flags::PAUSED
    })
}

fn partial(scene_rev: u64) -> impl FnOnce(&mut Frame) {
    move |f| {
        f.header.flags = frame_flags::PARTIAL;
        f.header.scene_rev = scene_rev;
    }
}

/// Brings the scene to its next revision.
fn revise(bench: &mut Bench, name: &str) {
    bench.edit(Edit::Put(Put {
        body: std::sync::Arc::new(fixed(name, 0, 99.0)),
        shapes: crate::support::cube(),
    }));
}

fn x(bench: &Bench, name: &str) -> f64 {
    bench.body(name).pose.translation.vector.x
}

#[test]
fn bug_a_pause_threw_away_the_poses_that_waited_and_renewed_those_before_them() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    assert_eq!(
        send(&mut bench, MS, (2, &[row(1, 3.0)]), |f| f
            .header
            .scene_rev = 2),
        WAITING
    );
    for seq in 3..6 {
        assert_eq!(pause(&mut bench, 100 * MS, seq), admitted(0, 0, 0));
    }
    assert_eq!(bench.world.sources()[0].to_row(bench.now_ns).skipped, 0);
    revise(&mut bench, "wall");
    assert_eq!(
        (x(&bench, "a"), bench.status("a")),
        (3.0, BodyStatus::Known)
    );
    // The published row keeps the last sequence number.
    assert_eq!(bench.world.sources()[0].to_row(bench.now_ns).seq, 5);
    // From here on pauses renew these poses.
    for seq in 6..16 {
        pause(&mut bench, 200 * MS, seq);
        assert_eq!(bench.status("a"), BodyStatus::Known);
    }
}

#[test]
fn bug_a_pause_renewed_poses_that_newer_ones_had_followed_which_were_never_taken() {
    let lost = |_: &mut Bench| {};
    let refused = |bench: &mut Bench| {
        let wrong = |f: &mut Frame| f.velocities.resize(2, [0.0; 6]);
        send(bench, MS, (2, &[row(1, 3.0)]), wrong);
        assert_eq!(bench.rejects(RejectReason::BadLayout), 1);
    };
    let old = |bench: &mut Bench| {
        let of_the_past = |f: &mut Frame| (f.waited, f.header.sent_ns) = (true, 0);
        send(bench, MS, (2, &[row(1, 3.0)]), of_the_past);
        assert_eq!(bench.rejects(RejectReason::TooOld), 1);
    };
    let in_vain = |bench: &mut Bench| {
        send(bench, MS, (2, &[row(1, 3.0)]), |f| f.header.scene_rev = 9);
        pause(bench, 400 * MS, 3);
        bench.wait(100 * MS);
        assert_eq!(bench.rejects(RejectReason::SceneRevision), 1);
    };
    let ways: [fn(&mut Bench); 4] = [lost, refused, old, in_vain];
    for (nth, way) in ways.into_iter().enumerate() {
        let mut bench = Bench::of(vec![moving("a", 1)]);
        bench.send(MS, "sim", 1, &[row(1, 0.0)]);
        let since_ns = bench.now_ns;
        way(&mut bench);
        for seq in 4..8 {
            assert_eq!(pause(&mut bench, 100 * MS, seq), admitted(0, 0, 0));
        }
        bench.wait((since_ns + TIMEOUT_NS).saturating_sub(bench.now_ns));
        assert_eq!(bench.status("a"), BodyStatus::Stale, "{nth}");
        assert!(bench.world.sources()[0].alive());
        // The next pose frame ends this.
        bench.send(MS, "sim", 8, &[row(1, 4.0)]);
        for seq in 9..12 {
            pause(&mut bench, 400 * MS, seq);
            assert_eq!(bench.status("a"), BodyStatus::Known, "{nth}");
        }
    }
}

#[test]
fn bug_a_frame_was_refused_before_its_time_out_with_the_one_before_it() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    send(&mut bench, MS, (1, &[row(1, 1.0)]), partial(9));
    for (seq, own) in [(2, row(2, 2.0)), (3, row(1, 3.0))] {
        send(&mut bench, 200 * MS, (seq, &[own]), partial(2));
    }
    bench.wait(TIMEOUT_NS - 400 * MS);
    assert_eq!(bench.rejects(RejectReason::SceneRevision), 1);
    bench.wait(200 * MS);
    assert_eq!(bench.rejects(RejectReason::SceneRevision), 2);
    revise(&mut bench, "wall");
    assert_eq!(
        (x(&bench, "a"), bench.status("b")),
        (3.0, BodyStatus::NotReceived)
    );
}

/// The lost frames are older than the poses applied last, or newer.
#[test]
fn a_pause_speaks_of_poses_that_waited_unless_newer_ones_were_lost() {
    for (lost_before, lost_after) in [(false, false), (true, false), (false, true), (true, true)] {
        let mut bench = Bench::of(vec![moving("a", 1)]);
        bench.send(MS, "sim", 1, &[row(1, 0.0)]);
        let seq = 2 + u64::from(lost_before);
        let later = |f: &mut Frame| f.header.scene_rev = 2;
        assert_eq!(send(&mut bench, MS, (seq, &[row(1, 3.0)]), later), WAITING);
        let first = seq + 1 + u64::from(lost_after);
        pause(&mut bench, MS, first);
        revise(&mut bench, "wall");
        assert_eq!(x(&bench, "a"), 3.0);
        for seq in first + 1..first + 6 {
            // A pause needs no scene revision, whatever its header says.
            send(&mut bench, 200 * MS, (seq, &[]), |f| {
                f.header.flags = frame_flags::PAUSED;
                f.header.scene_rev = 77;
            });
        }
        let known = bench.status("a") == BodyStatus::Known;
        assert_eq!(known, !lost_after, "{lost_before}");
    }
}

#[test]
fn bug_a_frame_that_is_too_old_threw_away_what_waited() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    let later = |f: &mut Frame| f.header.scene_rev = 2;
    assert_eq!(send(&mut bench, MS, (1, &[row(1, 3.0)]), later), WAITING);
    let of_the_past = |f: &mut Frame| (f.waited, f.header.sent_ns) = (true, 0);
    send(&mut bench, MS, (2, &[row(1, 4.0)]), of_the_past);
    revise(&mut bench, "wall");
    assert_eq!(x(&bench, "a"), 3.0);
    // The sender has sent other poses since.
    let since_ns = bench.now_ns;
    for seq in 3..6 {
        pause(&mut bench, 100 * MS, seq);
    }
    bench.wait(since_ns + TIMEOUT_NS - bench.now_ns);
    assert_eq!(bench.status("a"), BodyStatus::Stale);
}

#[test]
fn bug_a_partial_frame_that_waited_was_passed_over_for_the_next() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0), row(2, 9.0)]);
    assert_eq!(
        send(&mut bench, MS, (2, &[row(1, 1.0)]), partial(2)),
        WAITING
    );
    // They queue behind the waiting frame regardless of their own revisions: the newest pose of a body must be applied
    // last.
    for (seq, own, rev) in [
        (3, row(2, 8.0), 0),
        (4, row(1, 2.0), 2),
        (5, row(2, 7.0), 3),
    ] {
        assert_eq!(send(&mut bench, MS, (seq, &[own]), partial(rev)), WAITING);
    }
    assert_eq!((x(&bench, "a"), x(&bench, "b")), (0.0, 9.0));
    revise(&mut bench, "wall");
    assert_eq!((x(&bench, "a"), x(&bench, "b")), (2.0, 8.0));
    assert_eq!(bench.world.sources()[0].to_row(bench.now_ns).seq, 4);
    // The last frame waits with its own timeout.
    bench.wait(TIMEOUT_NS - 2 * MS);
    assert_eq!(bench.rejects(RejectReason::SceneRevision), 0);
    revise(&mut bench, "other");
    assert_eq!(x(&bench, "b"), 7.0);
    let told = bench.world.sources()[0].to_row(bench.now_ns);
    assert_eq!((told.skipped, told.refused, told.seq), (0, 0, 5));
}

#[test]
fn a_full_frame_stands_for_all_that_wait_and_one_that_needs_what_a_reset_makes_is_after_it() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    for seq in 1..4 {
        send(&mut bench, MS, (seq, &[row(1, 1.0)]), partial(2));
    }
    bench.send(MS, "sim", 4, &[row(1, 5.0), row(2, 9.0)]);
    assert_eq!(x(&bench, "a"), 5.0);
    assert_eq!(bench.world.sources()[0].to_row(bench.now_ns).skipped, 3);
    for source in [None, Some("sim".to_owned())] {
        let seq = bench.world.sources()[0].to_row(bench.now_ns).seq + 1;
        bench.send(MS, "sim", seq, &[row(1, 5.0), row(2, 9.0)]);
        let later = bench.world.scene_rev() + 1;
        let rows = [row(1, 1.0)];
        assert_eq!(
            send(&mut bench, MS, (seq + 1, &rows), partial(later)),
            WAITING
        );
        bench.edit(Edit::Reset { source });
        assert_eq!(bench.world.scene_rev(), later);
        assert_eq!(
            (x(&bench, "a"), bench.status("a")),
            (1.0, BodyStatus::Known)
        );
        assert_eq!(bench.status("b"), BodyStatus::NotReceived);
        bench.send(MS, "sim", seq + 2, &[row(1, 5.0), row(2, 9.0)]);
    }
}

#[test]
fn a_body_that_is_lost_and_comes_back_lost_in_one_tick_is_whole() {
    let mut bench = Bench::of(vec![moving("a", 1)]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    let now_ns = bench.now_ns + 900 * MS;
    let refused = frame("sim", 2, now_ns, &[row(1, f64::NAN)]);
    let mut old = frame("sim", 1, now_ns, &[row(1, 0.0)]);
    old.header.epoch = 1;
    old.header.sent_ns = now_ns - 600 * MS;
    bench.tick_at(now_ns, &[], &[refused, old]);
    assert_eq!(bench.status("a"), BodyStatus::Stale);
    bench.wait(MS);
}

#[test]
fn of_too_many_that_wait_the_oldest_go() {
    let mut bench = Bench::of(vec![moving("a", 1), moving("b", 2)]);
    send(&mut bench, 0, (1, &[row(1, 1.0)]), partial(2));
    for seq in 2..=1024 + 7 {
        let rows = [row(2, seq as f64)];
        assert_eq!(send(&mut bench, 0, (seq, &rows), partial(2)), WAITING);
    }
    revise(&mut bench, "wall");
    assert_eq!(bench.status("a"), BodyStatus::NotReceived);
    assert_eq!(x(&bench, "b"), 1031.0);
    assert_eq!(bench.world.sources()[0].to_row(bench.now_ns).skipped, 7);
}

#[test]
fn bug_a_pause_renewed_the_pose_of_a_body_that_another_had_put_there() {
    let robots = sweepd::scene::BodySpec {
        source: Some(1),
        ..moving("b", 2)
    };
    let mut bench = Bench::of(vec![moving("a", 1), robots]);
    bench.send(MS, "sim", 1, &[row(1, 0.0)]);
    bench.send(MS, "robot", 1, &[row(2, 5.0)]);
    let to = |to: Option<&str>| Edit::Attach {
        name: "a".to_owned(),
        to: to.map(str::to_owned),
        pose: None,
    };
    bench.edit(to(Some("b")));
    bench.send(MS, "robot", 2, &[row(2, 9.0)]);
    bench.edit(to(None));
    assert_eq!(
        (x(&bench, "a"), bench.status("a")),
        (4.0, BodyStatus::Known)
    );
    let since_ns = bench.now_ns;
    for seq in 2..6 {
        pause(&mut bench, 100 * MS, seq);
    }
    bench.wait(since_ns + TIMEOUT_NS - bench.now_ns);
    assert_eq!(bench.status("a"), BodyStatus::Stale);
}
