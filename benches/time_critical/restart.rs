//! The baseline that keeps nothing but, on request, the triangles that touched last: every tick each pair's walk starts
//! again at the tick's poses.

use sweepd::narrow::mesh::{Goal, Walk, retest_witness};
use sweepd::time::Meter;

use crate::stage::{PAIRS, Stage};

/// Node tests of a pair's turn, as in the engine.
const SLICE_UNITS: u64 = 32;

pub struct Restart {
    walks: Vec<Walk>,
    witnesses: Vec<Option<(u32, u32)>>,
    cached: bool,
    /// Verdict at this tick's poses: colliding, apart, or unknown.
    pub verdicts: Vec<Option<bool>>,
    /// Ticks since the last verdict.
    pub ages: Vec<u64>,
}

impl Restart {
    /// * `cached` - last tick's witness is asked first.
    pub fn new(cached: bool) -> Self {
        Self {
            walks: (0..PAIRS).map(|_| Walk::default()).collect(),
            witnesses: vec![None; PAIRS],
            cached,
            verdicts: vec![None; PAIRS],
            ages: vec![0; PAIRS],
        }
    }

    pub fn spend(&mut self, stage: &Stage, meter: &mut Meter<'_>) {
        self.verdicts.fill(None);
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
        let mut started = [false; PAIRS];
        order.retain(|&pair| self.verdicts[pair].is_none());
        while meter.open() && !order.is_empty() {
            order.retain(|&pair| {
                if !meter.open() {
                    return true;
                }
                let [a, b] = stage.couple(pair);
                let walk = &mut self.walks[pair];
                if !std::mem::replace(&mut started[pair], true) {
                    walk.start(a, b, &stage.pose(pair));
                }
                if !walk.advance(a, b, Goal::Verdict, SLICE_UNITS, meter) {
                    return true;
                }
                let collides = walk.interval().min <= 0.0;
                self.verdicts[pair] = Some(collides);
                let witness = walk.witness().filter(|_| collides);
                self.witnesses[pair] = witness.map(|w| (w.triangle_a, w.triangle_b));
                false
            });
        }
        for (age, verdict) in self.ages.iter_mut().zip(&self.verdicts) {
            *age = if verdict.is_some() { 0 } else { *age + 1 };
        }
    }
}
