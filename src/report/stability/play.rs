//! Runs a case through an engine as the daemon has it, without a limit, and judges each pair's answer in each tick.
//!
//! In: a [`Case`]. Out: a [`Point`], which shows the worst tick and pair. Frames go through admission, broad phase and
//! publishing, so that the judged rows are those that a client reads.

use std::sync::Arc;

use serde::Serialize;

use super::dd::Dd;
use super::judge::{Answer, Judgement, judge};
use super::setting::{reach_of, row, scene, shapes};
use super::stage::{Asked, Case, Pos, is_round};
use super::truth::{Truth, gap};
use crate::error::{Error, Result};
use crate::math::Pose;
use crate::narrow::exact::raw;
use crate::report::rig::Rig;
use crate::time::{Budget, Clock, SystemClock};
use crate::wire::{PairRow, Stage, Verdict, pair_flags};

/// Tolerance of the error of a pair without cylinders and cones, in parts of its size: the rounding that its interval
/// allows for (some 64 units of roundoff), and how far its best estimate may be off within it.
pub const TOLERANCE: f64 = 1e-13;
/// Tolerance for cylinders and cones: their depth search ends where the next bit would cost as much as all before it,
/// at some 1e-7; an interval that is wider than this does not count as finished.
pub const TOLERANCE_ROUND: f64 = 1e-6;

/// Tolerance of times of impact, in parts of the way: a touch is bracketed as closely.
pub const TOLERANCE_IMPACT: f64 = 1e-9;
/// One point of a family: its worst tick and pair.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Kind of the pair.
    pub kind: &'static str,
    /// The family's parameter.
    pub value: f64,
    /// Number of judged answers, one per tick and pair.
    pub answers: u64,
    /// True gap at the worst tick and pair, metres; `null`: an overlap of unknown depth. For impacts: the share of the
    /// way.
    pub truth: Option<f64>,
    /// Lower end of the interval there, in the same unit; `null`: no known end.
    pub gap_min: Option<f64>,
    /// Upper end, likewise.
    pub gap_max: Option<f64>,
    /// Best estimate there.
    pub best: Option<f64>,
    /// The size that errors are given in parts of, metres; 1 for impacts.
    pub size: f64,
    /// Greatest error of the best estimate, or of the interval's farther end where there is none, in parts of the size;
    /// `null`: no truth to compare with, or infinite.
    pub error: Option<f64>,
    /// Greatest width of an interval whose truth is known, in parts of the size; `null`: there is none, or it is
    /// infinite.
    pub width: Option<f64>,
    /// Tolerance of the error.
    pub tolerance: f64,
    /// Verdict at the worst tick and pair.
    pub verdict: String,
    /// Number of intervals that exclude the truth.
    pub excluded: u64,
    /// Number of verdicts that are not the truth.
    pub wrong: u64,
    /// Number of pairs left open although nothing limited the work.
    pub open: u64,
    /// Number of answers of touching where the truth is apart by less than rounding.
    pub touching: u64,
    /// Number of verdict changes from tick to tick, not counting ticks in which the truth is within the tolerance of 0.
    pub changes: u64,
    /// Number of changes of the truth, counted likewise.
    pub changes_true: u64,
    /// Longest narrow phase of a tick, nanoseconds.
    pub time_ns: u64,
    /// Most work units of a tick.
    pub units: u64,
    /// Error of plain parry at the same poses, in parts of the size; `null`: it gave no answer, or was not called.
    pub raw_error: Option<f64>,
    /// Whether plain parry was called.
    pub raw_asked: bool,
    /// Number of missing answers of plain parry, and of wrong signs where the truth is farther from 0 than the
    /// tolerance.
    pub raw_wrong: u64,
}

impl Point {
    /// Whether an interval excludes the truth, or a verdict is wrong.
    #[must_use]
    pub fn is_wrong(&self) -> bool {
        self.excluded + self.wrong > 0
    }

    /// Whether the error exceeds its tolerance, or a pair was left open.
    #[must_use]
    pub fn is_beyond(&self) -> bool {
        self.open > 0 || self.error.is_some_and(|error| error > self.tolerance)
    }

    /// Whether the worst answer is an interval without an estimate.
    #[must_use]
    pub fn is_bounded(&self) -> bool {
        self.open == 0 && self.best.is_none()
    }

