//! What is known when time runs out: 200 pairs of meshes of 19,880 triangles, one thread, at the narrow phase's door.
//!
//! For each method: a cold start (all verdicts, and the share of verdicts against the budget, in microseconds and in
//! work units), and coherent motion of 0.1, 0.5 and 2 % of the diameter a tick, without a limit and within 200 and
//! 500 us: unresolved pairs, pairs whose last verdict is not the truth, the oldest pair without a verdict, contacts
//! that were reported late, overshoot. The time starts after the motion pass, which is told beside it. Truth: walks to
//! the end over the other trees.
//!
//! `cargo bench --bench time_critical [-- --quick] [--cold] [METHOD..]`, and `-- regions` for approximate contacts
//! alone (see `regions`), `-- distance` for the distance of one pair, `-- interruptible` for what it costs that work can
//! be stopped; `-- peers FOLDER` is a part of `benches/mesh_peers.py`.

#![allow(
    clippy::cast_precision_loss,
    clippy::unwrap_used,
    clippy::print_stdout,
    unreachable_pub,
    missing_debug_implementations,
    reason = "a bench"
)]

#[path = "../common/mod.rs"]
mod common;
mod distance;
mod interruptible;
#[path = "../../tests/oracle/mod.rs"]
mod oracle;
mod peers;
mod regions;
mod restart;
mod stage;

use std::sync::Arc;

use common::{provenance, quantile, save};
use restart::Restart;
use stage::{PAIRS, Stage, shapes};
use sweepd::narrow::mesh::{Search, Walk};
use sweepd::narrow::{Order, Wanted};
use sweepd::shape::Shape;
use sweepd::time::{Clock, Meter, SystemClock};
use sweepd::wire::Verdict;

const SEED: u64 = 17;
/// Budgets of the cold profile, microseconds, and about what they buy in work units.
const PROFILE_US: [u64; 9] = [50, 100, 200, 300, 500, 750, 1_000, 1_500, 2_000];
const PROFILE_UNITS: [u64; 8] = [500, 1_000, 2_000, 4_000, 8_000, 16_000, 32_000, 64_000];

/// Limits in motion: none, microseconds, or work units (which no other load disturbs).
#[derive(Clone, Copy)]
enum Limit {
    None,
    Us(u64),
    Units(u64),
}

const LIMITS: [Limit; 6] = [
    Limit::None,
    Limit::Us(200),
    Limit::Us(500),
    Limit::Units(500),
    Limit::Units(1_000),
    Limit::Units(2_000),
];

const WANTED: Wanted = Wanted {
    contacts: false,
    bounds: false,
    regions: false,
    order: Order::Aged,
};

/// What is measured: the engine's narrow phase, or a baseline.
enum Subject {
    Engine(Search),
    Restart(Box<Restart>),
}

/// The engine's searches; and walks over the boxes in the bodies' frames, with and without last tick's witness.
const SUBJECTS: [&str; 6] = [
    "carried",
    "restart",
    "breadth_first",
    "priority",
    "walk",
    "walk_witness",
];

impl Subject {
    fn new(name: &str) -> Self {
        match name {
            "walk" => Self::Restart(Box::new(Restart::new(false))),
            "walk_witness" => Self::Restart(Box::new(Restart::new(true))),
            _ => Self::Engine(Search::named(name).unwrap()),
        }
    }

    fn spend(&mut self, stage: &mut Stage, meter: &mut Meter<'_>) {
        match self {
            Self::Engine(search) => {
                stage.narrow.set_search(*search);
                stage.narrow.spend(&mut stage.world, WANTED, meter);
            }
            Self::Restart(restart) => restart.spend(stage, meter),
        }
    }

    /// Verdict of every pair at this tick's poses; `None`: unresolved.
    fn verdicts(&self, stage: &Stage) -> Vec<Option<bool>> {
        match self {
            Self::Engine(_) => {
                let mut all = vec![None; PAIRS];
                for (slot, _) in stage.pairs.iter() {
                    let verdict = stage.narrow.finding(slot).unwrap().verdict;
                    all[stage.pair_of(slot)] = match verdict {
                        Verdict::Colliding => Some(true),
                        Verdict::Possible => None,
                        _ => Some(false),
                    };
                }
                all
            }
            Self::Restart(restart) => restart.verdicts.clone(),
        }
    }
}

#[derive(Default)]
struct Tally {
    pair_ticks: u64,
    unresolved: u64,
    unconfirmed: u64,
    wrong: u64,
    guess_errors: u64,
    oldest: u64,
    spent_ns: Vec<u64>,
    spent_cpu_ns: Vec<u64>,
    motion_ns: Vec<u64>,
    units: Vec<u64>,
    over_wall_ns: Vec<u64>,
    over_cpu_ns: Vec<u64>,
    delays: Vec<u64>,
    ages: Vec<u64>,
    last: Vec<bool>,
    begun: Vec<Option<u64>>,
    were: Vec<bool>,
}

impl Tally {
    fn new() -> Self {
        Self {
            ages: vec![0; PAIRS],
            last: vec![false; PAIRS],
            begun: vec![None; PAIRS],
            were: vec![true; PAIRS],
            ..Self::default()
        }
    }

