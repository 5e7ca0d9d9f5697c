//! The box and the radius of a mesh that deforms: how they follow its vertices.
//!
//! In: the update, and the boxes of the tree. Out: bounds that contain all vertices at once, and that shrink again even
//! if only some of the vertices are sent at a time.

use super::{Deform, Mesh, aabb};
use crate::math::{Aabb, Point, ROUND, Vec3};

impl Deform {
    /// A box and a radius that contain all triangles: the root's boxes, widened by how far a vertex may be outside
    /// them, within the bounds so far. A sender may send in each tick, so that no refit ends without newer vertices.
    pub(super) fn fitted(&self, bounds: &Aabb, centre: &Point) -> Option<(Aabb, f64)> {
        let root = self.around.first().filter(|_| self.stale_m.is_finite())?;
        let around = match self.stale_m {
            0.0 => aabb(root),
            stale_m => aabb(root).widened(stale_m),
        };
        let bounds = Aabb {
            min: around.min.sup(&bounds.min),
            max: around.max.inf(&bounds.max),
        };
        let farthest = (bounds.centre() - centre).abs() + bounds.half_extents();
        let radius = farthest.norm() * (1.0 + 8.0 * ROUND);
        Some((
            bounds,
            radius + 8.0 * ROUND * (centre.coords.amax() + bounds.centre().coords.amax()),
        ))
    }

    /// Adds what the bounds have shrunk by.
    ///
    /// * `step_m` - the largest displacement of the vertices that came, metres.
    pub(super) fn note_shed(&mut self, step_m: f64, then: &(Aabb, f64), now: &(Aabb, f64)) {
        let inward = (now.0.min - then.0.min).sup(&(then.0.max - now.0.max));
        let drawn_m = inward.sup(&Vec3::zeros()).norm().max(then.1 - now.1);
        self.shed_m += step_m.max(drawn_m);
    }
}

impl Mesh {
    /// Running sum of how far, in each update, a vertex moved or the bounds shrank, whichever is more, metres; 0 for a
    /// rigid mesh. A test of its bounds may have a different result once this has grown by what was lacking.
    #[inline]
    pub(crate) fn shed_m(&self) -> f64 {
        self.deform.as_ref().map_or(0.0, |deform| deform.shed_m)
    }

    /// Bounds and radius of all vertices.
    pub(super) fn measure(&mut self) {
        self.bounds = Aabb::of(&self.vertices);
        let far = |v: &Point| (v - self.centre).norm_squared();
        let square = self.vertices.iter().map(far).fold(0.0, f64::max);
        self.radius = square.sqrt() * (1.0 + 8.0 * ROUND);
    }

    /// How far a mesh that deforms reaches from its centre along a direction and against it, metres.
    pub(in crate::shape::mesh) fn extent_of_bounds(&self, direction: &Vec3) -> [f64; 2] {
        let (middle, half) = (self.bounds.centre(), self.bounds.half_extents());
        let on = direction.dot(&(middle - self.centre));
        let reach = direction.abs().dot(&half);
        [reach + on, reach - on].map(|r| r.min(self.radius))
    }
}
