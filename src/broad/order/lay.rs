//! Lanes of bodies without candidates: they are laid out along the curve, and every box is written to its lane.
//!
//! In: every box. Out: lanes, the tree over their blocks, and how much the volume of the blocks has grown.

use super::afresh::{Afresh, FRAME_TICKS};
use super::curve::Frame;
use super::fatten::outward;
use super::home::NO_HOMES;
use super::links::{room, spare};
use super::load::Taking;
use super::place::{ATTIC, grow, middle};
use super::sort::{FILL, Sorter};
use super::{BodySlot, MANY_CAME, NONE, Order, Proxies, Tick, is_thrifty, ones, parts, small};
use crate::simd::boxes::{Boxes16, Down, Kernel, Lanes, WIDTH, prefetch};

/// Laying out a body costs as much as this many comparisons of a box with a block.
pub(super) const LAY_TESTS: u32 = 12;
/// How many bodies ahead boxes are prefetched.
const AHEAD: usize = 16;

impl Order {
    /// How many times more often a block is met than at its layout, on average, estimated from volumes.
    pub(super) fn grown(&self) -> f64 {
        let side = self.afresh.side;
        let (mut sum, mut count) = (0.0, 0.0);
        for (block, before) in self.afresh.reach.iter().enumerate() {
            let times = reach(self.tree.bound(block), side) / before;
            if times.is_finite() {
                sum += f64::from(times);
                count += 1.0;
            }
        }
        if count > 0.0 { sum / count } else { 1.0 }
    }

    /// Sorts the bodies into blocks again, each block compact.
    pub(super) fn lay_anew<P: Proxies>(&mut self, tick: &Tick<'_, P>) {
        self.afresh.presort.stop();
        let bodies = tick.members.bounded();
        let look_again = self.afresh.framed >= FRAME_TICKS;
        if look_again {
            self.origin = middle(bodies, tick.proxies);
            self.afresh.framed = 0;
        }
        let mut boxes = std::mem::take(&mut self.boxes);
        self.level.run(TakeAll {
            origin: self.origin,
            bodies,
            proxies: tick.proxies,
            boxes: &mut boxes,
        });
        if look_again {
            self.sorter.frame = Frame::of(&boxes);
        }
        let mut sorter = std::mem::take(&mut self.sorter);
        self.clear_blocks(bodies);
        // A layout that is spoilt within a tick is not worth compact blocks.
        if self.afresh.spoilt == 0 {
            for (key, at) in sorter.sort(&boxes) {
                let at = at as usize;
                self.deal_to(key, FILL, Some((bodies[at], &boxes[at])));
            }
        } else {
            for (key, at) in sorter.along_curve(&boxes) {
                let at = at as usize;
                self.deal_to(key, WIDTH, Some((bodies[at], &boxes[at])));
            }
        }
        (self.sorter, self.boxes) = (sorter, boxes);
        self.close_blocks(bodies.len(), bodies.len());
    }

    /// Bodies left: they give up their lanes, and their pairs are not part of the difference.
    pub(super) fn leave_afresh(&mut self, left: &[BodySlot]) {
        self.afresh.presort.note_left(left.len());
        for slot in left {
            let Some(rank) = self.rank(*slot) else {
                continue;
            };
            let (block, lane) = parts(rank);
            self.rank_of[slot.index()] = NONE;
            self.slot_of[rank as usize] = NONE;
            self.live[block] &= !(1 << lane);
            self.fat[block].set(lane, &[f32::NAN; 6]);
            self.afresh.gone[block] |= 1 << lane;
            self.len -= 1;
            self.forget_seen(*slot);
        }
    }

    /// Removes everything from the blocks.
    pub(super) fn clear_blocks(&mut self, bodies: &[BodySlot]) {
        self.live.clear();
        self.keys.clear();
        self.slot_of.clear();
        self.fat.clear();
        self.reserve_blocks(bodies.len());
        if let Some(last) = bodies.iter().max() {
            grow(&mut self.rank_of, last.index(), NONE);
        }
    }

    /// Finishes a layout: the attic, the tree, and room for all.
    ///
    /// * `dealt` - bodies with a lane.
    /// * `bodies` - all bodies, including those that still need a lane.
    pub(super) fn close_blocks(&mut self, dealt: usize, bodies: usize) {
        self.sorted = self.live.len();
        self.len = dealt;
        let blocks = self.sorted + self.sorted / ATTIC + 1;
        for list in [&mut self.live, &mut self.dirty, &mut self.renewing] {
            list.resize(blocks, 0);
        }
        self.slot_of.resize(blocks * WIDTH, NONE);
        self.exact.resize(blocks * WIDTH, Down::EMPTY);
        self.fat.resize(blocks, Boxes16::EMPTY);
        self.homes.resize(blocks.div_ceil(WIDTH), NO_HOMES);
        self.tree.reset(blocks);
        self.tree.reserve();
        self.bound_all(bodies);
    }

