//! What is stored of a pair: its certificate, verdict and witness.

use crate::ids::{BodySlot, PairSlot};
use crate::math::{Interval, Point, Pose, Vec3, relative};
use crate::pairs::{PairSet, Spare};
use crate::shape::Geometry;
use crate::wire::{NO_INDEX, Verdict};
use crate::world::{Body, World};

use super::around::box_bounds;
use super::bent::Bent;
use super::exact::Warm;
use super::mesh::Goal;
use super::order::Urgency;
use super::{NONE, Narrow};

/// What the motion pass reads of a pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hot {
    /// Body with the smaller id.
    pub(super) a: BodySlot,
    /// Body with the larger id.
    pub(super) b: BodySlot,
    /// Proved apart (and not near) while `S + d` of both sum to less than this, metres; minus infinity: visit it.
    pub(super) expiry_m: f64,
    /// Stamp of the tick of the last visit; 0: none.
    pub(super) visited: u32,
    pub(super) verdict: Verdict,
    pub(super) live: bool,
    /// A shape of either body is a mesh.
    pub(super) meshed: bool,
}

const _: () = assert!(
    size_of::<Hot>() == 24,
    "what the motion pass reads of a pair"
);

/// The rest of a pair's memory.
#[derive(Clone, Debug)]
pub(super) struct Memo {
    /// Certified at the test's poses.
    pub(super) gap: Interval,
    /// Sum of both bodies' `S - d` at the test, metres.
    pub(super) credit_m: f64,
    /// The deformation of both bodies at the test.
    pub(super) bent: Bent,
    /// Pose of B's body seen from A's at the test.
    pub(super) rel: Pose,
    /// Tick of the test's poses; 0: never tested, `gap` comes from the boxes.
    pub(super) tested: u64,
    /// The query was finished at the test.
    pub(super) finished: bool,
    /// The interval was narrowed as far as the exact query can, not only as far as a verdict needed.
    pub(super) tight: bool,
    /// Tick in which the witness was last retested.
    pub(super) retested: u64,
    /// At this tick's poses.
    pub(super) now: Interval,
    /// Motion since the test that `now` was widened by, metres.
    pub(super) motion_m: f64,
    /// Reach of both bodies that `now` was also widened by, metres.
    pub(super) reach_m: f64,
    /// Nothing moved relative to the test's poses.
    pub(super) rest: bool,
    /// On the list of undecided pairs.
    pub(super) queued: bool,
    /// On the list of reports to refresh.
    pub(super) refreshing: bool,
    /// Pairs nearer than this are `near`, metres.
    pub(super) report_m: f64,
    /// First tick without a verdict since the last one with; 0: decided.
    pub(super) undecided_since: u64,
    /// First tick of the pair.
    pub(super) born: u64,
    pub(super) witness: Option<Witness>,
    /// Where the next query starts from.
    pub(super) warm: Warm,
    /// Duration of the pair's last query, if one query decides it, nanoseconds.
    pub(super) query_ns: u32,
    /// Tick of the poses the contacts belong to.
    pub(super) contacts_tick: u64,
    /// First tick after `contacts_tick` in which the pair was certified not to touch; 0: none.
    pub(super) parted: u64,
    pub(super) active_at: u32,
    /// The surface that proved the last depth.
    pub(super) shell: u32,
    /// If one body is a half-space: the walk for a verdict, and the walk for listeners.
    pub(super) cursor: u32,
    pub(super) report_cursor: u32,
    pub(super) front: u32,
    pub(super) compound: u32,
    pub(super) contacts: u32,
    /// The pair's regions as last stored.
    pub(super) regions: u32,
    /// Turns of work that the pair has had.
    pub(super) turns: u32,
}

/// Where a pair is nearest or deepest: the shapes, triangles and points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Witness {
    /// Best estimate of the gap there, metres.
    pub best_m: f64,
    /// On A's surface, A's body frame, metres.
    pub point_a: Point,
    /// On B's surface, B's body frame, metres.
    pub point_b: Point,
    /// Unit, A's body frame, from A to B.
    pub normal: Vec3,
    /// Place of the shape in A.
    pub shape_a: u32,
    /// Place of the shape in B.
    pub shape_b: u32,
    /// Triangle of A's shape, or `NO_INDEX`.
    pub triangle_a: u32,
    /// Triangle of B's shape, or `NO_INDEX`.
    pub triangle_b: u32,
}