    fn of(case: &Case) -> Self {
        let round = case.actors.iter().any(is_round);
        Self {
            kind: case.kind,
            value: case.value,
            answers: 0,
            truth: None,
            gap_min: None,
            gap_max: None,
            best: None,
            size: 1.0,
            error: None,
            width: None,
            tolerance: match case.asked {
                Asked::Impact(_) => TOLERANCE_IMPACT,
                _ if round => TOLERANCE_ROUND,
                _ => TOLERANCE,
            },
            verdict: String::new(),
            excluded: 0,
            wrong: 0,
            open: 0,
            touching: 0,
            changes: 0,
            changes_true: 0,
            time_ns: 0,
            units: 0,
            raw_error: None,
            raw_asked: false,
            raw_wrong: 0,
        }
    }

    /// Adds one answer; the point shows the worst one.
    fn take(&mut self, truth: &Truth, answer: &Answer, found: &Judgement, size: f64) {
        self.answers += 1;
        self.excluded += u64::from(found.excluded);
        self.wrong += u64::from(found.wrong);
        self.open += u64::from(found.open);
        self.touching += u64::from(found.touching);
        let error = Some(found.error_m / size).filter(|error| !error.is_nan());
        let bad = found.excluded || found.wrong;
        let first = self.answers == 1;
        let worse = error.is_some_and(|e| self.error.is_none_or(|most| e > most));
        let spoiled = self.excluded + self.wrong > u64::from(bad);
        if first || bad || (worse && !spoiled) {
            let finite = |x: f64| x.is_finite().then_some(x);
            self.truth = truth.low.map(|_| truth.high.near());
            (self.gap_min, self.gap_max) = (finite(answer.min_m), finite(answer.max_m));
            self.best = finite(answer.best_m);
            self.size = size;
            self.verdict = answer.verdict.to_string();
        }
        if worse {
            self.error = error;
        }
        // For an overlap of unknown depth the interval is a bound, and its width measures no error.
        if truth.low.is_some() {
            let most = self.width.unwrap_or(0.0);
            self.width = Some(most.max(found.width_m / size)).filter(|width| width.is_finite());
        }
    }

    fn take_raw(&mut self, told: Option<f64>, truth: &Truth, size: f64) {
        self.raw_asked = true;
        let (Some(told), Some(low)) = (told, truth.low) else {
            self.raw_wrong += u64::from(told.is_none());
            return;
        };
        let error = (Dd::from(told) - low).abs().near() / size;
        // The sign only counts where the truth is farther from 0 than its own rounding could be.
        let clear = low.abs().near() > self.tolerance * size;
        self.raw_wrong += u64::from(clear && (told > 0.0) != (low > Dd::ZERO));
        self.raw_error = Some(self.raw_error.unwrap_or(0.0).max(error));
    }
}

/// Runs a case.
///
/// # Errors
/// `Error::Scene` for a case that the engine refuses, or whose truth is unknown: a fault of the case.
pub fn play(case: &Case) -> Result<Point> {
    let truths = truths(case)?;
    let scene = scene(case, &truths);
    let shapes = shapes(&scene)?;
    let clock: Arc<dyn Clock> = Arc::new(SystemClock);
    let mut rig = Rig::new(&scene, &shapes, clock)?;
    let mut point = Point::of(case);
    let mut last: Vec<[Option<bool>; 2]> = vec![[None; 2]; case.pairs.len()];
    for (tick, poses) in case.ticks.iter().enumerate() {
        let rows = (1..).zip(poses).map(|(body, pos)| row(body, pos)).collect();
        rig.tick(&[rows], Budget::UNLIMITED);
        let out = &rig.out().tick;
        let narrow_ns = out.stage_ns[usize::from(Stage::Narrow.code())];
        point.time_ns = point.time_ns.max(narrow_ns);
        point.units = point.units.max(out.units);
        if let Asked::Impact(toi) = &case.asked {
            if tick > 0 {
                impact(&mut point, rig.out().pairs.first(), *toi);
            }
            continue;
        }
        for (at, &pair) in case.pairs.iter().enumerate() {
            let truth = &truths[tick][at];
            let size = case.size_m(tick, pair);
            let answer = answer(&rig.out().pairs, pair, reach_of(&scene, pair));
            let found = judge(truth, &answer);
            point.take(truth, &answer, &found, size);
            changes(&mut point, &mut last[at], truth, &answer, size);
            if let Some(asked) = plain(case, tick, pair) {
                point.take_raw(asked, truth, size);
            }
        }
    }
    Ok(point)
}

