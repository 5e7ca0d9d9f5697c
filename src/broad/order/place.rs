//! Assignment of bodies to lanes: lanes are given up and taken, and from time to time everything is sorted again.

use super::curve::{CLASSES_MAX, Frame, SAMPLE, centre, fill, sampled};
use super::fatten::{Gait, outward};
use super::home::{NO_HOMES, widen};
use super::idle;
use super::links::{room, spare};
use super::sort::{FILL, Sorter};
use super::tree::NO_BOUND;
use super::{BodySlot, NONE, Order, Proxies, Tick, Work, ones, parts};
use crate::ids::small;
use crate::simd::boxes::{Boxes16, Down, Held, Portable, WIDTH};

/// Excess blocks met by queries that cost as much as sorting one body again, carrying its overlaps and finding its
/// candidates. Sorting when the excess has cost as much as a sort costs at most twice the best plan.
const WORN_PER_BODY: u64 = 20;
/// One block in this many stays empty after a sort, for bodies that find no free lane in their region.
pub(super) const ATTIC: usize = 16;

impl Order {
    /// Takes a body's lane away and saves its overlaps: it gets another lane in this tick.
    pub(super) fn evict(&mut self, slot: BodySlot) {
        let Some(rank) = self.rank(slot) else { return };
        let (block, lane) = parts(rank);
        let mut carried = std::mem::take(&mut self.carried);
        self.each_bit(rank, |bits| bits.hit, |other| carried.push((slot.0, other)));
        self.carried = carried;
        self.unlink(block, 1 << lane);
        self.vacate_lane(rank);
    }

    /// Takes away the lanes of bodies that left, block by block: most of the cost of a body is that of its block.
    pub(super) fn evict_all(&mut self, left: &[BodySlot]) {
        let mut ranks = std::mem::take(&mut self.worklist);
        ranks.clear();
        ranks.extend(left.iter().filter_map(|slot| self.rank(*slot)));
        ranks.sort_unstable();
        for of_block in ranks.chunk_by(|one, other| parts(*one).0 == parts(*other).0) {
            let gone = of_block
                .iter()
                .fold(0, |gone, rank| gone | 1 << parts(*rank).1);
            self.unlink(parts(of_block[0]).0, gone);
            for rank in of_block {
                self.vacate_lane(*rank);
            }
        }
        ranks.clear();
        self.worklist = ranks;
    }

    /// Removes some lanes of a block from all matrices.
    fn unlink(&mut self, block: usize, gone: u16) {
        let mut empty = std::mem::take(&mut self.emptied);
        let mut records = std::mem::take(&mut self.touched_records);
        records.extend(self.links.of(small(block)).map(|(_, record)| record));
        for record in records.drain(..) {
            let [a, b] = self.links.blocks(record).map(|block| block as usize);
            let bits = self.links.bits_mut(record);
            let mut any = 0;
            for row in 0..WIDTH {
                let mine = if a == block && gone >> row & 1 == 1 {
                    0
                } else {
                    u16::MAX
                };
                let theirs = if b == block { !gone } else { u16::MAX };
                bits.cand[row] &= mine & theirs;
                self.hits -= (bits.hit[row] & !(mine & theirs)).count_ones() as usize;
                bits.hit[row] &= mine & theirs;
                any |= bits.cand[row];
            }
            if any == 0 {
                empty.push(record);
            }
        }
        for record in empty.drain(..) {
            self.links.remove(record);
        }
        self.emptied = empty;
        self.touched_records = records;
    }

    /// Empties a lane that no matrix refers to any more.
    fn vacate_lane(&mut self, rank: u32) {
        let (block, lane) = parts(rank);
        let rank = rank as usize;
        let slot = std::mem::replace(&mut self.slot_of[rank], NONE);
        self.rank_of[slot as usize] = NONE;
        self.live[block] &= !(1 << lane);
        self.renewing[block] &= !(1 << lane);
        self.fat[block].set(lane, &[f32::NAN; 6]);
        if self.listed {
            self.sure[block].set(lane, &[f32::NAN; 6]);
        }
        self.exact[rank] = Down::EMPTY;
        self.held[slot as usize] = Held::EMPTY;
        self.ages[rank] = self.ages[rank].wrapping_add(1);
        self.len -= 1;
        self.lanes_changed += 1;
    }

    /// Returns whether the order has cost more than sorting again would.
    pub(super) fn is_worn(&self) -> bool {
        self.excess > WORN_PER_BODY * self.len as u64
    }

    /// Gives every homeless body a lane; `false` when one finds none.
    pub(super) fn settle<P: Proxies>(&mut self, tick: &Tick<'_, P>) -> bool {
        for at in 0..self.homeless.len() {
            let slot = self.homeless[at];
            let Some((rank, one)) = self.lane_for(Portable, slot, tick.proxies) else {
                return false;
            };
            // How it got here does not predict where it goes.
            self.gaits[rank as usize] = Gait::NEW;
            self.seat(slot, rank, one);
        }
        true
    }

