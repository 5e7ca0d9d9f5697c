//! Which lanes of which blocks overlap, found from scratch: a bit matrix for each two blocks with any overlap.
//!
//! In: boxes in their lanes, the tree over the blocks. Out: the overlaps of a tick in block order, so that two ticks
//! with the same lanes differ only in bits.

use super::bits::{Gathered, words};
use super::idle::shed;
use super::links::{EMPTY, Matrix, room, spare};
use super::{BodySlot, parts};
use crate::ids::{PairKey, small};
use crate::simd::boxes::{Kernel, Lanes, Level, Portable, WIDTH};

/// The overlaps of a tick.
#[derive(Debug, Default)]
pub(super) struct Met {
    /// By block: where its records begin; one more entry for the end of the last.
    firsts: Vec<u32>,
    /// By record: the other block, which is not before the record's own. Ascending within a block.
    others: Vec<u32>,
    /// By record: lanes of the other block, by lane of its own. Within one block only bits above the row's own are
    /// used.
    hits: Vec<Matrix>,
    /// Number of bits in all of them.
    count: usize,
}

impl Clone for Met {
    fn clone(&self) -> Self {
        let mut met = Self::default();
        met.clone_from(self);
        met
    }

    /// Reuses the memory.
    fn clone_from(&mut self, from: &Self) {
        self.firsts.clone_from(&from.firsts);
        self.others.clone_from(&from.others);
        self.hits.clone_from(&from.hits);
        self.count = from.count;
    }
}

impl Met {
    /// Clears it.
    pub(super) fn clear(&mut self) {
        self.firsts.clear();
        self.others.clear();
        self.hits.clear();
        self.count = 0;
    }

    /// Gives all memory back.
    pub(super) fn give_back(&mut self) {
        self.clear();
        shed(&mut self.firsts);
        shed(&mut self.others);
        shed(&mut self.hits);
    }

    /// Reserves room for more than it, or another of its size, holds: the number of records varies from tick to tick,
    /// and memory grows with it.
    pub(super) fn spare_for(&mut self, records: usize, blocks: usize) {
        room(&mut self.firsts, blocks + 1);
        spare(&mut self.others, records, blocks);
        spare(&mut self.hits, records, blocks);
    }

    /// Appends the records of the following blocks.
    pub(super) fn append(&mut self, next: &Self) {
        let before = small(self.len());
        self.firsts.pop();
        self.firsts.extend(next.firsts.iter().map(|at| at + before));
        self.others.extend_from_slice(&next.others);
        self.hits.extend_from_slice(&next.hits);
        self.count += next.count;
    }

    /// Number of records.
    pub(super) fn len(&self) -> usize {
        self.others.len()
    }

    /// Number of blocks.
    pub(super) fn blocks(&self) -> usize {
        self.firsts.len().saturating_sub(1)
    }

    /// The records of a block.
    #[inline(always)]
    fn of(&self, block: usize) -> std::ops::Range<usize> {
        self.firsts[block] as usize..self.firsts[block + 1] as usize
    }

    /// Begins the next block.
    #[inline(always)]
    pub(super) fn open_block(&mut self) {
        self.firsts.push(small(self.others.len()));
    }

    /// Adds records of the current block; those with any overlap are kept. Overlaps are counted by [`Met::add`].
    #[inline(always)]
    pub(super) fn push_all<'a>(
        &mut self,
        records: impl ExactSizeIterator<Item = (u32, &'a Matrix)>,
    ) {
        // Which records have an overlap is unpredictable: all are written, and empty ones are overwritten.
        let mut kept = self.others.len();
        self.others.resize(kept + records.len(), 0);
        self.hits.resize(kept + records.len(), EMPTY);
        for (other, hits) in records {
            self.others[kept] = other;
            self.hits[kept] = *hits;
            kept += usize::from(*hits != EMPTY);
        }
        self.others.truncate(kept);
        self.hits.truncate(kept);
    }

    /// Adds to the count of overlaps.
    #[inline(always)]
    pub(super) fn add(&mut self, overlaps: usize) {
        self.count += overlaps;
    }

