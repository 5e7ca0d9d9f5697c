//! Refits of meshes that deform: whose boxes come first, and how much of the budget they take.
//!
//! In: the pairs that wait for work, a [`Meter`]. Out: boxes that hold the newest vertices, at least in part.
//!
//! A body is refitted when one of its pairs waits, before that pair's turn: boxes widened by the deformation already
//! decide three times fewer tests when it is 1.3 % of the body's size. Refits take at most half of what the budget
//! leaves until pairs have had their turn; otherwise a budget too small for the refits would never decide anything. An
//! unfinished refit continues in the next tick, even if new vertices have come: a round is finished before the next
//! begins, so boxes are never older than two rounds.
//!
//! Refused: starting over in each tick (with a third of what a refit needs, its upper boxes would never be done);
//! refits of bodies for which no pair waits.

use std::cmp::Reverse;

use super::{Narrow, Wanted};
use crate::ids::{BodyId, BodySlot, PairSlot};
use crate::time::{Meter, Share};
use crate::world::World;

/// Packs of eight boxes between two checks of the meter: a quarter of a microsecond.
const PACKS_PER_SLICE: usize = 8;
/// Cost of a pack, in tests of a box against a pack: decides when the clock is read.
const PACK_COST: u64 = 2;

/// Bodies to be refitted. Empty, and without memory, if no body deforms.
#[derive(Debug, Default)]
pub(super) struct Refits {
    /// Total waiting time of each body's pairs, by `BodySlot`, ticks.
    waits: Vec<u64>,
    /// Sorted by it.
    due: Vec<(Reverse<u64>, BodyId, BodySlot)>,
}

impl Narrow {
    /// Refits the bodies whose pairs wait, longest total wait first, with at most half of what the meter has.
    pub(super) fn spend_on_refits(
        &mut self,
        world: &mut World,
        wanted: Wanted,
        meter: &mut Meter<'_>,
    ) {
        self.refits.due.clear();
        if world.deforming().is_empty() {
            return;
        }
        self.find_due(world, wanted);
        let half = meter.half();
        self.refit_due(world, meter, Some(half));
    }

    /// Continues the refits while the meter is open.
    pub(super) fn go_on_with_refits(&mut self, world: &mut World, meter: &mut Meter<'_>) {
        if !self.refits.due.is_empty() {
            self.refit_due(world, meter, None);
        }
    }

    fn refit_due(&mut self, world: &mut World, meter: &mut Meter<'_>, share: Option<Share>) {
        for &(_, _, slot) in &self.refits.due {
            loop {
                let open = meter.open() && share.is_none_or(|share| meter.within(share));
                let done = if open {
                    world.refit(slot, PACKS_PER_SLICE)
                } else {
                    0
                };
                if done == 0 {
                    break;
                }
                let packs = done as u64;
                meter.charge_weighted(packs, PACK_COST * packs);
            }
        }
    }

    /// Lists the bodies whose boxes are out of date and for which a pair waits.
    fn find_due(&mut self, world: &World, wanted: Wanted) {
        let Self {
            refits,
            hot,
            memos,
            undecided,
            refresh,
            tick,
            ..
        } = self;
        let Refits { waits, due } = refits;
        waits.clear();
        waits.resize(world.slots_len(), 0);
        let mut wait = |slot: PairSlot| {
            let pair = &hot[slot.index()];
            let age = match memos[slot.index()].undecided_since {
                0 => 1,
                since => tick.saturating_sub(since) + 1,
            };
            for body in [pair.a, pair.b] {
                waits[body.index()] += age;
            }
        };
        undecided.iter().for_each(|slot| wait(*slot));
        if wanted.bounds || wanted.contacts {
            refresh.iter().for_each(|slot| wait(*slot));
        }
        for &slot in world.deforming() {
            let wait = waits[slot.index()];
            if let Some(body) = world.body(slot).filter(|body| wait > 0 && body.lags()) {
                due.push((Reverse(wait), body.id, slot));
            }
        }
        due.sort_unstable();
    }
}
