//! The cost of publishing the list of pairs: the whole list in each tick (`pairs`), or only its changes (`changes`),
//! compared with a tick without readers (`nobody`). All engines have the same scene and poses and take turns tick by
//! tick; `copy` is one copy of the message, as a transport makes it into shared memory.
//!
//! `cargo bench --bench changes [-- --quick] [--case=N] [--only=nobody|pairs|changes]`; a single case, counted from 0,
//! or a single reader (useful to count instructions) is printed and not saved.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a bench")]

mod common;

use common::{Bench, Flight, arguments, provenance, quantile, row, save};
use sweepd::builtin::pool;
use sweepd::time::{Budget, Clock, SystemClock};
use sweepd::wire::{Demand, PairRow};

/// The cases: bodies, percentage of them that moves, ticks.
const CASES: [(usize, usize, usize); 4] = [
    (10_000, 100, 100),
    (10_000, 1, 200),
    (100_000, 10, 40),
    (100_000, 1, 100),
];
/// Motion per tick, metres: one percent of a body's size.
const STEP_M: f64 = 0.0075;
/// Ticks before the measurement.
const SETTLE: usize = 20;
const SEED: u64 = 11;
const READERS: [&str; 3] = ["nobody", "pairs", "changes"];

/// An engine with its reader, and the measured values.
struct Side {
    reader: &'static str,
    demand: Demand,
    bench: Bench,
    /// Target of the copy of the message.
    sent: Vec<PairRow>,
    publish_ns: Vec<u64>,
    copy_ns: Vec<u64>,
    tick_ns: Vec<u64>,
    rows: usize,
}

impl Side {
    fn new(reader: &'static str, scene: &str) -> Self {
        let demand = Demand {
            pairs: reader == "pairs",
            changes: reader == "changes",
            ..Demand::default()
        };
        Self {
            reader,
            demand,
            bench: Bench::new(scene),
            sent: Vec::new(),
            publish_ns: Vec::new(),
            copy_ns: Vec::new(),
            tick_ns: Vec::new(),
            rows: 0,
        }
    }

    fn tick(&mut self, rows: &[sweepd::wire::TransformRow], full: bool, counted: bool) {
        let took = self.bench.tick(rows, full, Budget::UNLIMITED, self.demand);
        let out = self.bench.out();
        let message = if self.demand.changes {
            &out.changes
        } else {
            &out.pairs
        };
        let start_ns = SystemClock.monotonic_ns();
        self.sent.clear();
        self.sent.extend_from_slice(message);
        let copy_ns = SystemClock.monotonic_ns() - start_ns;
        if counted {
            self.publish_ns.push(out.tick.stage_ns[4]);
            self.copy_ns.push(copy_ns);
            self.tick_ns.push(took.wall_ns);
            self.rows += message.len();
        }
    }

    fn columns(&mut self, listed: usize) -> String {
        let us = |ns: u64| ns as f64 / 1e3;
        let ticks = self.tick_ns.len();
        format!(
            "{},{listed},{},{:.1},{:.1},{:.1},{:.1}",
            self.reader,
            self.rows / ticks,
            us(quantile(&mut self.publish_ns, 0.5)),
            us(quantile(&mut self.publish_ns, 0.99)),
            us(quantile(&mut self.copy_ns, 0.5)),
            us(quantile(&mut self.tick_ns, 0.5)),
        )
    }
}

fn main() {
    let value = |one: &str, name: &str| one.strip_prefix(name).map(ToOwned::to_owned);
    let case_of = |one: &str| {
        value(one, "--case=")?
            .parse::<usize>()
            .ok()
            .filter(|at| *at < CASES.len())
    };
    let reader_of = |one: &str| {
        let wanted = value(one, "--only=")?;
        READERS.into_iter().find(|reader| *reader == wanted)
    };
    let known = |one: &str| one == "--quick" || case_of(one).is_some() || reader_of(one).is_some();
    let arguments = arguments(known);
    let quick = arguments.iter().any(|one| one == "--quick");
    let case = arguments.iter().find_map(|one| case_of(one));
    let only = arguments.iter().find_map(|one| reader_of(one));
    let mut csv = String::from(
        "machine,commit,compiler,seed,bodies,moving_percent,ticks,reader,rows_listed,rows_sent_mean,publish_median_us,\
         publish_p99_us,copy_median_us,tick_median_us\n",
    );
    let from = provenance();
    for (at, (bodies, moving, ticks)) in CASES.into_iter().enumerate() {
        if case.is_some_and(|case| case != at) || (quick && bodies > 10_000) {
            continue;
        }
        for columns in run(bodies, moving, ticks, only) {
            csv += &format!("{from},{SEED},{bodies},{moving},{ticks},{columns}\n");
        }
    }
    if case.is_some() || only.is_some() {
        print!("{csv}");
    } else {
        save("changes.csv", &csv);
    }
}

/// Runs one case; returns the CSV columns of each reader.
fn run(bodies: usize, moving: usize, ticks: usize, only: Option<&'static str>) -> Vec<String> {
    // Bodies that do not move are not sent again; the long timeout keeps them from becoming stale.
    let scene = pool(bodies, SEED).replace("timeout_ms = 500", "timeout_ms = 600000");
    let readers = READERS.into_iter();
    let wanted = readers.filter(|reader| only.is_none_or(|only| only == *reader));
    let mut sides: Vec<Side> = wanted.map(|reader| Side::new(reader, &scene)).collect();
    let mut flight = Flight::new(&sides[0].bench.scene, STEP_M, SEED);
    let who: Vec<usize> = (0..bodies).step_by(100 / moving).collect();
    let all = sides[0].bench.rows.clone();
    let mut rows: Vec<_> = who.iter().map(|at| all[*at]).collect();
    for tick in 0..ticks + SETTLE {
        if tick == 0 {
            // The first frame gives every body a pose.
            sides
                .iter_mut()
                .for_each(|side| side.tick(&all, true, false));
            continue;
        }
        flight.advance(who.iter().copied());
        for (to, at) in rows.iter_mut().zip(&who) {
            *to = row(to.body, &flight.poses[*at]);
        }
        // Rotates the order of the engines, so that each is first equally often.
        let first = tick % sides.len();
        for side in 0..sides.len() {
            let at = (first + side) % sides.len();
            sides[at].tick(&rows, moving == 100, tick >= SETTLE);
        }
    }
    let tick = &sides[0].bench.out().tick;
    let listed = usize::try_from(tick.colliding + tick.near + tick.possible).unwrap();
    sides.iter_mut().map(|side| side.columns(listed)).collect()
}
