//! Keeps the order good while bodies move, a little in each tick, so that sorting everything again is rare.
//!
//! Sixteen consecutive blocks form a quarter. Its region is what their bodies filled after the last sort of all; it
//! follows the common motion of its bodies. A body that has left its quarter moves to a lane in another; within a
//! quarter the bodies are dealt to the blocks again when the blocks have spread.

use super::curve::centre;
use super::fatten::Gait;
use super::glance::{Glance, LookOver};
use super::home::far_from;
use super::links::room;
use super::sort::{Sorter, split};
use super::tree::NO_BOUND;
use super::{BodySlot, MANY_CAME, NONE, Order, Proxies, Tick, ones, small};
use crate::simd::boxes::{Boxes16, Down, WIDTH};

/// A body farther outside its quarter than this, in its mean sides, looks for another block.
const DRIFT_SIDES: f32 = 0.5;
/// A body moves to a block whose squared distance is this many times smaller than that to its own region: a lane change
/// costs one or two microseconds. With less, lanes change for little gain; with more, bodies that stay stretch their
/// blocks.
const NEARER: f32 = 4.0;
/// Blocks whose bodies spread by this factor since they were dealt are dealt again: that costs about as much as
/// renewing all of them once more, and blocks this much longer meet twice as many others.
const MIXED: f32 = 1.2;
/// Blocks whose bodies have more overlaps than this, per body, are not dealt again: each overlap is carried to the new
/// lanes, and that costs more than it saves.
const CROWD: usize = 128;
/// Least bodies of a block that is dealt again: with fewer there would be many nearly empty blocks.
const FILL_LEAST: usize = 8;

/// A body on its way to another lane.
#[derive(Clone, Copy, Debug)]
struct Seat {
    slot: BodySlot,
    exact: Down,
    gait: Gait,
}

/// Memory kept across calls.
#[derive(Clone, Debug, Default)]
pub(super) struct Mender {
    seats: Vec<Seat>,
    middles: Vec<([f32; 3], u32)>,
    records: Vec<u32>,
}

impl Mender {
    /// Reserves memory for the quarters of any tick.
    pub(super) fn reserve(&mut self, records: usize) {
        room(&mut self.seats, WIDTH * WIDTH);
        room(&mut self.middles, WIDTH * WIDTH);
        room(&mut self.records, records);
    }
}

impl Order {
    /// Lanes of a block that are to be renewed and whose bodies have jumped out of its bound.
    fn jumped_clear(&self, block: usize) -> u16 {
        let bound = self.tree.bound(block);
        let mut clear = 0;
        for lane in ones(self.renewing[block]) {
            let one = self.exact[block * WIDTH + lane].corners();
            let meets = (0..3).all(|k| one[k] <= bound[k + 3] && bound[k] <= one[k + 3]);
            clear |= u16::from(!meets) << lane;
        }
        clear
    }

    /// Returns whether so many bodies came or jumped out of their blocks that sorting all again costs less than giving
    /// each a lane.
    pub(super) fn have_scattered(&self, bodies: usize) -> bool {
        let few = bodies / MANY_CAME;
        let mut count = self.homeless.len();
        let renewing = self.worklist.iter().map(|block| *block as usize);
        let most: u32 = (renewing.clone())
            .map(|block| self.renewing[block].count_ones())
            .sum();
        if count + most as usize <= few {
            return false;
        }
        for block in renewing {
            count += self.jumped_clear(block).count_ones() as usize;
        }
        count > few
    }

    /// Bodies that jumped out of their block's bound give up their lanes, to get one elsewhere.
    pub(super) fn rehome(&mut self) {
        for at in 0..self.worklist.len() {
            let block = self.worklist[at] as usize;
            for lane in ones(self.jumped_clear(block)) {
                let slot = BodySlot(self.slot_of[block * WIDTH + lane]);
                self.evict(slot);
                self.homeless.push(slot);
            }
        }
    }

    /// Moves renewed bodies to a nearer block if they are farther from their block's region than it is long: a block
    /// that kept a traveller would become as long as its path, and every query would meet it. Used when few move, as
    /// quarters are not mended then.
    pub(super) fn send_on(&mut self) {
        for at in 0..self.worklist.len() {
            let block = self.worklist[at] as usize;
            let home = self.home(block);
            let longest = (0..3).fold(0.0, |longest, k| (home[k + 3] - home[k]).max(longest));
            for lane in ones(self.renewing[block]) {
                let from = block * WIDTH + lane;
                let boxed = self.exact[from];
                let far = far_from(&centre(&boxed.corners()), &home);
                let side = boxed.mean_side().max(longest);
                if far > side * side {
                    self.move_nearer(from, far);
                }
            }
        }
    }

