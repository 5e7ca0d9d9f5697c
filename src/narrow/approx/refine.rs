//! Splitting regions within the budget, and which results are kept.
//!
//! It comes after verdicts, bounds and contacts: their work narrows regions too, and stays proved when the pair moves.
//! A reader of `regions` needs them most when the budget does not suffice for all of that, so one part in
//! [`KEPT_PARTS`] is reserved for them while pairs are open, and released to the others if they do not need it.
//!
//! Pairs have their turn in the order of their last one. A test that splits a box drops what is apart at these poses,
//! and keeps no proof; so a moving pair starts from what its front knows, and one at rest keeps its regions. Refused:
//! proofs for these tests too (a front has them already, and goes where it matters), and regions widened by motion (a
//! place that has come to touch elsewhere would be in none).

use crate::ids::PairSlot;
use crate::limits::REGIONS_PER_PAIR_MAX;
use crate::math::Pose;
use crate::narrow::bent::Bent;
use crate::narrow::order::Line;
use crate::narrow::{NONE, Narrow, Order, Wanted};
use crate::time::{Meter, Reserve};
use crate::wire::Verdict;
use crate::world::World;

use super::pace::{CLOSING_NS, Pace};
use super::{Approx, Place, Region};

/// One in this many parts of the budget is reserved for regions while they are read: at a quarter of the work, 16 tests
/// of a pair reduce its median radius from 24 to 14 % of the diameter, and an eighth of the work costs its verdict next
/// to nothing (`benches/time_critical`).
const KEPT_PARTS: u64 = 8;

/// The regions of a pair, and the poses they were made at.
#[derive(Debug)]
pub(in crate::narrow) struct Kept {
    rel: Pose,
    bent: Bent,
    /// Turns of work that the pair had had by then.
    turns: u32,
    contacts_tick: u64,
    /// Last tick in which the pair had its turn of splitting.
    asked: u64,
    /// Number of tests used; `None`: made by looks alone.
    tests: Option<u32>,
    /// No test was left to do.
    whole: bool,
    pub(super) complete: bool,
    pub(super) clipped: bool,
    pub(super) all: Vec<Region>,
}

impl Default for Kept {
    fn default() -> Self {
        Self {
            rel: Pose::identity(),
            bent: Bent::default(),
            turns: 0,
            contacts_tick: 0,
            asked: 0,
            tests: None,
            whole: false,
            complete: false,
            clipped: false,
            all: Vec::with_capacity(REGIONS_PER_PAIR_MAX),
        }
    }
}

impl Kept {
    /// Whether they hold all that the two share here.
    fn holds(&self, here: &Place, contacts_tick: u64) -> bool {
        !self.all.is_empty()
            && self.bent == here.bent
            && self.rel == here.rel
            && (!self.complete || self.contacts_tick == contacts_tick)
    }
}

impl Narrow {
    /// Reserves budget for a reader of `regions`.
    pub(in crate::narrow) fn keep_back_for_regions(
        wanted: Wanted,
        meter: &mut Meter<'_>,
    ) -> Reserve {
        if wanted.regions && wanted.order != Order::AsFound {
            meter.reserve(KEPT_PARTS)
        } else {
            Reserve::default()
        }
    }

    /// Splits regions of pairs with meshes, pair by pair, while the meter is open.
    pub(in crate::narrow) fn spend_on_regions(
        &mut self,
        world: &World,
        wanted: Wanted,
        meter: &mut Meter<'_>,
    ) {
        if !wanted.regions || !meter.open() {
            return;
        }
        let ranked_ns = self.rank_cost.of(self.active.len(), true);
        if !meter.has_ns(ranked_ns + CLOSING_NS) {
            return self.rank_cost.forget(true);
        }
        let mut line = self.line_up_for_regions(world, wanted.order);
        let mut at = 0;
        while at < self.keyed.len() {
            self.order_next(&mut line, at, world, meter);
            if !meter.open() || !meter.has_ns(2 * CLOSING_NS) {
                break;
            }
            self.refine_regions(self.keyed[at].1, world, meter);
            at += 1;
        }
        self.keyed.clear();
    }

