//! Shapes that deform: a mesh for one body alone.

use super::{Geometry, Mesh, NewTree, Shape, ShapeError};

impl Shape {
    /// A copy of this shape whose vertices can be moved.
    ///
    /// # Errors
    /// It is no mesh, or one that cannot deform, and what to change.
    pub fn to_deforming(&self) -> Result<Self, ShapeError> {
        let Geometry::Mesh(mesh) = &self.geometry else {
            return Err(ShapeError::Setting(
                "deforms = true, but it is no triangle mesh: give a trimesh, or remove `deforms`"
                    .to_owned(),
            ));
        };
        let mut shape = Self {
            geometry: Geometry::Mesh(mesh.clone().into_deforming()?),
            ..self.clone()
        };
        shape.follow_mesh();
        Ok(shape)
    }

    /// Whether its vertices may be moved.
    #[must_use]
    pub fn is_deforming(&self) -> bool {
        self.mesh().is_some_and(Mesh::is_deforming)
    }

    /// See [`Mesh::lag_m`]; 0 if nothing deforms.
    #[inline]
    pub(crate) fn lag_m(&self) -> f64 {
        self.mesh().map_or(0.0, Mesh::lag_m)
    }

    /// See [`Mesh::bent_m`]; 0 if nothing deforms.
    #[inline]
    pub(crate) fn bent_m(&self) -> f64 {
        self.mesh().map_or(0.0, Mesh::bent_m)
    }

    /// See [`Mesh::shed_m`]; 0 if nothing deforms.
    #[inline]
    pub(crate) fn shed_m(&self) -> f64 {
        self.mesh().map_or(0.0, Mesh::shed_m)
    }

    /// A different number means a different tree.
    #[inline]
    pub(crate) fn tree_revision(&self) -> u32 {
        self.mesh().map_or(0, Mesh::tree_revision)
    }

    /// See [`Mesh::bend`].
    pub(crate) fn bend(&mut self, first: usize, moved: &[[f32; 3]]) -> f64 {
        let Geometry::Mesh(mesh) = &mut self.geometry else {
            return 0.0;
        };
        let step_m = mesh.bend(first, moved);
        self.follow_mesh();
        step_m
    }

    /// See [`Mesh::refit`].
    pub(crate) fn refit(&mut self, packs_max: usize) -> usize {
        match &mut self.geometry {
            Geometry::Mesh(mesh) => mesh.refit(packs_max),
            _ => 0,
        }
    }

    /// See [`Mesh::take_tree`].
    pub(crate) fn take_tree(&mut self, new: NewTree) -> bool {
        match &mut self.geometry {
            Geometry::Mesh(mesh) => mesh.take_tree(new),
            _ => false,
        }
    }

    /// Its mesh, if it is one.
    #[inline]
    pub(crate) fn mesh(&self) -> Option<&Mesh> {
        match &self.geometry {
            Geometry::Mesh(mesh) => Some(mesh),
            _ => None,
        }
    }

    fn follow_mesh(&mut self) {
        if let Geometry::Mesh(mesh) = &self.geometry {
            (self.aabb, self.radius) = (mesh.aabb(), mesh.radius());
        }
    }
}