    fn compare(&mut self, tick: u64, truth: &[bool], verdicts: &[Option<bool>]) {
        for pair in 0..PAIRS {
            let (collides, verdict) = (truth[pair], verdicts[pair]);
            self.pair_ticks += 1;
            if collides && !self.were[pair] {
                self.begun[pair] = Some(tick);
            }
            self.were[pair] = collides;
            match verdict {
                Some(said) => {
                    self.wrong += u64::from(said != collides);
                    self.ages[pair] = 0;
                    self.last[pair] = said;
                    if let Some(begun) = self.begun[pair].take_if(|_| said) {
                        self.delays.push(tick - begun);
                    }
                }
                None => {
                    self.unresolved += 1;
                    self.unconfirmed += u64::from(collides);
                    self.guess_errors += u64::from(self.last[pair] != collides);
                    self.ages[pair] += 1;
                    self.oldest = self.oldest.max(self.ages[pair]);
                }
            }
            if !collides {
                self.begun[pair] = None;
            }
        }
    }
}

fn main() {
    let quick = std::env::args().any(|arg| arg == "--quick");
    let only: Vec<String> = std::env::args()
        .skip(1)
        .filter(|arg| !arg.starts_with("--"))
        .collect();
    let ticks = if quick { 20 } else { 99 };
    let shapes = shapes();
    if let Some(at) = only.iter().position(|name| name == "peers") {
        peers::run(&shapes, std::path::Path::new(&only[at + 1]));
        return;
    }
    if only.iter().any(|name| name == "distance") {
        distance::run(&shapes);
        return;
    }
    if only.iter().any(|name| name == "interruptible") {
        interruptible::run(&shapes, quick);
        return;
    }
    if only.iter().any(|name| name == "regions") {
        regions::run(&shapes, quick);
        return;
    }
    let from = provenance();
    let mut csv = String::from(
        "machine,commit,compiler,seed,method,case,motion_percent,budget,ticks,pairs,spent_p50_us,spent_p99_us,spent_cpu_p50_us,motion_pass_p50_us,\
         units_p50,unresolved_percent,unconfirmed_percent,guess_error_percent,oldest_ticks,wrong,onset_p50_ticks,onset_p99_ticks,\
         overshoot_wall_p99_us,overshoot_cpu_p99_us,area\n",
    );
    for name in SUBJECTS {
        if !only.is_empty() && !only.iter().any(|o| o == name) {
            continue;
        }
        let mut add = |line: String| {
            println!("{line}");
            csv += &format!("{from},{SEED},{name},{line}\n");
        };
        println!(
            "{name}: case,motion,budget,ticks,pairs,spent p50,p99,cpu p50,motion pass,units,unresolved %,unconfirmed %,guess %,oldest,wrong,onset p50,p99,over wall,cpu,area"
        );
        cold(name, &shapes, if quick { 3 } else { 15 }, &mut add);
        if std::env::args().any(|arg| arg == "--cold") {
            continue;
        }
        for percent in [0.1, 0.5, 2.0] {
            for limit in LIMITS {
                add(moving(name, &shapes, percent, limit, ticks));
            }
        }
    }
    save("time_critical.csv", &csv);
}

/// From nothing: the share of pairs with a verdict against the budget, each point a fresh start, the median of several.
fn cold(name: &str, shapes: &[Arc<Shape>], rounds: usize, add: &mut impl FnMut(String)) {
    let mut stage = Stage::new(shapes, 0.0, SEED);
    let truth = stage.truth(&mut Walk::default());
    let mut start = |limit: (Option<u64>, Option<u64>)| {
        let mut subject = Subject::new(name);
        stage.make_cold();
        stage.begin();
        let clock = SystemClock;
        let from_ns = clock.monotonic_ns();
        let deadline_ns = limit.0.map(|us| from_ns + us * 1_000);
        let mut meter = Meter::new(&clock, deadline_ns, limit.1);
        subject.spend(&mut stage, &mut meter);
        let spent_ns = clock.monotonic_ns() - from_ns;
        let mut tally = Tally::new();
        tally.compare(1, &truth, &subject.verdicts(&stage));
        (spent_ns, meter.spent(), tally)
    };
    let line =
        |case: &str, budget: String, times: &mut [u64], units: u64, tally: &Tally, area: &str| {
            format!(
                "{case},0,{budget},{},{PAIRS},{:.1},{:.1},,,{units},{:.2},{:.2},,,{},,,,,{area}",
                times.len(),
                us(quantile(times, 0.5)),
                us(quantile(times, 0.99)),
                percent_of(tally.unresolved, tally.pair_ticks),
                percent_of(tally.unconfirmed, tally.pair_ticks),
                tally.wrong,
            )
        };
    let mut times = Vec::new();
    let mut last = None;
    for _ in 0..rounds {
        let (spent_ns, units, tally) = start((None, None));
        times.push(spent_ns);
        last = Some((units, tally));
    }
    let (units, tally) = last.unwrap();
    add(line(
        "cold_all",
        "none".to_owned(),
        &mut times,
        units,
        &tally,
        "",
    ));
    let (mut area, mut before) = (0.0, (0_u64, 0.0));
    for budget_us in PROFILE_US {
        let mut runs: Vec<_> = (0..rounds)
            .map(|_| start((Some(budget_us), None)))
            .collect();
        runs.sort_by_key(|run| run.2.unresolved);
        let tally = &runs[rounds / 2].2;
        let share = 1.0 - tally.unresolved as f64 / PAIRS as f64;
        area += (budget_us - before.0) as f64 * (share + before.1) / 2.0;
        before = (budget_us, share);
        let mut times: Vec<u64> = runs.iter().map(|run| run.0).collect();
        let (units, so_far) = (
            runs[rounds / 2].1,
            format!("{:.3}", area / budget_us as f64),
        );
        add(line(
            "cold",
            format!("{budget_us}us"),
            &mut times,
            units,
            tally,
            &so_far,
        ));
    }
    for units in PROFILE_UNITS {
        let (spent_ns, spent, tally) = start((None, Some(units)));
        add(line(
            "cold",
            format!("{units}units"),
            &mut [spent_ns],
            spent,
            &tally,
            "",
        ));
    }
}

