//! The certificate front of a mesh pair: a proof stays valid until the two have moved by more than it allows.
//!
//! In: two shapes of which at least one is a mesh and none is a half-space, and successive poses of B seen from A. Out:
//! a sound interval of their gap at the current pose, a witness, contacts. Stops after any unit, and continues at the
//! same pose or at another.
//!
//! Every pair of leaves is covered by exactly one entry at any time (see `cover`; [`CarriedFront::covered`] counts
//! them).
//!
//! The path `S` runs over anchors (poses), and `d` is the displacement from the newest: boxes apart by `g` now stay
//! apart while `S + d < g + S - d` (with `S` and `d` of now on the right; both of the relative pose, so two that move
//! together do not move). An anchor is set when the pair moves on away from the last two, and when bounds must be
//! exact; so a drift adds up its length, and trembling in place adds nothing.
//!
//! Three orders for three goals: depth first, deepest overlap first, for a verdict; the heap, best first, for the
//! bounds; depth first to the end for the contact set. The others in [`Search`] are baselines.
//!
//! A mesh that deforms moves too: the sum of its updates' largest displacements is added to the path. Its boxes may
//! belong to older vertices; then as much is subtracted from the gap of boxes (`placed`). Leaves always have the
//! present vertices.
//!
//! Refused: radii of nodes instead of the body's (the order of a heap would change with the motion); one entry for each
//! pair of boxes (eight times the memory, and eight boxes are tested at the cost of one and a half).

use super::bound::Frame;
use super::contacts::LeafContact;
use super::containment::{Containment, ShellTests};
use super::deep::Deep;
use super::lack::Lack;
use super::parting::Parting;
use super::patches::Patches;
use super::placed::{Placed, lag_of, moved};
use super::query::Goal;
use super::retest::{reach_of, tree_of};
use super::side::{self, Side};
use crate::math::{Pose, ROUND};
use crate::narrow::bent::Bent;
pub use crate::narrow::cover::Search;
use crate::narrow::cover::{Cover, Wear};
use crate::narrow::holdings::Holdings;
use crate::narrow::widen::widened;
use crate::shape::{BoxId, Obb, Shape};
use crate::time::Meter;

mod count;
mod fathom;
mod glance;
mod known;
mod leaves;
mod search;
mod store;
mod touch;
mod unproved;

use known::Known;
pub use store::FrontStore;
use touch::Crossing;

/// A front that touched starts over after a step beyond this share of the smaller radius: at 2 % of the diameter a tick
/// 5,300 units instead of 7,300, at 0.5 % 3,400 instead of 3,700; at 0.02 more pairs stay open within a limit.
const ADRIFT: f64 = 0.04;

/// The front of one pair; its entries are in a [`FrontStore`], the same one from [`CarriedFront::start`] to
/// [`CarriedFront::release`].
#[derive(Debug, Default)]
pub struct CarriedFront {
    search: Search,
    /// Started, and not released since.
    started: bool,
    at: Placed,
    cover: Cover,
    /// The box of each convex side.
    whole: [Option<Obb>; 2],
    solids: bool,
    /// Least depth that a solid pair, or an open pair of pieces, can have, metres; always sound.
    floor_m: f64,
    shells: ShellTests,
    /// Until when the result of the inside tests holds, as a path, metres.
    shells_expiry_m: f64,
    /// Settled: the surfaces were found apart.
    wear: Wear,
    /// Known at this pose.
    known: Known,
    /// The leaves that were nearest or touched last.
    last: Option<(BoxId, BoxId)>,
    witness: Option<LeafContact>,
    crossing: Option<Crossing>,
    parting: Parting,
    deep: Deep,
    /// Where the last search for an overlap of leaves that barely touch failed.
    vain: Lack,
    contacts: Patches,
    /// The deformation of the two at the last move.
    bent: Bent,
    /// The trees that the boxes belong to.
    trees: [u32; 2],
}

/// Whether a pair of shapes can have a front.
#[must_use]
pub fn has_front(a: &Shape, b: &Shape) -> bool {
    matches!(
        (Side::of(a), Side::of(b)),
        (Some(Side::Mesh(_)), Some(_)) | (Some(_), Some(Side::Mesh(_)))
    )
}

impl CarriedFront {
    /// Forgets everything and starts at a pose.
    ///
    /// * `pos12` - pose of `b` seen from `a`, finite, unit quaternion; [`has_front`] holds for the two.
    pub fn start(
        &mut self,
        store: &mut FrontStore,
        a: &Shape,
        b: &Shape,
        pos12: &Pose,
        search: Search,
    ) {
        self.search = search;
        self.started = true;
        self.at = Placed::of(a, b, pos12);
        (self.last, self.crossing) = (None, None);
        self.vain = Lack::default();
        self.start_over(store, a, b);
    }

