//! What can be said of two whole shapes without opening the front: a plane that separates them, or inner balls that
//! overlap.

use super::{CarriedFront, Search};
use crate::math::Pose;
use crate::shape::Shape;
use crate::time::Meter;

impl CarriedFront {
    /// A lower bound on the gap at a pose, from a plane that separates the two; `None`: none was found. The pair's
    /// proofs and the front's pose are unchanged. One unit at most.
    pub fn parted(
        &mut self,
        a: &Shape,
        b: &Shape,
        pos12: &Pose,
        meter: &mut Meter<'_>,
    ) -> Option<f64> {
        let is_carried = self.search == Search::Carried;
        is_carried.then(|| self.parting.low(a, b, pos12, meter))?
    }

    /// A lower bound on the depth of the overlap at a pose, from balls within the two; `None`: they do not overlap
    /// enough. The pair's proofs and the front's pose are unchanged. One unit at most.
    pub fn overlap(
        &mut self,
        a: &Shape,
        b: &Shape,
        pos12: &Pose,
        meter: &mut Meter<'_>,
    ) -> Option<f64> {
        let is_carried = self.search == Search::Carried;
        is_carried.then(|| self.deep.depth(a, b, pos12, meter))?
    }
}
