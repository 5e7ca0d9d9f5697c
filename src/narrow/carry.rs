//! Pairs of single shapes of which one is a mesh: work on their fronts, and what it says of the bodies.
//!
//! A front works at this tick's poses; what it had proved before is carried there. It stays behind, or is not begun,
//! while a glance tells enough: a plane that parts the two, balls within them that overlap, or a touch where they
//! touched last. The pair's memory is an interval with its own certificate, so a pair that has not moved enough is not
//! looked at, and its front is not touched.

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

/// What asking two triangles whether they surely cross costs, in tests of a box against a pack, with what it takes to
/// come to them: when the clock is to be read.
const RETEST_COST: u64 = 2;

/// What taking a front to another pose costs in the same way, with what it takes to come to it from the pair before.
pub(super) const CARRY_COST: u64 = 4;

/// A pair's turn doubles with each tick it waits for its verdict, up to so many times: what motion undoes in a tick may
/// be more than a plain turn, and then equal turns for all would decide it never.
const SLICE_DOUBLINGS_MAX: u64 = 6;

impl Narrow {
    /// One turn of a pair on its front; whether there is more to do for `goal`.
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
                    // Where it touched or was nearest once is not where it does or is now.
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

/// What a front or a query has told of a pair at the poses it was asked at.
#[derive(Debug)]
pub(super) struct Told {
    pub(super) gap: Interval,
    /// The goal is reached.
    pub(super) done: bool,
    /// 0 inside the interval of a reached goal means touching.
    pub(super) certain: bool,
    pub(super) witness: Option<Witness>,
}

impl Told {
    /// Of what was not asked.
    pub(super) const NOTHING: Self = Self {
        gap: Interval::UNKNOWN,
        done: false,
        certain: false,
        witness: None,
    };
}

impl Memo {
    /// It is asked at the poses of this tick: what is told of it holds there.
    pub(super) fn note_asked(&mut self, (a, b): (&Body, &Body), rel: &Pose, tick: u64) {
        self.rel = *rel;
        self.credit_m = a.motion.credit_m() + b.motion.credit_m();
        (self.bent, self.tested) = (Bent::of_bodies(a, b), tick);
    }

    /// Takes over what a turn towards a goal told; false: it told nothing new.
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
        // What was known before holds at these poses too.
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
            // Where it touched says nothing of a pair that is apart, nor where it was nearest of bounds of these poses.
            self.witness = None;
        }
        true
    }
}

/// What a front found once its goal is a contact set and reached: points of touching leaves, with each the number of
/// its patch; of a shape within another the way out.
pub(super) fn found_on(
    front: &CarriedFront,
    store: &FrontStore,
    shapes: (&Shape, &Shape),
    pos12: &Pose,
) -> impl Iterator<Item = (LeafContact, u32)> {
    let found = front.contacts(store);
    let way_out = match found.first() {
        None => front.way_out(store),
        // Nothing lies straight across: what stands for the pair is the nearest way out, where that is known.
        Some(first) if first.patch == LeafContact::SPARE => front.witness(),
        Some(_) => None,
    };
    let led = way_out.and_then(|leaf| lead_out(&leaf, shapes, pos12));
    let alone = led.or(way_out.filter(|_| found.is_empty()));
    let found = if led.is_some() { &[][..] } else { found };
    let points = numbered(found).map(|(point, patch)| (*point, patch));
    points.chain(alone.map(|point| (point, 0)))
}

/// Units of a turn of a pair without a verdict since a tick, 0 of one that is decided and asked for more.
pub(super) fn slice_units(undecided_since: u64, tick: u64) -> u64 {
    let waited = match undecided_since {
        0 => 0,
        since => tick.saturating_sub(since),
    };
    SLICE_UNITS << waited.min(SLICE_DOUBLINGS_MAX)
}

/// What a glance at a pair says, without a search of its front.
pub(super) enum Glance {
    /// It touches still: where it did, or at these leaves.
    Touch(Option<LeafContact>),
    /// Balls within the two overlap so deep, metres.
    Deep(f64),
    /// A plane parts it by so much, metres.
    Apart(f64),
    /// Nothing.
    Nothing,
}

impl Glance {
    /// The leaves that it touches at, where they were found just now.
    pub(super) fn leaf(&self) -> Option<LeafContact> {
        match *self {
            Self::Touch(leaf) => leaf,
            Self::Deep(_) | Self::Apart(_) | Self::Nothing => None,
        }
    }

    /// The pair's interval at these very poses.
    ///
    /// * `here` - what motion left of the one before: the lower end of a pair that touches.
    /// * `sound` - makes a bound on the two shapes one on the two bodies.
    pub(super) fn gap(&self, here: Interval, sound: impl Fn(Interval) -> Interval) -> Interval {
        match *self {
            // A certified touch, whatever composing the poses lost; how deep it is at most has not been asked again.
            Self::Touch(_) => Interval::new(here.min.min(0.0), 0.0),
            Self::Deep(depth_m) => sound(Interval::new(f64::NEG_INFINITY, -depth_m)).meet(here),
            Self::Apart(low_m) => sound(Interval::new(low_m, f64::INFINITY)).meet(here),
            Self::Nothing => Interval::UNKNOWN,
        }
    }
}

/// Looks at a pair where it touched last, or else at what balls within the two, and then a plane, would say.
///
/// * `off_m` - how far the second may be from that pose for the two bodies, metres: a touch is one there, too.
/// * `touched` - whether it touched when it was last looked at.
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

/// Two leaves as the witness of the bodies.
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
