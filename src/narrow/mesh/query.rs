//! One resumable query of a shape pair of which at least one is a mesh, at a fixed relative pose.

use super::carried::{CarriedFront, FrontStore, Search};
use super::contacts::LeafContact;
use super::half_space::HalfSpaceWalk;
use super::patches::numbered;
use super::side::Side;
use crate::math::{Interval, Pose};
use crate::narrow::holdings::Holdings;
use crate::shape::{Geometry, Mesh, Shape};
use crate::time::Meter;

/// How far work is to go. A later goal can be set once an earlier one is reached: only touching leaves are queried
/// again, for their contact points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Goal {
    /// Until the pair is certified colliding or proved apart.
    Verdict,
    /// Until the least distance is exact; an overlapping pair needs no more than its verdict.
    Gap,
    /// Until all touching or crossing leaf pairs are found, or the least distance is exact.
    Contacts,
}

/// The query; its entries are in a [`FrontStore`], the same one from [`MeshQuery::start`] to [`MeshQuery::release`].
#[derive(Debug)]
pub struct MeshQuery {
    kind: Kind,
    /// What is known of the gap, metres.
    gap: Interval,
    front: CarriedFront,
    half_space: HalfSpaceWalk,
    pos12: Pose,
    /// The trees that the places in `half_space` refer to.
    trees: [u32; 2],
    search: Search,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Kind {
    /// Not started, or an unsupported pair: nothing is ever known of it.
    #[default]
    Idle,
    Surfaces,
    HalfSpace,
}

impl Default for MeshQuery {
    fn default() -> Self {
        Self {
            kind: Kind::Idle,
            gap: Interval::UNKNOWN,
            front: CarriedFront::default(),
            half_space: HalfSpaceWalk::default(),
            pos12: Pose::identity(),
            trees: [0; 2],
            search: Search::default(),
        }
    }
}

impl MeshQuery {
    /// Sets how surfaces are searched from the next start on.
    pub fn set_search(&mut self, search: Search) {
        self.search = search;
    }

    /// Starts a query; from here on [`MeshQuery::interval`] is sound.
    ///
    /// * `pos12` - pose of `b` seen from `a`, unit quaternion.
    ///
    /// At least one of the two must be a mesh; else, or with a pose that is not finite, the interval stays unknown and
    /// the query never finishes.
    pub fn start(&mut self, store: &mut FrontStore, a: &Shape, b: &Shape, pos12: &Pose) {
        (self.kind, self.gap) = (Kind::Idle, Interval::UNKNOWN);
        (self.pos12, self.trees) = (*pos12, [a.tree_revision(), b.tree_revision()]);
        if !(pos12
            .translation
            .vector
            .iter()
            .chain(pos12.rotation.coords.iter()))
        .all(|x| x.is_finite())
        {
            return;
        }
        match (Side::of(a), Side::of(b)) {
            (Some(Side::Convex(_)), Some(Side::Convex(_))) => {}
            (Some(_), Some(_)) => {
                // A query has one pose: nothing is carried.
                let search = match self.search {
                    Search::Carried => Search::Restart,
                    other => other,
                };
                self.front.start(store, a, b, pos12, search);
                self.kind = Kind::Surfaces;
            }
            (None, Some(Side::Mesh(mesh))) => self.start_half_space(a, mesh, pos12, false),
            (Some(Side::Mesh(mesh)), None) => self.start_half_space(b, mesh, pos12, true),
            _ => {}
        }
        self.narrow();
    }

    /// Works until the goal is reached (true), `slice_units` are spent, or the meter closes.
    ///
    /// `a` and `b` are those of [`MeshQuery::start`]. Units: a node test each, a leaf query each.
    ///
    /// If a mesh deforms from turn to turn, each result refers to the vertices of its turn: the interval then holds for
    /// those of any one moment when widened by the deformation since the start.
    pub fn advance(
        &mut self,
        store: &mut FrontStore,
        (a, b): (&Shape, &Shape),
        goal: Goal,
        slice_units: u64,
        meter: &mut Meter<'_>,
    ) -> bool {
        self.advance_despite(store, (a, b), (goal, 0.0), slice_units, meter)
    }

