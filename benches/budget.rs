//! Budgets above the floor: how far a tick overshoots, on the wall and on the thread's CPU clock, and how much of what
//! is left above the floor is used while work remains (before and after
//! publishing; and before alone). Scene: `pool(4000, 11)`, each body 1 % of its size a tick, pairs and
//! contacts asked for.
//!
//! `cargo bench --bench budget [-- --quick]`

#![allow(clippy::cast_precision_loss, reason = "a bench")]

mod common;

use common::{Bench, Flight, provenance, quantile, row, save};
use sweepd::builtin::pool;
use sweepd::time::Budget;
use sweepd::wire::{Demand, Stage};

fn main() {
    let quick = std::env::args().any(|arg| arg == "--quick");
    let (seed, bodies) = (11, 4_000);
    let ticks = if quick { 60 } else { 400 };
    let mut csv = String::from(
        "machine,commit,compiler,seed,bodies,above_floor_us,ticks,floor_us,overshoot_wall_p50_us,overshoot_wall_p99_us,\
         overshoot_cpu_p50_us,overshoot_cpu_p99_us,used_percent,used_before_publishing_percent,\
         undecided_percent\n",
    );
    let from = provenance();
    for above_us in [100, 250, 500, 1_000, 2_000, 5_000_u64] {
        let mut bench = Bench::new(&pool(bodies, seed));
        let mut flight = Flight::new(&bench.scene, 0.75 * 0.01, seed);
        let mut rows = bench.rows.clone();
        let mut floors = Vec::new();
        let (mut wall, mut cpu) = (Vec::new(), Vec::new());
        let (mut used, mut told, mut offered) = (0_u64, 0_u64, 0_u64);
        let (mut open, mut all) = (0_u64, 0_u64);
        for tick in 0..ticks + 40 {
            flight.advance(0..flight.poses.len());
            for (to, pose) in rows.iter_mut().zip(&flight.poses) {
                *to = row(to.body, pose);
            }
            // The budget a user would set: the floor as published so far, and so much above it.
            let floor_ns = if floors.is_empty() {
                5_000_000
            } else {
                quantile(&mut floors, 0.5)
            };
            let budget_ns = floor_ns + above_us * 1_000;
            let took = bench.tick(
                &rows,
                true,
                Budget::time_ns(budget_ns),
                Demand {
                    regions: false,
                    bodies: false,
                    body_verdicts: false,
                    ..Demand::ALL
                },
            );
            let out = &bench.out().tick;
            if floors.len() == 64 {
                floors.remove(0);
            }
            floors.push(out.floor_ns);
            if tick < 40 {
                continue;
            }
            // Below its own floor a tick takes the floor: then there is nothing to overshoot by.
            let limit_ns = budget_ns.max(out.floor_ns);
            wall.push(took.wall_ns.saturating_sub(limit_ns));
            cpu.push(took.cpu_ns.saturating_sub(limit_ns));
            if out.possible > 0 && budget_ns > out.floor_ns {
                used += out.stage_ns[usize::from(Stage::Narrow.code())] + took.rest_ns;
                told += out.stage_ns[usize::from(Stage::Narrow.code())];
                offered += budget_ns - out.floor_ns;
            }
            open += out.possible;
            all += out.candidates;
        }
        let us = |ns: u64| ns as f64 / 1e3;
        let share = |part: u64, whole: u64| {
            if whole == 0 {
                f64::NAN
            } else {
                100.0 * part as f64 / whole as f64
            }
        };
        csv += &format!(
            "{from},{seed},{bodies},{above_us},{ticks},{:.1},{:.1},{:.1},{:.1},{:.1},{:.1},{:.1},{:.2}\n",
            us(quantile(&mut floors, 0.5)),
            us(quantile(&mut wall, 0.5)),
            us(quantile(&mut wall, 0.99)),
            us(quantile(&mut cpu, 0.5)),
            us(quantile(&mut cpu, 0.99)),
            share(used, offered),
            share(told, offered),
            share(open, all)
        );
    }
    save("budget.csv", &csv);
}
