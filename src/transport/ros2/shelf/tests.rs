//! Which frames and poses wait, which are dropped, and how drops are reported.

use super::*;
use crate::wire::name_bytes;

/// Seats of bodies with these ids.
fn seats(ids: &[u64]) -> Vec<Seat> {
    let seat = |&body| Seat {
        body,
        ..Seat::default()
    };
    ids.iter().map(seat).collect()
}

fn update(member: usize, x: f64, stamp_ns: u64) -> Update {
    let row = TransformRow {
        position: [x, 0.0, 0.0],
        ..TransformRow::default()
    };
    Update {
        member,
        result: Ok(row),
        velocity: None,
        stamp_ns,
        received_ns: 100 - stamp_ns,
        since_ns: 90,
        waited: false,
    }
}

#[test]
fn poses_of_a_source_go_out_as_one_partial_frame_with_the_newest_of_each_body() {
    let shelf = Shelf::default();
    shelf.add_group(name_bytes("tf"), 9, seats(&[11, 12, 13]));
    shelf.merge(0, &[update(2, 1.0, 5), update(0, 1.0, 6)]);
    let refused = Update {
        result: Err(RejectReason::BadChain),
        ..update(1, 0.0, 0)
    };
    shelf.merge(0, &[update(2, 2.0, 7), refused]);
    let mut inbox = Inbox::default();
    shelf.drain(&mut inbox);
    let frame = &inbox.frames()[0];
    let rows: Vec<_> = frame
        .transforms
        .iter()
        .map(|row| (row.body, row.position[0]))
        .collect();
    assert_eq!(rows, [(13, 2.0), (11, 1.0)]);
    assert_eq!(frame.stamps_ns, [7, 6]);
    assert_eq!(frame.refused_bodies, [(12, RejectReason::BadChain)]);
    assert_eq!(
        (frame.received_ns, frame.header.sent_ns, frame.header.flags),
        (93, 90, frame_flags::PARTIAL)
    );
    inbox.clear();
    shelf.drain(&mut inbox);
    assert!(inbox.is_empty());
}

#[test]
fn a_flood_of_one_source_keeps_its_newest_frames_and_spares_the_others() {
    let shelf = Shelf::default();
    let frame = |source: &str, seq| {
        let mut frame = shelf.spare();
        frame.header.source = name_bytes(source);
        frame.header.seq = seq;
        frame
    };
    shelf.put(Some(0), frame("quiet", 1));
    (0..1000).for_each(|seq| shelf.put(Some(1), frame("flood", seq)));
    let mut inbox = Inbox::default();
    shelf.drain(&mut inbox);
    assert_eq!(inbox.frames().len(), 1 + FRAMES_PER_DRAIN_MAX);
    assert_eq!(inbox.frames()[FRAMES_PER_DRAIN_MAX].header.seq, 999);
    assert_eq!(inbox.frames()[0].header.source, name_bytes("quiet"));
    assert_eq!(shelf.take_passed_over(), 1000 - FRAMES_PER_DRAIN_MAX as u64);
}

#[test]
fn bug_frames_of_sources_that_the_scene_lacks_share_the_room_of_one() {
    let shelf = Shelf::default();
    for number in 0..1000 {
        let mut frame = shelf.spare();
        frame.header.source = name_bytes(&format!("source_{number}"));
        shelf.put(None, frame);
    }
    let mut inbox = Inbox::default();
    shelf.drain(&mut inbox);
    assert_eq!(inbox.frames().len(), FRAMES_PER_DRAIN_MAX);
    assert_eq!(shelf.take_passed_over(), 1000 - FRAMES_PER_DRAIN_MAX as u64);
}

#[test]
fn time_that_goes_back_raises_the_epoch_and_drops_what_waits() {
    let shelf = Shelf::default();
    shelf.add_group(name_bytes("tf"), 9, seats(&[1]));
    shelf.merge(0, &[update(0, 1.0, 5)]);
    shelf.reset(0);
    shelf.merge(0, &[update(0, 3.0, 1)]);
    let mut inbox = Inbox::default();
    shelf.drain(&mut inbox);
    let frame = &inbox.frames()[0];
    assert_eq!(
        (
            frame.header.epoch,
            frame.header.seq,
            frame.transforms[0].position[0]
        ),
        (2, 1, 3.0)
    );
}

