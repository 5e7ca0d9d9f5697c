//! Narrow phase: a sound interval for every candidate pair, widened by motion, narrowed by work that can stop
//! after any unit.
//!
//! In: the world, the pair set and its delta, a [`Meter`]. Out: for each pair a verdict, an interval, a witness and
//! (when somebody listens) contacts; see [`Narrow::finding`].
//!
//! The stages of a tick:
//! 1. `begin`: memories follow the pair set (`PairDelta`); a new pair starts from the bounds of its boxes.
//! 2. `widen`: the pairs of bodies that moved are checked against their certificates. A certificate is an interval with
//!    the bodies' motion accumulators at its test; until the motion since then uses it up, the pair costs one
//!    comparison. Pairs of which neither body moved are not visited.
//! 3. `spend`: pairs without a verdict first, oldest first; then bounds and contacts of reported pairs; then the
//!    regions in which open pairs may touch.
//!
//! Refused: a verdict from an older pose without widening (unsound); a queue per pair for convex shapes (one query
//! decides them); discarding interrupted work (it is resumed at its first pose and widened from there).

pub mod exact;
pub mod mesh;

mod approx;
mod arena;
mod around;
mod ask;
mod bent;
mod carry;
mod change;
mod compound;
mod contacts;
mod cover;
mod cursor;
mod finding;
mod flags;
mod holdings;
mod memo;
mod order;
mod pass;
mod plane;
mod pool;
mod query;
mod refit;
mod reports;
mod shelves;
mod spend;
mod sweep;
mod validate;
mod widen;

pub use approx::{Region, Regions};
pub use ask::{Asked, gap_between};
pub use contacts::{Contact, ContactSet};
pub use finding::Finding;
pub use memo::Witness;
pub use order::Order;
pub use sweep::{Passage, Swept, touch_on_way};

use crate::ids::{BodySlot, PairSlot};
use crate::limits::SWEEP_LOOKS_MAX;
use crate::pairs::{PairDelta, PairSet, Spare};
use crate::simd;
use crate::time::Meter;
use crate::wire::{BodyStatus, Verdict};
use crate::world::World;

use approx::{Approx, Kept};
use compound::CompoundFront;
use flags::Flags;
use memo::{Hot, Memo};
use mesh::Search;
use order::{RankCost, Urgency};
use pool::{NONE, Pool};
use refit::Refits;
use shelves::Shelves;
use sweep::{FIRST_LOOKS, Sweeps};

/// What the narrow phase did in this tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Pairs visited because one of their bodies moved.
    pub visited: u64,
    /// Pair slots passed over to find them.
    pub walked: u64,
    /// Exact queries of convex shape pairs.
    pub queries: u64,
    /// Slices of mesh walks.
    pub slices: u64,
    /// Manifolds computed.
    pub manifolds: u64,
}

/// The narrow phase's memory of all pairs, by `PairSlot`.
#[derive(Debug, Default)]
pub struct Narrow {
    /// What the motion pass reads, 24 bytes per pair.
    hot: Vec<Hot>,
    /// Everything else about a pair.
    memos: Vec<Memo>,
    /// `S + d` of each body, by `BodySlot`; infinite while the body's place is not known exactly: then no certificate
    /// saves a visit.
    spent_m: Vec<f64>,
    /// The ticks in which pairs of a body may have been missed, by `BodySlot`.
    unseen: Vec<Unseen>,
    /// Bodies with a pair that did not fit into the pair set in the last tick.
    short: Vec<BodySlot>,
    /// Pairs whose verdict is not `apart`.
    active: Vec<PairSlot>,
    /// Pairs that became active since this was last cleared; by now they may be inactive, or the slot reused.
    entered: Vec<PairSlot>,
    /// By `PairSlot`: the finding or the contacts may differ from what was last published.
    stirred: Flags,
    /// Pairs that stopped being active in this tick and still exist.
    left: Vec<PairSlot>,
    /// `left` was filled after the findings were published; the next tick must report it.
    left_is_news: bool,
    /// Pairs that got their verdicts in the last [`Narrow::go_on`]; may hold duplicates.
    late: Vec<PairSlot>,
    /// Pairs that lack a verdict at this tick's poses and can get one by work.
    undecided: Vec<PairSlot>,
    /// Pairs whose work ended without a verdict because there was no room: they start again in the next tick.
    lost: Vec<PairSlot>,
    /// Active pairs whose bounds or contacts are older than their poses.
    refresh: Vec<PairSlot>,
    /// Fronts of pairs of which one body has several shapes.
    compounds: Pool<CompoundFront>,
    shelves: Shelves,
    search: Search,
    sweeps: Sweeps,
    refits: Refits,
    contact_sets: Pool<ContactSet>,
    /// What the order of work depends on, by `PairSlot`.
    urgencies: Vec<Urgency>,
    spare: Spare,
    /// Work with its ranks, while it is being ordered.
    keyed: Vec<(u64, PairSlot)>,
    rank_cost: RankCost,
    /// Contacts of the current query.
    found: Vec<Contact>,
    /// The previous contacts of a set, while ids are passed on.
    before: Vec<Contact>,
    approx: Approx,
    /// Regions of pairs that were split or complete.
    kept: Pool<Kept>,
    counts: [u64; Verdict::ALL.len()],
    counters: Counters,
    contacts_per_pair: usize,
    contacts_wanted: bool,
    bounds_wanted: bool,
    /// In the last tick there was no time for all bounds.
    scarce: bool,
    /// Pairs that lack the level being worked on.
    level: Vec<PairSlot>,
    tick: u64,
    /// This tick's stamp in [`Hot::visited`]; never 0.
    stamp: u32,
}

