//! Law 4.5: the rest of a budget after publishing is used, and the next tick publishes its results.

use sweepd::math::Pose;
use sweepd::time::Budget;
use sweepd::wire::{Event, Stage, State, Verdict, pair_flags};

use crate::rig::{ALL, NONE, Rig, ball, has, scene};

/// Just longer than the time reserved for sending: nothing is decided before the outbox is handed over.
const SHORT: Budget = Budget::time_ns(900_000);

/// Two balls with overlapping boxes, after a tick in which all was decided and sending took long.
fn two(at: [f64; 2]) -> Rig {
    let mut rig = Rig::new(&scene("", &[ball(1, 0.0, ""), ball(2, 0.0, "")]));
    rig.place(2, &Pose::translation(at[0], at[1], 0.0));
    rig.send(ALL);
    rig.engine.note_sent(1_000_000);
    rig
}

/// Time that a tick reserves at its end for the query in progress.
const LAST_NS: u64 = 6_000;
const TOUCHING: [f64; 2] = [1.2, 1.2];
const APART: [f64; 2] = [1.5, 1.5];

#[test]
fn law_4_5_a_collision_that_ends_after_publishing_is_told_in_the_next_tick() {
    let mut rig = two(TOUCHING);
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
    rig.place(2, &Pose::translation(APART[0], APART[1], 0.0));
    rig.send(SHORT);
    assert_eq!(rig.verdict(1, 2), Verdict::Possible);
    assert_eq!(rig.out.tick.units, 0);
    assert!(!rig.engine.work_on(u64::MAX), "all is decided");
    rig.engine.validate().unwrap();
    rig.send(NONE);
    let row = rig.pair(1, 2).unwrap();
    assert!(has(row, Event::End) && !has(row, Event::Begin));
    assert_eq!((row.end_first_tick, row.end_last_tick), (2, 2));
    assert_eq!(rig.verdict(1, 2), Verdict::Apart);
    assert_eq!(rig.out.tick.units, 1, "of the rest of tick 2");
    rig.send(NONE);
    assert!(rig.out.pairs.is_empty());
    assert_eq!(rig.out.tick.units, 0);
}

#[test]
fn law_4_5_a_collision_found_after_publishing_is_told_in_the_next_tick() {
    let mut rig = two(APART);
    rig.place(2, &Pose::translation(TOUCHING[0], TOUCHING[1], 0.0));
    rig.send(SHORT);
    assert_eq!(rig.verdict(1, 2), Verdict::Possible);
    while rig.engine.work_on(5_000) {}
    rig.send(NONE);
    let row = rig.pair(1, 2).unwrap();
    assert!(has(row, Event::Begin) && !has(row, Event::End));
    assert_eq!((row.begin_first_tick, row.begin_last_tick), (2, 2));
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
}

#[test]
fn bug_what_was_certified_after_publishing_was_forgotten_where_the_bodies_moved_on() {
    let mut rig = two(APART);
    rig.place(2, &Pose::translation(TOUCHING[0], TOUCHING[1], 0.0));
    rig.send(SHORT);
    assert_eq!(rig.verdict(1, 2), Verdict::Possible);
    rig.engine.work_on(u64::MAX);
    rig.engine.validate().unwrap();
    rig.place(2, &Pose::translation(APART[0], APART[1], 0.0));
    rig.send(NONE);
    assert_eq!(rig.verdict(1, 2), Verdict::Possible);
    let row = rig.pair(1, 2).unwrap();
    let certified = (row.certified_verdict, row.certified_tick);
    assert_eq!(certified, (Verdict::Colliding.code(), 2));
    assert_eq!(row.events, Event::Begin.bit());
    assert_eq!((row.begin_first_tick, row.begin_last_tick), (2, 2));
    rig.send(ALL);
    let row = rig.pair(1, 2).unwrap();
    assert_eq!(rig.verdict(1, 2), Verdict::Apart);
    assert_eq!(row.events, Event::End.bit());
    assert_eq!((row.end_first_tick, row.end_last_tick), (3, 4));
}

#[test]
fn bug_a_collision_persisted_across_an_end_that_was_certified_after_publishing() {
    let mut rig = two(TOUCHING);
    rig.place(2, &Pose::translation(APART[0], APART[1], 0.0));
    rig.send(SHORT);
    rig.engine.work_on(u64::MAX);
    rig.place(2, &Pose::translation(TOUCHING[0], TOUCHING[1], 0.0));
    rig.send(ALL);
    let row = rig.pair(1, 2).unwrap();
    assert_eq!(row.events, Event::End.bit() | Event::Begin.bit());
    assert_eq!((row.end_first_tick, row.end_last_tick), (2, 2));
    assert_eq!((row.begin_first_tick, row.begin_last_tick), (3, 3));
    // As above, but the next tick decides nothing.
    let mut rig = two(TOUCHING);
    rig.place(2, &Pose::translation(APART[0], APART[1], 0.0));
    rig.send(SHORT);
    rig.engine.work_on(u64::MAX);
    rig.place(2, &Pose::translation(TOUCHING[0], TOUCHING[1], 0.0));
    rig.send(NONE);
    let row = rig.pair(1, 2).unwrap();
    assert_eq!(row.events, Event::End.bit());
    let certified = (row.certified_verdict, row.certified_tick);
    assert_eq!(certified, (Verdict::Apart.code(), 2));
}