    /// Mends the quarters whose turn it is: bodies that have left one move, and a mixed-up quarter is dealt again.
    pub(super) fn mend<P: Proxies>(&mut self, tick: &Tick<'_, P>) {
        for quarter in 0..self.quarters.len() {
            let first = quarter * WIDTH;
            if !self.is_quarter_due(quarter) {
                continue;
            }
            self.catch_up(first..(first + WIDTH).min(self.live.len()), tick.proxies);
            let mut seen = self.look_over(quarter);
            self.follow(quarter, &seen);
            let mut drifted = false;
            for (block, seen) in (first..self.live.len()).zip(&seen) {
                let stay =
                    block < self.sorted && seen.is_within(&self.quarters[quarter], DRIFT_SIDES);
                drifted |= !stay && self.drift(block);
            }
            if drifted {
                seen = self.look_over(quarter);
            }
            // If two classes meet in a quarter, only its first class is dealt.
            let class = |block: usize| Sorter::class_of(self.keys[block]);
            let blocks = first..(first + WIDTH).min(self.sorted);
            let same = blocks.take_while(|block| class(*block) == class(first));
            let count = same.count();
            let end = first + count;
            if self.is_mixed(first, &seen[..count]) && !self.is_crowd(first, end) {
                self.deal(first, end);
            }
        }
    }

    /// Summary of the bodies of each block of a quarter.
    fn look_over(&self, quarter: usize) -> [Glance; WIDTH] {
        let first = quarter * WIDTH;
        let live = &self.live[first..(first + WIDTH).min(self.live.len())];
        let exact = &self.exact.as_chunks().0[first..];
        self.level.run(LookOver { live, exact })
    }

    /// Shifts the regions of a quarter and its blocks with the centre of its bodies: common motion does not mix them
    /// up.
    fn follow(&mut self, quarter: usize, seen: &[Glance; WIDTH]) {
        let (mut sum, mut bodies) = ([0.0_f32; 3], 0.0_f32);
        for block in seen {
            for (sum, of_block) in sum.iter_mut().zip(&block.sum) {
                *sum += of_block;
            }
            bodies += block.bodies;
        }
        if bodies == 0.0 {
            return;
        }
        let now = sum.map(|sum| sum / bodies);
        let before = std::mem::replace(&mut self.middles[quarter], now);
        // Unknown after a sort.
        if before[0].is_nan() {
            return;
        }
        let by: [f32; 3] = std::array::from_fn(|k| now[k] - before[k]);
        if by.iter().any(|by| !by.is_finite()) {
            return;
        }
        // An empty region is infinite, and is unchanged by this.
        let (homes, quarter) = (&mut self.homes[quarter], &mut self.quarters[quarter]);
        for (k, faces) in homes.faces.iter_mut().enumerate() {
            quarter[k] += by[k % 3];
            for face in faces {
                *face += by[k % 3];
            }
        }
    }

    /// Moves bodies of a block for which another block with a free lane is much nearer than their quarter; returns
    /// whether there were any.
    fn drift(&mut self, block: usize) -> bool {
        let mut drifted = false;
        for lane in ones(self.live[block]) {
            let from = block * WIDTH + lane;
            let boxed = self.exact[from];
            let one = boxed.corners();
            let far = if block < self.sorted {
                far_from(&centre(&one), &self.quarters[block / WIDTH])
            } else {
                f32::INFINITY
            };
            let side = boxed.mean_side();
            if far <= side * side * DRIFT_SIDES * DRIFT_SIDES {
                continue;
            }
            drifted |= self.move_nearer(from, far);
        }
        drifted
    }

    /// Moves a body to a block with a free lane whose distance is much less than `far`, squared; returns whether there
    /// is one.
    fn move_nearer(&mut self, from: usize, far: f32) -> bool {
        let boxed = self.exact[from];
        let nearer = self.lane_near(&boxed.corners(), 0.0);
        let Some((_, to)) = nearer.filter(|(near, _)| near * NEARER < far) else {
            return false;
        };
        let slot = BodySlot(self.slot_of[from]);
        let (gait, held) = (self.gaits[from], self.held[slot.index()]);
        self.evict(slot);
        self.seat(slot, to, boxed);
        let to = to as usize;
        (self.gaits[to], self.held[slot.index()]) = (gait, held);
        true
    }

