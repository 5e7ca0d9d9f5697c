//! Convex geometry.

use crate::math::{Aabb, Pose};

/// Convex.
#[derive(Debug)]
pub struct Convex;

impl Convex {
    /// Its tight box at `pose`, rounded outward.
    #[must_use]
    pub fn aabb_at(&self, _pose: &Pose) -> Aabb {
        Aabb::empty()
    }
}
