//! Pairs of single shapes of which one is a mesh: work on their fronts, and what the fronts prove of the bodies.
//!
//! A front works at this tick's poses; its earlier proofs are carried there. It is left as it is, or not started, while
//! a cheap test (`glance`) is enough: a plane that separates the two, inner balls that overlap, or a touch where they
//! touched last. The pair's memory is an interval with its own certificate, so a pair that has not moved enough is not
//! visited, and its front is not read.

use crate::ids::PairSlot;
use crate::math::{Interval, Pose, relative};
use crate::shape::Shape;
use crate::time::Meter;
use crate::world::{Body, PlacedShape};

use super::Narrow;
use super::bent::Bent;
use super::cursor::SLICE_UNITS;
use super::memo::{Memo, Witness};
use super::mesh::{CarriedFront, FrontStore, Goal, LeafContact, Search, lead_out, numbered};
use super::query::{leaf_contact, lost_m, shape_pose, sound, witness_of};
use super::widen::widened;

/// Cost of testing whether two triangles surely cross, including memory access, in tests of a box against a pack:
/// decides when the clock is read.
const RETEST_COST: u64 = 2;

/// Cost of carrying a front to another pose, in the same units, including the cache misses after the previous pair.
pub(super) const CARRY_COST: u64 = 4;

/// A pair's turn doubles with each tick that it waits for its verdict, at most this many times: motion may undo more
/// per tick than a plain turn does, and equal turns for all would then never decide the pair.
const SLICE_DOUBLINGS_MAX: u64 = 6;

impl Narrow {
    /// One turn of a pair on its front. Returns whether there is more to do for `goal`.
    pub(super) fn turn_front(
        &mut self,
        slot: PairSlot,
        (a, b): (&Body, &Body),
        goal: Goal,
        meter: &mut Meter<'_>,
    ) -> bool {
        let (one, other) = (&a.shapes[0], &b.shapes[0]);
        let rel = relative(&a.pose, &b.pose);
        let pos12 = shape_pose(one, other, &rel);
        let due = goal == Goal::Verdict && self.witness_due(slot);
        let memo = &mut self.memos[slot.index()];
        let Some(front) = self.shelves.fronts.get_or_take(&mut memo.front) else {
            return false;
        };
        let store = &mut self.shelves.store;
        let (one_shape, other_shape) = (&one.shape, &other.shape);
        if goal == Goal::Verdict && self.search == Search::Carried || due {
            if due {
                self.counters.queries += 1;
                memo.retested = self.tick;
            }
            let at = (&pos12, lost_m(one, other, &rel));
            let told = glance(front, (one_shape, other_shape), at, due, meter);
            let gap = told.gap(memo.here(), |gap| sound(gap, one, other, &rel));
            let now = widened(gap, memo.reach_m);
            if now.max <= 0.0 || now.min > memo.report_m.max(0.0) {
                memo.gap = gap;
                memo.note_asked((a, b), &rel, self.tick);
                (memo.finished, memo.tight) = (false, false);
                match told {
                    Glance::Touch(Some(leaf)) => {
                        memo.witness = Some(seen_at((one, other), (0, 0), &pos12, &leaf));
                    }
                    Glance::Touch(None) => {}
                    // The old place of touch or of least distance is out of date.
                    Glance::Deep(_) | Glance::Apart(_) | Glance::Nothing => memo.witness = None,
                }
                return false;
            }
        }
        let goal = memo.goal(goal);
        if !front.is_started() {
            front.start(store, one_shape, other_shape, &pos12, self.search);
        }
        front.move_to(store, one_shape, other_shape, &pos12);
        meter.charge_weighted(0, CARRY_COST);
        self.counters.slices += 1;
        let slice_units = slice_units(memo.undecided_since, self.tick);
        let asked = (goal, lost_m(one, other, &rel));
        let done =
            front.advance_despite(store, (one_shape, other_shape), asked, slice_units, meter);
        let told = Told {
            gap: sound(front.interval(), one, other, &rel),
            done,
            certain: front.is_certain(),
            witness: (front.witness()).map(|leaf| seen_at((one, other), (0, 0), &pos12, &leaf)),
        };
        if !memo.take_over(&told, goal, (a, b, &rel), self.tick) {
            return true;
        }
        if done && goal == Goal::Contacts {
            let gap = memo.gap;
            self.found.clear();
            if gap.min <= 0.0 {
                let seen = |(leaf, patch): (LeafContact, u32)| {
                    leaf_contact((one, other), (0, 0), &pos12, (&leaf, patch), gap)
                };
                self.found
                    .extend(found_on(front, store, (one_shape, other_shape), &pos12).map(seen));
            }
            self.keep_contacts(slot, a.radius.min(b.radius), self.tick);
        }
        !done
    }
}

/// What a front or a query has found for a pair at the poses it was tested at.
#[derive(Debug)]
pub(super) struct Told {
    pub(super) gap: Interval,
    /// The goal is reached.
    pub(super) done: bool,
    /// An interval of a reached goal that contains 0 means touching.
    pub(super) certain: bool,
    pub(super) witness: Option<Witness>,
}

impl Told {
    /// The result where nothing was tested.
    pub(super) const NOTHING: Self = Self {
        gap: Interval::UNKNOWN,
        done: false,
        certain: false,
        witness: None,
    };
}

impl Memo {
    /// Records that the pair is tested at this tick's poses: the results hold there.
    pub(super) fn note_asked(&mut self, (a, b): (&Body, &Body), rel: &Pose, tick: u64) {
        self.rel = *rel;
        self.credit_m = a.motion.credit_m() + b.motion.credit_m();
        (self.bent, self.tested) = (Bent::of_bodies(a, b), tick);
    }

