//! The look when few bodies moved: the candidates of each are looked up in the matrices.
//!
//! In: moved bodies, matrices of candidates, boxes by rank. Out: pairs that began and pairs that parted, and their
//! bits.
//!
//! How: in three passes over some bodies at a time, with no branch on the boxes except for the few pairs that change.
//! Which blocks near a body hold a candidate, how many they hold and whether boxes overlap is unpredictable, and other
//! bodies move in each tick: a mispredicted branch takes longer than a comparison.

use super::bits::each_bit;
use super::idle::{give_back, is_thrifty};
use super::links::{Bits, Links, Matrix, room};
use super::look::{is_as_before, overlap, verdict};
use super::{BodySlot, MANY_MOVED, Order, Proxies, Tick, Work, parts, small};
use crate::simd::boxes::{Down, Kernel, LANES, Lanes, WIDTH, prefetch};

/// While at least one in this many bodies moved, an existing candidate list is kept: to list them again costs as much
/// as some ticks, so the list is dropped later than it is made.
const STILL_MANY: usize = 14;
/// Ticks with few moved bodies for which candidates stay listed: to list them again costs about as much as this many
/// looks at the list, so in the worst case the cost is twice the least.
const STILL_TICKS: u8 = 3;
/// Moved bodies ahead whose block lists are prefetched, and those whose matrices are.
const AHEAD_LISTS: usize = 8;
const AHEAD_BITS: usize = 4;
/// Blocks with candidates that are gathered before a comparison: they stay in the first-level cache.
const TOGETHER: usize = 64;

/// Candidates of a body in a block.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    record: u32,
    /// Rank of the body, and of the first lane of the block.
    rank: u32,
    first: u32,
    /// Lanes of the block: the candidates, and those of them that overlapped.
    cand: u16,
    hit: u16,
}

/// A candidate.
#[derive(Clone, Copy, Debug, Default)]
struct Pair {
    record: u32,
    ranks: [u32; 2],
    hit: bool,
}

/// A candidate that may have begun or parted.
#[derive(Clone, Copy, Debug)]
struct Found {
    record: u32,
    ranks: [u32; 2],
    /// Whether the boxes overlap; `None` where rounding leaves it open.
    now: Option<bool>,
}

/// Memory of the look, kept across ticks.
#[derive(Clone, Debug, Default)]
pub(super) struct Gather {
    /// One more than are gathered: the entry after the last is written and read, but never kept.
    rows: Vec<Row>,
    len: usize,
    pairs: Vec<Pair>,
    found: Vec<Found>,
    tests: u64,
}

impl Gather {
    /// Reserves memory for a tick of `bodies` bodies.
    pub(super) fn reserve(&mut self, bodies: usize) {
        self.rows.resize(TOGETHER + 1, Row::default());
        room(&mut self.pairs, TOGETHER * WIDTH);
        if !is_thrifty(bodies) {
            room(&mut self.found, bodies);
        }
    }

    /// Gathers the candidates of the body at a rank.
    #[inline(always)]
    fn put<L: Lanes>(&mut self, lanes: L, links: &Links, exact: &[Down], rank: u32) {
        let (block, lane) = parts(rank);
        let mine = small(block);
        for (other, record) in links.of(mine) {
            let Bits { cand, hit } = links.bits(record);
            // Rows are lanes of the lower block; within one block a pair may be in either.
            let all = |yes: bool| u16::from(yes).wrapping_neg();
            let (rows, columns) = (all(mine <= other), all(other <= mine));
            let of =
                |matrix: &Matrix| (matrix[lane] & rows) | (lanes.column(matrix, lane) & columns);
            let (cand, hit) = (of(cand), of(hit));
            self.rows[self.len] = Row {
                record,
                rank,
                first: other * LANES,
                cand,
                hit,
            };
            self.len += usize::from(cand != 0);
            if self.len == TOGETHER {
                self.compare(lanes, exact);
            }
        }
    }

    /// Compares what is gathered, and clears it.
    #[inline(always)]
    fn compare<L: Lanes>(&mut self, lanes: L, exact: &[Down]) {
        let rows = &self.rows[..=self.len];
        let candidates: u32 = rows[..self.len]
            .iter()
            .map(|row| row.cand.count_ones())
            .sum();
        self.tests += u64::from(candidates);
        let bits = each_bit(rows, candidates as usize, |row| u64::from(row.cand));
        self.pairs.clear();
        self.pairs.extend(bits.map(|(row, lane)| {
            let ranks = [row.rank, row.first + lane];
            prefetch(&exact[ranks[1] as usize]);
            Pair {
                record: row.record,
                ranks,
                hit: row.hit >> lane & 1 == 1,
            }
        }));
        self.len = 0;
        for pair in &self.pairs {
            let [a, b] = pair.ranks.map(|rank| &exact[rank as usize]);
            let parts = lanes.parts(a, b);
            if !is_as_before(pair.hit, parts) {
                self.found.push(Found {
                    record: pair.record,
                    ranks: pair.ranks,
                    now: verdict(parts),
                });
            }
        }
    }
}

impl Order {
    /// Returns whether so many moved that candidates are scanned as a list. With hysteresis in number and in time: to
    /// list all candidates again costs as much as some ticks.
    pub(super) fn are_many(&mut self, moved: usize) -> bool {
        let share = if self.listed { STILL_MANY } else { MANY_MOVED };
        if moved * share > self.len {
            self.still = 0;
            return true;
        }
        self.still = self.still.saturating_add(1);
        self.listed && self.still <= STILL_TICKS
    }

