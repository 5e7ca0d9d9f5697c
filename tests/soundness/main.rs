//! Goal: everything published is sound, at any budget, for every kind of shape (laws 1, 3.4). Method: couples of bodies
//! of all kinds in random motion, in four engines at once (unlimited work; a random limit in each tick; half of the
//! first one's work; a deadline with continued work after publishing). Each published verdict and interval is compared
//! with an oracle that shares no code with the narrow phase (`truth.rs`; claims on the depth of an overlap:
//! `depth.rs`). In addition certificate fronts of the meshes are interrupted at random, and every leaf pair of them is
//! checked (`fronts.rs`).
//!
//! At least a third of the pair-ticks overlap, and at least a third are apart by at most 1 % of the smaller body's
//! size, as proved by the oracle (`regimes.rs`). Faults are counted to the end; the count must be 0.
//!
//! `SWEEPD_PAIR_TICKS` sets the number of couples times ticks, 1,500 by default; `SWEEPD_SEED` sets the first seed. The
//! ignored tests are the same with 100,000 pair-ticks.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::float_cmp,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    missing_docs,
    missing_debug_implementations,
    unreachable_pub,
    reason = "a test"
)]

#[path = "../oracle/mod.rs"]
mod oracle;

mod bends;
mod couples;
mod depth;
mod directions;
mod fronts;
mod kinds;
mod regimes;
mod run;
mod tally;
mod truth;

use kinds::KINDS;
use regimes::Shares;
use run::{Run, TICKS};

#[test]
fn law_1_every_verdict_and_interval_holds_the_truth_at_any_budget_for_all_kinds_of_shapes() {
    rigid(1_500);
}

#[test]
#[ignore = "takes minutes; SWEEPD_CI_SLOW=1 .ci/run runs it"]
fn law_1_the_same_in_100_000_pair_ticks() {
    let run = rigid(LARGE);
    assert_large(&run);
    // 27 of the 65 pairs of kinds have a mesh and no half-space.
    let fronts = run.fronts.pair_ticks;
    assert!(fronts * 5 >= run.shares.all * 2, "{fronts} with fronts");
}

#[test]
fn law_4_6_bodies_that_deform_hold_it_too_with_all_kinds_of_shapes_and_at_any_budget() {
    bending(600);
}

#[test]
#[ignore = "takes minutes; SWEEPD_CI_SLOW=1 .ci/run runs it"]
fn law_4_6_the_same_in_100_000_pair_ticks_with_fronts() {
    // All have fronts except for those with a half-space, 2 of the 25 pairs of kinds.
    let run = bending(LARGE * 25 / 23 + 1);
    assert_large(&run);
    let fronts = run.fronts.pair_ticks;
    assert!(fronts >= LARGE, "{fronts} with fronts");
}

const LARGE: u64 = 100_000;

/// Asserts that there were enough pair-ticks, and enough of each pair of kinds.
fn assert_large(run: &Run) {
    let all = run.shares.all;
    assert!(all >= LARGE, "{all} pair-ticks");
    assert!(run.fewest() >= 500, "{} of a pair of kinds", run.fewest());
}

fn rigid(wanted: u64) -> Run {
    run_all(wanted, |b| b < kinds::BENDING)
}

fn bending(wanted: u64) -> Run {
    let run = run_all(wanted, |b| b >= kinds::BENDING);
    assert!(run.trees > 0, "no tree was built anew");
    run
}

/// Runs scenes of all pairs of kinds whose second kind fulfils `wanted_kind`; asserts what must hold for any number of
/// pair-ticks.
fn run_all(wanted: u64, wanted_kind: impl Fn(usize) -> bool) -> Run {
    let number = |name: &str| std::env::var(name).map(|text| text.parse::<u64>().unwrap());
    let wanted = number("SWEEPD_PAIR_TICKS").unwrap_or(wanted);
    let first = number("SWEEPD_SEED").unwrap_or(0);
    let mut kinds = Vec::new();
    for a in 0..KINDS {
        for b in a..KINDS {
            if (a, b) != (kinds::HALF_SPACE, kinds::HALF_SPACE) && wanted_kind(b) {
                kinds.push((a, b));
            }
        }
    }
    let each = wanted.div_ceil(kinds.len() as u64 * TICKS).max(1);
    let mut run = Run::default();
    for round in 0..each {
        for (at, chunk) in kinds.chunks(13).enumerate() {
            run.scene((first + round) * 1000 + at as u64, chunk);
        }
    }
    run.report();
    run.tally.assert_none();
    assert!(run.fewest() >= TICKS * each);
    let Shares {
        all,
        overlapping,
        close,
    } = run.shares;
    assert!(overlapping * 3 >= all, "{overlapping} of {all} overlap");
    assert!(close * 3 >= all, "{close} of {all} are close");
    run
}
