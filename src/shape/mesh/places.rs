//! The boxes of a mesh for rays, planes and points, for either tree: a place is a node of the binary tree of a rigid
//! mesh, or a box in the packs of one that deforms.

use super::tree::{Below, Node};
use super::{BoxId, Held, Mesh};
use crate::math::{Point, Vec3};

impl Mesh {
    /// The box at a place, holding the newest vertices; the root is at place 0.
    #[inline]
    pub(crate) fn node(&self, place: u32) -> Node {
        if !self.is_deforming() {
            return self.tree.nodes()[place as usize];
        }
        let obb = self.obb.get(BoxId(place));
        let lag_m = self.lag_m();
        let half = obb.half.map(|h| f64::from(h) + lag_m);
        let half = Vec3::from(half);
        let middle = obb.centre.coords;
        Node::leaf(&(middle - half), &(middle + half), 0)
    }

    /// What is below a place.
    #[inline]
    pub(crate) fn below(&self, place: u32) -> Below {
        if !self.is_deforming() {
            return self.tree.nodes()[place as usize].below(place);
        }
        match self.obb.held(BoxId(place)) {
            Held::Triangle(face) => Below::Triangle(face),
            Held::Pack(pack) => {
                Below::Row(BoxId::new(pack, 0).0, self.obb.packs()[pack as usize].mask)
            }
        }
    }

    /// The origin of the boxes at places, own frame.
    pub(crate) fn places_origin(&self) -> Point {
        if self.is_deforming() {
            Point::origin()
        } else {
            self.tree.origin()
        }
    }

    /// A box around the whole mesh, relative to [`Mesh::centre`].
    pub(crate) fn whole(&self) -> Node {
        if self.is_deforming() {
            let from = self.bounds.min - self.centre;
            Node::leaf(&from, &(self.bounds.max - self.centre), 0)
        } else {
            self.tree.nodes()[0]
        }
    }

    /// Visits the places of the children of a place, in ascending lanes of a mask; a leaf has none.
    pub(crate) fn each_below(&self, place: u32, mut visit: impl FnMut(u32)) {
        match self.below(place) {
            Below::Triangle(_) => {}
            Below::Nodes(left, right) => [left, right].into_iter().for_each(visit),
            Below::Row(first, mask) => {
                let mut rest = mask;
                while rest != 0 {
                    visit(first + rest.trailing_zeros());
                    rest &= rest - 1;
                }
            }
        }
    }
}
