//! The triangles that touched last, asked again at another pose; where they have parted, a walk to where the surfaces
//! cross now.
//!
//! Two surfaces that go on touching do so along a curve, which moves over a triangle's edge into the next: a walk over
//! both from the two that touched last comes to the curve in a few steps, where a search from boxes takes twenty units.
//! At 0.5 % of the diameter a tick 1,440 units for all verdicts in place of 2,000, at 2 % 2,100 in place of 4,070
//! (`benches/time_critical`). Refused: to set out from boxes of a search that has not come to leaves yet, or from the
//! points that reach farthest out. They are too far from the curve; most such walks are in vain.

use super::leaves::contact;
use super::{CarriedFront, LeafContact, Search};
use crate::math::Pose;
use crate::narrow::mesh::placed::Placed;
use crate::narrow::mesh::retest::reach_of;
use crate::narrow::mesh::side::{self, Side};
use crate::narrow::mesh::triangle::{Triangle, surely_crosses};
use crate::narrow::mesh::way::{Way, way};
use crate::shape::{Mesh, Shape};
use crate::time::Meter;

/// Steps of a walk, from one touch to the next. With 8, 16 and 24 at 2 % of the diameter a tick it takes 2,140, 2,160
/// and 2,180 units, with 12 it takes 2,100.
const STEPS_MAX: usize = 12;

/// The triangles that touched last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    places: [u32; 2],
    /// Each in its own frame: to ask them again costs no look into a mesh that does not deform.
    corners: [Triangle; 2],
    /// Where the walk from them stands: one that was cut off goes on.
    reached: [u32; 2],
    steps: usize,
}

impl CarriedFront {
    /// Whether it is known where they touched last; after a walk in vain it is not.
    pub(in crate::narrow) fn knows_touch(&self) -> bool {
        self.crossing.is_some()
    }

    /// Whether the leaves that touched last are certain to touch at a pose; nothing else is looked at. Where they are,
    /// a walk from them that was cut off is no more to be gone on with.
    ///
    /// * `off_m` - how far B may be from that pose, metres.
    #[must_use]
    pub fn still_touches(&mut self, a: &Shape, b: &Shape, (pos12, off_m): (&Pose, f64)) -> bool {
        let Some(crossing) = &mut self.crossing else {
            return false;
        };
        let now = |shape: &Shape, k: usize| match shape.mesh() {
            Some(mesh) if mesh.is_deforming() => mesh.triangle(crossing.places[k]),
            _ => crossing.corners[k],
        };
        let at = placed((a, b), pos12, off_m);
        let touches = surely_crosses(&now(a, 0), &now(b, 1).map(|p| at.to_a(&p)), at.slop);
        if touches {
            (crossing.reached, crossing.steps) = (crossing.places, 0);
        }
        touches
    }

    /// Leaves that are certain to touch at a pose, found by a walk from those that touched last and do not any more:
    /// they are the ones to be asked next time. After a walk in vain it is forgotten where the two touched, so that no
    /// pair spends a small budget on it for ever; nothing else is changed. Units: a step each.
    ///
    /// * `off_m` - as [`CarriedFront::still_touches`] has it.
    pub fn touches_beside(
        &mut self,
        a: &Shape,
        b: &Shape,
        (pos12, off_m): (&Pose, f64),
        meter: &mut Meter<'_>,
    ) -> Option<LeafContact> {
        let crossing = self.crossing.as_mut()?;
        let meshes = [a.mesh()?, b.mesh()?];
        if self.search != Search::Carried {
            return None;
        }
        let at = placed((a, b), pos12, off_m);
        let walked = crossing.walk(meshes, &at, meter);
        if matches!(walked, Walked::Nowhere) {
            self.crossing = None;
        }
        walked.found()
    }

    /// A walk from two leaves that do not touch, once a pose; where it comes to leaves that do, the two touch.
    ///
    /// What it finds is under an entry that is open or has expired, as all that touches is, and stays there.
    pub(super) fn seek(
        &mut self,
        places: [u32; 2],
        (a, b): (Side<'_>, Side<'_>),
        meter: &mut Meter<'_>,
    ) {
        let (Side::Mesh(one), Side::Mesh(other)) = (a, b) else {
            return;
        };
        if self.search != Search::Carried || std::mem::replace(&mut self.known.sought, true) {
            return;
        }
        let corners = [one.triangle(places[0]), other.triangle(places[1])];
        let mut crossing = Crossing::at(places, corners);
        if let Some(contact) = crossing.walk([one, other], &self.at, meter).found() {
            self.crossing = Some(crossing);
            self.known.touches = true;
            self.known.high = self.known.high.min(self.high_of(&contact.closest));
            self.witness = Some(contact);
        }
    }
}

/// Two shapes at a pose that B may be `off_m` from.
fn placed((a, b): (&Shape, &Shape), pos12: &Pose, off_m: f64) -> Placed {
    let at = Placed::new(pos12, reach_of(a), reach_of(b));
    Placed {
        slop: at.slop + off_m,
        ..at
    }
}

/// How a walk ended.
enum Walked {
    /// At leaves that touch.
    Found(LeafContact),
    /// The meter closed.
    Stopped,
    /// In vain.
    Nowhere,
}

impl Walked {
    fn found(self) -> Option<LeafContact> {
        match self {
            Self::Found(contact) => Some(contact),
            Self::Stopped | Self::Nowhere => None,
        }
    }
}

impl Crossing {
    /// * `corners` - each in its own frame.
    pub(super) fn at(places: [u32; 2], corners: [Triangle; 2]) -> Self {
        Self {
            places,
            corners,
            reached: places,
            steps: 0,
        }
    }

    /// Goes on over the two surfaces to where they cross. Units: a step each.
    fn walk(&mut self, meshes: [&Mesh; 2], at: &Placed, meter: &mut Meter<'_>) -> Walked {
        let corners = |k: usize, place: u32| {
            let own = meshes[k].triangle(place);
            if k == 0 {
                own
            } else {
                own.map(|p| at.to_a(&p))
            }
        };
        let mut now = [0, 1].map(|k| corners(k, self.reached[k]));
        while self.steps < STEPS_MAX {
            if !meter.open() {
                return Walked::Stopped;
            }
            meter.charge(1);
            self.steps += 1;
            let sides = match way(&now[0], &now[1]) {
                Way::Cross if surely_crosses(&now[0], &now[1], at.slop) => {
                    return self.arrive(meshes, at);
                }
                Way::Cross | Way::None => return Walked::Nowhere,
                Way::Over(sides) => sides,
            };
            let mut moved = false;
            for (k, side) in sides.into_iter().enumerate() {
                let beyond = side.and_then(|side| meshes[k].beside(self.reached[k], side));
                if let Some(place) = beyond {
                    moved = true;
                    self.reached[k] = place;
                    now[k] = corners(k, place);
                }
            }
            if !moved {
                return Walked::Nowhere;
            }
        }
        Walked::Nowhere
    }

    /// The leaves reached are the ones that touched last from now on.
    fn arrive(&mut self, meshes: [&Mesh; 2], at: &Placed) -> Walked {
        let [i, j] = self.reached;
        *self = Self::at([i, j], [meshes[0].triangle(i), meshes[1].triangle(j)]);
        let leaves = ((Side::Mesh(meshes[0]), i), (Side::Mesh(meshes[1]), j));
        match side::leaf(leaves.0, leaves.1, at, 0.0) {
            Ok(closest) => Walked::Found(contact(leaves.0, leaves.1, closest)),
            Err(_) => Walked::Nowhere,
        }
    }
}
