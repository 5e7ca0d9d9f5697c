//! The load when nearly all bodies stay in their holds: boxes are tested against these in the order of the world.
//!
//! In: which bodies moved, their boxes, their holds. Out: which bodies left their hold.
//!
//! A body inside its hold matters only to candidates that are not certain, and a pile at rest has few of these: they
//! read the world itself (`look`). So no box is stored, and memory is read in sequence. Block by block, in contrast,
//! each box of the world and its place among the stored ones is somewhere else, and a tick only waits for memory.
//! Before a stored box is read, it is updated from the world.

use std::ops::Range;

use super::fatten::{HORIZON, outward};
use super::load::Taking;
use super::{BodySlot, Order, Proxies, Tick, ones, parts};
use crate::simd::boxes::{Kernel, Lanes, WIDTH};

/// This mode begins when no more than one body in this many was renewed in the last tick.
const CALM: u64 = 64;
/// This mode continues while no more than one body in this many was renewed in the last tick: taking all boxes again
/// costs as much as some ticks.
const STILL_CALM: u64 = 2 * HORIZON as u64;

impl Order {
    /// Returns whether this mode is used.
    ///
    /// * `many` - whether many moved.
    pub(super) fn stands(&self, many: bool) -> bool {
        let calm = if self.lags { STILL_CALM } else { CALM };
        // An uncertain candidate costs as much as a body: two boxes at random places in memory.
        let few_open = self.entries.len() < self.len;
        many && self.listed && few_open && self.renewed * calm <= self.len as u64
    }

    /// Finds bodies that left their hold, and marks them for renewal; see [`Order::load`].
    pub(super) fn load_standing<P: Proxies>(&mut self, tick: &Tick<'_, P>) {
        self.lags = true;
        let level = self.level;
        level.run(LoadStanding { order: self, tick });
    }

    /// Ends this mode: all boxes are stored again.
    pub(super) fn stir<P: Proxies>(&mut self, proxies: &P) {
        if self.lags {
            self.catch_up(0..self.live.len(), proxies);
            self.lags = false;
        }
    }

    /// Updates the stored boxes of some blocks, if they lag.
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

    /// Updates the stored boxes of a block.
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

impl<P: Proxies> Kernel for LoadStanding<'_, '_, P> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (order, tick) = (self.order, self.tick);
        let origin = order.origin;
        for slot in tick.moved {
            // A body without a lane has no hold.
            let Some(held) = order.held.get(slot.index()) else {
                continue;
            };
            let aabb = tick.proxies.aabb(*slot);
            let corners = [aabb.min.coords.as_ref(), aabb.max.coords.as_ref()];
            if lanes.keeps(corners, &origin, held) {
                continue;
            }
            if let Some(rank) = order.rank(*slot) {
                // Far from the origin the rounding error exceeds the core's reserve.
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

impl<P: Proxies> Kernel for CatchUp<'_, P> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        for block in self.blocks {
            self.order.catch_up_block(lanes, block, self.proxies);
        }
    }
}
