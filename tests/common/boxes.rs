//! Boxes for a broad phase without a world around it.

use sweepd::broad::Proxies;
use sweepd::ids::{BodyId, BodySlot};
use sweepd::math::Aabb;
use sweepd::pairs::PairPolicy;

/// Boxes by slot, each of a body. One without an end has no bound, for who asks when it comes.
pub struct Boxes {
    pub all: Vec<Aabb>,
    pub ids: Vec<u64>,
}

impl Boxes {
    /// Empty boxes of bodies 1, 2, 3, ...
    pub fn new(count: usize) -> Self {
        Self {
            all: vec![Aabb::empty(); count],
            ids: (1..=count as u64).collect(),
        }
    }
}

impl Proxies for Boxes {
    fn aabb(&self, slot: BodySlot) -> &Aabb {
        &self.all[slot.index()]
    }
    fn unbounded(&self, slot: BodySlot) -> bool {
        self.all[slot.index()].max.x == f64::INFINITY
    }
    fn id(&self, slot: BodySlot) -> BodyId {
        BodyId(self.ids[slot.index()])
    }
}

/// Every pair counts.
pub struct Everything;

impl PairPolicy for Everything {
    fn allows(&self, _: BodySlot, _: BodySlot) -> bool {
        true
    }
}