    /// Tests the candidates of moved bodies, one by one.
    pub(super) fn look_at_moved<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, done: &mut Work) {
        self.give_back_list();
        let mut gather = std::mem::take(&mut self.gather);
        // After candidates were dropped there is no memory; a sort reserves what it finds.
        gather.reserve(0);
        gather.tests = 0;
        self.level.run(LookAtMoved {
            order: self,
            moved: tick.moved,
            gather: &mut gather,
        });
        done.tests += gather.tests;
        for found in &gather.found {
            let [one, other] = found.ranks;
            let now = found
                .now
                .unwrap_or_else(|| overlap(&self.slot_of, found.ranks, tick.proxies));
            // If both bodies moved, the pair is found twice.
            self.put_hit(found.record, [one.min(other), one.max(other)], now, tick);
        }
        give_back(&mut gather.found, self.len);
        self.gather = gather;
    }

    /// Prefetches data of the next bodies, which are far apart in memory.
    #[inline(always)]
    fn prefetch_ahead(&self, moved: &[BodySlot]) {
        let rank = |ahead: usize| moved.get(ahead).and_then(|slot| self.rank(*slot));
        if let Some(rank) = rank(AHEAD_LISTS) {
            self.links.prefetch_list(small(parts(rank).0));
        }
        if let Some(rank) = rank(AHEAD_BITS) {
            for (_, record) in self.links.of(small(parts(rank).0)) {
                prefetch(self.links.bits(record));
            }
        }
    }
}

/// See [`Order::look_at_moved`].
struct LookAtMoved<'a> {
    order: &'a Order,
    moved: &'a [BodySlot],
    gather: &'a mut Gather,
}

impl Kernel for LookAtMoved<'_> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self {
            order,
            moved,
            gather,
        } = self;
        // Moved out of the reference, and back: see `sweep`.
        let mut kept = std::mem::take(gather);
        for at in 0..moved.len() + order.homeless.len() {
            let slot = match moved.get(at) {
                Some(slot) => *slot,
                None => order.homeless[at - moved.len()],
            };
            order.prefetch_ahead(moved.get(at..).unwrap_or(&[]));
            if let Some(rank) = order.rank(slot) {
                kept.put(lanes, &order.links, &order.exact, rank);
            }
        }
        kept.compare(lanes, &order.exact);
        *gather = kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::Random;
    use crate::simd::boxes::Level;

    /// Tests the candidates of some ranks.
    struct Ask<'a>(&'a Links, &'a [Down], &'a [u32], &'a mut Gather);

    impl Kernel for Ask<'_> {
        type Out = ();

        #[inline(always)]
        fn run<L: Lanes>(self, lanes: L) {
            for rank in self.2 {
                self.3.put(lanes, self.0, self.1, *rank);
            }
            self.3.compare(lanes, self.1);
        }
    }

    #[test]
    fn what_changed_is_found_in_every_block_on_every_side() {
        let mut random = Random::new(1);
        // More blocks than are gathered at a time, half of them before the body's block.
        let (blocks, mine, lane) = (3 * TOGETHER, TOGETHER + TOGETHER / 2, 5);
        let rank = small(mine * WIDTH + lane);
        let mut exact = vec![Down::EMPTY; blocks * WIDTH];
        exact[rank as usize] = Down::of([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
        let mut links = Links::default();
        links.reset(blocks);
        let (mut wanted, mut candidates) = (Vec::new(), 0);
        for block in 0..blocks {
            let mut bits = Bits::default();
            // Random candidates of other bodies, in rows and lanes that are not the body's; in each fourth block the
            // body itself has none.
            for row in (0..WIDTH).filter(|row| *row != lane) {
                #[allow(clippy::cast_possible_truncation, reason = "any bits will do")]
                let others = random.bits() as u16 & !(1 << lane);
                (bits.cand[row], bits.hit[row]) = (others, others & others << 1);
            }
            if block % 4 == 3 {
                links.add(small(mine.min(block)), small(mine.max(block)), bits);
                continue;
            }
            let cand = [(); 3].map(|()| usize::try_from(random.bits() % 16).unwrap());
            for other in cand
                .into_iter()
                .filter(|other| block != mine || *other != lane)
            {
                let theirs = block * WIDTH + other;
                let [now, before] = [(); 2].map(|()| random.bits().is_multiple_of(2));
                // Some touch within the rounding error.
                let open = random.bits().is_multiple_of(8);
                let x = match (open, now) {
                    (true, _) => 1.0,
                    (_, true) => 0.5,
                    _ => 2.0,
                };
                exact[theirs] = Down::of([x, 0.0, 0.0, x + 1.0, 1.0, 1.0]);
                // The lower rank is the row.
                let (row, bit) = if small(theirs) < rank {
                    (other, lane)
                } else {
                    (lane, other)
                };
                if bits.cand[row] >> bit & 1 == 1 {
                    bits.hit[row] &= !(1 << bit);
                    wanted.retain(|(rank, _)| *rank != small(theirs));
                } else {
                    candidates += 1;
                }
                bits.cand[row] |= 1 << bit;
                bits.hit[row] |= u16::from(before) << bit;
                if open || now != before {
                    wanted.push((small(theirs), (!open).then_some(now)));
                }
            }
            links.add(small(mine.min(block)), small(mine.max(block)), bits);
        }
        for level in Level::available() {
            let mut gather = Gather::default();
            gather.reserve(0);
            level.run(Ask(&links, &exact, &[rank], &mut gather));
            let mut found: Vec<(u32, Option<bool>)> = (gather.found.iter())
                .map(|found| (found.ranks[1], found.now))
                .collect();
            found.sort_unstable();
            wanted.sort_unstable();
            assert!(gather.found.iter().all(|found| found.ranks[0] == rank));
            assert_eq!(
                (found, gather.tests),
                (wanted.clone(), candidates),
                "{level:?}"
            );
        }
    }
}
