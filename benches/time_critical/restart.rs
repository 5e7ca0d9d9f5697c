//! The baseline: each pair's search restarts from the roots in every tick, at the tick's poses. It keeps no state but,
//! if requested, the triangles that touched last.

use sweepd::math::{Interval, Pose};
use sweepd::narrow::mesh::{CarriedFront, FrontStore, Goal, Search, Walk, retest_witness};
use sweepd::shape::Shape;
use sweepd::time::Meter;

use crate::stage::{PAIRS, Stage};

/// Node tests per slice of a pair, as in the engine.
const SLICE_UNITS: u64 = 32;

/// The search of each pair.
pub enum Trees {
    /// Over axis-aligned boxes in the bodies' frames.
    Walks(Vec<Walk>),
    /// Over oriented boxes, in the engine's order for verdicts.
    Fronts(Vec<CarriedFront>, Box<FrontStore>),
}

impl Trees {
    pub fn walks() -> Self {
        Self::Walks((0..PAIRS).map(|_| Walk::default()).collect())
    }

    pub fn fronts() -> Self {
        let fronts = (0..PAIRS).map(|_| CarriedFront::default());
        Self::Fronts(fronts.collect(), Box::default())
    }

    fn start(&mut self, pair: usize, [a, b]: [&Shape; 2], pos12: &Pose) {
        match self {
            Self::Walks(walks) => walks[pair].start(a, b, pos12),
            Self::Fronts(fronts, store) => {
                fronts[pair].start(store, a, b, pos12, Search::Restart);
            }
        }
    }

    /// Runs one slice; returns whether there is a verdict.
    fn advance(&mut self, pair: usize, [a, b]: [&Shape; 2], meter: &mut Meter<'_>) -> bool {
        let goal = Goal::Verdict;
        match self {
            Self::Walks(walks) => walks[pair].advance(a, b, goal, SLICE_UNITS, meter),
            Self::Fronts(fronts, store) => {
                fronts[pair].advance(store, a, b, goal, SLICE_UNITS, meter)
            }
        }
    }

    fn interval(&self, pair: usize) -> Interval {
        match self {
            Self::Walks(walks) => walks[pair].interval(),
            Self::Fronts(fronts, _) => fronts[pair].interval(),
        }
    }

    /// The triangles that are nearest or touch.
    fn witness(&self, pair: usize) -> Option<(u32, u32)> {
        let witness = match self {
            Self::Walks(walks) => walks[pair].witness(),
            Self::Fronts(fronts, _) => fronts[pair].witness(),
        };
        witness.map(|leaves| (leaves.triangle_a, leaves.triangle_b))
    }
}

pub struct Restart {
    trees: Trees,
    witnesses: Vec<Option<(u32, u32)>>,
    cached: bool,
    /// Per pair: whether its search has begun in this tick.
    started: Vec<bool>,
    /// Per pair: verdict at this tick's poses; `Some(true)` colliding, `Some(false)` apart, `None` unknown.
    pub verdicts: Vec<Option<bool>>,
    /// Ticks since the last verdict.
    ages: Vec<u64>,
}

impl Restart {
    /// * `cached` - whether last tick's witness is tested first.
    pub fn new(trees: Trees, cached: bool) -> Self {
        Self {
            trees,
            witnesses: vec![None; PAIRS],
            cached,
            started: vec![false; PAIRS],
            verdicts: vec![None; PAIRS],
            ages: vec![0; PAIRS],
        }
    }

    pub fn spend(&mut self, stage: &Stage, meter: &mut Meter<'_>) {
        self.verdicts.fill(None);
        self.started.fill(false);
        let mut order: Vec<usize> = (0..PAIRS).collect();
        order.sort_by_key(|&pair| (std::cmp::Reverse(self.ages[pair]), pair));
        if self.cached {
            for &pair in &order {
                if let Some((i, j)) = self.witnesses[pair].filter(|_| meter.open()) {
                    let [a, b] = stage.couple(pair);
                    let closest = retest_witness(a, b, &stage.pose(pair), i, j);
                    meter.charge_dear(1);
                    if closest.is_some_and(|c| c.gap.max <= 0.0) {
                        self.verdicts[pair] = Some(true);
                    }
                }
            }
        }
        order.retain(|&pair| self.verdicts[pair].is_none());
        while meter.open() && !order.is_empty() {
            order.retain(|&pair| {
                if !meter.open() {
                    return true;
                }
                let couple = stage.couple(pair);
                if !std::mem::replace(&mut self.started[pair], true) {
                    self.trees.start(pair, couple, &stage.pose(pair));
                }
                if !self.trees.advance(pair, couple, meter) {
                    return true;
                }
                let collides = self.trees.interval(pair).min <= 0.0;
                self.verdicts[pair] = Some(collides);
                self.witnesses[pair] = self.trees.witness(pair).filter(|_| collides);
                false
            });
        }
        for (age, verdict) in self.ages.iter_mut().zip(&self.verdicts) {
            *age = if verdict.is_some() { 0 } else { *age + 1 };
        }
    }

    /// The known interval of a pair's gap at this tick's poses.
    pub fn gap(&self, pair: usize) -> Interval {
        if self.verdicts[pair] == Some(true) {
            Interval::new(f64::NEG_INFINITY, 0.0)
        } else if self.started[pair] {
            self.trees.interval(pair)
        } else {
            Interval::UNKNOWN
        }
    }
}
