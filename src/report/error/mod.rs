//! Error against run time: one scene in one motion at a sweep of budgets. Each answer is compared with that of a twin
//! engine without a budget at the same poses.
//!
//! In: a checked scene with its shapes ([`Setup`]). Out: a [`Report`], one row per budget. Time budgets are measured on
//! the machine's clock; work budgets read no clock, so that a report on them is the same to the last bit.
//!
//! Each budget's engine runs a block of ticks before the next one does, so that its memory is as warm as if it ran
//! alone. Then the twin runs the same ticks, and the answers are compared.

pub mod check;
pub mod columns;
pub mod course;
mod lane;
pub mod page;
pub mod tally;

use std::sync::Arc;

use serde::Serialize;

use super::rig::Rig;
use super::stats::quantile;
use crate::builtin::Pattern;
use crate::error::Result;
use crate::scene::Scene;
use crate::time::{Budget, Clock, SystemClock};
use crate::world::Parts;

use course::Course;
use lane::{Lane, Twin};
use tally::Row;

/// Ticks that one engine runs before the next one does: enough that its memory is warm for most of them, few enough
/// that all their rows fit into memory.
const BLOCK_TICKS: u64 = 16;
/// Ticks of the pilot run that determines the budgets.
const PILOT_TICKS: u64 = 24;
/// Least value of a sweep's longest time budget, nanoseconds: some tens of microseconds are kept back for publishing,
/// however little work a scene has.
const TIME_MIN_NS: u64 = 200_000;
/// Number of budgets if none are given; a sweep over work units adds 0 and no limit.
const BUDGETS: i32 = 9;

/// The limited quantity, and its limits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sweep {
    /// Time per tick, nanoseconds; `None`: no limit. If the list is empty, the scene determines the budgets.
    Time(Vec<Option<u64>>),
    /// Work units per tick, likewise.
    Units(Vec<Option<u64>>),
}

/// What to run.
#[derive(Clone, Debug)]
pub struct Setup<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its built shapes, in the order of its bodies.
    pub shapes: &'a [Parts],
    /// Motion of the bodies.
    pub motion: Pattern,
    /// Frames per second.
    pub rate_hz: f64,
    /// Seed of the motion.
    pub seed: u64,
    /// Number of bodies of each source that move; `None`: all.
    pub count: Option<usize>,
    /// Ticks at each budget.
    pub ticks: u64,
    /// The budgets.
    pub sweep: Sweep,
}

/// Results of a sweep.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of sweepd.
    pub version: &'static str,
    /// Number of bodies of the scene.
    pub bodies: usize,
    /// Number of bodies that the motion moves.
    pub moving: usize,
    /// Median diameter of the scene's bounded bodies, metres: a scale for the widths.
    pub size_m: f64,
    /// Frames per second.
    pub rate_hz: f64,
    /// Seed of the motion.
    pub seed: u64,
    /// Ticks that count, at each budget.
    pub ticks: u64,
    /// Number of warm-up ticks before them.
    pub warm_up_ticks: u64,
    /// `time` or `units`: the limited quantity.
    pub limited: &'static str,
    /// Verdicts that are not the truth, over all budgets.
    pub wrong: u64,
    /// Intervals that exclude the truth, over all budgets.
    pub excluded: u64,
    /// Whether every pair had its verdict in every tick, at every budget.
    pub decided_everywhere: bool,
    /// Mean number of pairs whose boxes overlap.
    pub pairs: f64,
    /// One row per budget, the least first.
    pub rows: Vec<Row>,
}

impl Report {
    /// Whether a verdict is wrong, or an interval excludes the truth.
    #[must_use]
    pub fn is_wrong(&self) -> bool {
        self.wrong + self.excluded > 0
    }
}

/// Runs the sweep.
///
/// * `progress` - called before each engine tick with the number done and the total; returns whether to go on.
/// * returns - `None`: stopped.
///
/// # Errors
/// `Error::Scene` if the scene exceeds its limits.
pub fn run(
    setup: &Setup<'_>,
    mut progress: impl FnMut(u64, u64) -> bool,
) -> Result<Option<Report>> {
    let course = Course::new(setup);
    let budgets = budgets(setup, &course)?;
    let warm_up = (setup.ticks / 6).max(4);
    let timed = matches!(setup.sweep, Sweep::Time(_));
    let mut lanes = Vec::with_capacity(budgets.len());
    for budget in budgets {
        lanes.push(Lane::new(setup, budget, timed)?);
    }
    let mut twin = Twin::new(setup)?;
    let last = setup.ticks + warm_up;
    let all = last * (lanes.len() as u64 + 1);
    let (mut done, mut from) = (0, 0);
    while from < last {
        let to = (from + BLOCK_TICKS).min(last);
        for lane in &mut lanes {
            for tick in from..to {
                if !progress(done, all) {
                    return Ok(None);
                }
                lane.tick(&course, tick, tick >= warm_up);
                done += 1;
            }
        }
        for tick in from..to {
            if !progress(done, all) {
                return Ok(None);
            }
            twin.tick(&course, tick);
            for lane in &mut lanes {
                lane.compare(&mut twin, tick, tick - from, tick >= warm_up);
            }
            done += 1;
        }
        lanes.iter_mut().for_each(Lane::forget);
        from = to;
    }
    let rows: Vec<Row> = lanes.into_iter().map(Lane::row).collect();
    Ok(Some(Report {
        version: env!("CARGO_PKG_VERSION"),
        bodies: setup.scene.bodies.len(),
        moving: course.moving(),
        size_m: size_m(setup.shapes),
        rate_hz: setup.rate_hz,
        seed: setup.seed,
        ticks: setup.ticks,
        warm_up_ticks: warm_up,
        limited: if timed { "time" } else { "units" },
        wrong: rows.iter().map(|row| row.wrong).sum(),
        excluded: rows.iter().map(|row| row.excluded).sum(),
        decided_everywhere: rows.iter().all(|row| row.undecided == 0),
        pairs: rows.first().map_or(0.0, |row| row.pairs),
        rows,
    }))
}

