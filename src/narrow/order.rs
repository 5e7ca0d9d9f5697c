//! The order of work: which pair has a turn first when the budget does not suffice for all.
//!
//! Urgency is waiting time times weight. The waiting time is that for a turn, or that for a verdict up to
//! [`HEAD_START`] ticks, whichever is more; last tick's contacts count as if they had waited that long. So nothing
//! starves, neither behind contacts that are confirmed each tick nor behind pairs that no turn decides:
//!
//! **A pair that waits for a verdict has a turn after at most `w max(H + 2, R + 1) + R` ticks**, with
//! - `H` = [`HEAD_START`], 16;
//! - `R`: ticks needed to give each waiting pair one turn, `N / K` rounded up, with `N` pairs that wait at the same
//!   time and `K` turns a tick: one for each unit of the budget if all bodies are single convex shapes; else one for
//!   each 4,096 units (more than the longest turn of a mesh pair), and never less than one. Units that are kept back
//!   for other work do not count: an eighth while `regions` are read, half while meshes deform, and half of the rest
//!   while bodies are swept;
//! - `w`: the greatest weight of a pair over the least: the ratio of their priorities, times [`CLOSING_WEIGHT`], 4,
//!   times the weight of the scene's viewpoint.
//!
//! Proof: a pair served before one that has waited `T >= w max(H + 2, R + 1)` ticks has itself waited at least
//! `T / w - 1 >= R` ticks: its weight is at most `w` times as much, and no head start makes up for the difference. So
//! within the next `R` ticks no pair is served twice before it, and no pair that was not waiting when they began: `N`
//! turns are enough. (`tests/law_engine/schedule.rs` checks runs against it, `tests` runs of meshes.) One turn decides
//! a convex pair. A mesh pair may need several, and motion may undo them faster than a budget renews them; its turns
//! grow while it waits (`carry`).
//!
//! Reports (bounds, contacts) get what verdicts leave, in the same order.

use crate::ids::PairSlot;
use crate::math::f32_down;
use crate::time::Meter;
use crate::world::{Body, Gaze, World};

use super::Narrow;
use super::memo::Memo;

/// How work is ordered. The final results do not depend on it; what is finished when time runs out does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// As found: for a budget without limit, where order does not matter.
    AsFound,
    /// Last tick's contacts, then by age, weighted by the bodies' priority and by how fast they approach: for a budget
    /// in time.
    Aged,
    /// As `Aged`, with ties broken by body ids: for a budget in units, so that a run replays bit for bit regardless of
    /// the slots.
    Counted,
}

/// Number of pairs sorted at once. Work is sorted as it is reached: where time ends after a few queries, most of the
/// list never needs sorting, and no sort takes longer than a query or two.
const BATCH: usize = 128;

/// Most partitions that a list can have while its front is sorted: each is at least a quarter of the enclosing one.
const PARTS_MAX: usize = 64;

/// Time to rank a pair and to partition the list a first time, nanoseconds: learned from list to list, and clamped
/// between `RANK_NS` (measured on a good day: 4 to 10 without a viewpoint; with one, two bodies are looked up and an
/// angle is computed) and a multiple of it: anything above had another cause.
#[derive(Clone, Copy, Debug)]
pub(super) struct RankCost {
    /// Without a viewpoint, and with one.
    ns: [u64; 2],
}

const RANK_NS: [u64; 2] = [16, 160];
const RANK_TIMES_MAX: u64 = 8;
/// Shorter lists teach nothing: their fixed reads outweigh the pairs.
const RANK_LEARN_MIN: usize = 256;

impl Default for RankCost {
    fn default() -> Self {
        Self { ns: RANK_NS }
    }
}

impl RankCost {
    /// Expected time for a list of `pairs` pairs, nanoseconds.
    pub(super) fn of(&self, pairs: usize, gaze: bool) -> u64 {
        pairs as u64 * self.ns[usize::from(gaze)]
    }

    /// No list was ranked because it might have taken too long: lower the estimate, so that it does not hold for ever.
    pub(super) fn forget(&mut self, gaze: bool) {
        self.set(0, gaze);
    }