impl Memo {
    pub(super) fn new() -> Self {
        Self {
            gap: Interval::UNKNOWN,
            credit_m: 0.0,
            bent: Bent::default(),
            rel: Pose::identity(),
            tested: 0,
            finished: false,
            tight: false,
            retested: 0,
            now: Interval::UNKNOWN,
            motion_m: 0.0,
            reach_m: 0.0,
            rest: false,
            queued: false,
            refreshing: false,
            report_m: 0.0,
            undecided_since: 0,
            born: 0,
            witness: None,
            warm: Warm::default(),
            query_ns: 0,
            contacts_tick: 0,
            parted: 0,
            active_at: NONE,
            shell: NONE,
            cursor: NONE,
            report_cursor: NONE,
            front: NONE,
            compound: NONE,
            contacts: NONE,
            regions: NONE,
            turns: 0,
        }
    }

    /// Finished at exactly these poses, and the gap cannot be distinguished from 0. A proved overlap is not touching,
    /// however near 0 its upper end: that of meshes is a bound, not a depth.
    pub(super) fn touching(&self) -> bool {
        self.finished && self.widened_m() == 0.0 && self.gap.contains(0.0) && self.gap.max > 0.0
    }

    /// Whether the contacts belong to a collision that has ended since: their ids may continue, their points are void.
    pub(super) fn contacts_are_over(&self) -> bool {
        self.parted > self.contacts_tick
    }

    /// The verdict that this tick's interval allows.
    pub(super) fn verdict(&self) -> Verdict {
        if self.now.max <= 0.0 || self.touching() {
            Verdict::Colliding
        } else if self.now.min <= 0.0 {
            Verdict::Possible
        } else if self.now.min < self.report_m {
            Verdict::Near
        } else {
            Verdict::Apart
        }
    }
}

/// How far two bodies approached between the test's relative pose and this one, metres: along the witness normal, or
/// without a witness along the line of their centres. For the order of work; not a bound.
pub(super) fn closing(a: &Body, b: &Body, memo: &Memo, rel: &Pose) -> f64 {
    let (point, direction) = match memo.witness {
        Some(witness) => (witness.point_b, witness.normal),
        None => {
            let apart = memo.rel * b.centre - a.centre;
            (b.centre, apart.try_normalize(0.0).unwrap_or_default())
        }
    };
    direction.dot(&(memo.rel * point - rel * point))
}

fn meshed(body: &Body) -> bool {
    let mut shapes = body.shapes.iter();
    shapes.any(|placed| matches!(placed.shape.geometry, Geometry::Mesh(_)))
}

impl Narrow {
    /// Starts the memory of a new pair.
    pub(super) fn meet(&mut self, slot: PairSlot, world: &World, pairs: &PairSet) {
        let Some(key) = pairs.get(slot) else { return };
        let (one, other) = key.slots();
        let (Some(first), Some(second)) = (world.body(one), world.body(other)) else {
            return;
        };
        let swap = second.id < first.id;
        let (a, b) = if swap { (other, one) } else { (one, other) };
        let (body_a, body_b) = if swap {
            (second, first)
        } else {
            (first, second)
        };
        while self.hot.len() <= slot.index() {
            self.hot.push(Hot::dead());
            self.memos.push(Memo::new());
            self.urgencies.push(Urgency::default());
        }
        self.hot[slot.index()] = Hot {
            a,
            b,
            expiry_m: f64::NEG_INFINITY,
            visited: 0,
            verdict: Verdict::Apart,
            live: true,
            meshed: meshed(body_a) || meshed(body_b),
        };
        self.stirred.set(slot);
        self.counts[usize::from(Verdict::Apart.code())] += 1;
        let memo = &mut self.memos[slot.index()];
        *memo = Memo {
            gap: box_bounds(body_a, body_b),
            credit_m: body_a.motion.credit_m() + body_b.motion.credit_m(),
            bent: Bent::of_bodies(body_a, body_b),
            rel: relative(&body_a.pose, &body_b.pose),
            report_m: world.report_within(one, other),
            born: self.tick,
            ..Memo::new()
        };
        self.look(slot, world);
    }

