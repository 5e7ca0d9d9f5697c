//! 4.5: while work remains at least 90 % of what a budget leaves above the floor is used, and what is at or above its
//! floor ends in time. Each look at the clock takes a microsecond here, so that every unit of work takes time, a cheap
//! one an eighth of what a dear one does.

use std::f64::consts::FRAC_PI_2;

use sweepd::math::{Pose, Quat, Vec3};
use sweepd::time::{Budget, Clock};
use sweepd::wire::{Stage, TickRow, Verdict};

use crate::oracle::meshes::{torus, trimesh};
use crate::rig::{FRAME_NS, Rig, ball_pairs, body, put_pairs, scene};

const LOOK_NS: u64 = 1_000;
/// What handing the outbox over takes, and what it takes the first time.
const SEND_NS: u64 = 20_000;
const FIRST_SEND_NS: u64 = 120_000;
/// The last of them is told by the one behind it.
const TICKS: usize = 8;
/// A budget that is well above the floor, to learn it.
const LEARNING_NS: u64 = 400_000;
/// What the budgets leave above it. Of less than the first a tenth is less than what is kept back for the query under
/// way at the end.
const ABOVES_NS: [u64; 4] = [100_000, 170_000, 300_000, 500_000];
/// Longest slice of what is done after the outbox was handed over.
const SLICE_NS: u64 = 50_000;
/// Pairs of meshes.
const LINKS: u64 = 110;
/// Where the second body of a pair stands in every other tick, seen from the first: each pair is open again.
const PLACES: [[f64; 2]; 2] = [[1.2, 1.2], [1.5, 1.5]];

/// What a tick had, took and used, nanoseconds.
struct Used {
    row: TickRow,
    /// In narrowing, before the outbox went out and after.
    narrowed_ns: u64,
    /// From the tick's end to the end of all its work; less than nothing: it was over before.
    late_ns: i64,
    /// Pairs without a verdict at that end.
    open: u64,
}

fn stage(row: &TickRow, stage: Stage) -> u64 {
    row.stage_ns[usize::from(stage.code())]
}

/// Ticks as the daemon runs them: outbox, sending, what is left.
///
/// * `put` - makes the poses of a tick, which leave every pair open.
fn run(rig: &mut Rig, put: impl Fn(&mut Rig, usize), budget_ns: u64) -> Vec<Used> {
    rig.checked = false;
    rig.clock.step_each_read(LOOK_NS);
    let mut all: Vec<Used> = Vec::new();
    for tick in 0..=TICKS {
        put(rig, tick);
        // This look and the two of a frame's receipt and its tick's wake-up.
        let end_ns = rig.clock.monotonic_ns() + FRAME_NS + 2 * LOOK_NS + budget_ns;
        rig.send(Budget::time_ns(budget_ns));
        // For long after the first more is kept back than sending takes: it is to be used behind it.
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

/// Runs a scene anew within several budgets.
///
/// * `aboves_ns` - of the budgets, what they have above the floor.
fn check(make: impl Fn() -> Rig, put: impl Fn(&mut Rig, usize), aboves_ns: &[u64]) {
    let floor_ns = run(&mut make(), &put, LEARNING_NS)[TICKS - 1].row.floor_ns;
    for &above_ns in aboves_ns {
        // The first tick does not know what sending takes, and the next counts it.
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
    // Links of chains: no plane parts them.
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
