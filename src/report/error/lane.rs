//! The engine of one budget, and its twin without a budget.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::Setup;
use super::check::{Checked, Key, Told, check};
use super::course::Course;
use super::tally::{Row, Tally};
use crate::error::Result;
use crate::ids::BodySlot;
use crate::math::Interval;
use crate::narrow::gap_between;
use crate::report::rig::Rig;
use crate::time::{Budget, Clock, ManualClock, Meter, SystemClock};
use crate::wire::Verdict;

/// Start of the clock of work budgets, nanoseconds: any time but 0, which would mean that nothing was received.
const START_NS: u64 = 1_000_000_000;

/// An engine with one budget.
pub(super) struct Lane {
    rig: Rig,
    budget: Budget,
    /// The clock of a work budget; `None`: real time counts.
    manual: Option<Arc<ManualClock>>,
    period_ns: u64,
    /// Rows of each tick of the block, sorted by key.
    told: Vec<Vec<Told>>,
    tally: Tally,
}

impl Lane {
    pub(super) fn new(setup: &Setup<'_>, budget: Budget, timed: bool) -> Result<Self> {
        let manual = (!timed).then(|| Arc::new(ManualClock::new(START_NS)));
        let clock: Arc<dyn Clock> = match &manual {
            Some(manual) => Arc::clone(manual) as _,
            None => Arc::new(SystemClock),
        };
        Ok(Self {
            rig: Rig::new(setup.scene, setup.shapes, clock)?,
            budget,
            manual,
            period_ns: period_ns(setup),
            told: Vec::new(),
            tally: Tally::default(),
        })
    }

    /// Runs a tick and keeps its rows.
    pub(super) fn tick(&mut self, course: &Course, tick: u64, counts: bool) {
        if let Some(clock) = &self.manual {
            clock.advance(self.period_ns);
        }
        let took_ns = self.rig.tick(&course.frames(tick), self.budget);
        let out = self.rig.out();
        let mut told: Vec<Told> = out.pairs.iter().filter_map(Told::of).collect();
        told.sort_unstable_by_key(|told| told.key);
        if counts {
            let timed = self.manual.is_none();
            self.tally
                .take_tick(&out.tick, timed.then_some(took_ns), &told);
        }
        self.told.push(told);
    }

    /// Compares one tick of the block with the twin's.
    pub(super) fn compare(&mut self, twin: &mut Twin, tick: u64, at: u64, counts: bool) {
        let Some(told) = usize::try_from(at).ok().and_then(|at| self.told.get(at)) else {
            return;
        };
        let truth = std::mem::take(&mut twin.truth);
        let found = check(told, &truth, |key| twin.ask(key));
        self.tally.onsets(told, &truth, tick, counts);
        twin.truth = truth;
        // Wrong answers count in the warm-up, too.
        let kept = if counts {
            found
        } else {
            Checked {
                undecided: 0,
                guess_errors: 0,
                ..found
            }
        };
        self.tally.take_checked(kept);
    }

    pub(super) fn forget(&mut self) {
        self.told.clear();
    }

    pub(super) fn row(self) -> Row {
        self.tally.row(self.budget)
    }
}

fn period_ns(setup: &Setup<'_>) -> u64 {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "rates are above 0, and checked"
    )]
    let ns = (1e9 / setup.rate_hz).clamp(1.0, 1e9) as u64;
    ns
}

/// The engine without a budget, at the same poses.
pub(super) struct Twin {
    rig: Rig,
    clock: Arc<ManualClock>,
    period_ns: u64,
    slots: BTreeMap<u64, BodySlot>,
    /// Its rows of the last tick.
    truth: BTreeMap<Key, Told>,
    /// Further gaps that were computed for its last tick.
    asked: BTreeMap<Key, Interval>,
}

impl Twin {
    pub(super) fn new(setup: &Setup<'_>) -> Result<Self> {
        let clock = Arc::new(ManualClock::new(START_NS));
        let rig = Rig::new(
            setup.scene,
            setup.shapes,
            Arc::clone(&clock) as Arc<dyn Clock>,
        )?;
        let bodies = rig.engine().world().bodies();
        Ok(Self {
            slots: bodies.map(|(slot, body)| (body.id.0, slot)).collect(),
            rig,
            clock,
            period_ns: period_ns(setup),
            truth: BTreeMap::new(),
            asked: BTreeMap::new(),
        })
    }

    pub(super) fn tick(&mut self, course: &Course, tick: u64) {
        self.clock.advance(self.period_ns);
        self.rig.tick(&course.frames(tick), Budget::UNLIMITED);
        let told = self.rig.out().pairs.iter().filter_map(Told::of);
        self.truth = told.map(|told| (told.key, told)).collect();
        self.asked.clear();
    }

    /// The gap of a pair at this tick's poses, by a query without memory of earlier ticks.
    fn ask(&mut self, key: Key) -> Interval {
        if let Some(gap) = self.asked.get(&key) {
            return *gap;
        }
        let world = self.rig.engine().world();
        let body = |id: u64| self.slots.get(&id).and_then(|slot| world.body(*slot));
        let gap = match (body(key.0), body(key.1)) {
            (Some(a), Some(b)) => {
                let mut meter = Meter::unlimited(self.clock.as_ref());
                gap_between(a, b, 0.0, &mut meter).gap
            }
            _ => Interval::UNKNOWN,
        };
        self.asked.insert(key, gap);
        gap
    }
}

/// Whether a pair is certified as colliding.
pub(super) fn collides(told: &Told) -> bool {
    told.verdict == Verdict::Colliding
}
