//! The cost of the narrow phase's motion pass is proportional to the number of pairs that moved: 300,000 candidate
//! pairs (10,000 spheres, 60 pairs per body), of which 0.5 % of the bodies (1 % of the pairs), 1 %, 10 % or all bodies
//! move.
//!
//! `cargo bench --bench motion_pass [-- --quick]`

#![allow(clippy::cast_precision_loss, reason = "a bench")]

mod common;

use std::fmt::Write as _;

use common::{Bench, arguments, provenance, quantile, save};
use sweepd::builtin::Random;
use sweepd::time::Budget;
use sweepd::wire::{Demand, Stage};

/// Spheres at a density at which the box of each overlaps 60 others.
fn dense(bodies: usize, seed: u64) -> String {
    let mut random = Random::new(seed);
    let side = (bodies as f64 / 8.8).cbrt();
    let mut text = String::from("frame_id = \"world\"\n[[source]]\nname = \"feed\"\n");
    for at in 0..bodies {
        let place = [
            random.range(0.0, side),
            random.range(0.0, side),
            random.range(0.0, side),
        ];
        let _ = write!(
            text,
            "[[body]]\nname = \"b{at}\"\nposition = [{:.6}, {:.6}, {:.6}]\nmoves = true\n\
             shape = {{ type = \"sphere\", radius = 0.5 }}\n",
            place[0], place[1], place[2]
        );
    }
    text
}

fn main() {
    let quick = !arguments(|one| one == "--quick").is_empty();
    let (seed, bodies) = (5, 10_000);
    let ticks = if quick { 30 } else { 200 };
    let mut csv = String::from(
        "machine,commit,compiler,seed,bodies,moved_percent,ticks,candidates,visited,widen_median_us,widen_ns_a_visit\n",
    );
    let from = provenance();
    let mut bench = Bench::new(&dense(bodies, seed));
    let all = bench.rows.clone();
    bench.tick(&all, true, Budget::UNLIMITED, Demand::default());
    for percent in [0.5, 1.0, 10.0, 100.0] {
        let mut widen = Vec::new();
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most all of them"
        )]
        let moved = (bodies as f64 * percent / 100.0) as usize;
        let mut rows: Vec<_> = all[..moved].to_vec();
        for tick in 0..ticks {
            // Each body oscillates by a micrometre: verdicts stay valid, but their certificates must be checked.
            for row in &mut rows {
                row.position[0] += if tick % 2 == 0 { 1e-6 } else { -1e-6 };
            }
            bench.tick(&rows, false, Budget::UNLIMITED, Demand::default());
            widen.push(bench.out().tick.stage_ns[usize::from(Stage::Widen.code())]);
        }
        let visited = bench.engine.counters().visited;
        let candidates = bench.out().tick.candidates;
        assert!(candidates >= 300_000, "{candidates} candidate pairs");
        let median = quantile(&mut widen, 0.5);
        csv += &format!(
            "{from},{seed},{bodies},{percent},{ticks},{candidates},{visited},{:.1},{:.1}\n",
            median as f64 / 1e3,
            median as f64 / visited.max(1) as f64
        );
    }
    save("motion_pass.csv", &csv);
}