    /// Takes over the result of a turn towards a goal. Returns false if it said nothing new.
    pub(super) fn take_over(
        &mut self,
        told: &Told,
        goal: Goal,
        (a, b, rel): (&Body, &Body, &Pose),
        tick: u64,
    ) -> bool {
        let (found, here) = (told.gap, self.here());
        if !told.done && found.min <= here.min && found.max >= here.max {
            return false;
        }
        // The earlier bound, carried here, holds at these poses too.
        self.gap = found.meet(here);
        self.note_asked((a, b), rel, tick);
        let whole = told.done && !(goal == Goal::Verdict && self.gap.max <= 0.0);
        self.finished = whole && told.certain;
        self.tight = whole && goal != Goal::Verdict;
        if told.witness.is_some() {
            self.witness = told.witness;
        } else if self.gap.min > 0.0
            && (self.tight || self.witness.is_some_and(|w| w.best_m <= 0.0))
        {
            // Apart: an old touch means nothing, nor does an old nearest place next to tight bounds at these poses.
            self.witness = None;
        }
        true
    }
}

/// The contact points of a front whose goal, a contact set, is reached: points of touching leaves, each with the number
/// of its patch; for a shape within another the way out.
pub(super) fn found_on(
    front: &CarriedFront,
    store: &FrontStore,
    shapes: (&Shape, &Shape),
    pos12: &Pose,
) -> impl Iterator<Item = (LeafContact, u32)> {
    let found = front.contacts(store);
    let way_out = match found.first() {
        None => front.way_out(store),
        // There are no opposite faces: the nearest way out stands for the pair, if it is known.
        Some(first) if first.patch == LeafContact::SPARE => front.witness(),
        Some(_) => None,
    };
    let led = way_out.and_then(|leaf| lead_out(&leaf, shapes, pos12));
    let alone = led.or(way_out.filter(|_| found.is_empty()));
    let found = if led.is_some() { &[][..] } else { found };
    let points = numbered(found).map(|(point, patch)| (*point, patch));
    points.chain(alone.map(|point| (point, 0)))
}

/// Units of a turn of a pair that has had no verdict since a tick; 0: decided, and worked on for more.
pub(super) fn slice_units(undecided_since: u64, tick: u64) -> u64 {
    let waited = match undecided_since {
        0 => 0,
        since => tick.saturating_sub(since),
    };
    SLICE_UNITS << waited.min(SLICE_DOUBLINGS_MAX)
}

/// What is known of a pair without a search of its front.
pub(super) enum Glance {
    /// It still touches: where it did before, or at these leaves.
    Touch(Option<LeafContact>),
    /// Inner balls of the two overlap by this depth, metres.
    Deep(f64),
    /// A plane separates the two by this distance, metres.
    Apart(f64),
    /// Nothing.
    Nothing,
}

impl Glance {
    /// The leaves that it touches at, if they were found just now.
    pub(super) fn leaf(&self) -> Option<LeafContact> {
        match *self {
            Self::Touch(leaf) => leaf,
            Self::Deep(_) | Self::Apart(_) | Self::Nothing => None,
        }
    }

    /// The pair's interval at exactly these poses.
    ///
    /// * `here` - the previous interval, widened by motion: gives the lower end of a pair that touches.
    /// * `sound` - turns a bound on the two shapes into one on the two bodies.
    pub(super) fn gap(&self, here: Interval, sound: impl Fn(Interval) -> Interval) -> Interval {
        match *self {
            // A certified touch, whatever composing the poses lost; the greatest depth has not been tested again.
            Self::Touch(_) => Interval::new(here.min.min(0.0), 0.0),
            Self::Deep(depth_m) => sound(Interval::new(f64::NEG_INFINITY, -depth_m)).meet(here),
            Self::Apart(low_m) => sound(Interval::new(low_m, f64::INFINITY)).meet(here),
            Self::Nothing => Interval::UNKNOWN,
        }
    }
}

/// Tests a pair where it touched last; otherwise inner balls, and then a separating plane.
///
/// * `off_m` - how far the second body's true pose may be from this pose, metres: a touch must hold there, too.
/// * `touched` - whether it touched at the last test.
pub(super) fn glance(
    front: &mut CarriedFront,
    (a, b): (&Shape, &Shape),
    (pos12, off_m): (&Pose, f64),
    touched: bool,
    meter: &mut Meter<'_>,
) -> Glance {
    if touched && front.knows_touch() {
        meter.charge_weighted(1, RETEST_COST);
        if front.still_touches(a, b, (pos12, off_m)) {
            return Glance::Touch(None);
        }
    }
    if let Some(depth_m) = front.overlap(a, b, pos12, meter) {
        return Glance::Deep(depth_m);
    }
    if !touched {
        let low_m = front.parted(a, b, pos12, meter);
        return low_m.map_or(Glance::Nothing, Glance::Apart);
    }
    let beside = front.touches_beside(a, b, (pos12, off_m), meter);
    beside.map_or(Glance::Nothing, |leaf| Glance::Touch(Some(leaf)))
}

/// Two leaves as a witness of the bodies.
pub(super) fn seen_at(
    (one, other): (&PlacedShape, &PlacedShape),
    places: (u32, u32),
    pos12: &Pose,
    leaf: &LeafContact,
) -> Witness {
    let leaf = lead_out(leaf, (&one.shape, &other.shape), pos12).unwrap_or(*leaf);
    Witness {
        triangle_a: leaf.triangle_a,
        triangle_b: leaf.triangle_b,
        ..witness_of(one, other, pos12, &leaf.closest, places)
    }
}
