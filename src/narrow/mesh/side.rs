//! One side of a pair of which at least one is a mesh: its boxes, its surface points, its leaf queries.

use super::Closest;
use super::bound::Frame;
use super::placed::Placed;
use super::triangle::{self, Triangle};
use crate::math::{Point, Vec3};
use crate::narrow::exact::{Warm, convex_gap};
use crate::shape::{Convex, Geometry, Mesh, Node, Obb, Shape};

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

    /// The boxes, root first; a convex shape has the one that is passed in.
    pub(super) fn nodes<'n>(self, one: &'n Node) -> &'n [Node]
    where
        'a: 'n,
    {
        match self {
            Self::Mesh(mesh) => mesh.tree().nodes(),
            Self::Convex(_) => std::slice::from_ref(one),
        }
    }

    /// The box of a convex shape, which is its own only leaf.
    pub(super) fn whole(self, shape: &Shape) -> Option<Obb> {
        match self {
            Self::Mesh(_) => None,
            Self::Convex(_) => Some(Obb::around(&shape.aabb)),
        }
    }

    /// The solid mesh, if it is one; a convex shape's inside is handled by its leaf query, a surface has none.
    pub(super) fn solid(self) -> Option<&'a Mesh> {
        match self {
            Self::Mesh(mesh) if mesh.is_solid() => Some(mesh),
            _ => None,
        }
    }

    /// An upper bound on how far it reaches from the origin of its tree along a direction of its frame.
    pub(super) fn reach(self, direction: &Vec3, origin: &Point) -> f64 {
        match self {
            Self::Mesh(mesh) => mesh.reach(direction),
            Self::Convex(convex) => direction.dot(&(convex.support(direction) - origin)),
        }
    }

    /// How many points a support query visits; 0 for a mesh, which has a table.
    pub(super) fn points(self) -> usize {
        match self {
            Self::Mesh(_) => 0,
            Self::Convex(convex) => convex.vertices().len(),
        }
    }

    /// Upper bounds on how far it reaches from the origin of its tree along a direction of its frame, and against it.
    pub(super) fn extent(self, direction: &Vec3, origin: &Point) -> [f64; 2] {
        match self {
            Self::Mesh(mesh) => mesh.extent(direction),
            Self::Convex(_) => [*direction, -direction].map(|along| self.reach(&along, origin)),
        }
    }

    /// Greatest distance of its surface from its middle, metres.
    pub(super) fn radius(self) -> f64 {
        match self {
            Self::Mesh(mesh) => mesh.radius(),
            Self::Convex(convex) => convex.radius(),
        }
    }

    /// See [`Mesh::shed_m`]; 0 if nothing deforms.
    pub(super) fn shed_m(self) -> f64 {
        match self {
            Self::Mesh(mesh) => mesh.shed_m(),
            Self::Convex(_) => 0.0,
        }
    }

    /// How many points represent all its connected surfaces.
    pub(super) fn shell_count(self) -> usize {
        match self {
            Self::Mesh(mesh) => mesh.shells().len(),
            Self::Convex(_) => 1,
        }
    }

    /// A point of its `place`th connected surface, own frame; far along `direction` if there is only one surface.
    pub(super) fn shell_point(self, place: usize, direction: &Vec3) -> Point {
        match self {
            Self::Mesh(mesh) if mesh.shells().len() == 1 => mesh.outlying(direction),
            Self::Mesh(mesh) => mesh.vertices()[mesh.shells()[place] as usize],
            Self::Convex(convex) => convex.support(direction),
        }
    }

    /// A point of it far along a direction of its own frame: not always the farthest, but a point of it in any case.
    pub(super) fn outlying(self, direction: &Vec3) -> Point {
        match self {
            Self::Mesh(mesh) => mesh.outlying(direction),
            Self::Convex(convex) => convex.support(direction),
        }
    }
}

/// A lower bound on the gap of all of A and all of B, tighter than that of their root boxes: the separation along the
/// axes of both and along the line between their origins, from their true reach.
pub(super) fn low(a: (Side<'_>, &Point), b: (Side<'_>, &Point), frame: &Frame) -> f64 {
    let mut best = f64::NEG_INFINITY;
    for axis in frame.axes() {
        let [up_a, down_a] = a.0.extent(&axis, a.1);
        let [up_b, down_b] = b.0.extent(&frame.placed.turn_to_b(&axis), b.1);
        let between = axis.dot(&frame.between());
        best = best
            .max(between - up_a - down_b)
            .max(-between - down_a - up_b);
    }
    best - frame.placed.slop
}

/// The gap of one triangle (or convex shape) of A and one of B, in A's frame.
///
/// * `beyond_m` - a gap that exceeds this does not matter; 0: only a touch matters.
///
/// # Errors
/// The proved lower bound on the gap, metres, more than `beyond_m`.
pub(super) fn leaf(
    a: (Side<'_>, u32),
    b: (Side<'_>, u32),
    at: &Placed,
    beyond_m: f64,
) -> Result<Closest, f64> {
    match (a.0, b.0) {
        (Side::Mesh(mesh_a), Side::Mesh(mesh_b)) => {
            let in_a = mesh_b.triangle(b.1).map(|p| at.to_a(&p));
            triangle::gap(&mesh_a.triangle(a.1), &in_a, at.slop, beyond_m)
        }
        (Side::Mesh(mesh), Side::Convex(convex)) => {
            let triangle = Convex::triangle(mesh.triangle(a.1));
            Ok(convex_gap(
                &triangle,
                convex,
                &at.pos12,
                &mut Warm::default(),
            ))
        }
        (Side::Convex(convex), Side::Mesh(mesh)) => {
            let triangle = Convex::triangle(mesh.triangle(b.1));
            Ok(convex_gap(
                convex,
                &triangle,
                &at.pos12,
                &mut Warm::default(),
            ))
        }
        // Not reached: such a pair has no front, and nothing is known of it.
        (Side::Convex(_), Side::Convex(_)) => Err(f64::NEG_INFINITY),
    }
}

/// The corners of two leaves that are triangles, each in its own frame.
pub(super) fn triangles(a: (Side<'_>, u32), b: (Side<'_>, u32)) -> Option<[Triangle; 2]> {
    match (a.0, b.0) {
        (Side::Mesh(mesh_a), Side::Mesh(mesh_b)) => {
            Some([mesh_a.triangle(a.1), mesh_b.triangle(b.1)])
        }
        _ => None,
    }
}
