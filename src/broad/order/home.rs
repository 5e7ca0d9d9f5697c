//! The region of each block; a body that comes or moves away gets a lane in a near one.
//!
//! In: a box, the regions of the blocks. Out: a free lane.

use super::curve::centre;
use super::fatten::outward;
use super::sort::Sorter;
use super::tree::NO_BOUND;
use super::{BodySlot, Order, Proxies};
use crate::ids::small;
use crate::simd::boxes::{Boxes16, Down, Lanes, WIDTH};

/// When a block is no farther from a body than this, in mean sides of its box, the sixteen blocks before and after are
/// not tested.
const NEAR_ENOUGH: f32 = 0.5;

/// Empty regions.
pub(super) const NO_HOMES: Boxes16 = Boxes16 {
    faces: {
        let [low, _, _, high, _, _] = NO_BOUND;
        let (low, high) = ([low; WIDTH], [high; WIDTH]);
        [low, low, low, high, high, high]
    },
};

impl Order {
    /// The region of a block.
    #[inline(always)]
    pub(super) fn home(&self, block: usize) -> [f32; 6] {
        self.homes[block / WIDTH].get(block % WIDTH)
    }

    /// Sets the region of a block.
    #[inline(always)]
    pub(super) fn set_home(&mut self, block: usize, home: &[f32; 6]) {
        self.homes[block / WIDTH].set(block % WIDTH, home);
    }

    /// Widens the region of a block to contain a point.
    pub(super) fn widen_home(&mut self, block: usize, place: &[f32; 3]) {
        let mut home = self.home(block);
        widen(&mut home, place);
        self.set_home(block, &home);
    }

    /// A free lane for a body, the nearer the better, and its box.
    #[inline(always)]
    pub(super) fn lane_for<L: Lanes, P: Proxies>(
        &self,
        lanes: L,
        slot: BodySlot,
        proxies: &P,
    ) -> Option<(u32, Down)> {
        let one = outward(lanes, proxies.aabb(slot), &self.origin);
        // At this distance the box hardly stretches the block.
        let enough = one.mean_side() * NEAR_ENOUGH;
        let near = self.lane_near(&one.corners(), enough * enough);
        let rank = near
            .map(|(_, rank)| rank)
            .or_else(|| self.lane_in_attic())?;
        Some((rank, one))
    }

    /// A free lane near a box's position on the curve: in the block with the nearest region among the sixteen where it
    /// belongs, those before and those after; and the distance, squared.
    ///
    /// * `enough` - regions within this distance, squared, count as equally good.
    #[inline(always)]
    pub(super) fn lane_near(&self, one: &[f32; 6], enough: f32) -> Option<(f32, u32)> {
        let key = self.sorter.frame.key(one);
        let after = self.keys[..self.sorted].partition_point(|first| *first <= key);
        let mine = after.saturating_sub(1) / WIDTH;
        let (class, middle) = (Sorter::class_of(key), centre(one));
        let mut best = (f32::INFINITY, None);
        // Sixteen at a time: which block has room and is nearest is unpredictable for branches.
        for quarter in [Some(mine), mine.checked_sub(1), Some(mine + 1)] {
            let Some(quarter) = quarter.filter(|quarter| quarter * WIDTH < self.sorted) else {
                continue;
            };
            let far = self.far_from_free(&middle, quarter, class);
            let least = far.iter().fold(
                f32::INFINITY,
                |least, far| if *far < least { *far } else { least },
            );
            if least < best.0 {
                let at = far.iter().position(|far| *far <= least);
                best = (least, at.map(|at| quarter * WIDTH + at));
                // Infinite for an infinite body: one with room must have been found.
                if least <= enough {
                    break;
                }
            }
        }
        Some((best.0, self.free_lane(best.1?)))
    }

    /// The first free lane of a block that has one.
    fn free_lane(&self, block: usize) -> u32 {
        small(block * WIDTH) + (!self.live[block]).trailing_zeros()
    }

    /// Squared distances of a point from the regions of sixteen blocks; infinite for those of another class or without
    /// a free lane.
    #[inline(always)]
    fn far_from_free(&self, place: &[f32; 3], quarter: usize, class: u64) -> [f32; WIDTH] {
        let blocks = quarter * WIDTH..(quarter * WIDTH + WIDTH).min(self.sorted);
        // Blocks beyond `sorted` are not part of the order: the attic, and leftovers from before the last sort.
        let mut live = [u16::MAX; WIDTH];
        live[..blocks.len()].copy_from_slice(&self.live[blocks.clone()]);
        let homes = &self.homes[quarter];
        let mut far: [f32; WIDTH] = std::array::from_fn(|at| {
            let far = far_from(place, &homes.get(at));
            if live[at] == u16::MAX {
                f32::INFINITY
            } else {
                far
            }
        });
        let keys = &self.keys[blocks];
        let other = |key: &u64| Sorter::class_of(*key) != class;
        // Keys ascend.
        if keys.first().is_some_and(other) || keys.last().is_some_and(other) {
            for (far, key) in far.iter_mut().zip(keys) {
                *far = if other(key) { f32::INFINITY } else { *far };
            }
        }
        far
    }

