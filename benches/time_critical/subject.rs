//! The methods that are measured: the engine's narrow phase with its searches, and the baselines of this bench.

use sweepd::ids::PairSlot;
use sweepd::math::Interval;
use sweepd::narrow::mesh::Search;
use sweepd::narrow::{Order, Wanted};
use sweepd::time::Meter;
use sweepd::wire::Verdict;

use crate::regions::millionths;
use crate::restart::{Restart, Trees};
use crate::stage::{DIAMETER_M, PAIRS, Stage};

/// Demand for verdicts only.
pub const VERDICTS: Wanted = Wanted {
    contacts: false,
    bounds: false,
    regions: false,
    order: Order::Aged,
};

/// The engine's searches (its `restart` keeps each pair's certificate and last contact), and plain restarts: each pair
/// from the start in every tick, over oriented boxes or over boxes in the bodies' frames, with and without last tick's
/// witness.
pub const SUBJECTS: [&str; 8] = [
    "carried",
    "restart",
    "restart_plain",
    "restart_witness",
    "breadth_first",
    "priority",
    "walk",
    "walk_witness",
];

pub enum Subject {
    Engine(Search),
    Restart(Box<Restart>),
}

impl Subject {
    pub fn new(name: &str) -> Self {
        let restart = |trees, cached| Self::Restart(Box::new(Restart::new(trees, cached)));
        match name {
            "restart_plain" => restart(Trees::fronts(), false),
            "restart_witness" => restart(Trees::fronts(), true),
            "walk" => restart(Trees::walks(), false),
            "walk_witness" => restart(Trees::walks(), true),
            _ => Self::Engine(Search::named(name).unwrap()),
        }
    }

    /// Whether the method continues with bounds once it has the verdicts.
    pub fn has_bounds(name: &str) -> bool {
        Search::named(name).is_some()
    }

    pub fn spend(&mut self, stage: &mut Stage, wanted: Wanted, meter: &mut Meter<'_>) {
        match self {
            Self::Engine(search) => {
                stage.narrow.set_search(*search);
                stage.narrow.spend(&mut stage.world, wanted, meter);
            }
            Self::Restart(restart) => restart.spend(stage, meter),
        }
    }

    /// Verdict of every pair at this tick's poses; `None`: unresolved.
    pub fn verdicts(&self, stage: &Stage) -> Vec<Option<bool>> {
        match self {
            Self::Engine(_) => {
                let mut all = vec![None; PAIRS];
                for (slot, _) in stage.pairs.iter() {
                    let verdict = stage.narrow.finding(slot).unwrap().verdict;
                    all[stage.pair_of(slot)] = match verdict {
                        Verdict::Colliding => Some(true),
                        Verdict::Possible => None,
                        _ => Some(false),
                    };
                }
                all
            }
            Self::Restart(restart) => restart.verdicts.clone(),
        }
    }

    /// The width of each pair's distance interval after a cold start, millionths of the diameter. For a pair without
    /// any work it is the interval from the bodies' boxes.
    pub fn widths(&self, stage: &Stage) -> Vec<u64> {
        let distance = |gap: Interval| gap.max.max(0.0) - gap.min.max(0.0);
        let width = |(slot, _)| {
            let told = stage.narrow.finding(slot).unwrap().gap;
            let gap = match self {
                Self::Engine(_) => told,
                Self::Restart(restart) => restart.gap(stage.pair_of(slot)).meet(told),
            };
            millionths(distance(gap) / DIAMETER_M)
        };
        stage.pairs.iter().map(width).collect()
    }

    /// Progress on each open pair: radius of the largest sphere in which it may touch, from the boxes that are not
    /// proved apart, millionths of the diameter. Empty for a plain restart.
    pub fn regions(&self, stage: &mut Stage) -> Vec<u64> {
        if matches!(self, Self::Restart(_)) {
            return Vec::new();
        }
        let (narrow, world) = (&mut stage.narrow, &stage.world);
        let slots: Vec<PairSlot> = stage.pairs.iter().map(|(slot, _)| slot).collect();
        let mut all = Vec::new();
        for slot in slots {
            if narrow.finding(slot).unwrap().verdict != Verdict::Possible {
                continue;
            }
            let found = narrow.regions(slot, world, usize::MAX);
            let radii = found.iter().flat_map(|found| found.all);
            let widest_m = radii.map(|region| region.radius_m).fold(0.0, f64::max);
            all.push(millionths(widest_m / DIAMETER_M));
        }
        all
    }
}
