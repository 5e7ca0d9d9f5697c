//! Law 4.5: a frame's own deadline shortens the time of its tick and never lengthens it; a tick that ends late is
//! flagged and counted. Each clock read takes a microsecond here, so that work takes time.

use sweepd::time::{Budget, Clock};
use sweepd::wire::{RejectReason, TickRow, Verdict, frame_flags};
use sweepd::world::Edit;

use crate::rig::{ALL, FRAME_NS, Rig, ball_pairs, put_pairs};

const LOOK_NS: u64 = 1_000;
const PAIRS: u64 = 400;
/// Position of the second ball of a pair relative to the first; the boxes overlap at both positions.
const TOUCHING: [f64; 2] = [1.2, 1.2];
const APART: [f64; 2] = [1.5, 1.5];
/// Time for about 250 queries, with one clock read each.
const SHORT_NS: u64 = 300_000;
const LONG_NS: u64 = 1_000_000_000;

/// Pairs of balls, all of them apart and decided.
fn pairs() -> Rig {
    let mut rig = ball_pairs(PAIRS);
    put(&mut rig, APART);
    rig.send(ALL);
    assert_eq!((rig.out.tick.candidates, rig.out.tick.possible), (PAIRS, 0));
    rig
}

fn put(rig: &mut Rig, place: [f64; 2]) {
    put_pairs(rig, PAIRS, place);
}

/// Moves all pairs into overlap, so that each is open again.
fn collide(rig: &mut Rig, budget: Budget) -> TickRow {
    put(rig, TOUCHING);
    rig.clock.step_each_read(LOOK_NS);
    rig.send(budget);
    rig.clock.step_each_read(0);
    rig.out.tick
}

/// An edit that makes a new scene revision if the margin differs from the current one.
fn margin(report_within_m: f64) -> Edit {
    Edit::Margin {
        name: None,
        report_within_m: Some(report_within_m),
    }
}

/// A time `ns` after the next tick's wake-up, up to a few clock reads.
fn after(rig: &Rig, ns: u64) -> u64 {
    rig.clock.monotonic_ns() + FRAME_NS + ns
}

/// Asserts that the tick was cut off at about `SHORT_NS`, and in time.
fn assert_short(row: &TickRow) {
    assert!(
        (SHORT_NS - 10 * LOOK_NS..=SHORT_NS).contains(&row.budget_ns),
        "{} ns",
        row.budget_ns
    );
    assert!(row.elapsed_ns <= row.budget_ns, "{} ns", row.elapsed_ns);
    assert!((200..300).contains(&row.units), "{} units", row.units);
    assert_eq!(row.possible + row.colliding, PAIRS);
    assert!(row.possible > 100);
    assert_eq!((row.overrun, row.missed), (0, 0));
}

#[test]
fn law_4_5_a_frames_deadline_shortens_a_budget_and_ends_a_tick_without_one() {
    for budget in [ALL, Budget::time_ns(LONG_NS)] {
        let mut rig = pairs();
        rig.deadline_ns = after(&rig, SHORT_NS);
        assert_short(&collide(&mut rig, budget));
    }
}

#[test]
fn law_4_5_the_time_that_a_frame_has_left_counts_from_its_receipt() {
    for budget in [ALL, Budget::time_ns(LONG_NS)] {
        let mut rig = pairs();
        (rig.time_left_ns, rig.waited_ns) = (SHORT_NS + 200_000, 200_000);
        assert_short(&collide(&mut rig, budget));
    }
}

#[test]
fn law_4_5_bug_what_a_tick_took_before_it_began_was_charged_twice_to_the_time_that_a_frame_has_left()
 {
    let mut rig = pairs();
    // The frame arrives at the wake-up, and 0.2 ms pass before the tick.
    (rig.woken_ns, rig.time_left_ns) = (200_000, SHORT_NS + 200_000);
    let row = collide(&mut rig, ALL);
    let budget_ns = row.budget_ns - 200_000;
    assert!(
        (SHORT_NS - 10 * LOOK_NS..=SHORT_NS).contains(&budget_ns),
        "{budget_ns} ns"
    );
    assert!(row.possible > 100 && row.units > 200);
    assert_eq!((row.overrun, row.missed), (0, 0));
}

