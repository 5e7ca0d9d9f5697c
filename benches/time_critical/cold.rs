//! Cold starts: the knowledge about all pairs as a function of the budget. Each point is a fresh start, the median of
//! several.
//!
//! `cold`: only verdicts are demanded. The area under the curve of the share of pairs with a verdict is given against
//! microseconds and against work units. `cold_bounds`: after the verdicts also distances of pairs nearer than
//! [`REPORT_WITHIN_M`].
//!
//! For both, the uncertainty of open pairs: the width of the distance interval, and the region of a possible contact.
//! The upper end of the interval is that of the bodies' boxes until the search reaches leaves. The region shrinks box
//! by box in any order of work, so it shows how deep a breadth-first search has come.

use std::fmt::Display;
use std::sync::Arc;

use sweepd::narrow::Wanted;
use sweepd::narrow::mesh::Walk;
use sweepd::shape::Shape;
use sweepd::time::{Clock, SystemClock};

use crate::SEED;
use crate::common::quantile;
use crate::stage::{PAIRS, Stage};
use crate::subject::{Subject, VERDICTS};
use crate::table::{Limit, Row, tenths};
use crate::tally::Tally;

/// Budgets of the profile: microseconds, then work units that take about as long.
const PROFILE_US: [u64; 11] = [
    50, 100, 200, 300, 500, 750, 1_000, 1_500, 2_000, 5_000, 20_000,
];
const PROFILE_UNITS: [u64; 9] = [
    500, 1_000, 2_000, 4_000, 8_000, 16_000, 32_000, 64_000, 128_000,
];
/// Budgets for verdicts and bounds: microseconds, then work units that a breadth-first search spends in about that
/// time.
const BOUNDS_US: [u64; 5] = [500, 1_000, 2_000, 5_000, 20_000];
const BOUNDS_UNITS: [u64; 5] = [2_500, 5_000, 10_000, 25_000, 100_000];
/// Budgets as percentages of the work that the same method needs to finish.
const SHARES: [u64; 5] = [5, 10, 25, 50, 75];
/// Distance that no pair reaches, metres, so that all are reported.
const REPORT_WITHIN_M: f64 = 0.5;
/// Most starts per point with bounds, because each takes long.
const BOUNDS_ROUNDS: usize = 5;

/// The result of a fresh start.
struct Run {
    spent_ns: u64,
    spent_cpu_ns: u64,
    units: u64,
    tally: Tally,
    /// Widths of intervals, millionths of the diameter.
    widths: Vec<u64>,
    regions: Vec<u64>,
}

/// The stage and method of all starts, each of which is cold.
struct Bed<'a> {
    name: &'a str,
    stage: Stage,
    truth: Vec<bool>,
    wanted: Wanted,
}

impl<'a> Bed<'a> {
    fn new(name: &'a str, shapes: &[Arc<Shape>], bounds: bool) -> Self {
        let within_m = if bounds { REPORT_WITHIN_M } else { 0.0 };
        let stage = Stage::reporting(shapes, 0.0, SEED, within_m);
        Self {
            name,
            truth: stage.truth(&mut Walk::default()),
            stage,
            wanted: Wanted { bounds, ..VERDICTS },
        }
    }

    fn start(&mut self, limit: Limit) -> Run {
        let mut subject = Subject::new(self.name);
        self.stage.make_cold();
        self.stage.begin();
        let clock = SystemClock;
        let (from_ns, cpu_ns) = (clock.monotonic_ns(), clock.thread_cpu_ns());
        let mut meter = limit.meter(&clock, from_ns);
        subject.spend(&mut self.stage, self.wanted, &mut meter);
        let spent_ns = clock.monotonic_ns() - from_ns;
        let spent_cpu_ns = clock.thread_cpu_ns() - cpu_ns;
        let mut tally = Tally::new();
        tally.compare(1, &self.truth, &subject.verdicts(&self.stage));
        Run {
            spent_ns,
            spent_cpu_ns,
            units: meter.spent(),
            tally,
            widths: subject.widths(&self.stage),
            regions: subject.regions(&mut self.stage),
        }
    }

    fn runs(&mut self, limit: Limit, rounds: usize) -> Runs {
        let mut all: Vec<Run> = (0..rounds).map(|_| self.start(limit)).collect();
        all.sort_by_key(|run| run.tally.unresolved);
        Runs(all)
    }

