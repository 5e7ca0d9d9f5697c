//! The search for overlaps among all boxes, block by block.
//!
//! In: boxes in their lanes, the tree over the blocks. Out: a bit matrix for each two blocks with any overlap (`met`),
//! and the pairs that rounding leaves open.
//!
//! How: a block within itself, and then four passes over the others near it, each a loop without a branch that depends
//! on the boxes. Which lanes come near which block, how many there are and what they meet is unpredictable: with one
//! loop per pair of blocks, mispredicted branches took longer than the comparisons.

use crate::ids::small;
use std::ops::Range;

use super::bits::each_bit;
use super::idle::shed;
use super::links::{EMPTY, Matrix, room, spare};
use super::met::Met;
use super::near::Near;
use super::tree::{Tree, Walk};
use crate::simd::boxes::{Boxes16, Kernel, LANES, Lanes, WIDTH, prefetch, slack};

/// Nearby blocks that are processed together: what the passes hand on stays in the first-level cache.
const TOGETHER: usize = 64;
/// Sides whose lanes fit in a word.
const SIDES: usize = u64::BITS as usize / WIDTH;
/// Blocks ahead whose boxes are prefetched.
const AHEAD: usize = 2;

/// A block with some lanes to compare with the boxes of another block, or of itself.
#[derive(Clone, Copy, Debug, Default)]
struct Side {
    block: u32,
    against: u32,
}

/// Result for a box: the index of its side, its lane, and the lanes of the other block that it met.
#[derive(Clone, Copy, Debug, Default)]
struct Hit {
    side: u16,
    lane: u16,
    met: u16,
}

/// Totals of the passes over some near blocks.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    sides: usize,
    /// Boxes compared with a block.
    boxes: usize,
    hits: usize,
}

/// Input of a search: where the boxes are stored.
#[derive(Clone, Copy)]
pub(super) struct Field<'a> {
    /// By block: lanes in use.
    pub(super) live: &'a [u16],
    /// By block: the boxes.
    pub(super) fat: &'a [Boxes16],
    pub(super) tree: &'a Tree,
}

/// What a search found, and its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Finds {
    /// The overlaps, of the searched blocks only.
    pub(super) met: Met,
    /// Ranks of boxes whose overlap rounding leaves open.
    pub(super) open: Vec<[u32; 2]>,
    /// The near pairs, if only these are searched.
    pub(super) near: Vec<Near>,
    /// How many boxes were compared with a block.
    pub(super) tests: u64,
    scratch: Scratch,
}

impl Finds {
    /// Reserves memory for a search among that many blocks and bodies.
    pub(super) fn reserve(&mut self, blocks: usize, bodies: usize) {
        self.scratch.reserve(blocks);
        room(&mut self.open, bodies);
    }

    /// Gives back the memory of the results.
    pub(super) fn give_back(&mut self) {
        self.met.give_back();
        shed(&mut self.open);
        shed(&mut self.near);
    }

    /// Reserves room for more than it holds.
    pub(super) fn spare(&mut self) {
        let (records, blocks) = (self.met.len(), self.met.blocks());
        self.met.spare_for(records, blocks);
        let near = self.near.len();
        spare(&mut self.near, near, blocks);
    }

    /// Appends the results of the following blocks.
    pub(super) fn append(&mut self, next: &Self) {
        self.met.append(&next.met);
        self.open.extend_from_slice(&next.open);
        self.near.extend_from_slice(&next.near);
        self.tests += next.tests;
    }
}

/// Data passed between the passes, kept across calls.
#[derive(Clone, Debug)]
struct Scratch {
    walk: Walk,
    /// Blocks near one.
    near: Vec<u32>,
    sides: [Side; TOGETHER],
    /// By side: lanes to compare. With one extra word, since several are read together.
    lanes: [u16; TOGETHER + SIDES],
    /// As long as the most hits possible, plus one.
    hits: Vec<Hit>,
    matrices: [Matrix; TOGETHER],
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            walk: Walk::default(),
            near: Vec::new(),
            sides: [Side::default(); TOGETHER],
            lanes: [0; TOGETHER + SIDES],
            hits: Vec::new(),
            matrices: [[0; WIDTH]; TOGETHER],
        }
    }
}

impl Scratch {
    /// Reserves memory for a block that is near every other.
    fn reserve(&mut self, blocks: usize) {
        self.walk.reserve(blocks);
        room(&mut self.near, blocks + WIDTH);
        self.hits.resize(TOGETHER * WIDTH + 1, Hit::default());
    }
}

/// What is searched for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Search {
    /// Overlaps, as matrices, and pairs that rounding leaves open.
    Overlaps,
    /// Near pairs, appended to those already listed.
    Near,
}