#[test]
fn law_3_9_a_collision_found_after_publishing_that_is_over_in_the_next_tick_cancels() {
    let mut rig = two(APART);
    rig.place(2, &Pose::translation(TOUCHING[0], TOUCHING[1], 0.0));
    rig.send(SHORT);
    rig.engine.work_on(u64::MAX);
    rig.place(2, &Pose::translation(APART[0], APART[1], 0.0));
    rig.send(ALL);
    assert!(rig.out.pairs.is_empty());
    assert_eq!(rig.out.tick.cancelled_events, 1);
}

#[test]
fn law_3_5_a_collision_found_after_publishing_that_ends_on_the_way_to_the_next_poses_is_a_pass() {
    let balls = [ball(1, 0.0, ""), ball(2, 0.0, "continuous = true")];
    let mut rig = Rig::new(&scene("", &balls));
    rig.place(2, &Pose::translation(APART[0], APART[1], 0.0));
    rig.send(ALL);
    rig.engine.note_sent(1_000_000);
    rig.place(2, &Pose::translation(TOUCHING[0], TOUCHING[1], 0.0));
    rig.send(SHORT);
    assert_eq!(rig.verdict(1, 2), Verdict::Possible);
    rig.engine.work_on(u64::MAX);
    rig.place(2, &Pose::translation(APART[0], APART[1], 0.0));
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Apart);
    assert_eq!(rig.state(), State::Colliding);
    let row = rig.pair(1, 2).unwrap();
    let pass = Event::Begin.bit() | Event::End.bit() | Event::Passed.bit();
    assert_eq!(row.events, pass);
    assert_ne!(row.flags & pair_flags::SWEPT_HIT, 0);
    assert_eq!((row.begin_first_tick, row.begin_last_tick), (2, 3));
    assert_eq!((row.end_first_tick, row.end_last_tick), (3, 3));
}

#[test]
fn law_4_5_a_pair_that_ends_after_publishing_and_is_gone_in_the_next_tick_is_told_once() {
    let mut rig = two(TOUCHING);
    rig.place(2, &Pose::translation(APART[0], APART[1], 0.0));
    rig.send(SHORT);
    rig.engine.work_on(u64::MAX);
    rig.place(2, &Pose::translation(100.0, 0.0, 0.0));
    rig.send(NONE);
    let ends = rig.out.pairs.iter().filter(|row| has(row, Event::End));
    assert_eq!(ends.count(), 1);
    rig.send(NONE);
    assert!(rig.out.pairs.is_empty());
}

#[test]
fn law_4_5_no_work_goes_on_past_the_deadline_nor_under_a_budget_of_units() {
    let mut rig = two(TOUCHING);
    rig.place(2, &Pose::translation(APART[0], APART[1], 0.0));
    rig.send(SHORT);
    rig.clock.advance(900_000);
    assert!(!rig.engine.work_on(u64::MAX));
    rig.send(NONE);
    assert_eq!(rig.verdict(1, 2), Verdict::Possible);
    assert_eq!(rig.out.tick.stage_ns[usize::from(Stage::Rest.code())], 0);
    // Unit budgets have no rest, so that they replay bit for bit.
    assert!(!rig.engine.work_on(u64::MAX));
    rig.send(NONE);
    assert_eq!(rig.verdict(1, 2), Verdict::Possible);
}

#[test]
fn law_4_5_time_that_does_not_reach_to_rank_the_pairs_is_used_all_the_same() {
    let count = 200;
    let bodies: Vec<String> = (1..=2 * count)
        .map(|id| ball(id, ((id - 1) / 2) as f64 * 10.0, ""))
        .collect();
    let mut rig = Rig::new(&scene("", &bodies));
    let second = |rig: &mut Rig, [x, y]: [f64; 2]| {
        for pair in 0..count {
            let at = Pose::translation(pair as f64 * 10.0 + x, y, 0.0);
            rig.place(2 * pair + 2, &at);
        }
    };
    second(&mut rig, APART);
    rig.send(ALL);
    rig.engine.note_sent(1_000_000);
    second(&mut rig, TOUCHING);
    rig.send(SHORT);
    assert_eq!(rig.out.tick.possible, count);
    // One microsecond is left, and the clock stands still.
    rig.clock.advance(900_000 - LAST_NS - 1_000);
    assert!(!rig.engine.work_on(u64::MAX), "all is decided");
    rig.send(NONE);
    assert_eq!(rig.out.tick.colliding, count);
}
