//! The triangles that touched last, asked again at another pose; where they have parted, those beside them.
//!
//! Two surfaces that go on touching do so along a curve, which moves over a triangle's edge into the next: so whoever
//! looks beside the two that touched last finds the touch in a few queries, where a search from boxes takes ten units.

use super::leaves::contact;
use super::{CarriedFront, LeafContact, Search};
use crate::math::Pose;
use crate::narrow::mesh::placed::Placed;
use crate::narrow::mesh::retest::reach_of;
use crate::narrow::mesh::side::{self, Side};
use crate::narrow::mesh::triangle::{Triangle, surely_crosses};
use crate::shape::{Mesh, Shape};
use crate::time::Meter;

/// Which of the faces about the one that touched are asked against which about the other; 0 is the face itself.
const BESIDE: [(usize, usize); 15] = [
    (0, 1),
    (0, 2),
    (0, 3),
    (1, 0),
    (2, 0),
    (3, 0),
    (1, 1),
    (1, 2),
    (1, 3),
    (2, 1),
    (2, 2),
    (2, 3),
    (3, 1),
    (3, 2),
    (3, 3),
];

/// The triangles that touched last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    pub(super) places: [u32; 2],
    /// Each in its own frame: to ask them again costs no look into a mesh that does not deform.
    pub(super) corners: [Triangle; 2],
    /// How many of those beside them have been asked: a round that was cut off goes on.
    pub(super) asked: usize,
}

impl CarriedFront {
    /// Whether it is known where they touched last; after a round in vain it is not.
    pub(in crate::narrow) fn knows_touch(&self) -> bool {
        self.crossing.is_some()
    }

    /// Whether the leaves that touched last are certain to touch at a pose; nothing else is looked at. Where they are,
    /// a round beside them that was cut off is no more to be gone on with.
    #[must_use]
    pub fn still_touches(&mut self, a: &Shape, b: &Shape, pos12: &Pose) -> bool {
        let Some(crossing) = &mut self.crossing else {
            return false;
        };
        let now = |shape: &Shape, k: usize| match shape.mesh() {
            Some(mesh) if mesh.is_deforming() => mesh.triangle(crossing.places[k]),
            _ => crossing.corners[k],
        };
        let at = Placed::new(pos12, reach_of(a), reach_of(b));
        let touches = surely_crosses(&now(a, 0), &now(b, 1).map(|p| at.to_a(&p)), at.slop);
        if touches {
            crossing.asked = 0;
        }
        touches
    }

    /// Leaves that are certain to touch at a pose, beside those that touched last and do not any more: they are the
    /// ones to be asked next time. After a round in vain it is forgotten where the two touched, so that no pair spends
    /// a small budget on it for ever; nothing else is changed. Units: a pair of leaves each.
    pub fn touches_beside(
        &mut self,
        a: &Shape,
        b: &Shape,
        pos12: &Pose,
        meter: &mut Meter<'_>,
    ) -> Option<LeafContact> {
        let crossing = self.crossing.as_mut()?;
        let (mesh_a, mesh_b) = (a.mesh()?, b.mesh()?);
        if self.search != Search::Carried {
            return None;
        }
        let at = Placed::new(pos12, reach_of(a), reach_of(b));
        let (near_a, near_b) = (
            near(mesh_a, crossing.places[0]),
            near(mesh_b, crossing.places[1]),
        );
        let of_a = near_a.map(|place| place.map(|place| mesh_a.triangle(place)));
        let of_b =
            near_b.map(|place| place.map(|place| mesh_b.triangle(place).map(|p| at.to_a(&p))));
        // One that touched and one beside the other first; the two themselves have been asked.
        for (i, j) in BESIDE.into_iter().skip(crossing.asked) {
            if !meter.open() {
                return None;
            }
            crossing.asked += 1;
            let (Some(one), Some(other)) = (&of_a[i], &of_b[j]) else {
                continue;
            };
            meter.charge(1);
            let places = (near_a[i]?, near_b[j]?);
            if surely_crosses(one, other, at.slop) {
                let leaves = (
                    (Side::Mesh(mesh_a), places.0),
                    (Side::Mesh(mesh_b), places.1),
                );
                let closest = side::leaf(leaves.0, leaves.1, &at, 0.0).ok()?;
                self.crossing = Some(Crossing {
                    places: [places.0, places.1],
                    corners: [*one, mesh_b.triangle(places.1)],
                    asked: 0,
                });
                return Some(contact(leaves.0, leaves.1, closest));
            }
        }
        self.crossing = None;
        None
    }
}

/// A face and those beside it.
fn near(mesh: &Mesh, face: u32) -> [Option<u32>; 4] {
    let beside = |k| mesh.beside(face, k);
    [Some(face), beside(0), beside(1), beside(2)]
}
