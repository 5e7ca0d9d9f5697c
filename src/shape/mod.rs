//! Shapes: what a user writes (`ShapeSpec`), what the engine queries (`Shape`), and the loaders between them.
//!
//! In: a spec and the folder its files are relative to. Out: an immutable, shared `Shape` with its bounds.

mod build;
mod check;
mod convex;
mod deform;
mod error;
mod files;
mod height_field;
mod library;
mod load;
mod mesh;
mod spec;

pub use build::{Built, build};
pub(crate) use check::spread;
pub use convex::Convex;
pub(crate) use convex::{Core, RING_MAX};
pub use error::ShapeError;
pub use files::Contents;
pub use library::Library;
pub(crate) use load::find_mesh;
pub use mesh::Mesh;
#[cfg(test)]
pub(crate) use mesh::tests::ball;
pub(crate) use mesh::{
    Ball, Below, BoxId, Climb, Cone, Held, Inside, NODES_WAITING_MAX, NewTree, NoVertex, Node, Obb,
    ObbPack, ObbTree, Trails, TreeJob, can_be_vertices, side,
};
pub use spec::ShapeSpec;

use crate::math::{Aabb, Point, Pose, Vec3};

/// A built shape, immutable and shared between bodies; one that deforms belongs to one body alone.
#[derive(Clone, Debug)]
pub struct Shape {
    /// What it is.
    pub geometry: Geometry,
    /// Tight box in the shape's own frame; infinite for a half-space.
    pub aabb: Aabb,
    /// Centre of its geometry, own frame: the reference point of motion bounds.
    pub centre: Point,
    /// Greatest distance of any of its points from `centre`, metres, rounded up; infinite for a half-space.
    pub radius: f64,
}

/// The kinds of geometry that the narrow phase distinguishes.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// A convex solid, or a triangle.
    Convex(Convex),
    /// Triangles, as a solid or as a surface; height fields too.
    Mesh(Mesh),
    /// `normal . x <= offset`.
    HalfSpace {
        /// Unit, outward, own frame.
        normal: Vec3,
        /// Metres along `normal`.
        offset: f64,
    },
}

impl Shape {
    /// For a convex solid or a triangle, of any sizes: also a segment or a point.
    pub(crate) fn of_convex(convex: Convex) -> Self {
        Self {
            aabb: convex.aabb_at(&Pose::identity()),
            centre: convex.centre(),
            radius: convex.radius(),
            geometry: Geometry::Convex(convex),
        }
    }

    /// Its tight box at `pose`, rounded outward; infinite for a half-space.
    #[must_use]
    pub fn aabb_at(&self, pose: &Pose) -> Aabb {
        match &self.geometry {
            Geometry::Convex(convex) => convex.aabb_at(pose),
            Geometry::Mesh(mesh) => mesh.aabb_at(pose),
            Geometry::HalfSpace { .. } => self.aabb,
        }
    }

    /// Whether two shapes of equal specs are equal: a file that both name may have changed.
    ///
    /// * `deforms` - then vertex positions do not count, as the sender moves them.
    pub(crate) fn is_built_alike(&self, other: &Self, deforms: bool) -> bool {
        match (&self.geometry, &other.geometry) {
            (Geometry::Convex(a), Geometry::Convex(b)) => a.vertices() == b.vertices(),
            (Geometry::Mesh(a), Geometry::Mesh(b)) => {
                a.is_solid() == b.is_solid()
                    && a.faces() == b.faces()
                    && a.vertices().len() == b.vertices().len()
                    && (deforms || a.vertices() == b.vertices())
            }
            _ => true,
        }
    }
}
