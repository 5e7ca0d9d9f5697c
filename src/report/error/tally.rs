//! The sums over the ticks of one budget, and the row that they make.

use std::collections::BTreeMap;

use serde::Serialize;

use super::check::{Checked, Key, Told};
use super::lane::collides;
use crate::report::stats::{mean, quantile, share};
use crate::time::Budget;
use crate::wire::TickRow;

/// Results at one budget. Times in nanoseconds, lengths in metres, shares of 1; `null`: no value.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Time budget of a tick; `null`: not limited.
    pub budget_ns: Option<u64>,
    /// Work budget of a tick, units; `null`: not limited.
    pub budget_units: Option<u64>,
    /// Mean number of pairs whose boxes overlap.
    pub pairs: f64,
    /// Mean number of pairs reported as colliding.
    pub colliding: f64,
    /// Pair-ticks without a verdict.
    pub undecided: u64,
    /// Their share of all pair-ticks.
    pub undecided_share: f64,
    /// Share of all pair-ticks that have no verdict and whose last verdict is not the truth.
    pub guess_error_share: f64,
    /// Mean width of the intervals of the reported pairs (colliding, possible, near).
    pub width_mean_m: Option<f64>,
    /// 99th percentile of those widths.
    pub width_p99_m: Option<f64>,
    /// Pair-ticks whose interval has an open end, which the widths leave out.
    pub width_endless: u64,
    /// Longest time that a pair was without a verdict, ticks.
    pub oldest_ticks: u64,
    /// Number of collisions that began.
    pub onsets: u64,
    /// Ticks from the first tick of a collision until it is reported as certain; median.
    pub onset_p50_ticks: Option<u64>,
    /// 99th percentile of the same.
    pub onset_p99_ticks: Option<u64>,
    /// Collisions that were not reported as certain until they, or the ticks, ended (they were reported as possible).
    pub onsets_never: u64,
    /// Time of a whole tick, with the work after its outbox is filled; median.
    pub time_p50_ns: Option<u64>,
    /// 99th percentile of the same.
    pub time_p99_ns: Option<u64>,
    /// The part of a tick that cannot be cut; median.
    pub floor_p50_ns: Option<u64>,
    /// Time beyond the budget, or beyond the floor where that is more; median.
    pub over_p50_ns: Option<u64>,
    /// 99th percentile of the same.
    pub over_p99_ns: Option<u64>,
    /// Share of ticks that ended after their budget.
    pub late_share: Option<f64>,
    /// Mean work units per tick.
    pub units_mean: f64,
    /// Most work units of a tick.
    pub units_max: u64,
    /// Verdicts that are not the truth.
    pub wrong: u64,
    /// Intervals that exclude the truth.
    pub excluded: u64,
}

/// A collision in progress.
#[derive(Clone, Copy, Debug)]
struct Onset {
    since: u64,
    told: bool,
}

/// Sums over the ticks of one budget.
#[derive(Debug, Default)]
pub(super) struct Tally {
    ticks: u64,
    pair_ticks: u64,
    colliding: u64,
    found: Checked,
    widths_m: Vec<f64>,
    endless: u64,
    oldest: u64,
    going_on: BTreeMap<Key, Onset>,
    delays: Vec<u64>,
    onsets: u64,
    never: u64,
    times_ns: Vec<u64>,
    floors_ns: Vec<u64>,
    /// Number of ticks that reported an overrun.
    overruns: u64,
    units: Vec<u64>,
    /// Whether the previous tick counted: then a collision that begins now is an onset.
    counted: bool,
}

impl Tally {
    pub(super) fn take_tick(&mut self, out: &TickRow, took_ns: Option<u64>, told: &[Told]) {
        self.ticks += 1;
        self.pair_ticks += out.candidates;
        self.colliding += out.colliding;
        self.oldest = self.oldest.max(out.oldest_undecided_ticks);
        self.units.push(out.units);
        for told in told.iter().filter(|told| !told.unknown) {
            let width = told.gap.max - told.gap.min;
            if width.is_finite() {
                self.widths_m.push(width);
            } else {
                self.endless += 1;
            }
        }
        if let Some(took_ns) = took_ns {
            self.times_ns.push(took_ns);
            self.floors_ns.push(out.floor_ns);
            self.overruns += u64::from(out.overrun);
        }
    }

    pub(super) fn take_checked(&mut self, found: Checked) {
        self.found.undecided += found.undecided;
        self.found.guess_errors += found.guess_errors;
        self.found.wrong += found.wrong;
        self.found.excluded += found.excluded;
    }