    fn learn(&mut self, took_ns: u64, pairs: usize, gaze: bool) {
        if took_ns == 0 || pairs < RANK_LEARN_MIN {
            return;
        }
        self.set(took_ns / pairs as u64, gaze);
    }

    /// Raises at once, lowers slowly.
    fn set(&mut self, each_ns: u64, gaze: bool) {
        let at = usize::from(gaze);
        let (least, now) = (RANK_NS[at], self.ns[at]);
        let each_ns = each_ns.max(now - now.div_ceil(32));
        self.ns[at] = each_ns.clamp(least, RANK_TIMES_MAX * least);
    }
}

/// The fastest approach multiplies the age by this: a pair that came nearer by much more than its size since its last
/// query is up to four times as urgent as one that did not.
const CLOSING_WEIGHT: f64 = 4.0;

/// Ticks of waiting for a verdict that count, and the bonus of last tick's contacts: a contact is mostly confirmed by
/// one test. Without a cap, a pair that no turn decides would be ahead of all others for ever.
const HEAD_START: u32 = 16;

/// What the order of work depends on, in one array for all pairs: the records it comes from are far apart.
///
/// Ticks are cut to 32 bits: only differences are used.
#[derive(Clone, Copy, Debug)]
pub(super) struct Urgency {
    /// First tick without a verdict.
    since: u32,
    /// Tick of its last turn, or in which it was put on a list of work.
    turn: u32,
    /// Priority times the factor for its approach, positive.
    weight: f32,
    /// It has no verdict.
    undecided: bool,
    /// The witness of the last test touched.
    touched: bool,
}

const _: () = assert!(size_of::<Urgency>() == 16, "four to a cache line");

impl Default for Urgency {
    fn default() -> Self {
        Self {
            since: 0,
            turn: 0,
            weight: 1.0,
            undecided: false,
            touched: false,
        }
    }
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "only differences are asked"
)]
fn cut(tick: u64) -> u32 {
    tick as u32
}

impl Urgency {
    /// Updates the weight from a visit to the pair.
    ///
    /// * `priority` - the pair's: the greater of its bodies'.
    /// * `closing_m` - how far the two approached each other since the test, along the witness (`memo::closing`).
    /// * `size_m` - the radius of the smaller.
    pub(super) fn weigh(&mut self, priority: f64, closing_m: f64, size_m: f64) {
        let nearer = closing_m.max(0.0);
        let share = if nearer > 0.0 {
            1.0 / (1.0 + size_m / nearer)
        } else {
            0.0
        };
        self.weight = f32_down(priority * (1.0 + (CLOSING_WEIGHT - 1.0) * share));
    }

    /// Takes over the pair's verdict.
    pub(super) fn settle(&mut self, memo: &Memo) {
        self.since = cut(memo.undecided_since);
        self.undecided = memo.undecided_since != 0;
        self.touched = memo.witness.is_some_and(|w| w.best_m <= 0.0);
    }

    /// The pair has a turn in this tick, or is put on a list: its waiting time starts here.
    pub(super) fn note_turn(&mut self, tick: u64) {
        self.turn = cut(tick);
    }

    /// Sort key in the order of work, least first: waiting time times weight, greatest first (positive floats order
    /// like their bits).
    ///
    /// * `seen` - weight of the pair's place (`Gaze::weight`); 1 without a viewpoint.
    fn rank(self, tick: u64, seen: f64) -> u64 {
        let since = |then: u32| cut(tick).wrapping_sub(then);
        let age = if self.undecided { since(self.since) } else { 0 };
        let waits = age.min(HEAD_START).max(since(self.turn));
        let fresh_contact = self.touched && age == 0;
        let head_start = if fresh_contact { HEAD_START } else { 0 };
        let ticks = f64::from(waits) + f64::from(head_start) + 1.0;
        !(ticks * f64::from(self.weight) * seen).to_bits()
    }
}