    /// The record of two ranks' blocks, and row and lane in it.
    fn place(&self, ranks: [u32; 2]) -> Option<(usize, usize, usize)> {
        let (a, row) = parts(ranks[0].min(ranks[1]));
        let (b, lane) = parts(ranks[0].max(ranks[1]));
        let mine = self.of(a);
        let at = self.others[mine.clone()].binary_search(&small(b)).ok()?;
        Some((mine.start + at, row, lane))
    }

    /// Returns whether two ranks overlap.
    pub(super) fn has(&self, ranks: [u32; 2]) -> bool {
        let place = self.place(ranks);
        place.is_some_and(|(at, row, lane)| self.hits[at][row] >> lane & 1 == 1)
    }

    /// Removes the overlap of two ranks; returns whether it was there.
    pub(super) fn take_out(&mut self, ranks: [u32; 2]) -> bool {
        let Some((at, row, lane)) = self.place(ranks) else {
            return false;
        };
        let bits = &mut self.hits[at][row];
        let was = *bits >> lane & 1 == 1;
        *bits &= !(1 << lane);
        self.count -= usize::from(was);
        was
    }

    /// Number of overlaps.
    pub(super) fn hits(&self) -> usize {
        self.count
    }

    /// Number of overlaps, counted again.
    pub(super) fn recount(&self) -> usize {
        let rows = self.hits.iter().flatten();
        rows.map(|row| row.count_ones() as usize).sum()
    }

    /// Saves overlaps as pairs of body slots, and removes them; those of lanes that lost their body are not saved.
    ///
    /// * `lanes` - by block, lanes whose overlaps are removed; `None`: all.
    /// * `gone` - by block, lanes that lost their body.
    /// * `slot_of` - by rank, the body slot.
    pub(super) fn carry(
        &mut self,
        lanes: Option<&[u16]>,
        (gone, slot_of): (&[u16], &[u32]),
        level: Level,
        carried: &mut Vec<(u32, u32)>,
    ) {
        level.run(Carry {
            met: self,
            lanes,
            gone,
            slot_of,
            carried,
        });
    }
}

/// See [`Met::carry`].
struct Carry<'a> {
    met: &'a mut Met,
    lanes: Option<&'a [u16]>,
    gone: &'a [u16],
    slot_of: &'a [u32],
    carried: &'a mut Vec<(u32, u32)>,
}

impl Kernel for Carry<'_> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (met, gone) = (self.met, self.gone);
        if self.lanes.is_none() {
            self.carried.reserve(met.count);
        }
        let mut gathered = Gathered::new(self.slot_of, self.carried, |one, other| (one, other));
        for block in 0..met.blocks() {
            for at in met.of(block) {
                let other = met.others[at] as usize;
                let all = met.hits[at];
                let goes = match self.lanes {
                    None => all,
                    Some(chosen) if chosen[block] | chosen[other] == 0 => continue,
                    Some(chosen) => {
                        let stays = without(lanes, &all, chosen[block], chosen[other]);
                        met.hits[at] = stays;
                        minus(&all, &stays)
                    }
                };
                let lost = words(&goes).map(|word| word.count_ones() as usize);
                met.count -= lost.iter().sum::<usize>();
                let left = without(lanes, &goes, gone[block], gone[other]);
                gathered.put(&left, [block, other]);
            }
        }
        gathered.finish();
        if self.lanes.is_none() {
            met.clear();
        }
    }
}

/// A record that differs from that of the last tick, and its blocks.
#[derive(Clone, Copy, Debug, Default)]
struct Change {
    was: Matrix,
    is: Matrix,
    blocks: [usize; 2],
}

/// This many are collected before their bits are gathered: they stay in the first-level cache.
const CHANGES: usize = 64;

/// Reports overlaps that are in only one of two ticks with the same lanes, except lanes whose body left before the
/// second.
///
/// Which of the two ticks has a record is unpredictable: it selects what is read, without a branch.
pub(super) struct TellDifference<'a> {
    pub(super) before: &'a Met,
    pub(super) now: &'a Met,
    /// By block: lanes whose body has left since `before`.
    pub(super) gone: &'a [u16],
    /// By rank: the body slot.
    pub(super) slot_of: &'a [u32],
    /// Receives overlaps that are only in `before`.
    pub(super) parted: &'a mut Vec<PairKey>,
    /// Receives overlaps that are new.
    pub(super) began: &'a mut Vec<PairKey>,
}