    /// Gives a body a free lane and marks it for renewal.
    pub(super) fn seat(&mut self, slot: BodySlot, rank: u32, one: Down) {
        grow(&mut self.held, slot.index(), Held::EMPTY);
        self.sit(slot, rank, one);
        let (block, lane) = parts(rank);
        self.mark(block, 1 << lane);
    }

    /// Gives a body a free lane.
    pub(super) fn sit(&mut self, slot: BodySlot, rank: u32, one: Down) {
        let (block, lane) = parts(rank);
        grow(&mut self.rank_of, slot.index(), NONE);
        self.rank_of[slot.index()] = rank;
        self.slot_of[rank as usize] = slot.0;
        self.live[block] |= 1 << lane;
        self.len += 1;
        self.lanes_changed += 1;
        self.exact[rank as usize] = one;
    }

    /// Sorts everything again: every body, including homeless ones, gets a lane and a fat box, and all candidates are
    /// found.
    pub(super) fn sort_anew<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, done: &mut Work) {
        done.rebuilds += 1;
        self.carry_all();
        let bodies = tick.members.bounded();
        self.origin = middle(bodies, tick.proxies);
        let mut boxes = std::mem::take(&mut self.boxes);
        boxes.clear();
        boxes.extend(
            bodies
                .iter()
                .map(|slot| outward(Portable, tick.proxies.aabb(*slot), &self.origin).corners()),
        );
        self.sorter.frame = Frame::of(&boxes);
        self.lay_out(bodies, &boxes);
        self.hold_seen();
        self.boxes = boxes;
        self.give_back_sort();
        for rank in 0..self.slot_of.len() {
            if self.slot_of[rank] != NONE {
                _ = self.take(Portable, tick.proxies, BodySlot(self.slot_of[rank]), rank);
            }
        }
        self.lags = false;
        self.tree.reset(self.live.len());
        self.links.reset(self.live.len());
        self.hits = 0;
        self.renew_all(tick, done);
        self.restore(tick);
        idle::give_back(&mut self.carried, self.len);
        self.reserve(tick);
    }

    /// Reserves what the ticks until the next sort may need: memory grows in a sort, not in any tick.
    fn reserve<P>(&mut self, tick: &mut Tick<'_, P>) {
        let (bodies, blocks) = (self.len, self.live.len());
        // As many as possible at all; with many bodies, only as many as there are unless one is near half of the
        // others.
        let most = 2 * blocks + if idle::is_thrifty(bodies) { 0 } else { bodies };
        self.links.reserve();
        let entries = self.entries.len();
        spare(&mut self.entries, entries, 2 * bodies);
        for list in [
            &mut self.worklist,
            &mut self.touched_records,
            &mut self.emptied,
        ] {
            room(list, most);
        }
        self.gather.reserve(bodies);
        if !idle::is_thrifty(bodies) {
            room(&mut self.homeless, bodies);
            room(&mut self.found, bodies);
            room(tick.began, bodies);
            room(tick.parted, bodies);
        }
        self.tree.reserve();
        self.mender.reserve(blocks);
    }

    /// Saves every overlap.
    pub(super) fn carry_all(&mut self) {
        self.carried.reserve(self.hits);
        for block in 0..small(self.live.len()) {
            let (links, slot_of, carried) = (&self.links, &self.slot_of, &mut self.carried);
            for (other, record) in links.of(block) {
                if other < block {
                    continue;
                }
                for (row, bits) in links.bits(record).hit.into_iter().enumerate() {
                    for lane in ones(bits) {
                        let one = slot_of[block as usize * WIDTH + row];
                        carried.push((one, slot_of[other as usize * WIDTH + lane]));
                    }
                }
            }
        }
    }

    /// Reserves the blocks of `bodies` bodies.
    pub(super) fn reserve_blocks(&mut self, bodies: usize) {
        // The number of blocks depends on how many classes begin one: reserve the most there can be.
        let most = bodies / FILL + CLASSES_MAX;
        let most = most + most / ATTIC + 1;
        for list in [&mut self.live, &mut self.dirty, &mut self.renewing] {
            room(list, most);
        }
        room(&mut self.exact, most * WIDTH);
        room(&mut self.keys, most);
        room(&mut self.homes, most / WIDTH + 1);
        room(&mut self.quarters, most / WIDTH + 1);
        room(&mut self.middles, most / WIDTH + 1);
        room(&mut self.fat, most);
        room(&mut self.slot_of, most * WIDTH);
        self.tree.reserve_blocks(most);
        if self.afresh.on && idle::is_thrifty(bodies) {
            return;
        }
        if !idle::is_thrifty(bodies) {
            room(&mut self.sure, most);
        }
        room(&mut self.gaits, most * WIDTH);
        room(&mut self.ages, most * WIDTH);
        self.links.reserve_blocks(most);
        self.scratch.reserve(most);
    }

    /// Deals the sorted bodies to blocks; a class begins with its own block.
    fn lay_out(&mut self, bodies: &[BodySlot], boxes: &[[f32; 6]]) {
        self.keys.clear();
        self.homes.clear();
        self.quarters.clear();
        self.middles.clear();
        self.live.clear();
        self.slot_of.clear();
        self.reserve_blocks(bodies.len());
        self.former.clear();
        for slot in bodies {
            grow(&mut self.rank_of, slot.index(), NONE);
            let rank = self.rank_of[slot.index()] as usize;
            // Without candidates nothing is known about any body.
            if !self.gaits.is_empty() {
                let gait = self.gaits.get(rank).copied();
                self.former.push(gait.unwrap_or(Gait::NEW));
            }
        }
        self.gaits.clear();
        let span = self.afresh.probe.span();
        let mut sorter = std::mem::take(&mut self.sorter);
        for (key, index) in sorter.sort(boxes) {
            let starts = self.keys.last().is_none_or(|first| {
                let full = self
                    .live
                    .last()
                    .is_none_or(|live| live.count_ones() as usize == FILL);
                full || Sorter::class_of(*first) != Sorter::class_of(key)
            });
            if starts {
                self.keys.push(key);
                self.live.push(0);
                let quarters = self.live.len().div_ceil(WIDTH);
                self.homes.resize(quarters, NO_HOMES);
                self.quarters.resize(quarters, NO_BOUND);
                self.slot_of.resize(self.live.len() * WIDTH, NONE);
                self.gaits.resize(self.live.len() * WIDTH, Gait::NEW);
            }
            let block = self.live.len() - 1;
            let lane = self.live[block].trailing_ones() as usize;
            self.live[block] |= 1 << lane;
            let (rank, body) = (block * WIDTH + lane, bodies[index as usize]);
            self.slot_of[rank] = body.0;
            self.rank_of[body.index()] = small(rank);
            let one = &boxes[index as usize];
            let middle = centre(one);
            self.widen_home(block, &middle);
            widen(&mut self.quarters[block / WIDTH], &middle);
            let guess = || {
                let side = (one[3] - one[0] + one[4] - one[1] + one[5] - one[2]) / 3.0;
                span.map_or(Gait::NEW, |span| Gait::at_rest(span * side))
            };
            let gait = self.former.get(index as usize).copied();
            self.gaits[rank] = gait.unwrap_or_else(guess);
        }
        self.sorter = sorter;
        self.sorted = self.live.len();
        let blocks = self.sorted + self.sorted / ATTIC + 1;
        self.live.resize(blocks, 0);
        self.homes.resize(blocks.div_ceil(WIDTH), NO_HOMES);
        self.quarters.resize(blocks.div_ceil(WIDTH), NO_BOUND);
        self.middles.resize(self.quarters.len(), [f32::NAN; 3]);
        self.slot_of.resize(blocks * WIDTH, NONE);
        self.gaits.resize(blocks * WIDTH, Gait::NEW);
        self.len = bodies.len();
        for list in [&mut self.dirty, &mut self.renewing] {
            list.clear();
            list.resize(blocks, 0);
        }
        self.fat.clear();
        self.fat.resize(blocks, Boxes16::EMPTY);
        self.exact.clear();
        self.exact.resize(blocks * WIDTH, Down::EMPTY);
        self.ages.clear();
        self.ages.resize(blocks * WIDTH, 0);
    }
}

/// Grows a list by body so that it has an entry for `index`.
pub(super) fn grow<T: Clone>(list: &mut Vec<T>, index: usize, value: T) {
    if list.len() <= index {
        list.resize(index + 1, value);
    }
}

/// The median centre of the boxes on each axis. A few bodies far away do not affect it: coordinates far from it are
/// only coarse, by some ten millionths of the distance.
pub(super) fn middle<P: Proxies>(bodies: &[BodySlot], proxies: &P) -> [f64; 3] {
    let mut sample = [0.0; SAMPLE];
    std::array::from_fn(|k| {
        let middles = sampled(bodies.len()).map(|at| {
            let aabb = proxies.aabb(bodies[at]);
            aabb.min[k] * 0.5 + aabb.max[k] * 0.5
        });
        let sample = fill(&mut sample, middles.filter(|middle| middle.is_finite()));
        let half = sample.len() / 2;
        if half == sample.len() {
            return 0.0;
        }
        *sample.select_nth_unstable_by(half, f64::total_cmp).1
    })
}