    /// Computes the bounds of every block, which are the new baseline; bodies that get a lane later add to them.
    ///
    /// * `bodies` - number of bodies to reserve memory for.
    fn bound_all(&mut self, bodies: usize) {
        let blocks = self.live.len();
        self.level.run(Bound {
            order: self,
            blocks: 0..blocks,
        });
        for block in 0..blocks {
            let bound = *self.tree.bound(block);
            self.set_home(block, &bound);
        }
        self.measure();
        let Afresh {
            gone,
            jumped,
            finds,
            presort,
            ..
        } = &mut self.afresh;
        for lanes in [gone, jumped] {
            lanes.clear();
            lanes.resize(blocks, 0);
        }
        // Bodies that get a new lane in a tick, and where.
        let seats = bodies / MANY_CAME + 1;
        room(&mut self.homeless, seats);
        room(&mut self.worklist, 2 * seats);
        finds.reserve(blocks, bodies);
        if !is_thrifty(bodies) {
            presort.reserve(bodies + seats, seats);
            room(&mut self.boxes, bodies + seats);
            spare(&mut self.carried, self.hits, bodies);
        }
    }

    /// Gives a body the next lane, or leaves the lane empty for a body that is gone, so that the blocks stay those of
    /// the sort.
    ///
    /// * `key` - first key of the stretch that the body was sorted to.
    /// * `fill` - bodies per block.
    #[inline]
    pub(super) fn deal_to(&mut self, key: u64, fill: usize, body: Option<(BodySlot, &[f32; 6])>) {
        let same = |first: &u64| Sorter::class_of(*first) == Sorter::class_of(key);
        let starts = self.afresh.dealt == fill || !self.keys.last().is_some_and(same);
        if starts {
            self.keys.push(key);
            self.live.push(0);
            self.fat.push(Boxes16::EMPTY);
            self.slot_of.resize(self.live.len() * WIDTH, NONE);
            self.afresh.dealt = 0;
        }
        let (block, lane) = (self.live.len() - 1, self.afresh.dealt);
        self.afresh.dealt += 1;
        let Some((slot, one)) = body else { return };
        let rank = block * WIDTH + lane;
        self.live[block] |= 1 << lane;
        self.slot_of[rank] = slot.0;
        self.rank_of[slot.index()] = small(rank);
        self.fat[block].set(lane, one);
    }

    /// Records the volume of each block.
    fn measure(&mut self) {
        let blocks = self.live.len();
        let (mut sum, mut count) = (0.0_f64, 0.0_f64);
        for block in 0..blocks {
            let bound = self.tree.bound(block);
            let sides = (0..3).map(|k| bound[k + 3] - bound[k]).sum::<f32>();
            if sides.is_finite() {
                sum += f64::from(sides);
                count += 3.0;
            }
        }
        #[allow(clippy::cast_possible_truncation, reason = "a cost")]
        let side = (sum / count.max(1.0)) as f32;
        self.afresh.side = side;
        let Afresh { reach: reaches, .. } = &mut self.afresh;
        reaches.clear();
        reaches.extend((0..blocks).map(|block| reach(self.tree.bound(block), side)));
        (self.afresh.excess, self.afresh.last) = (0.0, 0.0);
        self.afresh.laid = 0;
    }
}

/// The volume in which the centre of a box with such sides meets a bound; 0 for an empty bound.
fn reach(bound: &[f32; 6], side: f32) -> f32 {
    (0..3)
        .map(|k| (bound[k + 3] - bound[k] + side).max(0.0))
        .product()
}

/// Reads every box, in the order of the members, as corners.
struct TakeAll<'a, P> {
    origin: [f64; 3],
    bodies: &'a [BodySlot],
    proxies: &'a P,
    boxes: &'a mut Vec<[f32; 6]>,
}

impl<P: Proxies> Kernel for TakeAll<'_, P> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self {
            origin,
            bodies,
            proxies,
            boxes,
        } = self;
        boxes.clear();
        boxes.reserve(bodies.len());
        for (at, slot) in bodies.iter().enumerate() {
            if let Some(ahead) = bodies.get(at + AHEAD) {
                prefetch(proxies.aabb(*ahead));
            }
            boxes.push(outward(lanes, proxies.aabb(*slot), &origin).corners());
        }
    }
}

/// Writes every box to its lane and updates the tree; returns how many lie clear of their block's old bound.
pub(super) struct TakeLanes<'a, P> {
    pub(super) order: &'a mut Order,
    pub(super) proxies: &'a P,
}

impl<P: Proxies> Kernel for TakeLanes<'_, P> {
    type Out = usize;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> usize {
        let (order, proxies) = (self.order, self.proxies);
        let origin = order.origin;
        let mut jumps = 0;
        for block in 0..order.live.len() {
            let taking = Taking::of(&order.slot_of, block);
            let fat = &mut order.fat[block];
            for lane in ones(order.live[block]) {
                let aabb = proxies.aabb(taking.slot(lane, proxies));
                fat.set(lane, &outward(lanes, aabb, &origin).corners());
            }
            let met = lanes.meets(&order.fat[block], order.tree.bound(block));
            let jumped = order.live[block] & !met;
            order.afresh.jumped[block] = jumped;
            jumps += jumped.count_ones() as usize;
            let bound = lanes.bound(&order.fat[block], u16::MAX);
            order.tree.set(block, bound);
        }
        order.tree.refit(lanes);
        jumps
    }
}

/// Updates the bounds of some blocks, and the tree.
pub(super) struct Bound<'a, B> {
    pub(super) order: &'a mut Order,
    /// Ascending.
    pub(super) blocks: B,
}

impl<B: Iterator<Item = usize>> Kernel for Bound<'_, B> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        for block in self.blocks {
            let bound = lanes.bound(&self.order.fat[block], u16::MAX);
            self.order.tree.set(block, bound);
        }
        self.order.tree.refit(lanes);
    }
}