impl Kernel for TellDifference<'_> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self {
            before,
            now,
            gone,
            slot_of,
            parted,
            began,
        } = self;
        let mut changes = [Change::default(); CHANGES];
        let mut len = 0;
        let mut goes = Gathered::new(slot_of, parted, key);
        let mut comes = Gathered::new(slot_of, began, key);
        for block in 0..now.blocks() {
            let (mut old, mut new) = (before.of(block), now.of(block));
            while !(old.is_empty() && new.is_empty()) {
                let head = |met: &Met, rest: &std::ops::Range<usize>| {
                    if rest.is_empty() {
                        u32::MAX
                    } else {
                        met.others[rest.start]
                    }
                };
                let heads = [head(before, &old), head(now, &new)];
                let other = heads[0].min(heads[1]);
                let [had, has] = heads.map(|head| usize::from(head == other));
                let record = |met: &Met, at: usize, there: usize| {
                    let hits = met.hits.get(at).unwrap_or(&EMPTY);
                    *[&EMPTY, hits][there]
                };
                let mut was = record(before, old.start, had);
                let is = record(now, new.start, has);
                old.start += had;
                new.start += has;
                let blocks = [block, other as usize];
                if gone[block] | gone[other as usize] != 0 {
                    was = without(lanes, &was, gone[block], gone[other as usize]);
                }
                // Field by field: copying a whole struct would wait for its parts to be stored.
                let change = &mut changes[len];
                (change.was, change.is, change.blocks) = (was, is, blocks);
                len += usize::from(was != is);
                if len == CHANGES {
                    gather(&changes, &mut goes, &mut comes);
                    len = 0;
                }
            }
        }
        gather(&changes[..len], &mut goes, &mut comes);
        goes.finish();
        comes.finish();
    }
}

/// Gathers the bits that went and those that came.
#[inline(always)]
fn gather<F: Fn(u32, u32) -> PairKey>(
    changes: &[Change],
    goes: &mut Gathered<'_, PairKey, F>,
    comes: &mut Gathered<'_, PairKey, F>,
) {
    for Change { was, is, blocks } in changes {
        // Word by word: done row by row, each row is extracted from a register and packed again.
        let (was, is) = (words(was), words(is));
        goes.put_words(std::array::from_fn(|word| was[word] & !is[word]), *blocks);
        comes.put_words(std::array::from_fn(|word| is[word] & !was[word]), *blocks);
    }
}

/// The pair of two body slots.
#[inline(always)]
fn key(one: u32, other: u32) -> PairKey {
    PairKey::new(BodySlot(one), BodySlot(other))
}

/// Reports every overlap.
pub(super) fn tell_all(met: &Met, slot_of: &[u32], began: &mut Vec<PairKey>) {
    tell_some(met, slot_of, began, |hits, _, _| *hits);
}

/// Reports every overlap of some lanes.
pub(super) fn tell_asked(met: &Met, asked: &[u16], slot_of: &[u32], began: &mut Vec<PairKey>) {
    tell_some(met, slot_of, began, |hits, block, other| {
        minus(hits, &without(Portable, hits, asked[block], asked[other]))
    });
}

/// Reports the bits that `left` returns for each record.
fn tell_some(
    met: &Met,
    slot_of: &[u32],
    began: &mut Vec<PairKey>,
    left: impl Fn(&Matrix, usize, usize) -> Matrix,
) {
    let mut gathered = Gathered::new(slot_of, began, key);
    for block in 0..met.blocks() {
        for at in met.of(block) {
            let other = met.others[at] as usize;
            gathered.put(&left(&met.hits[at], block, other), [block, other]);
        }
    }
    gathered.finish();
}

/// The bits that are in none of the given rows and columns.
#[inline(always)]
fn without<L: Lanes>(lanes: L, hits: &Matrix, rows: u16, columns: u16) -> Matrix {
    let goes = lanes.spread(rows);
    let mut left = [0; WIDTH];
    for row in 0..WIDTH {
        left[row] = hits[row] & !columns & !goes[row];
    }
    left
}

/// The bits of `one` that are not in `other`.
#[inline(always)]
fn minus(one: &Matrix, other: &Matrix) -> Matrix {
    let mut left = [0; WIDTH];
    for row in 0..WIDTH {
        left[row] = one[row] & !other[row];
    }
    left
}
