//! Budgets above the floor: by how much a tick overshoots, in wall time and in the thread's CPU time, and how much of
//! the time above the floor is used while work remains. That share is given in wall time for work before and after
//! publishing, in wall time for work before publishing alone, and as a lower bound in CPU time (waiting for a core uses
//! wall time but no CPU time).
//!
//! Each tick is followed by a control of the same length: a thread that only polls the clock until the time is up. Its
//! overshoot is caused by the machine (interrupts, a host with other guests); a tick could only avoid this overshoot by
//! ending earlier by as much, which would cost that part of its budget.
//!
//! Scenes: `pool`, `pool(4000, 11)`, each body moved by 1 % of its size per tick, with pairs and contacts in demand;
//! `meshes`, 200 pairs of meshes of 19,880 triangles (`benches/time_critical`), moved by 0.5 % of their diameter per
//! tick, with the same demand; and `meshes_regions`, the same with `regions` in demand too.
//!
//! `cargo bench --bench budget [-- --quick] [SCENE..]`; saved rows of scenes that are not named are kept

#![allow(clippy::cast_precision_loss, reason = "a bench")]

mod common;
#[allow(
    dead_code,
    unreachable_pub,
    missing_debug_implementations,
    clippy::unwrap_used,
    reason = "shared with another bench"
)]
#[path = "time_critical/stage.rs"]
mod stage;

use std::sync::Arc;

use common::{Bench, Flight, arguments, kept_rows, provenance, quantile, row, save};
use stage::{Courses, bodies, shapes};
use sweepd::builtin::pool;
use sweepd::shape::Shape;
use sweepd::time::{Budget, Clock, SystemClock};
use sweepd::wire::{Demand, Stage, TransformRow};

const SEED: u64 = 11;
const SCENES: [&str; 3] = ["pool", "meshes", "meshes_regions"];
/// Ticks before the measurement.
const WARM_UP: usize = 40;

/// The motion of the bodies of a scene.
enum Motion {
    Flight(Box<Flight>, Vec<TransformRow>),
    Courses(Courses),
}

impl Motion {
    fn next(&mut self) -> Vec<TransformRow> {
        match self {
            Self::Flight(flight, rows) => {
                flight.advance(0..flight.poses.len());
                for (to, pose) in rows.iter_mut().zip(&flight.poses) {
                    *to = row(to.body, pose);
                }
                rows.clone()
            }
            Self::Courses(courses) => {
                courses.advance();
                courses.rows().collect()
            }
        }
    }
}

fn start(scene: &str, meshes: &[Arc<Shape>]) -> (Bench, Motion) {
    if scene == "pool" {
        let bench = Bench::new(&pool(4_000, SEED));
        let flight = Flight::new(&bench.scene, 0.75 * 0.01, SEED);
        let rows = bench.rows.clone();
        return (bench, Motion::Flight(Box::new(flight), rows));
    }
    let (scene, placed) = bodies(meshes);
    (
        Bench::of(scene, placed),
        Motion::Courses(Courses::new(0.5, SEED)),
    )
}

fn main() {
    let arguments = arguments(|one| one == "--quick" || SCENES.contains(&one));
    let quick = arguments.iter().any(|one| one == "--quick");
    let named = |scene: &str| arguments.iter().any(|one| one == scene);
    let all = !SCENES.iter().any(|scene| named(scene));
    let ticks = if quick { 60 } else { 2_000 };
    let meshes = shapes();
    let columns = "machine,commit,compiler,seed,scene,bodies,above_floor_us,ticks,floor_us,publish_p50_us,\
         overshoot_wall_p50_us,overshoot_wall_p99_us,overshoot_wall_p999_us,overshoot_cpu_p50_us,overshoot_cpu_p99_us,\
         overshoot_cpu_p999_us,machine_cpu_p50_us,machine_cpu_p99_us,machine_cpu_p999_us,used_percent,\
         used_before_publishing_percent,undecided_percent,used_cpu_percent\n";
    let mut csv = String::from(columns);
    let from = provenance();
    for scene in SCENES {
        if !all && !named(scene) {
            csv += &kept_rows("budget.csv", columns, |cells| cells[4] == scene);
            continue;
        }
        for above_us in [100, 250, 500, 1_000, 2_000, 5_000_u64] {
            let line = run(scene, &meshes, above_us, ticks);
            eprintln!("{line}");
            csv += &format!("{from},{SEED},{line}\n");
        }
    }
    save("budget.csv", &csv);
}

