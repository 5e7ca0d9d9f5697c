//! Goal: no order of frames, silences and edits makes an engine say what is not so (laws 1, 3.4 to 3.7, 3.10, 4.2).
//! Method: scenes of all kinds of bodies, half-spaces that cannot move and such that do, parts far from their body's
//! centre, continuous bodies; in each tick any of them may be put anew, removed, disabled, hung on another (which may
//! be disabled, unknown or a half-space), let go, filtered, reset, sent, sent wrong, or be silent for too long. Three
//! engines are given the same (work without limit, up to a random stop, none at all) and have broad phases of their
//! own; some scenes have so many bodies that the plan changes its own back and forth. What they say is held against a
//! world of a few lines (`world.rs`) that shares no code with theirs, and exact queries at its poses, on the way there
//! too (`check.rs`).
//!
//! `SWEEPD_TICKS` says how many ticks; `SWEEPD_SEED` where to start. The ignored one is the same with 100,000.
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

/// Ticks of a scene.
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
