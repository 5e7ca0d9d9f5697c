//! The search for overlaps among all boxes, block by block.
//!
//! In: boxes in their lanes, the tree over the blocks. Out: a matrix of bits for each two blocks with any overlap
//! (`met`), and the pairs that rounding leaves open.
//!
//! How: a block within itself, and then four passes over the others near it, each a loop without a branch that depends
//! on the boxes. Which lanes come near which block, how many they are and what they meet cannot be guessed: with a loop
//! a pair of blocks, a branch guessed wrong took longer than the comparisons.

use crate::ids::small;
use std::ops::Range;

use super::bits::each_bit;
use super::idle::shed;
use super::links::{EMPTY, Matrix, room, spare};
use super::met::Met;
use super::near::Near;
use super::tree::{Tree, Walk};
use crate::simd::boxes::{Boxes16, LANES, Lanes, WIDTH, Work, prefetch, slack};

/// Blocks near one that are worked on together: what the passes hand on stays in the first cache.
const TOGETHER: usize = 64;
/// Sides whose lanes make a word.
const SIDES: usize = u64::BITS as usize / WIDTH;
/// Blocks ahead whose boxes are asked for.
const AHEAD: usize = 2;

/// A block of which some lanes are to be compared with the boxes of another, or of itself.
#[derive(Clone, Copy, Debug, Default)]
struct Side {
    block: u32,
    against: u32,
}

/// What a box met: the place of its side, its lane, and lanes of the other block.
#[derive(Clone, Copy, Debug, Default)]
struct Hit {
    side: u16,
    lane: u16,
    met: u16,
}

/// What the passes over some near blocks have come to.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    sides: usize,
    /// Boxes compared with a block.
    boxes: usize,
    hits: usize,
}

/// Where the boxes stand: what a search reads.
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
    /// The overlaps, of the searched blocks alone.
    pub(super) met: Met,
    /// Ranks of boxes for which rounding leaves it open.
    pub(super) open: Vec<[u32; 2]>,
    /// What is near, where that alone is asked for.
    pub(super) near: Vec<Near>,
    /// How many boxes were compared with a block.
    pub(super) tests: u64,
    scratch: Scratch,
}

impl Finds {
    /// Room for a search among so many blocks and bodies.
    pub(super) fn reserve(&mut self, blocks: usize, bodies: usize) {
        self.scratch.reserve(blocks);
        room(&mut self.open, bodies);
    }

    /// Gives the memory of what was found back.
    pub(super) fn give_back(&mut self) {
        self.met.give_back();
        shed(&mut self.open);
        shed(&mut self.near);
    }

    /// Room for more than it holds.
    pub(super) fn spare(&mut self) {
        let (records, blocks) = (self.met.len(), self.met.blocks());
        self.met.spare_for(records, blocks);
        let near = self.near.len();
        spare(&mut self.near, near, blocks);
    }

    /// Puts what was found among the blocks that follow behind.
    pub(super) fn append(&mut self, next: &Self) {
        self.met.append(&next.met);
        self.open.extend_from_slice(&next.open);
        self.near.extend_from_slice(&next.near);
        self.tests += next.tests;
    }
}

/// What the passes hand on, kept over calls.
#[derive(Clone, Debug)]
struct Scratch {
    walk: Walk,
    /// Blocks near one.
    near: Vec<u32>,
    sides: [Side; TOGETHER],
    /// By side: lanes to compare. A word more than there can be: some are read together.
    lanes: [u16; TOGETHER + SIDES],
    /// As long as the most there can be, and one more.
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
    /// Room for a block that is near every other.
    fn reserve(&mut self, blocks: usize) {
        self.walk.reserve(blocks);
        room(&mut self.near, blocks + WIDTH);
        self.hits.resize(TOGETHER * WIDTH + 1, Hit::default());
    }
}

/// What is searched for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Search {
    /// Overlaps, as matrices, and what rounding leaves open.
    Overlaps,
    /// What is near, behind what is listed already.
    Near,
}

/// Searches some blocks and every block behind them.
pub(super) struct Sweep<'a> {
    pub(super) field: Field<'a>,
    /// From a multiple of `WIDTH` on.
    pub(super) blocks: Range<usize>,
    pub(super) finds: &'a mut Finds,
    pub(super) search: Search,
}

impl Work for Sweep<'_> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (field, finds) = (self.field, self.finds);
        // Out of what is behind a reference, and back: the compiler keeps the ends of the lists in registers.
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
                    // It is near itself, and the first that is.
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
    /// All lanes, in use or not: which are is a guess that fails.
    #[inline(always)]
    fn within<L: Lanes>(&mut self, lanes: L, field: Field<'_>, block: usize, count: &mut Count) {
        let boxes = &field.fat[block];
        // A copy of its own, which no list can change: it stays in registers.
        let (mine, against) = (*boxes, small(block));
        self.sides[0] = Side {
            block: against,
            against,
        };
        // None is left to be compared.
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

    /// Of two blocks whose bounds meet, the fewer of the lanes that meet the other's bound; nothing where either has
    /// none.
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
            // How many lanes a side has is a guess that fails: it is made once for some.
            let some = self.lanes[first..first + SIDES].iter().rev();
            let mut left = some.fold(0, |left, lanes| left << WIDTH | u64::from(*lanes));
            while left != 0 {
                let bit = left.trailing_zeros() as usize;
                left &= left - 1;
                let (at, lane) = (first + bit / WIDTH, bit % WIDTH);
                let side = &self.sides[at % TOGETHER];
                // Both are at hand before a lane is read: it then goes from memory to all lanes in one step.
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

    /// Enters what was met into the matrices; what is not sure is noted as open. Returns how many pairs met.
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
        // What meets a box drawn in by the slack of either surely overlaps it, as `Lanes::parts` tells: a face of the
        // other that is farther out than the slack is made for is passed by more than it was rounded by.
        let by = slack(farthest(field.tree.bound(block)));
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

    /// Lists what was met.
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
        // The other of the two, or itself.
        met.push_all(sides.map(|(side, hits)| (side.block ^ side.against ^ small(block), hits)));
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
