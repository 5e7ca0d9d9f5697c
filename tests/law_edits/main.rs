//! Goal: no order of frames, silences and edits makes an engine publish a wrong result (laws 1, 3.4 to 3.7, 3.10, 4.2).
//! Method: scenes with all kinds of bodies: fixed and moving half-spaces, parts far from their body's centre,
//! continuous bodies. In each tick any body may be put again, removed, disabled, attached to another (which may be
//! disabled, unknown or a half-space), detached, filtered, reset, sent, sent with invalid numbers, or silent for too
//! long. Three engines get the same input (with unlimited work, a random limit, and none) and have different broad
//! phases; some scenes have so many bodies that the plan switches its own back and forth. Their results are compared
//! with a small world (`world.rs`) that shares no code with them, and with exact queries at its poses and on the way to
//! them (`check.rs`).
//!
//! `SWEEPD_TICKS` sets the number of ticks, `SWEEPD_SEED` the first seed. The ignored test is the same with 100,000
//! ticks.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    missing_docs,
    missing_debug_implementations,
    unreachable_pub,
    reason = "a test"
)]

#[path = "../oracle/mod.rs"]
mod oracle;

mod check;
mod draw;
mod solids;
mod twins;
mod world;

use check::Seen;

/// Ticks per scene.
const TICKS: u64 = 150;

#[test]
fn law_1_no_order_of_edits_frames_and_silences_hides_a_collision() {
    run(6_000);
}

#[test]
#[ignore = "takes minutes; SWEEPD_CI_SLOW=1 .ci/run runs it"]
fn law_1_the_same_in_100_000_ticks() {
    run(100_000);
}

fn run(ticks: u64) {
    let number = |name: &str| std::env::var(name).map(|text| text.parse::<u64>().unwrap());
    let ticks = number("SWEEPD_TICKS").unwrap_or(ticks);
    let first = number("SWEEPD_SEED").unwrap_or(0);
    let mut seen = Seen::default();
    for seed in first..first + ticks.div_ceil(TICKS) {
        draw::scene(seed, TICKS, &mut seen);
    }
    seen.report();
    seen.assert_enough(ticks);
}