/// Searches some blocks against themselves and every later block.
pub(super) struct Sweep<'a> {
    pub(super) field: Field<'a>,
    /// From a multiple of `WIDTH` on.
    pub(super) blocks: Range<usize>,
    pub(super) finds: &'a mut Finds,
    pub(super) search: Search,
}

impl Kernel for Sweep<'_> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (field, finds) = (self.field, self.finds);
        // Moved out of the reference, and back: the compiler then keeps the lists' ends in registers.
        let mut scratch = std::mem::take(&mut finds.scratch);
        let mut open = std::mem::take(&mut finds.open);
        let mut met = std::mem::take(&mut finds.met);
        let mut listed = std::mem::take(&mut finds.near);
        met.clear();
        open.clear();
        let mut tests = 0;
        for block in self.blocks {
            met.open_block();
            if block.is_multiple_of(WIDTH) {
                let walk = &mut scratch.walk;
                field.tree.query_nodes(lanes, block / WIDTH, walk);
            }
            if field.live[block] == 0 {
                continue;
            }
            let mut near = std::mem::take(&mut scratch.near);
            let walk = &mut scratch.walk;
            (field.tree).query_among(lanes, small(block), walk, &mut near);
            tests += near.len() as u64;
            for some in near.chunks(TOGETHER) {
                let mut count = Count::default();
                let others = match some {
                    // A block is near itself, and comes first.
                    [first, others @ ..] if *first == small(block) => {
                        scratch.within(lanes, field, block, &mut count);
                        others
                    }
                    others => others,
                };
                scratch.sift(lanes, field, (block, others), &mut count);
                scratch.compare(lanes, field, &mut count);
                if self.search == Search::Near {
                    scratch.list(count, &mut listed);
                } else {
                    met.add(scratch.enter(lanes, field, block, count, &mut open));
                    scratch.record(block, count, &mut met);
                }
                tests += count.boxes as u64;
            }
            scratch.near = near;
        }
        met.open_block();
        *finds = Finds {
            met,
            open,
            near: listed,
            tests,
            scratch,
        };
    }
}

impl Scratch {
    /// Compares the boxes of a block with one another: each pair once.
    ///
    /// All lanes, in use or not: which ones are is unpredictable.
    #[inline(always)]
    fn within<L: Lanes>(&mut self, lanes: L, field: Field<'_>, block: usize, count: &mut Count) {
        let boxes = &field.fat[block];
        // A local copy, which no list can alias: it stays in registers.
        let (mine, against) = (*boxes, small(block));
        self.sides[0] = Side {
            block: against,
            against,
        };
        // No lane is left to compare.
        self.lanes[0] = 0;
        for lane in 0..LANES {
            let behind = (u16::MAX << lane) << 1;
            let met = lanes.meets(&mine, &boxes.get(lane as usize)) & behind;
            #[allow(clippy::cast_possible_truncation, reason = "below 16")]
            let hit = Hit {
                side: 0,
                lane: lane as u16,
                met,
            };
            self.hits[count.hits] = hit;
            count.hits += usize::from(met != 0);
        }
        count.sides = 1;
        count.boxes = field.live[block].count_ones() as usize;
    }

    /// For two blocks whose bounds meet: of the lanes of either that meet the other's bound, takes the smaller set;
    /// nothing if either set is empty.
    #[inline(always)]
    fn sift<L: Lanes>(
        &mut self,
        lanes: L,
        field: Field<'_>,
        (block, near): (usize, &[u32]),
        count: &mut Count,
    ) {
        // Copies, as above.
        let (mine, bound) = (field.fat[block], *field.tree.bound(block));
        let Count {
            sides: mut kept,
            mut boxes,
            ..
        } = *count;
        for (at, other) in near.iter().enumerate() {
            if let Some(next) = near.get(at + AHEAD) {
                prefetch(&field.fat[*next as usize]);
            }
            let rows = lanes.meets(&mine, field.tree.bound(*other as usize));
            let columns = lanes.meets(&field.fat[*other as usize], &bound);
            let (few, many) = (rows.count_ones(), columns.count_ones());
            let rows_are_fewer = few <= many;
            let (block, against) = (small(block), *other);
            self.sides[kept] = if rows_are_fewer {
                Side { block, against }
            } else {
                Side {
                    block: against,
                    against: block,
                }
            };
            self.lanes[kept] = if rows_are_fewer { rows } else { columns };
            let any = (rows != 0) & (columns != 0);
            kept += usize::from(any);
            boxes += if any { few.min(many) as usize } else { 0 };
        }
        self.lanes[kept..kept + SIDES].fill(0);
        (count.sides, count.boxes) = (kept, boxes);
    }

