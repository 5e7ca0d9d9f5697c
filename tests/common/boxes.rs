//! Boxes for a broad phase, without a world.

use sweepd::broad::Proxies;
use sweepd::ids::{BodyId, BodySlot};
use sweepd::math::Aabb;
use sweepd::pairs::PairPolicy;

/// The box and the id of each body, by slot. A body whose box has an infinite upper x bound counts as unbounded, which
/// is read when the body is inserted.
pub struct Boxes {
    pub all: Vec<Aabb>,
    pub ids: Vec<u64>,
}

impl Boxes {
    /// Empty boxes of the bodies with ids 1, 2, 3, ...
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

/// A policy that allows every pair.
pub struct Everything;

impl PairPolicy for Everything {
    fn allows(&self, _: BodySlot, _: BodySlot) -> bool {
        true
    }
}
