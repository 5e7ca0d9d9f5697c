//! The triangles that touched last, retested at another pose; if they have separated, a walk to where the surfaces
//! cross now.
//!
//! Two surfaces that stay in touch do so along a curve, which moves over a triangle's edge into the next: a walk over
//! both from the two that touched last reaches the curve in a few steps, where a search from boxes takes twenty units.
//! At 0.5 % of the diameter a tick 1,440 units for all verdicts instead of 2,000, at 2 % 2,100 instead of 4,070
//! (`benches/time_critical`). Refused: starting from boxes of a search that has not reached leaves yet, or from the
//! points that reach farthest out: they are too far from the curve, and most such walks fail.

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

/// Most steps of a walk from one touch to the next. At 2 % of the diameter a tick, 8, 16 and 24 steps take 2,140, 2,160
/// and 2,180 units; 12 take 2,100.
const STEPS_MAX: usize = 12;

/// The triangles that touched last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    places: [u32; 2],
    /// Each in its own frame: retesting them needs no access to a mesh that does not deform.
    corners: [Triangle; 2],
    /// The walk's present position: an interrupted walk continues.
    reached: [u32; 2],
    steps: usize,
}

impl CarriedFront {
    /// Whether the place of the last touch is known; after a failed walk it is not.
    pub(in crate::narrow) fn knows_touch(&self) -> bool {
        self.crossing.is_some()
    }

    /// Whether the leaves that touched last surely touch at a pose; nothing else is tested. If so, an interrupted walk
    /// from them is dropped.
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

    /// Leaves that surely touch at a pose, found by a walk from those that touched last and no longer do; they are the
    /// ones to be retested next time. After a failed walk the place of touch is forgotten, so that no pair spends a
    /// small budget on it for ever; nothing else is changed. Units: one per step.
    ///
    /// * `off_m` - as in [`CarriedFront::still_touches`].
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

    /// A walk from two leaves that do not touch, once per pose; if it reaches leaves that do, the pair touches.
    ///
    /// The leaves it finds are below an entry that is open or expired, as all touching leaves are, and stay there.
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

/// Two shapes at a pose that B may be off by `off_m`.
fn placed((a, b): (&Shape, &Shape), pos12: &Pose, off_m: f64) -> Placed {
    let at = Placed::new(pos12, reach_of(a), reach_of(b));
    Placed {
        slop: at.slop + off_m,
        ..at
    }
}

/// The outcome of a walk.
enum Walked {
    /// At leaves that touch.
    Found(LeafContact),
    /// The meter closed.
    Stopped,
    /// Without success.
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

    /// Continues over the two surfaces to where they cross. Units: one per step.
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

    /// The leaves reached become the ones that touched last.
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
