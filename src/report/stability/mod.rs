//! Stiff and extreme cases: families swept along one parameter over many decades and run through the engine. Each
//! answer is compared with a truth in twice the precision ([`truth`]), and shown beside that of plain parry.
//!
//! In: families. Out: a [`Report`]: every point, and one summary per family.

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

/// All results.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of sweepd.
    pub version: &'static str,
    /// Number of intervals that exclude the truth.
    pub excluded: u64,
    /// Number of verdicts that are not the truth.
    pub wrong: u64,
    /// The families.
    pub families: Vec<Found>,
}

/// A family and its results.
#[derive(Clone, Debug, Serialize)]
pub struct Found {
    /// Its name.
    pub family: &'static str,
    /// What is stiff or extreme about it.
    pub about: &'static str,
    /// Its parameter, with the unit.
    pub parameter: &'static str,
    /// Summary of its points.
    pub summary: Summary,
    /// Sorted by kind, then by parameter.
    pub points: Vec<Point>,
}

/// Summary of a family's points.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// Number of points.
    pub cases: u64,
    /// Number of judged answers, one per tick and pair.
    pub answers: u64,
    /// The error that is greatest relative to its tolerance, in parts of the size.
    pub worst_error: Option<f64>,
    /// The tolerance of that error.
    pub tolerance: Option<f64>,
    /// The kind of pair at which that error occurs.
    pub worst_kind: Option<&'static str>,
    /// The parameter at which that error occurs.
    pub worst_value: Option<f64>,
    /// Number of points with an error above the tolerance, or with a pair left open.
    pub beyond: u64,
    /// Those of them whose depth is bounded and not estimated: their error is that of the interval's farther end, and
    /// is no flaw of the proof.
    pub beyond_bounded: u64,
    /// Number of pairs left open although nothing limited the work.
    pub open: u64,
    /// Number of intervals that exclude the truth.
    pub excluded: u64,
    /// Number of verdicts that are not the truth.
    pub wrong: u64,
    /// Number of answers of touching where the truth is apart by less than rounding.
    pub touching: u64,
    /// Number of verdict changes from tick to tick, counted where the truth is clear of touching.
    pub changes: u64,
    /// Number of changes of the truth, counted likewise.
    pub changes_true: u64,
    /// Longest narrow phase of one tick, nanoseconds.
    pub slowest_ns: u64,
    /// Most work units of one tick.
    pub units_max: u64,
    /// Number of points at which plain parry was called.
    pub raw_cases: u64,
    /// Number of points at which plain parry had a wrong sign, or no answer.
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

/// Runs families.
///
/// * `progress` - called before each case with the number done, the total and the family; returns whether to go on.
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