    /// Compares each box of the sides with the block that it is near.
    #[inline(always)]
    fn compare<L: Lanes>(&mut self, lanes: L, field: Field<'_>, count: &mut Count) {
        let mut kept = count.hits;
        for first in (0..count.sides).step_by(SIDES) {
            // The number of lanes of a side is unpredictable: one loop runs over several sides.
            let some = self.lanes[first..first + SIDES].iter().rev();
            let mut left = some.fold(0, |left, lanes| left << WIDTH | u64::from(*lanes));
            while left != 0 {
                let bit = left.trailing_zeros() as usize;
                left &= left - 1;
                let (at, lane) = (first + bit / WIDTH, bit % WIDTH);
                let side = &self.sides[at % TOGETHER];
                // Both references are loaded before a lane is read: it then goes from memory to all lanes in one step.
                let (block, against) = (
                    &field.fat[side.block as usize],
                    &field.fat[side.against as usize],
                );
                let met = lanes.meets(against, &block.get(lane));
                #[allow(clippy::cast_possible_truncation, reason = "below 16, below TOGETHER")]
                let hit = Hit {
                    side: at as u16,
                    lane: lane as u16,
                    met,
                };
                self.hits[kept] = hit;
                kept += usize::from(met != 0);
            }
        }
        count.hits = kept;
    }

    /// Enters the hits into the matrices; uncertain ones are listed as open. Returns how many pairs met.
    #[inline(always)]
    fn enter<L: Lanes>(
        &mut self,
        lanes: L,
        field: Field<'_>,
        block: usize,
        Count { sides, hits, .. }: Count,
        open: &mut Vec<[u32; 2]>,
    ) -> usize {
        let mut pairs = 0;
        self.matrices[..sides].fill(EMPTY);
        // A box that meets another shrunk by the slack of either certainly overlaps it, see `Lanes::parts`: a face of
        // the other that is farther out than the slack allows for is passed by more than its rounding error.
        let by = slack(farthest(field.tree.bound(block)));
        for hit in &self.hits[..hits] {
            let side = &self.sides[usize::from(hit.side)];
            let (one, other) = (side.block as usize, side.against as usize);
            let lane = 1 << hit.lane;
            pairs += hit.met.count_ones() as usize;
            // Rows are lanes of the current block.
            let (rows, columns) = if one == block {
                (lane, hit.met)
            } else {
                (hit.met, lane)
            };
            let matrix = &mut self.matrices[usize::from(hit.side)];
            for (line, row) in matrix.iter_mut().zip(lanes.spread(rows)) {
                *line |= columns & row;
            }
            let [x, y, z, u, v, w] = field.fat[one].get(usize::from(hit.lane));
            let less = [x + by, y + by, z + by, u - by, v - by, w - by];
            let mut doubt = hit.met & !lanes.meets(&field.fat[other], &less);
            while doubt != 0 {
                let theirs = other * WIDTH + doubt.trailing_zeros() as usize;
                open.push([one * WIDTH + usize::from(hit.lane), theirs].map(small));
                doubt &= doubt - 1;
            }
        }
        pairs
    }

    /// Lists the hits as near pairs.
    #[inline(always)]
    fn list(&self, Count { hits, .. }: Count, listed: &mut Vec<Near>) {
        let pairs = self.hits[..hits].iter().map(|hit| hit.met.count_ones());
        let pairs = pairs.sum::<u32>() as usize;
        let bits = each_bit(&self.hits[..=hits], pairs, |hit| u64::from(hit.met));
        listed.extend(bits.map(|(hit, bit)| {
            let side = &self.sides[usize::from(hit.side) % TOGETHER];
            let one = side.block * LANES + u32::from(hit.lane);
            Near::new(one, side.against * LANES + bit)
        }));
    }

    /// Records the matrices that hold any overlap.
    #[inline(always)]
    fn record(&self, block: usize, Count { sides, .. }: Count, met: &mut Met) {
        let sides = self.sides[..sides].iter().zip(&self.matrices);
        // The other of the two blocks, or the block itself.
        met.push_all(sides.map(|(side, hits)| (side.block ^ side.against ^ small(block), hits)));
    }
}

/// Distance of the farthest face of a bound from the origin: at least that of any box in it.
#[inline(always)]
fn farthest(bound: &[f32; 6]) -> f32 {
    let mut largest = 0.0_f32;
    for face in bound {
        let far = face.abs();
        largest = if far > largest { far } else { largest };
    }
    largest
}
