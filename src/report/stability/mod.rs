//! Stiff and extreme cases: families swept along one parameter over many decades, played through the engine, each
//! answer held against a truth in twice the precision ([`truth`]) and beside what plain parry says.
//!
//! In: names of families. Out: a [`Report`]: every point, and a summary a family.

pub mod dd;
pub mod families;
pub mod judge;
pub mod page;

mod pieces;
pub mod play;
mod setting;
pub mod stage;
pub mod truth;

use serde::Serialize;

use crate::error::Result;
use families::Family;
use play::{Point, play};

/// All that was found out.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of sweepd.
    pub version: &'static str,
    /// Intervals that do not hold the truth.
    pub excluded: u64,
    /// Verdicts that are not the truth.
    pub wrong: u64,
    /// The families.
    pub families: Vec<Found>,
}

/// A family, and what came of it.
#[derive(Clone, Debug, Serialize)]
pub struct Found {
    /// Its name.
    pub family: &'static str,
    /// What is stiff or extreme about it.
    pub about: &'static str,
    /// What its parameter is, with its unit.
    pub parameter: &'static str,
    /// The sum of its points.
    pub summary: Summary,
    /// By kind, then by parameter.
    pub points: Vec<Point>,
}

/// The sum of a family's points.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// Points.
    pub cases: u64,
    /// Ticks and pairs that were judged.
    pub answers: u64,
    /// Greatest error in parts of its tolerance, as an error in parts of the size.
    pub worst_error: Option<f64>,
    /// What that error is meant to stay below.
    pub tolerance: Option<f64>,
    /// The kind of pair at which it occurs.
    pub worst_kind: Option<&'static str>,
    /// The parameter at which it occurs.
    pub worst_value: Option<f64>,
    /// Points with a greater error than the tolerance, or left open.
    pub beyond: u64,
    /// Those of them whose depth is bounded and not estimated: the error is of the interval's farther end, and no limit
    /// of what is proved.
    pub beyond_bounded: u64,
    /// Pairs left open although nothing limited the work.
    pub open: u64,
    /// Intervals that do not hold the truth.
    pub excluded: u64,
    /// Verdicts that are not the truth.
    pub wrong: u64,
    /// Said to touch where the truth is apart by less than rounding.
    pub touching: u64,
    /// Verdict changes from tick to tick, where the truth can be told from touching.
    pub changes: u64,
    /// The same of the truth.
    pub changes_true: u64,
    /// Longest narrow phase of one tick, nanoseconds.
    pub slowest_ns: u64,
    /// Most work units of one tick.
    pub units_max: u64,
    /// Points that plain parry was asked.
    pub raw_cases: u64,
    /// Points with a wrong sign, or without an answer, of plain parry.
    pub raw_wrong: u64,
    /// Greatest error of plain parry, in parts of the size.
    pub raw_worst_error: Option<f64>,
}

impl Report {
    /// Whether an interval excludes the truth, or a verdict is wrong.
    #[must_use]
    pub fn is_wrong(&self) -> bool {
        self.excluded + self.wrong > 0
    }
}

/// Plays families.
///
/// * `progress` - told before each case: how many are done, of how many, and of which family; says whether to go on.
/// * returns - `None`: stopped.
///
/// # Errors
/// `Error::Scene` for a case that the engine refuses.
pub fn run(
    families: &[&'static Family],
    mut progress: impl FnMut(u64, u64, &str) -> bool,
) -> Result<Option<Report>> {
    let cases: Vec<_> = families.iter().map(|family| (family.cases)()).collect();
    let all = cases.iter().map(|cases| cases.len() as u64).sum();
    let mut done = 0_u64;
    let mut found = Vec::new();
    for (family, cases) in families.iter().zip(&cases) {
        let mut points = Vec::with_capacity(cases.len());
        for case in cases {
            if !progress(done, all, family.name) {
                return Ok(None);
            }
            points.push(play(case)?);
            done += 1;
        }
        points.sort_by(|a, b| a.kind.cmp(b.kind).then(a.value.total_cmp(&b.value)));
        found.push(Found {
            family: family.name,
            about: family.about,
            parameter: family.parameter,
            summary: Summary::of(&points),
            points,
        });
    }
    let sum = |of: fn(&Summary) -> u64| found.iter().map(|f| of(&f.summary)).sum();
    Ok(Some(Report {
        version: env!("CARGO_PKG_VERSION"),
        excluded: sum(|s| s.excluded),
        wrong: sum(|s| s.wrong),
        families: found,
    }))
}

impl Summary {
    fn of(points: &[Point]) -> Self {
        let mut sum = Self::default();
        let mut worst = f64::NEG_INFINITY;
        for point in points {
            sum.cases += 1;
            sum.answers += point.answers;
            sum.beyond += u64::from(point.is_beyond());
            sum.beyond_bounded += u64::from(point.is_beyond() && point.is_bounded());
            sum.open += point.open;
            sum.excluded += point.excluded;
            sum.wrong += point.wrong;
            sum.touching += point.touching;
            sum.changes += point.changes;
            sum.changes_true += point.changes_true;
            sum.slowest_ns = sum.slowest_ns.max(point.time_ns);
            sum.units_max = sum.units_max.max(point.units);
            sum.raw_cases += u64::from(point.raw_asked);
            sum.raw_wrong += u64::from(point.raw_wrong > 0);
            let raw = [sum.raw_worst_error, point.raw_error];
            sum.raw_worst_error = raw.into_iter().flatten().reduce(f64::max);
            let Some(error) = point.error else { continue };
            if error / point.tolerance > worst {
                worst = error / point.tolerance;
                sum.worst_error = Some(error);
                sum.tolerance = Some(point.tolerance);
                sum.worst_kind = Some(point.kind);
                sum.worst_value = Some(point.value);
            }
        }
        sum
    }
}