/// The control: polls the clock for `ns`; returns its overshoot on the thread's CPU clock, nanoseconds.
fn look_for(ns: u64) -> u64 {
    let from = [SystemClock.monotonic_ns(), SystemClock.thread_cpu_ns()];
    while SystemClock.monotonic_ns() < from[0] + ns {}
    (SystemClock.thread_cpu_ns() - from[1]).saturating_sub(ns)
}

/// Quantiles of overshoots, microseconds: 50, 99 and 99.9 %.
fn overshoots(times: &mut [u64]) -> String {
    let at = [0.5, 0.99, 0.999].map(|share| quantile(times, share) as f64 / 1e3);
    at.map(|us| format!("{us:.1}")).join(",")
}

/// Runs one scene with one budget; returns its CSV columns from `scene` on.
fn run(scene: &str, meshes: &[Arc<Shape>], above_us: u64, ticks: usize) -> String {
    let (mut bench, mut motion) = start(scene, meshes);
    let demand = Demand {
        regions: scene == "meshes_regions",
        bodies: false,
        body_verdicts: false,
        changes: false,
        ..Demand::ALL
    };
    let mut floors = Vec::new();
    let (mut wall, mut cpu, mut publish) = (Vec::new(), Vec::new(), Vec::new());
    let mut machine = Vec::new();
    let (mut used, mut told, mut used_cpu, mut offered) = (0_u64, 0_u64, 0_u64, 0_u64);
    let (mut open, mut all) = (0_u64, 0_u64);
    for tick in 0..ticks + WARM_UP {
        let rows = motion.next();
        // The budget that a user would set: the median of the floors published so far, plus `above_us`.
        let floor_ns = if floors.is_empty() {
            5_000_000
        } else {
            // `quantile` sorts its argument; `floors` must stay in order of age.
            quantile(&mut floors.clone(), 0.5)
        };
        let budget_ns = floor_ns + above_us * 1_000;
        let took = bench.tick(&rows, true, Budget::time_ns(budget_ns), demand);
        let out = &bench.out().tick;
        if floors.len() == 64 {
            floors.remove(0);
        }
        floors.push(out.floor_ns);
        if tick < WARM_UP {
            continue;
        }
        publish.push(out.stage_ns[usize::from(Stage::Publish.code())]);
        // A tick whose budget is below its floor takes the floor; only time beyond the floor is overshoot then.
        let limit_ns = budget_ns.max(out.floor_ns);
        wall.push(took.wall_ns.saturating_sub(limit_ns));
        cpu.push(took.cpu_ns.saturating_sub(limit_ns));
        machine.push(look_for(limit_ns));
        if out.possible > 0 && budget_ns > out.floor_ns {
            used += out.stage_ns[usize::from(Stage::Narrow.code())] + took.rest_ns;
            told += out.stage_ns[usize::from(Stage::Narrow.code())];
            // A lower bound of the CPU time used: the floor is wall time, which is at least its CPU time.
            used_cpu += took.cpu_ns.saturating_sub(out.floor_ns);
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
    format!(
        "{scene},{},{above_us},{ticks},{:.1},{:.1},{},{},{},{:.1},{:.1},{:.2},{:.1}",
        bench.scene.bodies.len(),
        us(quantile(&mut floors, 0.5)),
        us(quantile(&mut publish, 0.5)),
        overshoots(&mut wall),
        overshoots(&mut cpu),
        overshoots(&mut machine),
        share(used, offered),
        share(told, offered),
        share(open, all),
        share(used_cpu, offered)
    )
}
