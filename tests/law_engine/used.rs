//! Law 4.5: while work remains, at least 90 % of the budget above the floor is used, and ticks with a budget at or
//! above the floor end in time. Each clock read takes a microsecond here, so that every unit of work takes time, a
//! cheap one an eighth of that of an expensive one.

use std::f64::consts::FRAC_PI_2;

use sweepd::math::{Pose, Quat, Vec3};
use sweepd::time::{Budget, Clock};
use sweepd::wire::{Stage, TickRow, Verdict};

use crate::oracle::meshes::{torus, trimesh};
use crate::rig::{FRAME_NS, Rig, ball_pairs, body, put_pairs, scene};

const LOOK_NS: u64 = 1_000;
/// Duration of handing the outbox over, and of doing so the first time.
const SEND_NS: u64 = 20_000;
const FIRST_SEND_NS: u64 = 120_000;
/// Number of ticks; one more follows, which reports the rest of the last.
const TICKS: usize = 8;
/// A budget well above the floor, used to measure the floor.
const LEARNING_NS: u64 = 400_000;
/// Budgets above the floor. Below the first of these, a tenth of it would be less than the time reserved for the query
/// in progress at the end.
const ABOVES_NS: [u64; 4] = [100_000, 170_000, 300_000, 500_000];
/// Longest slice of work after the outbox is handed over.
const SLICE_NS: u64 = 50_000;
/// Pairs of meshes.
const LINKS: u64 = 110;
/// Alternating position of the second body of a pair relative to the first, so that each pair is open again in each
/// tick.
const PLACES: [[f64; 2]; 2] = [[1.2, 1.2], [1.5, 1.5]];

/// Budget, duration and use of a tick, nanoseconds.
struct Used {
    row: TickRow,
    /// Time in the narrow phase, before and after the outbox is handed over.
    narrowed_ns: u64,
    /// Time from the tick's deadline to the end of all its work; negative if it ended before the deadline.
    late_ns: i64,
    /// Pairs without a verdict at the end of all work.
    open: u64,
}

fn stage(row: &TickRow, stage: Stage) -> u64 {
    row.stage_ns[usize::from(stage.code())]
}

/// Runs ticks as the daemon does: outbox, sending, rest of the budget.
///
/// * `put` - sets the poses of a tick, at which every pair is open.
fn run(rig: &mut Rig, put: impl Fn(&mut Rig, usize), budget_ns: u64) -> Vec<Used> {
    rig.checked = false;
    rig.clock.step_each_read(LOOK_NS);
    let mut all: Vec<Used> = Vec::new();
    for tick in 0..=TICKS {
        put(rig, tick);
        // This clock read, and those of the frame's receipt and the tick's wake-up.
        let end_ns = rig.clock.monotonic_ns() + FRAME_NS + 2 * LOOK_NS + budget_ns;
        rig.send(Budget::time_ns(budget_ns));
        // For long after the first tick the reserve exceeds the duration of sending; the difference must be used after
        // sending.
        let send_ns = if tick == 0 { FIRST_SEND_NS } else { SEND_NS };
        rig.clock.advance(send_ns);
        rig.engine.note_sent(send_ns);
        while rig.engine.work_on(SLICE_NS) {}
        let row = rig.out.tick;
        if let Some(last) = all.last_mut() {
            last.narrowed_ns += stage(&row, Stage::Rest);
        }
        all.push(Used {
            row,
            narrowed_ns: stage(&row, Stage::Narrow),
            late_ns: rig.clock.monotonic_ns().cast_signed() - end_ns.cast_signed(),
            open: rig.engine.narrow().count(Verdict::Possible),
        });
    }
    all.pop();
    all
}

/// Runs a new engine for each of several budgets.
///
/// * `aboves_ns` - the budgets, as time above the floor.
fn check(make: impl Fn() -> Rig, put: impl Fn(&mut Rig, usize), aboves_ns: &[u64]) {
    let floor_ns = run(&mut make(), &put, LEARNING_NS)[TICKS - 1].row.floor_ns;
    for &above_ns in aboves_ns {
        // The first tick does not know the duration of sending, which the second one uses.
        let ticks = run(&mut make(), &put, floor_ns + above_ns);
        for (at, used) in ticks.iter().enumerate().skip(2) {
            let row = &used.row;
            let told = format!("tick {at}, {above_ns} ns above a floor of {floor_ns}");
            assert!(used.open > 0, "{told}: no work remains");
            assert!(row.floor_ns <= row.budget_ns, "{told}: {} ns", row.floor_ns);
            assert_eq!(row.overrun, 0, "{told}");
            assert!(used.late_ns <= 0, "{told}: {} ns late", used.late_ns);
            let left_ns = row.budget_ns - row.floor_ns;
            assert!(
                10 * used.narrowed_ns >= 9 * left_ns,
                "{told}: {} of {left_ns} ns used",
                used.narrowed_ns
            );
        }
    }
}

#[test]
fn law_4_5_nine_tenths_of_what_is_left_above_the_floor_are_used_on_convex_pairs() {
    let pairs = 2_500;
    let put = |rig: &mut Rig, tick| put_pairs(rig, pairs, PLACES[tick % 2]);
    check(|| ball_pairs(pairs), put, &ABOVES_NS);
}

#[test]
fn law_4_5_nine_tenths_of_what_is_left_above_the_floor_are_used_on_meshes() {
    // Linked rings, which no plane separates.
    let shape = trimesh(&torus(1.0, 0.3, 36, 24), None);
    let bodies: Vec<String> = (0..2 * LINKS)
        .map(|k| body(k + 1, [10.0 * (k / 2) as f64, 0.0, 0.0], &shape, ""))
        .collect();
    let put = |rig: &mut Rig, tick: usize| {
        for link in 0..LINKS {
            let turn = tick as f64 + link as f64;
            let upright = Quat::from_axis_angle(&Vec3::x_axis(), FRAC_PI_2);
            let rotation = upright * Quat::from_axis_angle(&Vec3::z_axis(), turn);
            let at = Vec3::new(10.0 * link as f64 + 1.0 + 0.2 * turn.sin(), 0.0, 0.0);
            rig.place(2 * link + 2, &Pose::from_parts(at.into(), rotation));
        }
    };
    check(|| Rig::new(&scene("", &bodies)), put, &ABOVES_NS);
}
