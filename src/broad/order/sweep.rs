//! The search for overlaps among all boxes, block by block.
//!
//! In: boxes in their lanes, the tree over the blocks. Out: a matrix of bits for each two blocks with any overlap
//! (`met`), and the pairs that rounding leaves open.
//!
//! How: in four passes over the blocks near one, each a loop without a branch that depends on the boxes. Which lanes
//! come near which block, how many they are and what they meet cannot be guessed: with a loop a pair of blocks, a
//! branch guessed wrong took longer than the comparisons.

use super::Order;
use super::links::{Matrix, room, small};
use super::met::Met;
use crate::simd::boxes::{Lanes, WIDTH, Work, prefetch, slack};

/// Blocks near one that are worked on together: what the passes hand on stays in the first cache.
const TOGETHER: usize = 64;
/// Blocks ahead whose boxes are asked for.
const AHEAD: usize = 2;

/// Lanes of a block, to be compared with the boxes of another, or of itself.
#[derive(Clone, Copy, Debug, Default)]
struct Side {
    block: u32,
    against: u32,
    lanes: u16,
}

/// What a box met: the place of its side, its lane, and lanes of the other block.
#[derive(Clone, Copy, Debug, Default)]
struct Hit {
    side: u16,
    lane: u16,
    met: u16,
}

/// What the passes hand on, kept over calls.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    /// Lowest nodes with blocks near one, and which; and those blocks.
    children: Vec<(u32, u16)>,
    near: Vec<u32>,
    /// One more than there can be, which the last step reads.
    sides: [Side; TOGETHER + 1],
    /// As long as the most there can be, and one more.
    hits: Vec<Hit>,
    matrices: [Matrix; TOGETHER],
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            children: Vec::new(),
            near: Vec::new(),
            sides: [Side::default(); TOGETHER + 1],
            hits: Vec::new(),
            matrices: [[0; WIDTH]; TOGETHER],
        }
    }
}

impl Scratch {
    /// Room for a block that is near every other.
    pub(super) fn reserve(&mut self, blocks: usize) {
        room(&mut self.children, blocks / WIDTH + 1);
        room(&mut self.near, blocks);
        self.hits.resize(TOGETHER * WIDTH + 1, Hit::default());
    }
}

/// Finds the overlaps of what stands in the lanes; returns how many boxes were compared with a block.
pub(super) struct Sweep<'a> {
    pub(super) order: &'a mut Order,
}

impl Work for Sweep<'_> {
    type Out = u64;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> u64 {
        let order = self.order;
        let mut scratch = std::mem::take(&mut order.afresh.scratch);
        let mut open = std::mem::take(&mut order.afresh.open);
        let mut met = std::mem::take(&mut order.afresh.found);
        met.clear();
        let mut tests = 0;
        for block in 0..order.live.len() {
            met.open_block();
            if block.is_multiple_of(WIDTH) {
                order.tree.query_nodes(lanes, block / WIDTH);
            }
            if order.live[block] == 0 {
                continue;
            }
            let mut near = std::mem::take(&mut scratch.near);
            let children = &mut scratch.children;
            (order.tree).query_among(lanes, small(block), children, &mut near);
            tests += near.len() as u64;
            for some in near.chunks(TOGETHER) {
                let (sides, boxes) = scratch.sift(lanes, order, block, some);
                let hits = scratch.compare(lanes, order, boxes);
                met.add(scratch.enter(lanes, order, (block, sides), hits, &mut open));
                scratch.record(block, sides, &mut met);
                tests += boxes as u64;
            }
            scratch.near = near;
        }
        met.open_block();
        order.afresh.scratch = scratch;
        order.afresh.open = open;
        order.afresh.found = met;
        tests
    }
}

