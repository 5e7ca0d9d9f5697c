//! The world as input of the broad phase: its boxes and its filters.

use super::Proxies;
use crate::ids::{BodyId, BodySlot};
use crate::math::Aabb;
use crate::pairs::PairPolicy;
use crate::world::{Filters, World};

/// The box of a slot without a body; such a slot is never in the broad phase.
static NOWHERE: Aabb = Aabb {
    min: crate::math::Point::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
    max: crate::math::Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
};

impl Proxies for World {
    fn aabb(&self, slot: BodySlot) -> &Aabb {
        self.proxy(slot).unwrap_or(&NOWHERE)
    }

    fn unbounded(&self, slot: BodySlot) -> bool {
        self.body(slot).is_some_and(|body| body.unbounded)
    }

    fn id(&self, slot: BodySlot) -> BodyId {
        self.body(slot).map_or(BodyId(0), |body| body.id)
    }
}

impl PairPolicy for Filters {
    fn allows(&self, a: BodySlot, b: BodySlot) -> bool {
        Self::allows(self, a, b)
    }

    fn keeps(&self, slot: BodySlot) -> bool {
        Self::keeps(self, slot)
    }

    fn bars(&self, slot: BodySlot) -> bool {
        Self::bars(self, slot)
    }
}