/// How far a list of work is sorted: an incremental quicksort, whose partitions wait for their turn.
#[derive(Debug)]
pub(super) struct Line {
    order: Order,
    /// Sorted up to here.
    ready: usize,
    /// Ends of the partitions that follow, the nearest last: each item in a partition comes before all behind its end.
    ends: [usize; PARTS_MAX],
    parts: usize,
}

impl Line {
    /// A list of `len` items, none of them sorted yet.
    pub(super) fn new(order: Order, len: usize) -> Self {
        let ready = if order == Order::AsFound { len } else { 0 };
        let mut ends = [0; PARTS_MAX];
        ends[0] = len;
        Self {
            order,
            ready,
            ends,
            parts: 1,
        }
    }

    /// Nothing more is to be sorted.
    pub(super) fn finish(&mut self, len: usize) {
        self.ready = len;
    }

    /// Sorts the next items, at most [`BATCH`], by partitioning the list until a partition is that small.
    fn advance<T, K: Ord>(&mut self, items: &mut [T], key: impl Fn(&T) -> K) {
        while self.parts > 0 {
            let end = self.ends[self.parts - 1];
            let part = &mut items[self.ready..end];
            if part.len() <= BATCH || self.parts == PARTS_MAX {
                part.sort_unstable_by_key(&key);
                (self.ready, self.parts) = (end, self.parts - 1);
                return;
            }
            let nearer = (part.len() / 4).max(BATCH);
            part.select_nth_unstable_by_key(nearer, &key);
            self.ends[self.parts] = self.ready + nearer;
            self.parts += 1;
        }
    }
}

impl Narrow {
    /// Begins a list of work: computes the ranks and sorts the first batch.
    pub(super) fn line_up(
        &mut self,
        work: &[PairSlot],
        order: Order,
        world: &World,
        gaze: Option<Gaze>,
        meter: &mut Meter<'_>,
    ) -> Line {
        self.keyed.clear();
        if order != Order::AsFound {
            // Room for every pair at once: the number of undecided pairs creeps up for long where work is cut off.
            if self.keyed.capacity() < work.len() {
                self.keyed.reserve(self.hot.len());
            }
            let (urgencies, hot, tick) = (&self.urgencies, &self.hot, self.tick);
            let rank = |slot: PairSlot, seen| (urgencies[slot.index()].rank(tick, seen), slot);
            match gaze {
                None => self.keyed.extend(work.iter().map(|&slot| rank(slot, 1.0))),
                Some(gaze) => self.keyed.extend(work.iter().map(|&slot| {
                    let hot = &hot[slot.index()];
                    let bodies = world.body(hot.a).zip(world.body(hot.b));
                    rank(slot, bodies.map_or(1.0, |pair| seen(&gaze, pair)))
                })),
            }
        }
        let mut line = Line::new(order, work.len());
        let took_ns = self.order_next(&mut line, 0, world, meter);
        if order != Order::AsFound {
            (self.rank_cost).learn(took_ns, work.len(), gaze.is_some());
        }
        line
    }

    /// Sorts the next batch once the work has used up the last; returns the time that took since the clock was last
    /// read.
    pub(super) fn order_next(
        &mut self,
        line: &mut Line,
        at: usize,
        world: &World,
        meter: &mut Meter<'_>,
    ) -> u64 {
        if at < line.ready {
            return 0;
        }
        let Self { keyed, hot, .. } = self;
        match line.order {
            Order::AsFound => {}
            Order::Aged => line.advance(keyed, |&key| key),
            Order::Counted => line.advance(keyed, |&(rank, slot)| {
                let hot = &hot[slot.index()];
                let id = |body| world.body(body).map(|body| body.id);
                (rank, id(hot.a), id(hot.b))
            }),
        }
        meter.charge_dear(0)
    }
}

/// Weight of a pair by its place: that of its smaller body.
fn seen(gaze: &Gaze, (a, b): (&Body, &Body)) -> f64 {
    let smaller = if a.radius < b.radius { a } else { b };
    gaze.weight(&(smaller.pose * smaller.centre), smaller.radius)
}

#[cfg(test)]
mod tests;