#[test]
fn law_4_5_a_frames_deadline_never_lengthens_the_budget() {
    let budget = Budget::time_ns(SHORT_NS);
    let plain = collide(&mut pairs(), budget);
    assert_eq!(plain.budget_ns, SHORT_NS);
    assert!(plain.possible > 100);
    let mut rig = pairs();
    rig.deadline_ns = after(&rig, LONG_NS);
    let row = collide(&mut rig, budget);
    assert_eq!(
        (row.budget_ns, row.units, row.elapsed_ns),
        (SHORT_NS, plain.units, plain.elapsed_ns)
    );
    let mut rig = pairs();
    rig.time_left_ns = LONG_NS;
    let row = collide(&mut rig, budget);
    // Two clock reads determine when the frame arrived.
    assert_eq!(row.budget_ns, SHORT_NS);
    assert!(row.units <= plain.units && row.units + 3 > plain.units);
    // A deadline does not raise the limit of work units either.
    let mut rig = pairs();
    rig.deadline_ns = after(&rig, LONG_NS);
    assert_eq!(collide(&mut rig, Budget::units(7)).units, 7);
}

#[test]
fn law_4_5_a_frame_that_waited_for_a_revision_shortens_the_tick_that_it_is_admitted_in() {
    for own in [true, false] {
        let mut rig = pairs();
        put(&mut rig, TOUCHING);
        rig.scene_rev = rig.out.tick.header.scene_rev + 1;
        if own {
            rig.deadline_ns = after(&rig, FRAME_NS + SHORT_NS);
        } else {
            rig.time_left_ns = FRAME_NS + SHORT_NS;
        }
        let row = rig.send(ALL).tick;
        assert_eq!((row.budget_ns, row.units), (u64::MAX, 0), "it waits");
        rig.clock.step_each_read(LOOK_NS);
        let row = rig.edit(vec![margin(0.01)], ALL).tick;
        rig.clock.step_each_read(0);
        assert_short(&row);
        // The deadline applies once: no frame limits the next tick.
        let row = rig.idle(FRAME_NS, ALL).tick;
        assert_eq!((row.budget_ns, row.possible), (u64::MAX, 0));
    }
}

#[test]
fn law_4_5_a_frame_that_goes_on_waiting_does_not_shorten_the_tick_of_the_one_before_it() {
    let mut rig = pairs();
    put(&mut rig, TOUCHING);
    let now = rig.out.tick.header.scene_rev;
    (rig.scene_rev, rig.time_left_ns) = (now + 1, 2 * FRAME_NS + SHORT_NS);
    rig.send(ALL);
    // The next frame arrives in the tick of the edit that the first waits for, and waits for a later edit.
    (rig.scene_rev, rig.time_left_ns) = (now + 2, 1);
    rig.clock.step_each_read(LOOK_NS);
    let row = rig.send_with(vec![margin(0.01)], ALL).tick;
    rig.clock.step_each_read(0);
    assert_eq!(row.header.scene_rev, now + 1);
    assert!(
        row.budget_ns > SHORT_NS,
        "{} ns: the first one's",
        row.budget_ns
    );
    assert!(row.budget_ns < FRAME_NS + SHORT_NS);
    assert_eq!(row.overrun, 0);
    let row = rig.edit(vec![margin(0.02)], ALL).tick;
    assert_eq!(
        (row.header.scene_rev, row.overrun),
        (now + 2, 1),
        "the second one's"
    );
}

#[test]
fn law_4_5_bug_of_several_frames_of_a_source_the_newest_says_when_to_end() {
    for older_ns in [1, LONG_NS] {
        let mut rig = pairs();
        put(&mut rig, TOUCHING);
        let ends = [older_ns, older_ns, after(&rig, 2 * FRAME_NS + SHORT_NS)];
        rig.clock.step_each_read(LOOK_NS);
        rig.send_several(3, |at, rig| rig.deadline_ns = ends[at], ALL);
        rig.clock.step_each_read(0);
        assert_short(&rig.out.tick);
    }
}