/// Median diameter of the bodies that have one, metres.
fn size_m(shapes: &[Parts]) -> f64 {
    let of = |placed: &Parts| {
        let boxes = placed.iter().map(|p| p.shape.aabb_at(&p.pose));
        let whole = boxes.reduce(|a, b| a.merged(&b))?;
        let size = 2.0 * whole.half_extents().norm();
        size.is_finite().then_some(size)
    };
    let mut sizes: Vec<f64> = shapes.iter().filter_map(of).collect();
    sizes.sort_by(f64::total_cmp);
    quantile(&sizes, 0.5).unwrap_or(0.0)
}

/// The budgets to sweep over, the least first; no limit is last.
fn budgets(setup: &Setup<'_>, course: &Course) -> Result<Vec<Budget>> {
    let (Sweep::Time(given) | Sweep::Units(given)) = &setup.sweep;
    let timed = matches!(setup.sweep, Sweep::Time(_));
    let mut limits = given.clone();
    if limits.is_empty() {
        limits = pilot(setup, course, timed)?;
    }
    limits.sort_unstable_by_key(|limit| limit.unwrap_or(u64::MAX));
    limits.dedup();
    let budget = |limit: Option<u64>| match (limit, timed) {
        (None, _) => Budget::UNLIMITED,
        (Some(ns), true) => Budget::time_ns(ns),
        (Some(units), false) => Budget::units(units),
    };
    Ok(limits.into_iter().map(budget).collect())
}

/// Runs a few ticks without a budget and derives the limits from them, evenly on a log scale: from the median floor to
/// twice the 90th percentile of time, or up to the most work units, with 0 and no limit.
fn pilot(setup: &Setup<'_>, course: &Course, timed: bool) -> Result<Vec<Option<u64>>> {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock);
    let mut rig = Rig::new(setup.scene, setup.shapes, clock)?;
    let (mut floors, mut whole, mut units) = (Vec::new(), Vec::new(), Vec::new());
    for tick in 0..PILOT_TICKS {
        let took_ns = rig.tick(&course.frames(tick), Budget::UNLIMITED);
        // The first ticks build structures that all later ones keep.
        if tick >= PILOT_TICKS / 4 {
            floors.push(rig.out().tick.floor_ns);
            whole.push(took_ns);
            units.push(rig.out().tick.units);
        }
    }
    for list in [&mut floors, &mut whole, &mut units] {
        list.sort_unstable();
    }
    let at = |list: &[u64], share| quantile(list, share).unwrap_or(0);
    if timed {
        let floor_ns = at(&floors, 0.5).max(1_000);
        let most_ns = (2 * at(&whole, 0.9)).max(4 * floor_ns).max(TIME_MIN_NS);
        return Ok(steps(floor_ns, most_ns));
    }
    let most = at(&units, 1.0);
    let mut limits = vec![Some(0), None];
    if most > 0 {
        limits.extend(steps((most / 128).max(1), most));
    }
    Ok(limits)
}

/// Numbers from `from` to `to`, evenly on a log scale, rounded to two digits.
fn steps(from: u64, to: u64) -> Vec<Option<u64>> {
    #[allow(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive, and rounded to two digits"
    )]
    let step = |k: i32| {
        let share = f64::from(k) / f64::from(BUDGETS - 1);
        let value = from as f64 * (to as f64 / from as f64).powf(share);
        let unit = 10.0_f64.powf((value.log10().floor() - 1.0).max(0.0));
        ((value / unit).round() * unit) as u64
    };
    (0..BUDGETS).map(|k| Some(step(k))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_are_spread_evenly_on_a_log_scale_with_two_digits() {
        let all: Vec<_> = steps(100, 25_600).into_iter().flatten().collect();
        assert_eq!(
            all,
            [100, 200, 400, 800, 1_600, 3_200, 6_400, 13_000, 26_000]
        );
    }
}
