//! Coherent motion with a limit per tick; the first tick is cold.

use std::sync::Arc;

use sweepd::narrow::mesh::Walk;
use sweepd::shape::Shape;
use sweepd::time::{Clock, SystemClock};

use crate::SEED;
use crate::common::quantile;
use crate::stage::{PAIRS, Stage};
use crate::subject::{Subject, VERDICTS};
use crate::table::{Limit, Row, tenths};
use crate::tally::Tally;

/// Motions of a surface point per tick, percent of the diameter.
pub const PERCENTS: [f64; 3] = [0.1, 0.5, 2.0];

pub const LIMITS: [Limit; 6] = [
    Limit::None,
    Limit::Us(200),
    Limit::Us(500),
    Limit::Units(500),
    Limit::Units(1_000),
    Limit::Units(2_000),
];

#[derive(Default)]
struct Times {
    spent_ns: Vec<u64>,
    spent_cpu_ns: Vec<u64>,
    motion_ns: Vec<u64>,
    units: Vec<u64>,
    over_wall_ns: Vec<u64>,
    over_cpu_ns: Vec<u64>,
}

impl Times {
    fn tell(&mut self, row: Row) -> Row {
        row.put("spent_p50_us", tenths(quantile(&mut self.spent_ns, 0.5)))
            .put("spent_p99_us", tenths(quantile(&mut self.spent_ns, 0.99)))
            .put(
                "spent_cpu_p50_us",
                tenths(quantile(&mut self.spent_cpu_ns, 0.5)),
            )
            .put(
                "motion_pass_p50_us",
                tenths(quantile(&mut self.motion_ns, 0.5)),
            )
            .put("units_p50", quantile(&mut self.units, 0.5))
            .put(
                "overshoot_wall_p99_us",
                tenths(quantile(&mut self.over_wall_ns, 0.99)),
            )
            .put(
                "overshoot_cpu_p99_us",
                tenths(quantile(&mut self.over_cpu_ns, 0.99)),
            )
    }
}

/// One motion, the same for all methods, and which pairs collide in each of its ticks.
pub struct Motion {
    percent: f64,
    truths: Vec<Vec<bool>>,
}

impl Motion {
    /// The truth is computed in advance: its walks read every tree, and between two ticks would evict the caches that
    /// the timed code uses.
    pub fn new(shapes: &[Arc<Shape>], percent: f64, ticks: u64) -> Self {
        let (mut stage, mut walk) = (Stage::new(shapes, percent, SEED), Walk::default());
        let truth = |_| {
            let truth = stage.truth(&mut walk);
            stage.advance();
            truth
        };
        Self {
            percent,
            truths: (0..ticks).map(truth).collect(),
        }
    }

    pub fn run(&self, name: &str, shapes: &[Arc<Shape>], limit: Limit) -> Row {
        let mut stage = Stage::new(shapes, self.percent, SEED);
        let mut subject = Subject::new(name);
        let (mut tally, mut times) = (Tally::new(), Times::default());
        let clock = SystemClock;
        for (tick, truth) in (1_u64..).zip(&self.truths) {
            let motion_ns = stage.begin();
            let (from_ns, cpu_ns) = (clock.monotonic_ns(), clock.thread_cpu_ns());
            let mut meter = limit.meter(&clock, from_ns);
            subject.spend(&mut stage, VERDICTS, &mut meter);
            let spent_ns = clock.monotonic_ns() - from_ns;
            let spent_cpu_ns = clock.thread_cpu_ns() - cpu_ns;
            // The first tick is cold and is covered by the cold figures.
            if tick > 1 {
                times.spent_ns.push(spent_ns);
                times.spent_cpu_ns.push(spent_cpu_ns);
                times.motion_ns.push(motion_ns);
                times.units.push(meter.spent());
                let limit_ns = limit.ns().unwrap_or(u64::MAX);
                times.over_wall_ns.push(spent_ns.saturating_sub(limit_ns));
                (times.over_cpu_ns).push(spent_cpu_ns.saturating_sub(limit_ns));
            }
            tally.compare(tick, truth, &subject.verdicts(&stage));
            stage.advance();
        }
        let row = Row::new("moving")
            .put("motion_percent", self.percent)
            .put("budget", limit)
            .put("ticks", self.truths.len())
            .put("pairs", PAIRS);
        tally.tell_run(times.tell(row))
    }
}