fn truths(case: &Case) -> Result<Vec<Vec<Truth>>> {
    let one = |poses: &Vec<Pos>, &(i, j): &(usize, usize)| match &case.asked {
        Asked::Known(truth) => Ok(*truth),
        Asked::Impact(toi) => Ok(Truth::is(*toi)),
        Asked::Gap => {
            gap(&case.actors[i], &poses[i], &case.actors[j], &poses[j]).ok_or_else(|| {
                Error::Scene(format!(
                    "case {} {}: no truth is known",
                    case.kind, case.value
                ))
            })
        }
    };
    let tick = |poses| case.pairs.iter().map(|pair| one(poses, pair)).collect();
    case.ticks.iter().map(tick).collect()
}

/// The published answer for a pair; without a row the pair is apart by more than `beyond_m`.
fn answer(rows: &[PairRow], (i, j): (usize, usize), beyond_m: f64) -> Answer {
    let id = |at: usize| at as u64 + 1;
    let ids = (id(i.min(j)), id(i.max(j)));
    let row = rows.iter().find(|row| (row.body_a, row.body_b) == ids);
    let told = row.filter(|row| row.flags & pair_flags::GONE == 0);
    told.map_or(
        Answer {
            min_m: beyond_m,
            max_m: f64::INFINITY,
            best_m: f64::NAN,
            verdict: Verdict::Apart,
        },
        |row| Answer {
            min_m: row.gap_min_m,
            max_m: row.gap_max_m,
            best_m: row.gap_best_m,
            verdict: Verdict::from_code(row.verdict).unwrap_or(Verdict::None),
        },
    )
}

/// Judges a time of impact: its interval must contain the share of the way at which the two first touch.
fn impact(point: &mut Point, row: Option<&PairRow>, toi: Dd) {
    let has = |flag: u8| row.is_some_and(|row| row.flags & flag != 0);
    let (hit, open) = (has(pair_flags::SWEPT_HIT), has(pair_flags::SWEPT_OPEN));
    let (min_m, max_m) = row.map_or((f64::NAN, f64::NAN), |row| (row.toi_min, row.toi_max));
    let answer = Answer {
        min_m,
        max_m,
        best_m: f64::midpoint(min_m, max_m),
        verdict: Verdict::Colliding,
    };
    let truth = Truth::is(toi);
    let judged = judge(&truth, &answer);
    let found = Judgement {
        wrong: !hit && !open,
        touching: false,
        open,
        ..judged
    };
    point.take(&truth, &answer, &found, 1.0);
    let verdict = match (hit, open) {
        (true, _) => "hit",
        (_, true) => "open",
        _ => "missed",
    };
    verdict.clone_into(&mut point.verdict);
}

/// Counts changes of the verdict and of the truth, in ticks in which the truth can be told from touching.
fn changes(
    point: &mut Point,
    last: &mut [Option<bool>; 2],
    truth: &Truth,
    answer: &Answer,
    size: f64,
) {
    let clear = truth.high.abs().near() > point.tolerance * size;
    let now = [
        Some(answer.verdict == Verdict::Colliding).filter(|_| clear),
        Some(truth.high <= Dd::ZERO).filter(|_| clear),
    ];
    let changed = |at: usize| now[at].zip(last[at]).is_some_and(|(a, b)| a != b);
    point.changes += u64::from(changed(0));
    point.changes_true += u64::from(changed(1));
    if clear {
        *last = now;
    }
}

/// Plain parry's gap at these poses; outer `None`: bodies with several shapes are not asked.
fn plain(case: &Case, tick: usize, (i, j): (usize, usize)) -> Option<Option<f64>> {
    let placed = |at: usize| {
        let [(shape, off)] = case.actors[at].parts.as_slice() else {
            return None;
        };
        let pos = &case.ticks[tick][at];
        let pose = crate::math::pose_from(pos.t, pos.q)?;
        Some((shape, pose * Pose::translation(off[0], off[1], off[2])))
    };
    let ((a, pose_a), (b, pose_b)) = (placed(i)?, placed(j)?);
    Some(raw::gap(a, &pose_a, b, &pose_b))
}