    /// Ends the memory of a pair.
    pub(super) fn forget(&mut self, slot: PairSlot) {
        let Some(hot) = self.hot.get_mut(slot.index()).filter(|hot| hot.live) else {
            return;
        };
        self.counts[usize::from(hot.verdict.code())] -= 1;
        hot.live = false;
        self.stirred.set(slot);
        hot.verdict = Verdict::Apart;
        self.deactivate(slot);
        let memo = &mut self.memos[slot.index()];
        memo.undecided_since = 0;
        memo.queued = false;
        memo.refreshing = false;
        self.contact_sets.give(&mut memo.contacts);
        self.kept.give(&mut memo.regions);
        self.give_back(slot);
    }

    /// Gives back the memory of slots that pairs have left, once they have been many for long.
    ///
    /// * `slots` - the number that the pair set has. No list names slots beyond it.
    pub(super) fn give_back_slots(&mut self, slots: usize) {
        if self.spare.is_over(self.hot.len(), slots) {
            debug_assert!(self.hot.iter().skip(slots).all(|hot| !hot.live));
            Spare::cut(&mut self.hot, slots);
            Spare::cut(&mut self.memos, slots);
            Spare::cut(&mut self.urgencies, slots);
            self.keyed.clear();
            self.keyed.shrink_to(slots);
        }
    }

    /// Sets a verdict and keeps lists and counts consistent.
    pub(super) fn settle(&mut self, slot: PairSlot, verdict: Verdict) {
        let hot = &mut self.hot[slot.index()];
        let before = std::mem::replace(&mut hot.verdict, verdict);
        let memo = &mut self.memos[slot.index()];
        if verdict == Verdict::Possible {
            if memo.undecided_since == 0 {
                memo.undecided_since = self.tick;
            }
        } else {
            memo.undecided_since = 0;
        }
        self.urgencies[slot.index()].settle(memo);
        if before == verdict {
            return;
        }
        if self.left_is_news {
            self.late.push(slot);
        }
        self.counts[usize::from(before.code())] -= 1;
        self.counts[usize::from(verdict.code())] += 1;
        if verdict == Verdict::Near && !memo.contacts_are_over() {
            memo.parted = self.tick;
        }
        let walk = self.shelves.cursors.get(memo.report_cursor);
        if verdict == Verdict::Near && walk.is_some_and(|walk| walk.goal == Goal::Contacts) {
            // Its contacts belong to a collision that is over.
            self.shelves.give_cursor(&mut memo.report_cursor);
        }
        if verdict == Verdict::Apart {
            self.contact_sets.give(&mut memo.contacts);
            self.kept.give(&mut memo.regions);
            self.shelves.give_cursor(&mut memo.cursor);
            self.shelves.give_cursor(&mut memo.report_cursor);
            memo.contacts_tick = 0;
            self.deactivate(slot);
            self.left.push(slot);
        } else if before == Verdict::Apart {
            memo.active_at = u32::try_from(self.active.len()).unwrap_or(NONE);
            self.active.push(slot);
            self.entered.push(slot);
        }
    }

    fn deactivate(&mut self, slot: PairSlot) {
        let at = std::mem::replace(&mut self.memos[slot.index()].active_at, NONE);
        if at == NONE {
            return;
        }
        self.active.swap_remove(at as usize);
        if let Some(&moved) = self.active.get(at as usize) {
            self.memos[moved.index()].active_at = at;
        }
    }
}

impl Hot {
    pub(super) fn dead() -> Self {
        Self {
            a: BodySlot(0),
            b: BodySlot(0),
            expiry_m: f64::NEG_INFINITY,
            visited: 0,
            verdict: Verdict::Apart,
            live: false,
            meshed: false,
        }
    }
}

impl Witness {
    /// A witness without triangles.
    pub(super) fn of_shapes(shape_a: u32, shape_b: u32) -> Self {
        Self {
            best_m: f64::NAN,
            point_a: Point::origin(),
            point_b: Point::origin(),
            normal: Vec3::z(),
            shape_a,
            shape_b,
            triangle_a: NO_INDEX,
            triangle_b: NO_INDEX,
        }
    }
}
