//! One side of a pair of which at least one is a mesh: its boxes, its surface points, its leaf queries.

use super::Closest;
use super::bound::Frame;
use super::triangle;
use crate::math::{Point, Vec3};
use crate::narrow::exact::{Warm, convex_gap};
use crate::shape::{Convex, Geometry, Mesh, Node, Shape};

/// A mesh, or a convex shape as a tree of one leaf.
#[derive(Clone, Copy)]
pub(super) enum Side<'a> {
    Mesh(&'a Mesh),
    Convex(&'a Convex),
}

impl<'a> Side<'a> {
    /// `None` for a half-space.
    pub(super) fn of(shape: &'a Shape) -> Option<Self> {
        match &shape.geometry {
            Geometry::Mesh(mesh) => Some(Self::Mesh(mesh)),
            Geometry::Convex(convex) => Some(Self::Convex(convex)),
            Geometry::HalfSpace { .. } => None,
        }
    }

    /// The boxes, root first; a convex shape has the one that is handed in.
    pub(super) fn nodes<'n>(self, one: &'n Node) -> &'n [Node]
    where
        'a: 'n,
    {
        match self {
            Self::Mesh(mesh) => mesh.tree().nodes(),
            Self::Convex(_) => std::slice::from_ref(one),
        }
    }

    /// Whether its inside belongs to it and is found by inside tests (that of a convex shape is in its leaf query).
    pub(super) fn has_inside_test(self) -> bool {
        matches!(self, Self::Mesh(mesh) if mesh.is_solid())
    }

    /// How many points stand for all its connected surfaces.
    pub(super) fn shell_count(self) -> usize {
        match self {
            Self::Mesh(mesh) => mesh.shells().len(),
            Self::Convex(_) => 1,
        }
    }

    /// A point of its `place`th connected surface, own frame.
    pub(super) fn shell_point(self, place: usize) -> Point {
        match self {
            Self::Mesh(mesh) => mesh.vertices()[mesh.shells()[place] as usize],
            Self::Convex(convex) => convex.support(&Vec3::x()),
        }
    }

    /// A point of it far along a direction of its own frame: a guess, but a point of it in any case.
    pub(super) fn outlying(self, direction: &Vec3) -> Point {
        match self {
            Self::Mesh(mesh) => mesh.outlying(direction),
            Self::Convex(convex) => convex.support(direction),
        }
    }
}

/// The gap of one triangle (or convex shape) of A and one of B, in A's frame; `None` when it is proved to exceed
/// `beyond`.
pub(super) fn leaf(
    a: (Side<'_>, u32),
    b: (Side<'_>, u32),
    frame: &Frame,
    beyond: f64,
) -> Option<Closest> {
    match (a.0, b.0) {
        (Side::Mesh(mesh_a), Side::Mesh(mesh_b)) => {
            let in_a = mesh_b.triangle(b.1).map(|p| frame.to_a(&p));
            triangle::gap(&mesh_a.triangle(a.1), &in_a, frame.slop, beyond)
        }
        (Side::Mesh(mesh), Side::Convex(convex)) => {
            let triangle = Convex::triangle(mesh.triangle(a.1));
            Some(convex_gap(
                &triangle,
                convex,
                frame.pos12(),
                &mut Warm::default(),
            ))
        }
        (Side::Convex(convex), Side::Mesh(mesh)) => {
            let triangle = Convex::triangle(mesh.triangle(b.1));
            Some(convex_gap(
                convex,
                &triangle,
                frame.pos12(),
                &mut Warm::default(),
            ))
        }
        (Side::Convex(_), Side::Convex(_)) => None,
    }
}