    /// Adds the rows whose budgets are shares of the total work.
    fn shares(&mut self, case: &str, work: u64, add: &mut impl FnMut(Row)) {
        for percent in SHARES {
            let runs = self.runs(Limit::Units(work * percent / 100), 1);
            add(runs.row(case, format!("{percent}%")));
        }
    }
}

/// Starts with the same limit, sorted by the number of pairs they left open.
struct Runs(Vec<Run>);

impl Runs {
    fn middle(&self) -> &Run {
        &self.0[self.0.len() / 2]
    }

    fn row(&self, case: &str, budget: impl Display) -> Row {
        let run = self.middle();
        let mut wall_ns: Vec<u64> = self.0.iter().map(|run| run.spent_ns).collect();
        let mut cpu_ns: Vec<u64> = self.0.iter().map(|run| run.spent_cpu_ns).collect();
        let row = Row::new(case)
            .put("motion_percent", 0)
            .put("budget", budget)
            .put("ticks", self.0.len())
            .put("pairs", PAIRS)
            .put("spent_p50_us", tenths(quantile(&mut wall_ns, 0.5)))
            .put("spent_p99_us", tenths(quantile(&mut wall_ns, 0.99)))
            .put("spent_cpu_p50_us", tenths(quantile(&mut cpu_ns, 0.5)))
            .put("units_p50", run.units);
        let row = run.tally.tell(row);
        let widths = ["width_mean_percent", "width_p50_percent"];
        let regions = ["region_mean_percent", "region_p50_percent"];
        spread(spread(row, widths, &run.widths), regions, &run.regions)
    }
}

/// Adds mean and median of shares of the diameter, if there are any.
fn spread(row: Row, [mean, median]: [&str; 2], millionths: &[u64]) -> Row {
    if millionths.is_empty() {
        return row;
    }
    let percent = |millionths: f64| format!("{:.3}", millionths / 1e4);
    let sum: u64 = millionths.iter().sum();
    let mut sorted = millionths.to_vec();
    row.put(mean, percent(sum as f64 / millionths.len() as f64))
        .put(median, percent(quantile(&mut sorted, 0.5) as f64))
}

/// Area under the curve of the share of pairs with a verdict: trapezoids, starting at 0 for a budget of 0.
#[derive(Default)]
struct Area {
    sum: f64,
    budget: u64,
    share: f64,
}

impl Area {
    /// Extends the area to a larger budget; returns it as a share of its greatest possible value.
    fn add(&mut self, budget: u64, share: f64) -> String {
        self.sum += (budget - self.budget) as f64 * (share + self.share) / 2.0;
        (self.budget, self.share) = (budget, share);
        format!("{:.3}", self.sum / budget as f64)
    }
}

/// Measures verdicts as a function of the budget.
pub fn profile(name: &str, shapes: &[Arc<Shape>], rounds: usize, add: &mut impl FnMut(Row)) {
    let mut bed = Bed::new(name, shapes, false);
    let all = bed.runs(Limit::None, rounds);
    add(all.row("cold_all", Limit::None));
    let mut area = Area::default();
    for budget_us in PROFILE_US {
        let limit = Limit::Us(budget_us);
        let runs = bed.runs(limit, rounds);
        let so_far = area.add(budget_us, runs.middle().tally.resolved());
        add(runs.row("cold", limit).put("area", so_far));
    }
    let mut area = Area::default();
    for units in PROFILE_UNITS {
        let limit = Limit::Units(units);
        let runs = bed.runs(limit, 1);
        let so_far = area.add(units, runs.middle().tally.resolved());
        add(runs.row("cold", limit).put("area", so_far));
    }
    bed.shares("cold", all.middle().units, add);
}

/// Measures verdicts, then distances, as functions of the budget.
pub fn bounds(name: &str, shapes: &[Arc<Shape>], rounds: usize, add: &mut impl FnMut(Row)) {
    let rounds = rounds.min(BOUNDS_ROUNDS);
    let mut bed = Bed::new(name, shapes, true);
    let all = bed.runs(Limit::None, rounds);
    add(all.row("cold_bounds_all", Limit::None));
    for limit in BOUNDS_US.map(Limit::Us) {
        add(bed.runs(limit, rounds).row("cold_bounds", limit));
    }
    for limit in BOUNDS_UNITS.map(Limit::Units) {
        add(bed.runs(limit, 1).row("cold_bounds", limit));
    }
    bed.shares("cold_bounds", all.middle().units, add);
}