/// Which pairs collide in each tick. Found before: the walks look at every tree, and between two ticks they would take
/// the caches from what is timed.
fn truths(shapes: &[Arc<Shape>], percent: f64, ticks: u64) -> Vec<Vec<bool>> {
    let (mut stage, mut walk) = (Stage::new(shapes, percent, SEED), Walk::default());
    let truth = |_| {
        let truth = stage.truth(&mut walk);
        stage.advance();
        truth
    };
    (1..=ticks).map(truth).collect()
}

/// Coherent motion, the first tick cold.
fn moving(name: &str, shapes: &[Arc<Shape>], percent: f64, limit: Limit, ticks: u64) -> String {
    let truths = truths(shapes, percent, ticks);
    let mut stage = Stage::new(shapes, percent, SEED);
    let mut subject = Subject::new(name);
    let mut tally = Tally::new();
    let clock = SystemClock;
    for (tick, truth) in (1..=ticks).zip(&truths) {
        let motion_ns = stage.begin();
        let (from_ns, cpu_ns) = (clock.monotonic_ns(), clock.thread_cpu_ns());
        let (limit_ns, units) = match limit {
            Limit::None => (None, None),
            Limit::Us(us) => (Some(us * 1_000), None),
            Limit::Units(units) => (None, Some(units)),
        };
        let deadline_ns = limit_ns.map(|ns| from_ns + ns);
        let mut meter = Meter::new(&clock, deadline_ns, units);
        subject.spend(&mut stage, &mut meter);
        let spent_ns = clock.monotonic_ns() - from_ns;
        let spent_cpu_ns = clock.thread_cpu_ns() - cpu_ns;
        let units = meter.spent();
        // The first tick is cold, and told by the cold figures.
        if tick > 1 {
            tally.spent_ns.push(spent_ns);
            tally.spent_cpu_ns.push(spent_cpu_ns);
            tally.motion_ns.push(motion_ns);
            tally.units.push(units);
            let limit_ns = limit_ns.unwrap_or(u64::MAX);
            tally.over_wall_ns.push(spent_ns.saturating_sub(limit_ns));
            tally
                .over_cpu_ns
                .push(spent_cpu_ns.saturating_sub(limit_ns));
        }
        tally.compare(tick, truth, &subject.verdicts(&stage));
        stage.advance();
    }
    let delay = |tally: &mut Tally, share: f64| {
        if tally.delays.is_empty() {
            return String::new();
        }
        quantile(&mut tally.delays, share).to_string()
    };
    let (onset_p50, onset_p99) = (delay(&mut tally, 0.5), delay(&mut tally, 0.99));
    format!(
        "moving,{percent},{},{ticks},{PAIRS},{:.1},{:.1},{:.1},{:.1},{},{:.2},{:.2},{:.2},{},{},{},{},{:.1},{:.1},",
        match limit {
            Limit::None => "none".to_owned(),
            Limit::Us(us) => format!("{us}us"),
            Limit::Units(units) => format!("{units}units"),
        },
        us(quantile(&mut tally.spent_ns, 0.5)),
        us(quantile(&mut tally.spent_ns, 0.99)),
        us(quantile(&mut tally.spent_cpu_ns, 0.5)),
        us(quantile(&mut tally.motion_ns, 0.5)),
        quantile(&mut tally.units, 0.5),
        percent_of(tally.unresolved, tally.pair_ticks),
        percent_of(tally.unconfirmed, tally.pair_ticks),
        percent_of(tally.guess_errors, tally.pair_ticks),
        tally.oldest,
        tally.wrong,
        onset_p50,
        onset_p99,
        us(quantile(&mut tally.over_wall_ns, 0.99)),
        us(quantile(&mut tally.over_cpu_ns, 0.99)),
    )
}

fn us(ns: u64) -> f64 {
    ns as f64 / 1e3
}

fn percent_of(part: u64, whole: u64) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}