#[test]
fn law_4_5_a_deadline_that_is_missed_is_told_with_a_budget_and_without_one() {
    for budget in [ALL, Budget::time_ns(LONG_NS)] {
        let mut rig = pairs();
        rig.deadline_ns = 1;
        let row = collide(&mut rig, budget);
        assert_eq!((row.overrun, row.missed, row.budget_ns), (1, 1, 0));
        // The tick still does the work of its floor, and no pair is omitted.
        assert_eq!((row.units, row.possible), (0, PAIRS));
        assert_eq!(rig.verdict(1, 2), Verdict::Possible);
        assert_eq!(rig.out.pairs.len() as u64, PAIRS);
        rig.deadline_ns = 0;
        let row = collide(&mut rig, ALL);
        assert_eq!((row.overrun, row.missed, row.budget_ns), (0, 1, u64::MAX));
        assert_eq!(row.colliding, PAIRS);
    }
}

#[test]
fn law_4_5_below_its_floor_a_tick_takes_the_floor_and_is_flagged_and_above_it_it_ends_in_time() {
    let mut rig = pairs();
    let mut missed = 0;
    let mut floor_ns = 0;
    for budget_ns in [0, 1, LOOK_NS] {
        let row = collide(&mut rig, Budget::time_ns(budget_ns));
        missed += 1;
        assert_eq!((row.overrun, row.missed), (1, missed));
        assert!(row.floor_ns > budget_ns && row.elapsed_ns >= row.floor_ns);
        assert_eq!(row.possible, PAIRS, "all of them are told");
        floor_ns = row.floor_ns;
    }
    // Clock reads that the narrow phase needs to find that it has no time.
    let looks_ns = 10 * LOOK_NS;
    let mut units = 0;
    for above_ns in (looks_ns..SHORT_NS).step_by(7_000) {
        put(&mut rig, APART);
        rig.send(ALL);
        let row = collide(&mut rig, Budget::time_ns(floor_ns + above_ns));
        assert_eq!((row.overrun, row.missed), (0, missed), "{above_ns} ns");
        units += row.units;
    }
    assert!(units > PAIRS);
}

#[test]
fn law_4_5_a_frame_that_is_refused_shortens_nobodys_tick() {
    let mut rig = pairs();
    rig.deadline_ns = 1;
    rig.flags = frame_flags::FULL | frame_flags::PAUSED;
    let row = collide(&mut rig, ALL);
    assert_eq!(rig.rejects(RejectReason::BadLayout), 1);
    assert_eq!((row.overrun, row.missed, row.budget_ns), (0, 0, u64::MAX));
}

#[test]
fn law_4_7_where_only_frames_deadlines_end_the_work_each_pair_has_its_turn_too() {
    let mut rig = pairs();
    let mut decided: Vec<bool> = (0..PAIRS).map(|_| false).collect();
    let mut least = PAIRS;
    for tick in 0..120 {
        // Positions change each tick, so that no earlier proof is valid.
        let [x, y] = if tick % 2 == 0 { TOUCHING } else { APART };
        let side = |turn: i32| if tick / turn % 2 == 0 { 1.0 } else { -1.0 };
        let aside = 0.25 * side(2);
        put(&mut rig, [side(4) * (x + aside), side(8) * (y - aside)]);
        rig.deadline_ns = after(&rig, 100_000);
        rig.clock.step_each_read(LOOK_NS);
        rig.send(ALL);
        rig.clock.step_each_read(0);
        least = least.min(rig.out.tick.possible);
        for (pair, decided) in (0..).zip(&mut decided) {
            *decided |= rig.verdict(2 * pair + 1, 2 * pair + 2) != Verdict::Possible;
        }
    }
    assert!(least > PAIRS / 2, "{least} pairs open: not cut off");
    let never = decided.iter().filter(|decided| !**decided).count();
    assert_eq!(never, 0, "pairs without a verdict in 120 ticks");
}