    /// Forgets everything and releases its memory.
    pub fn release(&mut self, store: &mut FrontStore) {
        self.cover.release(&mut store.entries);
        self.contacts.release(&mut store.contacts);
        // Another pair may get it next.
        self.started = false;
        (self.last, self.crossing) = (None, None);
        (self.parting, self.deep) = (Parting::default(), Deep::default());
    }

    /// Lists what it holds.
    pub(in crate::narrow) fn tell<'a>(&'a self, held: &mut Holdings<'a>) {
        held.covers.push(&self.cover);
        held.leaves.push(self.contacts.run());
    }

    /// Moves the pair to another pose, and to the present vertices; proofs are carried over as far as they hold.
    pub fn move_to(&mut self, store: &mut FrontStore, a: &Shape, b: &Shape, pos12: &Pose) {
        let bent = Bent::of_shapes(a, b);
        let other_trees = self.trees != trees_of(a, b);
        if self.at.pos12 == *pos12 && bent == self.bent && !other_trees {
            // A refit since then can only have tightened boxes.
            self.at.lag_m = lag_of(a, b);
            return;
        }
        self.at = Placed::of(a, b, pos12);
        if other_trees {
            (self.last, self.crossing) = (None, None);
            self.start_over(store, a, b);
            return;
        }
        (self.cover.drift).follow(pos12, |from, to| moved(a, b, from, to));
        let bent_m = bent.since_m(&self.bent);
        if bent_m > 0.0 {
            self.cover.drift.add(bent_m);
            self.bent = bent;
            self.shells.drop_test();
            self.measure_depth(a, b);
        }
        let worn = (self.wear).is_worn_out(&self.cover, &store.entries, [a.radius, b.radius]);
        // If a long step has lost the touch, the open entries are far from the next one.
        let adrift = !self.cover.touching.is_empty()
            && self.cover.drift.last_m > ADRIFT * a.radius.min(b.radius);
        if worn || adrift || self.search != Search::Carried {
            self.start_over(store, a, b);
            return;
        }
        self.known = Known::default();
        self.witness = None;
        self.contacts.clear();
        self.cover.arrive(&mut store.entries);
        if self.cover.drift.left_m(self.shells_expiry_m) <= 0.0 {
            self.shells.start(self.solids);
            // This expiry belongs to the discarded result: when the pair comes back, the other side's may hold.
            self.shells_expiry_m = f64::NEG_INFINITY;
        }
    }

    /// A mesh has new vertices, and the front is to stay at its pose: later results refer to the new ones, and the
    /// caller allows for the deformation in between.
    pub(super) fn note_bend(&mut self, a: &Shape, b: &Shape) {
        let bent = Bent::of_shapes(a, b);
        if bent.since_m(&self.bent) > 0.0 {
            self.bent = bent;
            self.shells.drop_test();
            self.known.walks = None;
        }
    }

    /// Works at this pose until the goal is reached (true), `slice_units` are spent, or the meter closes.
    ///
    /// `a` and `b` are those of [`CarriedFront::start`]. Units: a box against a pack, or two leaves; one each.
    pub fn advance(
        &mut self,
        store: &mut FrontStore,
        a: &Shape,
        b: &Shape,
        goal: Goal,
        slice_units: u64,
        meter: &mut Meter<'_>,
    ) -> bool {
        self.advance_despite(store, (a, b), (goal, 0.0), slice_units, meter)
    }

    /// As [`CarriedFront::advance`], with `off_m` as in [`super::MeshQuery::advance_despite`].
    pub(in crate::narrow) fn advance_despite(
        &mut self,
        store: &mut FrontStore,
        (a, b): (&Shape, &Shape),
        (goal, off_m): (Goal, f64),
        slice_units: u64,
        meter: &mut Meter<'_>,
    ) -> bool {
        let (Some(side_a), Some(side_b)) = (Side::of(a), Side::of(b)) else {
            return false;
        };
        let sides = (side_a, side_b);
        self.set_out(store, (a, b), sides, goal);
        let end = meter.spent().saturating_add(slice_units);
        let mut sought = goal;
        loop {
            if self.reached(sought) {
                if sought > Goal::Verdict || !self.is_apart_within(off_m) {
                    return true;
                }
                sought = Goal::Gap;
                self.set_out(store, (a, b), sides, sought);
                continue;
            }
            // Far apart by now: a verdict needs no more.
            if sought > goal && widened(self.interval(), off_m).min > 0.0 {
                return true;
            }
            if meter.spent() >= end || !meter.open() {
                return false;
            }
            if !self.fathom((a, b), meter) {
                self.step(store, sides, sought, meter);
            }
        }
    }

    /// Whether the surfaces are proved apart, but by no more than `off_m`.
    fn is_apart_within(&self, off_m: f64) -> bool {
        let gap = self.interval();
        gap.min > 0.0 && widened(gap, off_m).min <= 0.0
    }

    /// Prepares for a goal at this pose.
    fn set_out(
        &mut self,
        store: &mut FrontStore,
        (a, b): (&Shape, &Shape),
        (side_a, side_b): (Side<'_>, Side<'_>),
        goal: Goal,
    ) {
        if goal > Goal::Verdict && self.known.floor_m == f64::NEG_INFINITY {
            self.measure_wholes((a, side_a), (b, side_b));
            self.cover.anchor_here(&mut store.entries, &self.at.pos12);
        }
        if goal == Goal::Contacts
            && !std::mem::replace(&mut self.known.points_wanted, true)
            && self.known.touches
        {
            // A verdict ends at the first touch: there are few.
            self.cover.ask_touching_again(&mut store.entries);
        }
        if self.known.points_wanted {
            // Also for less than contacts: an interrupted search for them at this pose goes on with it.
            self.known.walks = Some(store.walks.resume(self.known.walks));
        }
    }

    /// Entries held, open or proved.
    #[must_use]
    pub fn len(&self) -> usize {
        self.cover.len()
    }

    /// Whether it was started and not released since: what it covers may still be lumped together, entry by entry.
    #[must_use]
    pub fn is_started(&self) -> bool {
        self.started
    }

    /// Whether an entry found no room, or the lumped entries have expired, so that only a new start helps.
    pub(in crate::narrow) fn is_lost(&self) -> bool {
        self.started && self.cover.is_lost()
    }

    /// Whether it holds no entry.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Starts over from the roots, at the current pose.
    fn start_over(&mut self, store: &mut FrontStore, a: &Shape, b: &Shape) {
        let (Some(side_a), Some(side_b)) = (Side::of(a), Side::of(b)) else {
            return;
        };
        let (from, roots) = ((&self.at.pos12, self.search), [(BoxId::ROOT, BoxId::ROOT)]);
        (self.cover).start(&mut store.entries, from, roots.into_iter());
        self.contacts.clear();
        self.wear = Wear::default();
        self.known = Known::default();
        self.witness = None;
        self.whole = [(a, side_a), (b, side_b)].map(|(shape, side)| side.whole(shape));
        self.solids = side_a.solid().or(side_b.solid()).is_some();
        (self.bent, self.trees) = (Bent::of_shapes(a, b), trees_of(a, b));
        self.measure_depth(a, b);
        self.shells.forget();
        self.shells.start(self.solids);
        self.shells_expiry_m = f64::NEG_INFINITY;
    }

    /// The least depth that the two can have at present.
    fn measure_depth(&mut self, a: &Shape, b: &Shape) {
        let (Some(side_a), Some(side_b)) = (Side::of(a), Side::of(b)) else {
            return;
        };
        // A ball around the deepest point fits into its solid; pieces separate when moved by the sum of both radii.
        let ball = |side: Side<'_>, shape: &Shape| match side {
            Side::Mesh(mesh) if !mesh.is_solid() => 0.0,
            _ => shape.aabb.half_extents().min(),
        };
        let depth_m = if self.solids {
            ball(side_a, a).max(ball(side_b, b))
        } else {
            a.radius + b.radius
        };
        self.floor_m = -(depth_m * (1.0 + 8.0 * ROUND)) - self.at.slop;
    }

    /// Bounds on the gap of the two whole shapes: the lower end for an overlapping pair.
    fn measure_wholes(&mut self, a: (&Shape, Side<'_>), b: (&Shape, Side<'_>)) {
        let ((root_a, origin_a), (root_b, origin_b)) = (tree_of(a.0, a.1), tree_of(b.0, b.1));
        let pos12 = self.at.pos12;
        let frame = Frame::new(&pos12, (origin_a, reach_of(a.0)), (origin_b, reach_of(b.0)));
        let wholes = side::low((a.1, &origin_a), (b.1, &origin_b), &frame);
        self.known.floor_m = frame.low(&root_a, &root_b).max(wholes);
    }
}

fn trees_of(a: &Shape, b: &Shape) -> [u32; 2] {
    [a.tree_revision(), b.tree_revision()]
}