    /// One turn of splitting of a pair that may touch.
    pub fn refine_regions(&mut self, slot: PairSlot, world: &World, meter: &mut Meter<'_>) {
        let mut approx = std::mem::take(&mut self.approx);
        approx.ready();
        let mut pace = Pace::metered(meter);
        let of = self.standing(slot, world).filter(|of| of.placed);
        let here = of.map(|of| {
            self.find_regions(slot, &of, &mut pace, &mut approx);
            of.place()
        });
        if let Some(here) = here {
            self.keep_regions(slot, &here, &approx, Some(&pace));
        }
        self.approx = approx;
    }

    /// Earlier regions of a pair that still hold: those made by splitting, and any of a complete pair.
    pub(super) fn kept_regions(&self, slot: PairSlot, here: &Place) -> Option<&Kept> {
        let memo = self.memos.get(slot.index())?;
        let kept = self.kept.get(memo.regions)?;
        let serves = kept.tests.is_some() || (kept.complete && here.complete);
        (serves && kept.holds(here, memo.contacts_tick)).then_some(kept)
    }

    /// Keeps the regions just made, unless stored ones made with more tests still hold.
    ///
    /// * `pace` - the allowance that splitting used; `None`: they were made by looks alone.
    pub(super) fn keep_regions(
        &mut self,
        slot: PairSlot,
        here: &Place,
        approx: &Approx,
        pace: Option<&Pace<'_, '_>>,
    ) {
        let tick = self.tick;
        let Some(memo) = self.memos.get_mut(slot.index()) else {
            return;
        };
        if memo.regions == NONE {
            memo.regions = self.kept.take(Kept::default);
            if let Some(kept) = self.kept.get_mut(memo.regions) {
                (kept.asked, kept.tests) = (0, None);
                kept.all.clear();
            }
        }
        let (contacts_tick, turns) = (memo.contacts_tick, memo.turns);
        let Some(kept) = self.kept.get_mut(memo.regions) else {
            return;
        };
        let tests = pace.map(|pace| pace.tests);
        if pace.is_some() {
            kept.asked = tick;
        }
        let as_well = kept.turns == turns
            && kept.complete == here.complete
            && kept.tests > tests
            && kept.holds(here, contacts_tick);
        if as_well || pace.is_some_and(|pace| pace.cut) {
            return;
        }
        (kept.rel, kept.bent) = (here.rel, here.bent);
        (kept.turns, kept.contacts_tick) = (turns, contacts_tick);
        (kept.tests, kept.whole) = (tests, pace.is_some_and(|pace| !pace.stopped));
        (kept.complete, kept.clipped) = (here.complete, approx.clipped);
        kept.all.clear();
        kept.all.extend_from_slice(&approx.regions);
    }

    /// Collects the pairs to be split, ordered by their last turn.
    fn line_up_for_regions(&mut self, world: &World, order: Order) -> Line {
        let mut keyed = std::mem::take(&mut self.keyed);
        keyed.clear();
        if keyed.capacity() < self.active.len() {
            keyed.reserve(self.hot.len());
        }
        let owing = self.active.iter().filter_map(|&slot| {
            let asked = self.owes_regions(slot, world)?;
            Some((asked, slot))
        });
        keyed.extend(owing);
        let line = Line::new(order, keyed.len());
        self.keyed = keyed;
        line
    }

    /// When a pair had its last turn (0: never), if splitting can make its regions smaller.
    fn owes_regions(&self, slot: PairSlot, world: &World) -> Option<u64> {
        let hot = self.hot.get(slot.index())?;
        let open = matches!(hot.verdict, Verdict::Possible | Verdict::Colliding);
        if !open || !hot.meshed {
            return None;
        }
        let memo = &self.memos[slot.index()];
        let Some(kept) = self.kept.get(memo.regions) else {
            return Some(0);
        };
        let here = &self.standing(slot, world).filter(|of| of.placed)?.place();
        let done = kept.whole
            && kept.complete == here.complete
            && (kept.complete || kept.turns == memo.turns)
            && kept.holds(here, memo.contacts_tick);
        (!done).then_some(kept.asked)
    }
}
