//! What is told of a pair as two wholes, without a look into its front: a plane that parts the two, or balls within
//! them that overlap.

use super::{CarriedFront, Search};
use crate::math::Pose;
use crate::shape::Shape;
use crate::time::Meter;

impl CarriedFront {
    /// A lower bound on the gap at a pose, of a plane that parts the two as wholes; `None`: none was found. What is
    /// proved of the pair stays as it is, at the pose it is at. One unit at most.
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

    /// A lower bound on the depth of the overlap at a pose, of balls within the two; `None`: they do not tell. What is
    /// proved of the pair stays as it is, at the pose it is at. One unit at most.
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