    /// As [`MeshQuery::advance`], until a verdict stands even if points are displaced by up to `off_m`; if none does,
    /// until the gap is as narrow as possible. Otherwise a goal reached with a wide interval that holds 0 once widened
    /// would pass for a touch.
    pub(in crate::narrow) fn advance_despite(
        &mut self,
        store: &mut FrontStore,
        (a, b): (&Shape, &Shape),
        (goal, off_m): (Goal, f64),
        slice_units: u64,
        meter: &mut Meter<'_>,
    ) -> bool {
        if self.trees != [a.tree_revision(), b.tree_revision()] {
            // Places in another tree mean nothing; what is known of the gap stays valid.
            let (gap, pos12) = (self.gap, self.pos12);
            self.start(store, a, b, &pos12);
            self.gap = gap;
        }
        self.front.note_bend(a, b);
        let reached = match (self.kind, Side::of(a), Side::of(b)) {
            (Kind::Surfaces, ..) => {
                (self.front).advance_despite(store, (a, b), (goal, off_m), slice_units, meter)
            }
            (Kind::HalfSpace, Some(Side::Mesh(mesh)), _)
            | (Kind::HalfSpace, _, Some(Side::Mesh(mesh))) => {
                let end = meter.spent().saturating_add(slice_units);
                (self.half_space).advance(&mut store.contacts, mesh, (goal, off_m), end, meter)
            }
            _ => false,
        };
        self.narrow();
        reached
    }

    /// Interval of the gap, metres: sound at any interruption, and never looser than before.
    #[must_use]
    pub fn interval(&self) -> Interval {
        self.gap
    }

    /// Whether 0 in the interval of a reached goal means touching (law 3.4).
    #[must_use]
    pub fn is_certain(&self) -> bool {
        self.kind == Kind::HalfSpace || self.front.is_certain()
    }

    /// Whether the pair still touches if points are displaced by up to `off_m`; false proves nothing.
    pub(in crate::narrow) fn touches_despite(&self, off_m: f64) -> bool {
        self.gap.max + off_m < 0.0
            || (self.kind == Kind::Surfaces && self.front.touches_despite(off_m))
    }

    /// The leaves with the least gap found so far; if one shape is within the other, with the normal that leads out.
    #[must_use]
    pub fn witness(&self) -> Option<LeafContact> {
        match self.kind {
            Kind::Idle => None,
            Kind::Surfaces => self.front.witness(),
            Kind::HalfSpace => self.half_space.witness(),
        }
    }

    /// Points where leaves touch or cross, [`super::PATCH_POINTS`] of each patch, with duplicates; those of all leaves
    /// once `Goal::Contacts` is reached. For a shape within another: the way out. Each with the number of its patch.
    pub fn contacts<'a>(
        &'a self,
        store: &'a FrontStore,
    ) -> impl Iterator<Item = (LeafContact, u32)> + use<'a> {
        let (found, within) = match self.kind {
            Kind::Idle => (&[][..], None),
            Kind::Surfaces => (self.front.contacts(store), self.front.way_out(store)),
            Kind::HalfSpace => (self.half_space.contacts(&store.contacts), None),
        };
        let found = numbered(found).map(|(point, patch)| (*point, patch));
        found.chain(within.map(|point| (point, 0)))
    }

    /// Forgets everything and releases its memory.
    pub fn release(&mut self, store: &mut FrontStore) {
        self.kind = Kind::Idle;
        self.front.release(store);
        self.half_space.release(&mut store.contacts);
    }

    /// Lists what it holds.
    pub(in crate::narrow) fn tell<'a>(&'a self, held: &mut Holdings<'a>) {
        self.front.tell(held);
        held.leaves.push(self.half_space.run());
    }

    /// A front's bound can drop by rounding after it was stored: keep what was known at this pose.
    fn narrow(&mut self) {
        let now = match self.kind {
            Kind::Idle => return,
            Kind::Surfaces => self.front.interval(),
            Kind::HalfSpace => self.half_space.interval(),
        };
        self.gap = self.gap.meet(now);
    }

    fn start_half_space(&mut self, plane: &Shape, mesh: &Mesh, pos12: &Pose, is_b: bool) {
        let Geometry::HalfSpace { normal, offset } = &plane.geometry else {
            return;
        };
        if (self.half_space).start(mesh, (normal, *offset), pos12, is_b) {
            self.kind = Kind::HalfSpace;
        }
    }
}