/// What is wanted of the narrow phase in this tick.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// Contacts and closest points of reported pairs.
    pub contacts: bool,
    /// Fresh intervals of reported pairs; without it a verdict is enough.
    pub bounds: bool,
    /// Regions of pairs that may touch, split as far as the budget goes.
    pub regions: bool,
    /// How work is ordered.
    pub order: Order,
}

impl Narrow {
    /// An empty memory that keeps at most `contacts_per_pair` contacts of a pair.
    #[must_use]
    pub fn new(contacts_per_pair: usize) -> Self {
        simd::prepare();
        Self {
            contacts_per_pair,
            ..Self::default()
        }
    }

    /// An empty memory in place of one that failed its validation: pairs that begin in tick `tick` may have collided
    /// unseen since `since`.
    #[must_use]
    pub fn renewed(contacts_per_pair: usize, world: &World, since: u64, tick: u64) -> Self {
        let mut narrow = Self::new(contacts_per_pair);
        let len = world.slots_len();
        let unseen = Unseen {
            first: since,
            last: tick,
        };
        narrow.unseen = vec![unseen; len];
        narrow.spent_m = vec![f64::INFINITY; len];
        for (slot, body) in world.bodies() {
            let known = matches!(body.status, BodyStatus::Known | BodyStatus::Held);
            if known && body.reach_m == 0.0 {
                narrow.spent_m[slot.index()] = body.motion.spent_m();
            } else {
                narrow.unseen[slot.index()].last = u64::MAX;
            }
        }
        narrow
    }

    /// Sets how the fronts of mesh pairs search; the default is [`Search::Carried`].
    pub fn set_search(&mut self, search: Search) {
        self.search = search;
    }

    /// Updates the memories from the pair set: ended pairs are forgotten, new ones start from their boxes.
    pub fn begin(&mut self, tick: u64, world: &World, pairs: &PairSet, delta: &PairDelta) {
        self.tick = tick;
        self.next_stamp();
        self.counters = Counters::default();
        if !std::mem::take(&mut self.left_is_news) {
            self.left.clear();
        }
        self.clear_sweeps();
        self.carry_over();
        self.give_back_slots(pairs.slots_len());
        self.note_bodies(world);
        self.note_missing(pairs);
        for ended in &delta.ended {
            self.forget(ended.slot);
        }
        for &slot in &delta.began {
            self.meet(slot, world, pairs);
        }
    }

    /// Spends the meter: refits of meshes that deform, sweeps, verdicts, then whatever has listeners. Returns whether
    /// all wanted work is done.
    ///
    /// * `world` - only boxes in its trees are changed.
    pub fn spend(&mut self, world: &mut World, wanted: Wanted, meter: &mut Meter<'_>) -> bool {
        self.shelves.store.touch_ahead(meter);
        self.spend_on_refits(world, wanted, meter);
        let done = self.spend_on_pairs(world, wanted, meter);
        self.note_scarcity(wanted);
        self.go_on_with_refits(world, meter);
        done
    }

    fn spend_on_pairs(&mut self, world: &World, wanted: Wanted, meter: &mut Meter<'_>) -> bool {
        let kept = Self::keep_back_for_regions(wanted, meter);
        let half = self.has_sweeps().then(|| meter.half());
        let swept = self.spend_on_sweeps(world, wanted, meter, half, FIRST_LOOKS);
        let decided = self.spend_on_verdicts(world, wanted, meter);
        let swept = swept || self.spend_on_sweeps(world, wanted, meter, None, FIRST_LOOKS);
        self.bring_up_swept(world);
        let done = decided && swept && self.spend_on_reports(world, wanted, meter);
        let done = self.spend_on_sweeps(world, wanted, meter, None, SWEEP_LOOKS_MAX) && done;
        self.close_sweeps();
        meter.release(kept);
        self.spend_on_regions(world, wanted, meter);
        // Once more, with the units that splitting left over.
        done || (swept
            && self.spend_on_verdicts(world, wanted, meter)
            && self.spend_on_reports(world, wanted, meter))
    }

