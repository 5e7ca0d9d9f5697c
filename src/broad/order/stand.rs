//! The load where nearly all bodies keep to their holds: boxes are held against these in the order of the world.
//!
//! In: which bodies moved, their boxes, their holds. Out: who has left his hold.
//!
//! A body that keeps to its hold tells nothing new but to candidates that are not sure, and in a pile at rest few are
//! not: these ask the world itself (`look`). So no box is stored, and what is read stands one after the other, while
//! block by block each box of the world and its place among those stored is somewhere else, and a tick waits for memory
//! alone. Where a stored box is read, that of its body is taken before.

use std::ops::Range;

use super::fatten::{HORIZON, outward};
use super::load::Taking;
use super::{BodySlot, Order, Proxies, Tick, ones, parts};
use crate::simd::boxes::{Lanes, WIDTH, Work};

/// Boxes begin to be held against holds alone where no more than one body in so many was renewed in the last tick.
const CALM: u64 = 64;
/// Boxes go on to be held against holds alone where no more than one body in so many was renewed in the last tick: to
/// take all boxes again costs as much as some ticks.
const STILL_CALM: u64 = 2 * HORIZON as u64;

impl Order {
    /// Whether boxes are to be taken so.
    ///
    /// * `many` - whether many moved.
    pub(super) fn stands(&self, many: bool) -> bool {
        let calm = if self.lags { STILL_CALM } else { CALM };
        // A candidate that is not sure costs as much as a body: two boxes that stand anywhere.
        let few_open = self.entries.len() < self.len;
        many && self.listed && few_open && self.renewed * calm <= self.len as u64
    }

    /// Finds who has left his hold, and notes whom to renew; see [`Order::load`].
    pub(super) fn load_standing<P: Proxies>(&mut self, tick: &Tick<'_, P>) {
        self.lags = true;
        let level = self.level;
        level.run(LoadStanding { order: self, tick });
    }

    /// They do not stand: all boxes are stored again.
    pub(super) fn stir<P: Proxies>(&mut self, proxies: &P) {
        if self.lags {
            self.catch_up(0..self.live.len(), proxies);
            self.lags = false;
        }
    }

    /// Takes the boxes of some blocks, where those stored lag.
    pub(super) fn catch_up<P: Proxies>(&mut self, blocks: Range<usize>, proxies: &P) {
        if self.lags {
            let level = self.level;
            level.run(CatchUp {
                order: self,
                blocks,
                proxies,
            });
        }
    }

    /// Takes the boxes of a block.
    #[inline(always)]
    fn catch_up_block<L: Lanes, P: Proxies>(&mut self, lanes: L, block: usize, proxies: &P) {
        let taking = Taking::of(&self.slot_of, block);
        let exact = &mut self.exact.as_chunks_mut::<WIDTH>().0[block];
        for lane in ones(self.live[block]) {
            let slot: BodySlot = taking.slot(lane, proxies);
            exact[lane] = outward(lanes, proxies.aabb(slot), &self.origin);
        }
    }
}

/// See [`Order::load_standing`].
struct LoadStanding<'a, 'b, P> {
    order: &'a mut Order,
    tick: &'a Tick<'b, P>,
}

impl<P: Proxies> Work for LoadStanding<'_, '_, P> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (order, tick) = (self.order, self.tick);
        let origin = order.origin;
        for slot in tick.moved {
            // Who has no lane has no hold.
            let Some(held) = order.held.get(slot.index()) else {
                continue;
            };
            let aabb = tick.proxies.aabb(*slot);
            let corners = [aabb.min.coords.as_ref(), aabb.max.coords.as_ref()];
            if lanes.keeps(corners, &origin, held) {
                continue;
            }
            if let Some(rank) = order.rank(*slot) {
                // Far from the origin rounding is more than the core leaves.
                if !order.take(lanes, tick.proxies, *slot, rank as usize) {
                    let (block, lane) = parts(rank);
                    order.mark(block, 1 << lane);
                }
            }
        }
        for block in order.due_blocks() {
            let moving = order.moving(block);
            if moving != 0 {
                order.catch_up_block(lanes, block, tick.proxies);
                let along = order.along(lanes, block, moving);
                order.mark(block, along);
            }
        }
    }
}

/// See [`Order::catch_up`].
struct CatchUp<'a, P> {
    order: &'a mut Order,
    blocks: Range<usize>,
    proxies: &'a P,
}

impl<P: Proxies> Work for CatchUp<'_, P> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        for block in self.blocks {
            self.order.catch_up_block(lanes, block, self.proxies);
        }
    }
}
