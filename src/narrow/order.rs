//! The order of work: who has a turn first when the budget does not reach for all.
//!
//! Urgency is a time of waiting times a weight: for its turn, or up to [`HEAD_START`] ticks for its verdict, whichever
//! is more; last tick's contacts count as if they had waited so long. So nothing starves, neither behind contacts that
//! are to be confirmed each tick nor behind pairs that no turn decides:
//!
//! **A pair that waits for a verdict has a turn after at most `w max(H + 2, R + 1) + R` ticks**, with
//! - `H` = [`HEAD_START`], 16;
//! - `R`: ticks that it takes to give each pair a turn that waits for one, `N / K` rounded up, of `N` pairs that wait
//!   at the same time, and `K` turns a tick: one for each unit of the budget where all bodies are single convex shapes;
//!   else one for each 4,096 (more than the longest turn of a mesh pair), and never less than one. Of the units, what
//!   is kept back for others does not count: an eighth while `regions` are read, half while meshes deform, and half of
//!   the rest while bodies are swept;
//! - `w`: the greatest weight of a pair over the least: the ratio of their priorities, times [`CLOSING_WEIGHT`], 4,
//!   times the weight of the scene's viewpoint.
//!
//! For who goes before a pair that has waited `T >= w max(H + 2, R + 1)` ticks has waited itself for at least
//! `T / w - 1 >= R`: its weight is at most `w` times as much, and no head start makes up for it. So within the next `R`
//! ticks nobody goes before it twice, and nobody at all who was not waiting at their begin: `N` turns are enough.
//! (`tests/law_engine/schedule.rs` holds runs against it, and `tests` runs of meshes.) A turn decides a convex pair. A
//! mesh pair may need several, and motion may undo them faster than a budget renews them; its turns grow while it waits
//! (`carry`).
//!
//! Reports (bounds, contacts) have what verdicts leave, in the same order.

use crate::ids::PairSlot;
use crate::math::f32_down;
use crate::time::Meter;
use crate::world::{Body, Gaze, World};

use super::Narrow;
use super::memo::Memo;

/// How work is ordered. What is finished in the end does not depend on it; what is finished when time runs out does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// As found: for a budget without limit, where order means nothing.
    AsFound,
    /// Last tick's contacts, then by age, weighted by the bodies' priority and by how fast they come nearer: for a
    /// budget in time.
    Aged,
    /// As `Aged`, with ties broken by body ids: for a budget in units, so that a run replays bit for bit whatever the
    /// slots are.
    Counted,
}

/// Pairs put in order at once. Work is put in order as it is reached: where time ends after a few queries, most of the
/// list never needs an order, and no sort takes longer than a query or two.
const BATCH: usize = 128;

/// Parts that a list can be in while the front of it is put in order: each is at least a quarter of the one around it.
const PARTS_MAX: usize = 64;

/// What it takes to rank a pair and to part the list a first time, nanoseconds: learned from list to list, and never
/// believed to be less than it is on a good day (measured: 4 to 10 without a viewpoint; with one two bodies are looked
/// up and an angle is taken), nor more than so many times as much: that was something else.
#[derive(Clone, Copy, Debug)]
pub(super) struct RankCost {
    /// Without a viewpoint, and with one.
    ns: [u64; 2],
}

const RANK_NS: [u64; 2] = [16, 160];
const RANK_TIMES_MAX: u64 = 8;
/// Lists of fewer pairs teach nothing: what is read once counts for more than the pairs.
const RANK_LEARN_MIN: usize = 256;

impl Default for RankCost {
    fn default() -> Self {
        Self { ns: RANK_NS }
    }
}

impl RankCost {
    /// Of a list of so many pairs, nanoseconds.
    pub(super) fn of(&self, pairs: usize, gaze: bool) -> u64 {
        pairs as u64 * self.ns[usize::from(gaze)]
    }

    /// No list was ranked, for it might have taken too long: what was learned once does not hold for ever.
    pub(super) fn forget(&mut self, gaze: bool) {
        self.set(0, gaze);
    }

    fn learn(&mut self, took_ns: u64, pairs: usize, gaze: bool) {
        if took_ns == 0 || pairs < RANK_LEARN_MIN {
            return;
        }
        self.set(took_ns / pairs as u64, gaze);
    }

    /// Upwards at once, downwards a little.
    fn set(&mut self, each_ns: u64, gaze: bool) {
        let at = usize::from(gaze);
        let (least, now) = (RANK_NS[at], self.ns[at]);
        let each_ns = each_ns.max(now - now.div_ceil(32));
        self.ns[at] = each_ns.clamp(least, RANK_TIMES_MAX * least);
    }
}

/// The fastest approach counts as this many times the age: what comes nearer by much more than its size since it was
/// last asked is up to four times as urgent as what does not.
const CLOSING_WEIGHT: f64 = 4.0;

/// Ticks of waiting for a verdict that count, and what last tick's contacts are given on top of their own: a contact is
/// mostly confirmed by one test. Without an end a pair that no turn decides would be ahead of all others for ever.
const HEAD_START: u32 = 16;

/// What the order of work asks of a pair, side by side for all pairs: the records it comes from are far apart.
///
/// Ticks are cut to 32 bits: only differences are asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Urgency {
    /// First tick without a verdict.
    since: u32,
    /// Tick in which it had its last turn, or was put on a list of work.
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
    /// Takes what a look at the pair has found.
    ///
    /// * `priority` - the pair's: the greater of its bodies'.
    /// * `closing_m` - how far the two came nearer since the test, where they are nearest.
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

    /// Takes the pair's verdict.
    pub(super) fn settle(&mut self, memo: &Memo) {
        self.since = cut(memo.undecided_since);
        self.undecided = memo.undecided_since != 0;
        self.touched = memo.witness.is_some_and(|w| w.best_m <= 0.0);
    }

    /// The pair has a turn in this tick, or is put on a list: from here on it waits.
    pub(super) fn note_turn(&mut self, tick: u64) {
        self.turn = cut(tick);
    }

    /// Place in the order of work, the least first: waiting times weight, the greatest first (positive floats order
    /// like their bits).
    ///
    /// * `seen` - weight of the place where it is (`Gaze::weight`); 1 without a viewpoint.
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

/// How far a list of work has been put in order: an incremental quicksort, whose parts wait for their turn.
#[derive(Debug)]
pub(super) struct Line {
    order: Order,
    /// Up to here it is in order.
    ready: usize,
    /// Ends of the parts that follow, the nearest last: what is in a part comes before all that is behind its end.
    ends: [usize; PARTS_MAX],
    parts: usize,
}

impl Line {
    /// A list of so many, of which nothing is in order yet.
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

    /// Nothing more is to be put in order.
    pub(super) fn finish(&mut self, len: usize) {
        self.ready = len;
    }

    /// Puts the next items in order, at most [`BATCH`], by parting the list until a part is that small.
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
    /// Begins a list of work: gathers the ranks, and puts the first batch in order.
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
            // Room for every pair at once: how many are undecided creeps up for long where work is cut off.
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

    /// Puts the next batch in order when the work has come as far as the last; returns what it took since the clock was
    /// last read.
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

/// How much a pair counts by where it is: at its smaller body.
fn seen(gaze: &Gaze, (a, b): (&Body, &Body)) -> f64 {
    let smaller = if a.radius < b.radius { a } else { b };
    gaze.weight(&(smaller.pose * smaller.centre), smaller.radius)
}

#[cfg(test)]
mod tests;