    /// As [`Narrow::spend`], after the tick's findings were published: what is found now holds at this tick's poses and
    /// is published in the next tick ([`Narrow::late`]).
    pub fn go_on(&mut self, world: &mut World, wanted: Wanted, meter: &mut Meter<'_>) -> bool {
        if !std::mem::replace(&mut self.left_is_news, true) {
            self.left.clear();
        }
        self.late.clear();
        self.shelves.store.touch_ahead(meter);
        self.go_on_with_refits(world, meter);
        self.spend_on_verdicts(world, wanted, meter) && self.spend_on_reports(world, wanted, meter)
    }

    /// Number of pairs with this verdict (`Apart`: only those that were ever decided).
    #[must_use]
    pub fn count(&self, verdict: Verdict) -> u64 {
        self.counts[usize::from(verdict.code())]
    }

    /// Counters of this tick.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// The tick since which a pair of this body that begins now may have collided unseen; `None`: had it collided in
    /// the last tick, its boxes would have overlapped then.
    #[must_use]
    pub fn unseen_since(&self, slot: BodySlot) -> Option<u64> {
        let unseen = self.unseen.get(slot.index())?;
        (unseen.last >= self.tick).then_some(unseen.first)
    }

    /// Keeps the work that the last tick left undone and drops settled pairs from the lists.
    fn carry_over(&mut self) {
        let (hot, memos) = (&self.hot, &mut self.memos);
        self.undecided.retain(|slot| {
            let (hot, memo) = (&hot[slot.index()], &mut memos[slot.index()]);
            memo.queued &= hot.live && hot.verdict == Verdict::Possible;
            memo.queued
        });
        // Queue them again here: at rest nothing else would. Free their memory: it may be the very room they lacked.
        for at in 0..self.lost.len() {
            let slot = self.lost[at];
            let hot = &self.hot[slot.index()];
            if hot.live && hot.verdict == Verdict::Possible && !self.memos[slot.index()].queued {
                self.give_back(slot);
                self.stirred.set(slot);
                self.memos[slot.index()].queued = true;
                self.undecided.push(slot);
            }
        }
        self.lost.clear();
        let (hot, memos) = (&self.hot, &mut self.memos);
        self.refresh.retain(|slot| {
            let (hot, memo) = (&hot[slot.index()], &mut memos[slot.index()]);
            let reported = matches!(hot.verdict, Verdict::Near | Verdict::Colliding);
            memo.refreshing &= hot.live && reported;
            memo.refreshing
        });
    }

    /// Records which bodies entered the broad phase or have no known place, and how far the others have moved.
    fn note_bodies(&mut self, world: &World) {
        let len = world.slots_len();
        if self.spent_m.len() < len {
            self.spent_m.resize(len, 0.0);
            self.unseen.resize(len, Unseen::default());
        }
        let changes = world.changes();
        let whole = changes.inserted.iter().chain(&changes.moved);
        for &slot in whole.chain(&changes.restated) {
            let Some(body) = world.body(slot) else {
                continue;
            };
            let known = matches!(body.status, BodyStatus::Known | BodyStatus::Held);
            let at_pose = known && body.reach_m == 0.0;
            self.spent_m[slot.index()] = if at_pose {
                body.motion.spent_m()
            } else {
                f64::INFINITY
            };
            let unseen = &mut self.unseen[slot.index()];
            if at_pose && unseen.last == u64::MAX {
                unseen.last = self.tick;
            } else if !at_pose && unseen.last != u64::MAX {
                *unseen = Unseen {
                    first: self.tick,
                    last: u64::MAX,
                };
            }
        }
        for &slot in &changes.requery {
            self.unseen[slot.index()].cover(self.tick, self.tick);
        }
        for &slot in &changes.inserted {
            let unseen = &mut self.unseen[slot.index()];
            unseen.first = self.tick;
            unseen.last = unseen.last.max(self.tick);
        }
    }

    /// Records the bodies whose pairs did not all fit into the pair set: the next tick may find more of them.
    fn note_missing(&mut self, pairs: &PairSet) {
        for at in 0..self.short.len() {
            let slot = self.short[at];
            self.unseen[slot.index()].cover(self.tick - 1, self.tick);
        }
        self.short.clear();
        self.short.extend_from_slice(pairs.truncated());
    }
}

/// Ticks in which pairs of a body may have been missed: it was not in the broad phase, its place was not known, its
/// filter was different, or the pair set was full.
#[derive(Clone, Copy, Debug, Default)]
struct Unseen {
    /// The first of these ticks; for a new body, its first tick.
    first: u64,
    /// The last tick in which a pair that was missed before may begin; `u64::MAX`: no end yet.
    last: u64,
}

impl Unseen {
    /// Adds the ticks from `first`, so that pairs that begin up to `last` are known to be late.
    fn cover(&mut self, first: u64, last: u64) {
        if self.last < first {
            self.first = first;
        }
        self.last = self.last.max(last);
    }
}