    /// Returns whether the blocks have spread over much more space than when they were dealt.
    ///
    /// * `seen` - summaries of the blocks from `from` on.
    fn is_mixed(&self, from: usize, seen: &[Glance]) -> bool {
        let extent = |home: &[f32; 6]| {
            (0..3)
                .map(|k| (home[k + 3] - home[k]).max(0.0))
                .sum::<f32>()
        };
        let (mut dealt, mut now) = (0.0, 0.0);
        for (block, seen) in (from..).zip(seen) {
            dealt += extent(&self.home(block));
            now += extent(&seen.spread);
        }
        now > dealt * MIXED
    }

    /// Returns whether the bodies of some blocks have so many overlaps that dealing them again costs more than it
    /// saves.
    fn is_crowd(&self, from: usize, to: usize) -> bool {
        let bodies: usize = self.live[from..to]
            .iter()
            .map(|live| live.count_ones() as usize)
            .sum();
        let records = (from..to).flat_map(|block| self.links.of(small(block)));
        let rows = records.flat_map(|(_, record)| self.links.bits(record).hit);
        rows.map(|row| row.count_ones() as usize).sum::<usize>() > bodies * CROWD
    }

    /// Deals the bodies of some blocks to the same blocks again, each block compact. Their overlaps are carried.
    fn deal(&mut self, from: usize, to: usize) {
        let mut mender = std::mem::take(&mut self.mender);
        mender.seats.clear();
        mender.middles.clear();
        for block in from..to {
            self.carry_block(block, &mut mender.records);
            for lane in ones(self.live[block]) {
                let rank = block * WIDTH + lane;
                let middle = centre(&self.exact[rank].corners());
                mender.middles.push((middle, small(mender.seats.len())));
                mender.seats.push(Seat {
                    slot: BodySlot(self.slot_of[rank]),
                    exact: self.exact[rank],
                    gait: self.gaits[rank],
                });
            }
            self.vacate(block);
        }
        let bodies = mender.seats.len();
        let fill = bodies.div_ceil(to - from).max(FILL_LEAST);
        split(&mut mender.middles, fill);
        for (block, group) in (from..to).zip(mender.middles.chunks(fill)) {
            for (lane, (middle, index)) in group.iter().enumerate() {
                let seat = &mender.seats[*index as usize];
                let rank = block * WIDTH + lane;
                self.seat(seat.slot, small(rank), seat.exact);
                self.gaits[rank] = seat.gait;
                self.widen_home(block, middle);
            }
        }
        self.mender = mender;
    }

    /// Saves the overlaps of a block and removes its records.
    fn carry_block(&mut self, block: usize, records: &mut Vec<u32>) {
        records.clear();
        for (other, record) in self.links.of(small(block)) {
            records.push(record);
            let [a, b] = self
                .links
                .blocks(record)
                .map(|block| block as usize * WIDTH);
            debug_assert!(a / WIDTH == block || b / WIDTH == block || other == NONE);
            for (row, bits) in self.links.bits(record).hit.into_iter().enumerate() {
                for lane in ones(bits) {
                    let pair = (self.slot_of[a + row], self.slot_of[b + lane]);
                    self.carried.push(pair);
                    self.hits -= 1;
                }
            }
        }
        for record in records.drain(..) {
            self.links.remove(record);
        }
    }

    /// Empties a block that has no records. Its bound is recomputed in this tick.
    fn vacate(&mut self, block: usize) {
        for lane in ones(self.live[block]) {
            let rank = block * WIDTH + lane;
            self.rank_of[self.slot_of[rank] as usize] = NONE;
            self.slot_of[rank] = NONE;
            self.exact[rank] = Down::EMPTY;
            self.ages[rank] = self.ages[rank].wrapping_add(1);
        }
        self.len -= self.live[block].count_ones() as usize;
        self.live[block] = 0;
        self.renewing[block] = 0;
        self.fat[block] = Boxes16::EMPTY;
        if self.listed {
            self.sure[block] = Boxes16::EMPTY;
        }
        self.set_home(block, &NO_BOUND);
        self.worklist.push(small(block));
    }
}
