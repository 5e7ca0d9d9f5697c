//! Mesh geometry.

use crate::math::{Aabb, Pose};

/// Mesh.
#[derive(Debug)]
pub struct Mesh;

impl Mesh {
    /// Its tight box at `pose`, rounded outward.
    #[must_use]
    pub fn aabb_at(&self, _pose: &Pose) -> Aabb {
        Aabb::empty()
    }
}
