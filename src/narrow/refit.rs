//! Refits of meshes that deform: which body's boxes come first, and how much of the budget they take.
//!
//! In: the pairs that wait for work, a [`Meter`]. Out: boxes that hold the newest vertices, or a part of them.
//!
//! A body is refitted when a pair of it waits, before that pair has its turn: with boxes that are widened by what has
//! moved a test tells three times less already where that is 1.3 % of the body's size. Refits take at most half of what
//! the budget leaves until pairs have had their turn; else a budget that does not reach for the refits would never
//! decide anything. What is not done goes on in the next tick, also when new vertices have come: a round is finished
//! before another begins, so boxes are never older than two rounds.
//!
//! Refused: each tick from the start (with a third of what a refit needs its upper boxes would never be done); refits
//! of bodies of which no pair waits.

use std::cmp::Reverse;

use super::{Narrow, Wanted};
use crate::ids::{BodyId, BodySlot, PairSlot};
use crate::time::{Meter, Share};
use crate::world::World;

/// Packs of eight boxes between two looks at the meter: a quarter of a microsecond.
const PACKS_PER_SLICE: usize = 8;
/// What a pack costs, in tests of a box against a pack: when the clock is to be read.
const PACK_COST: u64 = 2;

/// Bodies to be refitted. Empty, and without memory, where no body deforms.
#[derive(Debug, Default)]
pub(super) struct Refits {
    /// How long pairs of each body have waited, by `BodySlot`, ticks.
    waits: Vec<u64>,
    /// In their order.
    due: Vec<(Reverse<u64>, BodyId, BodySlot)>,
}

impl Narrow {
    /// Refits the bodies whose pairs wait, those first whose pairs wait longest in all; for at most half of what the
    /// meter has.
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

    /// Goes on with them while the meter is open.
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

    /// Lists the bodies whose boxes are behind and of which a pair waits.
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