/// Before the fix, such bodies were split into several frames by age, and continuous bodies were not in step.
#[test]
fn bug_bodies_that_moved_together_on_chains_of_different_age_stay_together() {
    let shelf = Shelf::default();
    shelf.add_group(name_bytes("tf"), 9, seats(&[1, 2, 3]));
    let aged = |member, since_ns| Update {
        received_ns: 1000,
        since_ns,
        ..update(member, 1.0, 5)
    };
    shelf.merge(0, &[aged(0, 1000), aged(1, 500), aged(2, 990)]);
    let mut inbox = Inbox::default();
    shelf.drain(&mut inbox);
    let [frame] = inbox.frames() else {
        panic!("one frame");
    };
    let bodies = frame.transforms.iter().map(|row| row.body);
    let ages: Vec<_> = bodies.zip(frame.since_ns.iter().copied()).collect();
    assert_eq!(ages, [(1, 1000), (2, 500), (3, 990)]);
    assert_eq!((frame.header.sent_ns, frame.received_ns), (1000, 1000));
}

#[test]
fn what_waited_while_the_process_stood_still_takes_nothing_else_with_it() {
    let shelf = Shelf::default();
    shelf.add_group(name_bytes("tf"), 9, seats(&[1, 2]));
    let late = Update {
        waited: true,
        ..update(1, 1.0, 5)
    };
    shelf.merge(0, &[update(0, 1.0, 5), late]);
    let mut inbox = Inbox::default();
    shelf.drain(&mut inbox);
    let told = |frame: &Frame| {
        let body = frame.transforms[0].body;
        (frame.header.seq, frame.waited, frame.header.sent_ns, body)
    };
    let told: Vec<_> = inbox.frames().iter().map(told).collect();
    assert_eq!(told, [(1, true, 0, 2), (2, false, 90, 1)]);
}

#[test]
fn bug_poses_of_a_continuous_body_that_gave_way_to_newer_ones_were_not_missing() {
    let shelf = Shelf::default();
    let mut all = seats(&[1, 2]);
    all[1].continuous = true;
    shelf.add_group(name_bytes("poses"), 9, all);
    let mut inbox = Inbox::default();
    let mut number = |updates: &[Update]| {
        shelf.merge(0, updates);
        inbox.clear();
        shelf.drain(&mut inbox);
        inbox.frames()[0].header.seq
    };
    assert_eq!(number(&[update(1, 1.0, 5)]), 1);
    assert_eq!(
        number(&[update(1, 2.0, 6), update(1, 3.0, 7), update(1, 4.0, 8)]),
        4
    );
    assert_eq!(number(&[update(1, 4.0, 9)]), 5, "none gave way");
    // Replaced poses count as missing only for continuous bodies, and not if they were repeated or refused.
    assert_eq!(number(&[update(0, 2.0, 6), update(0, 3.0, 7)]), 6);
    assert_eq!(number(&[update(1, 5.0, 10), update(1, 5.0, 10)]), 7);
    let refused = Update {
        result: Err(RejectReason::BadChain),
        ..update(1, 0.0, 11)
    };
    assert_eq!(number(&[refused, update(1, 6.0, 12)]), 8);
}

/// Before the fix, the source's frames were refused as `session_over` for as long as the daemon ran.
#[test]
fn bug_a_stranger_under_the_name_of_a_source_of_topics_locked_that_source_out() {
    let shelf = Shelf::default();
    shelf.add_group(name_bytes("tf"), 9, seats(&[1]));
    shelf.add_group(name_bytes("odom"), 9, seats(&[2]));
    let next = std::cell::Cell::new(100);
    let draw = || {
        next.set(next.get() + 1);
        Ok(next.get())
    };
    let tick = |session| {
        let mut tick = TickRow::default();
        for (row, (name, session)) in (tick.sources.iter_mut()).zip([("tf", session), ("odom", 9)])
        {
            (row.name, row.session) = (name_bytes(name), session);
        }
        tick.sources_len = 2;
        tick
    };
    // The session in force in a tick; the session of the frames sent after it.
    let sent = |session| {
        shelf.hear(&tick(session), draw);
        for group in 0..2 {
            shelf.merge(group, &[update(0, 1.0, 5)]);
        }
        let mut inbox = Inbox::default();
        shelf.drain(&mut inbox);
        assert_eq!(inbox.frames()[1].header.session, 9, "the other source");
        inbox.frames()[0].header.session
    };
    assert_eq!([0, 9, 9].map(sent), [9; 3]);
    // A stranger sends, then falls silent; the new session is kept, though it is not in force yet.
    assert_eq!([5, 5, 5, 0, 0].map(sent), [101; 5]);
    assert_eq!([101, 101].map(sent), [101; 2]);
    // A stranger came and went between two ticks.
    assert_eq!([0, 0, 102].map(sent), [102; 3]);
    assert_eq!([6, 7].map(sent), [103, 104], "each may have ended it");
    let fails = || Err(crate::error::Error::Usage(String::new()));
    shelf.hear(&tick(8), fails);
    assert_eq!(sent(8), 105, "drawn as soon as it can be");
    let mut inbox = Inbox::default();
    shelf.end(&mut inbox);
    assert_eq!(inbox.ended(), [9, 105]);
}