impl Scratch {
    /// Of two blocks whose bounds meet, the fewer of the lanes that meet the other's bound; nothing where either has
    /// none. Returns how many sides there are, and how many lanes.
    #[inline(always)]
    fn sift<L: Lanes>(
        &mut self,
        lanes: L,
        order: &Order,
        block: usize,
        near: &[u32],
    ) -> (usize, usize) {
        let (mine, bound) = (&order.fat[block], order.tree.bound(block));
        let (mut kept, mut boxes) = (0, 0);
        for (at, other) in near.iter().enumerate() {
            if let Some(next) = near.get(at + AHEAD) {
                prefetch(&order.fat[*next as usize]);
            }
            let rows = lanes.meets(mine, order.tree.bound(*other as usize));
            let columns = lanes.meets(&order.fat[*other as usize], bound);
            let (few, many) = (rows.count_ones(), columns.count_ones());
            let rows_are_fewer = few <= many;
            let (block, other) = (small(block), *other);
            self.sides[kept] = if rows_are_fewer {
                Side {
                    block,
                    against: other,
                    lanes: rows,
                }
            } else {
                Side {
                    block: other,
                    against: block,
                    lanes: columns,
                }
            };
            let any = (rows != 0) & (columns != 0);
            kept += usize::from(any);
            boxes += if any { few.min(many) as usize } else { 0 };
        }
        (kept, boxes)
    }

    /// Compares each box of the sides with the block that it is near; returns how many met any.
    #[inline(always)]
    fn compare<L: Lanes>(&mut self, lanes: L, order: &Order, boxes: usize) -> usize {
        let (mut at, mut left, mut kept) = (0, self.sides[0].lanes, 0);
        for _ in 0..boxes {
            let side = &self.sides[at];
            let lane = left.trailing_zeros();
            let one = order.fat[side.block as usize].get(lane as usize);
            // Within a block each pair once, and none of a body with itself.
            let within = side.block == side.against;
            let among = if within {
                (u16::MAX << (lane & 15)) << 1
            } else {
                u16::MAX
            };
            let met = lanes.meets(&order.fat[side.against as usize], &one) & among;
            #[allow(clippy::cast_possible_truncation, reason = "below 16, below TOGETHER")]
            let hit = Hit {
                side: at as u16,
                lane: lane as u16,
                met,
            };
            self.hits[kept] = hit;
            kept += usize::from(met != 0);
            left &= left.wrapping_sub(1);
            at += usize::from(left == 0);
            left = if left == 0 {
                self.sides[at].lanes
            } else {
                left
            };
        }
        kept
    }

    /// Enters what was met into the matrices; what is not sure is noted as open. Returns how many pairs met.
    #[inline(always)]
    fn enter<L: Lanes>(
        &mut self,
        lanes: L,
        order: &Order,
        (block, sides): (usize, usize),
        hits: usize,
        open: &mut Vec<[u32; 2]>,
    ) -> usize {
        let mut pairs = 0;
        self.matrices[..sides].fill([0; WIDTH]);
        for hit in &self.hits[..hits] {
            let side = &self.sides[usize::from(hit.side)];
            let (one, other) = (side.block as usize, side.against as usize);
            let lane = 1 << hit.lane;
            pairs += hit.met.count_ones() as usize;
            // Rows are lanes of the block at hand.
            let (rows, columns) = if one == block {
                (lane, hit.met)
            } else {
                (hit.met, lane)
            };
            let matrix = &mut self.matrices[usize::from(hit.side)];
            for (row, line) in matrix.iter_mut().enumerate() {
                // A compare with a constant a row: wide on every level.
                *line |= if rows & (1 << row) != 0 { columns } else { 0 };
            }
            // Drawn in by its slack: what meets that surely overlaps it, as `Lanes::parts` tells.
            let by = slack(farthest(order.tree.bound(one)));
            let [x, y, z, u, v, w] = order.fat[one].get(usize::from(hit.lane));
            let less = [x + by, y + by, z + by, u - by, v - by, w - by];
            let mut doubt = hit.met & !lanes.meets(&order.fat[other], &less);
            while doubt != 0 {
                let theirs = other * WIDTH + doubt.trailing_zeros() as usize;
                open.push([one * WIDTH + usize::from(hit.lane), theirs].map(small));
                doubt &= doubt - 1;
            }
        }
        pairs
    }

    /// Records the matrices that hold any overlap.
    #[inline(always)]
    fn record(&self, block: usize, sides: usize, met: &mut Met) {
        for (side, hits) in self.sides[..sides].iter().zip(&self.matrices) {
            if hits.iter().fold(0, |all, row| all | row) != 0 {
                // The other of the two, or itself.
                met.push(side.block ^ side.against ^ small(block), *hits);
            }
        }
    }
}

/// How far the farthest face of a bound is from the origin: at least as far as that of any box in it.
#[inline(always)]
fn farthest(bound: &[f32; 6]) -> f32 {
    let mut largest = 0.0_f32;
    for face in bound {
        let far = face.abs();
        largest = if far > largest { far } else { largest };
    }
    largest
}