    /// A free lane in an attic block.
    fn lane_in_attic(&self) -> Option<u32> {
        let mut attic = self.sorted..self.live.len();
        let block = attic.find(|block| self.live[*block] != u16::MAX)?;
        Some(self.free_lane(block))
    }
}

/// Widens a region to contain a point.
#[inline(always)]
pub(super) fn widen(home: &mut [f32; 6], place: &[f32; 3]) {
    for k in 0..3 {
        home[k] = home[k].min(place[k]);
        home[k + 3] = home[k + 3].max(place[k]);
    }
}

/// Squared distance of a point from a region; infinite if the region is empty.
#[inline(always)]
pub(super) fn far_from(place: &[f32; 3], home: &[f32; 6]) -> f32 {
    let mut sum = 0.0;
    for k in 0..3 {
        let (below, above) = (home[k] - place[k], place[k] - home[k + 3]);
        let apart = if below > above { below } else { above };
        let apart = if apart > 0.0 { apart } else { 0.0 };
        sum += apart * apart;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::broad::order::curve::Frame;
    use crate::broad::order::parts;
    use crate::builtin::Random;
    use crate::simd::boxes::Level;

    /// Blocks in order: four whole quarters and a part.
    const SORTED: usize = 75;

    fn cube(random: &mut Random, side: f32) -> [f32; 6] {
        let at = [(); 3].map(|()| f32::from(u16::try_from(random.bits() % 1000).unwrap()));
        std::array::from_fn(|k| if k < 3 { at[k] } else { at[k - 3] + side })
    }

    /// Blocks of two classes, a third of them full; what is stored behind them contains every place.
    fn stand(random: &mut Random) -> Order {
        let mut order = Order::new(Level::Portable);
        let side = |at| if at < 20 { 40.0 } else { 1.0 };
        let mut homes: Vec<_> = (0..SORTED).map(|at| cube(random, side(at))).collect();
        let frame = Frame::of(&homes);
        homes.sort_by_key(|one| frame.key(one));
        order.keys = homes.iter().map(|one| frame.key(one)).collect();
        (order.sorter.frame, order.sorted) = (frame, SORTED);
        order.live = vec![0x7FFF; SORTED + 5];
        for live in &mut order.live[..SORTED] {
            *live |= if random.bits().is_multiple_of(3) {
                u16::MAX
            } else {
                0
            };
        }
        order.homes = vec![NO_HOMES; order.live.len().div_ceil(WIDTH)];
        let all = [-1e6, -1e6, -1e6, 1e6, 1e6, 1e6];
        for block in 0..order.homes.len() * WIDTH {
            order.set_home(block, homes.get(block).unwrap_or(&all));
        }
        order
    }

    #[test]
    fn the_lane_found_is_in_the_nearest_block_of_the_class_with_room() {
        let mut random = Random::new(1);
        for _ in 0..50 {
            let order = stand(&mut random);
            for side in [1.0, 40.0, 1.0, 1.0] {
                let one = cube(&mut random, side);
                let key = order.sorter.frame.key(&one);
                let after = order.keys.partition_point(|first| *first <= key);
                let mine = after.saturating_sub(1) / WIDTH;
                let blocks = mine.saturating_sub(1) * WIDTH..((mine + 2) * WIDTH).min(SORTED);
                let far = |block: usize| far_from(&centre(&one), &order.home(block));
                let wanted = blocks
                    .filter(|block| order.live[*block] != u16::MAX)
                    .filter(|block| Sorter::class_of(order.keys[*block]) == Sorter::class_of(key))
                    .map(far)
                    .min_by(f32::total_cmp);
                // Nothing is near enough: all three quarters are tested.
                let found = order.lane_near(&one, -1.0);
                assert_eq!(
                    found.map(|(far, _)| far.to_bits()),
                    wanted.map(f32::to_bits)
                );
                if let Some((least, rank)) = found {
                    let (block, lane) = parts(rank);
                    assert!(order.live[block] >> lane & 1 == 0 && far(block) <= least);
                }
            }
        }
    }

    #[test]
    fn bug_a_body_without_end_looks_beyond_blocks_that_are_full() {
        let mut order = Order::new(Level::Portable);
        (order.keys, order.sorted) = (vec![0; 32], 32);
        order.live = [[0x7FFF; WIDTH], [u16::MAX; WIDTH]].concat();
        order.homes = vec![NO_HOMES; 2];
        let unit = [-1.0, -1.0, -1.0, 1.0, 1.0, 1.0];
        (0..32).for_each(|block| order.set_home(block, &unit));
        let endless = unit.map(|face| face * f32::INFINITY);
        assert!(order.lane_near(&endless, f32::INFINITY).is_some());
    }
}
