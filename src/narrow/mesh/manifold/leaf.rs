//! A leaf of a pair: a triangle with its surrounding surface, or a convex shape; seen from A.

use super::{Placed, Side, Walks};
use crate::math::{Point, Vec3};
use crate::shape::{Convex, Mesh};

/// One of the two leaves.
#[derive(Clone, Copy)]
pub(super) struct Leaf<'a> {
    pub(super) side: Side<'a>,
    pub(super) place: u32,
    pub(super) is_b: bool,
    pub(super) at: &'a Placed,
    /// Of a triangle, A's frame.
    pub(super) corners: [Point; 3],
    /// Of a triangle with non-zero area: unit, outward for a solid, A's frame.
    pub(super) normal: Option<Vec3>,
}

impl<'a> Leaf<'a> {
    pub(super) fn new((side, place): (Side<'a>, u32), is_b: bool, at: &'a Placed) -> Self {
        let mut leaf = Self {
            side,
            place,
            is_b,
            at,
            corners: [Point::origin(); 3],
            normal: None,
        };
        if let Side::Mesh(mesh) = side {
            leaf.corners = mesh.triangle(place).map(|p| leaf.in_a(&p));
            let turn = |n: Vec3| if is_b { at.rotation * n } else { n };
            leaf.normal = mesh.face_normal(place).map(turn);
        }
        leaf
    }

    pub(super) fn mesh(&self) -> Option<&'a Mesh> {
        match self.side {
            Side::Mesh(mesh) => Some(mesh),
            Side::Convex(_) => None,
        }
    }

    /// The surface it belongs to.
    pub(super) fn patch(&self) -> u32 {
        let region = self.mesh().map_or(0, |mesh| mesh.region(self.place));
        region << 1 | u32::from(self.is_b)
    }

    /// A direction of A's frame in the leaf's own.
    pub(super) fn turn(&self, direction: &Vec3) -> Vec3 {
        if self.is_b {
            self.at.turn_to_b(direction)
        } else {
            *direction
        }
    }

    pub(super) fn in_a(&self, point: &Point) -> Point {
        if self.is_b {
            self.at.to_a(point)
        } else {
            *point
        }
    }

    /// Coordinate of A's origin along a direction of A's frame, measured from the leaf's own origin.
    pub(super) fn offset(&self, direction: &Vec3) -> f64 {
        direction.dot(&self.in_a(&Point::origin()).coords)
    }

    /// How far the surface around this leaf reaches along a direction, from A's origin, and the mesh vertex there;
    /// `None`: beyond `beyond_m`, or the walk was stopped.
    pub(super) fn reach(
        &self,
        direction: &Vec3,
        beyond_m: f64,
        (walks, go_on): (&mut Walks, &mut impl FnMut() -> bool),
    ) -> Option<(f64, Option<u32>)> {
        let (own, offset) = (self.turn(direction), self.offset(direction));
        let (height, top) = match self.side {
            Side::Convex(convex) => (own.dot(&convex.support(&own).coords), None),
            Side::Mesh(mesh) => {
                let trails = walks.tops(self.is_b);
                let top = mesh.climb(self.place, &own, beyond_m - offset, trails, go_on)?;
                (own.dot(&mesh.vertices()[top as usize].coords), Some(top))
            }
        };
        Some((height + offset, top))
    }

    /// The same for the leaf's own normal: an edge of the surface is not left for higher ground beyond it.
    pub(super) fn own_reach(
        &self,
        direction: &Vec3,
        beyond_m: f64,
        (walks, go_on): (&mut Walks, &mut impl FnMut() -> bool),
    ) -> Option<f64> {
        let crest = (self.mesh()).and_then(|mesh| mesh.crest(self.place, &self.turn(direction)));
        match crest {
            Some(height) => Some(height + self.offset(direction)),
            None => (self.reach(direction, beyond_m, (walks, go_on))).map(|(height, _)| height),
        }
    }

    /// How far the leaf alone reaches along a direction, from A's origin.
    pub(super) fn least_reach(&self, direction: &Vec3) -> f64 {
        match self.side {
            Side::Convex(convex) => {
                let own = self.turn(direction);
                own.dot(&convex.support(&own).coords) + self.offset(direction)
            }
            Side::Mesh(_) => {
                let on = self.corners.map(|p| direction.dot(&p.coords));
                on[0].max(on[1]).max(on[2])
            }
        }
    }

    /// The leaf as a convex shape in its own frame.
    pub(super) fn convex(&self) -> Convex {
        match self.side {
            Side::Mesh(mesh) => Convex::triangle(mesh.triangle(self.place)),
            Side::Convex(convex) => convex.clone(),
        }
    }

    /// Name of a vertex by its corner's index, or of a convex shape's: unique within the shape.
    pub(super) fn corner_name(&self, corner: u32) -> u64 {
        let name = match self.side {
            Side::Mesh(mesh) => mesh.faces()[self.place as usize]
                .get(corner as usize)
                .map_or(u64::MAX >> 2, |&v| u64::from(v)),
            Side::Convex(_) => u64::from(corner),
        };
        name << 1 | u64::from(self.is_b)
    }

    /// Name of an edge by its index: for a triangle by its two vertices.
    pub(super) fn edge_name(&self, edge: u32) -> u64 {
        if self.mesh().is_none() {
            return mix(self.corner_name(edge), 1);
        }
        let (from, to) = (self.corner_name(edge % 3), self.corner_name((edge + 1) % 3));
        mix(from.min(to), from.max(to))
    }
}

/// Name of a vertex of one of the two.
pub(super) fn corner_name(vertex: u32, is_b: bool) -> u64 {
    u64::from(vertex) << 1 | u64::from(is_b)
}

/// Combines two names.
pub(super) fn mix(one: u64, other: u64) -> u64 {
    // Source: Steele, Lea, Flood 2014, Fast splittable pseudorandom number generators (the finalizer).
    let mut x = one
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(other)
        .wrapping_add(0x632b_e59b_d9b4_e019);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}