    /// Follows collisions from their first tick to the one in which they are reported. Collisions that began before the
    /// ticks that count have no onset.
    pub(super) fn onsets(
        &mut self,
        told: &[Told],
        truth: &BTreeMap<Key, Told>,
        tick: u64,
        counts: bool,
    ) {
        let Self {
            going_on,
            never,
            onsets,
            delays,
            counted,
            ..
        } = self;
        going_on.retain(|key, onset| {
            let goes_on = truth.get(key).is_some_and(collides);
            *never += u64::from(!goes_on && !onset.told && *counted);
            goes_on
        });
        for known in truth.values().filter(|known| collides(known)) {
            let onset = going_on.entry(known.key).or_insert_with(|| {
                *onsets += u64::from(*counted);
                Onset {
                    since: tick,
                    told: !*counted,
                }
            });
            let at = told.binary_search_by_key(&known.key, |told| told.key);
            if !onset.told && at.is_ok_and(|at| collides(&told[at])) {
                onset.told = true;
                delays.push(tick.saturating_sub(onset.since));
            }
        }
        *counted = counts;
    }

    pub(super) fn row(mut self, budget: Budget) -> Row {
        let budget_ns = budget.time_ns;
        // A tick takes at least its floor: a budget below the floor is overrun only by the time beyond the floor.
        let over = self.times_ns.iter().zip(&self.floors_ns);
        let mut over_ns: Vec<u64> = budget_ns.map_or_else(Vec::new, |budget_ns| {
            over.map(|(time, floor)| time.saturating_sub(budget_ns.max(*floor)))
                .collect()
        });
        for list in [
            &mut self.times_ns,
            &mut self.floors_ns,
            &mut over_ns,
            &mut self.delays,
        ] {
            list.sort_unstable();
        }
        self.widths_m.sort_by(f64::total_cmp);
        let untold = self.going_on.values().filter(|onset| !onset.told);
        let ticks = self.ticks;
        Row {
            budget_ns,
            budget_units: budget.units,
            pairs: share(self.pair_ticks, ticks),
            colliding: share(self.colliding, ticks),
            undecided: self.found.undecided,
            undecided_share: share(self.found.undecided, self.pair_ticks),
            guess_error_share: share(self.found.guess_errors, self.pair_ticks),
            width_mean_m: mean(&self.widths_m),
            width_p99_m: quantile(&self.widths_m, 0.99),
            width_endless: self.endless,
            oldest_ticks: self.oldest,
            onsets: self.onsets,
            onset_p50_ticks: quantile(&self.delays, 0.5),
            onset_p99_ticks: quantile(&self.delays, 0.99),
            onsets_never: self.never + untold.count() as u64,
            time_p50_ns: quantile(&self.times_ns, 0.5),
            time_p99_ns: quantile(&self.times_ns, 0.99),
            floor_p50_ns: quantile(&self.floors_ns, 0.5),
            over_p50_ns: quantile(&over_ns, 0.5),
            over_p99_ns: quantile(&over_ns, 0.99),
            late_share: (budget_ns.is_some() && !self.times_ns.is_empty())
                .then(|| share(self.overruns, ticks)),
            units_mean: share(self.units.iter().sum(), ticks),
            units_max: self.units.iter().copied().max().unwrap_or(0),
            wrong: self.found.wrong,
            excluded: self.found.excluded,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Interval;
    use crate::wire::Verdict;

    fn told(verdict: Verdict) -> Told {
        Told {
            key: (3, 7),
            verdict,
            last: Verdict::Apart,
            gap: Interval {
                min: -0.1,
                max: 0.1,
            },
            unknown: false,
        }
    }

    /// The row of ticks with these verdicts and truths.
    fn row(ticks: &[(Verdict, Verdict)]) -> Row {
        let mut tally = Tally::default();
        for (tick, (said, truth)) in (0..).zip(ticks) {
            let truth = BTreeMap::from([((3, 7), told(*truth))]);
            tally.onsets(&[told(*said)], &truth, tick, true);
        }
        tally.row(Budget::UNLIMITED)
    }

    #[test]
    fn bug_a_collision_that_is_not_told_by_the_last_tick_was_never_told() {
        use Verdict::{Colliding, Near, Possible};
        let begin = [(Near, Near), (Possible, Colliding)];
        let untold = row(&begin);
        assert_eq!((untold.onsets, untold.onsets_never), (1, 1));
        let told = row(&[&begin[..], &[(Colliding, Colliding)]].concat());
        assert_eq!((told.onsets, told.onsets_never), (1, 0));
        let ended = row(&[&begin[..], &[(Near, Near)]].concat());
        assert_eq!((ended.onsets, ended.onsets_never), (1, 1));
        // A collision that began before the ticks that count has no onset.
        let before = row(&[(Possible, Colliding), (Possible, Colliding)]);
        assert_eq!((before.onsets, before.onsets_never), (0, 0));
    }
}
