//! New fat boxes for bodies that left theirs, and the candidates that follow.
//!
//! First all fat boxes of the tick are written and the tree is refitted; then each block queries once, with the box
//! around its renewed lanes, and overwrites their rows and columns. So if two bodies leave their boxes in one tick,
//! each finds the other's new box, and since rows are overwritten, no pair is there twice.

mod scratch;

pub(super) use scratch::Scratch;

use scratch::Close;

use super::fatten::loose;
use super::links::{Bits, EMPTY, Matrix};
use super::look::sure;
use super::{BodySlot, NONE, Order, PairKey, Proxies, Tick, Work, ones, parts, small};
use crate::simd::boxes::{Held, Kernel, Lanes, WIDTH, prefetch};

impl Order {
    /// Renews the lanes marked in `renewing`.
    pub(super) fn renew<P>(&mut self, tick: &mut Tick<'_, P>, done: &mut Work) {
        self.worklist.sort_unstable();
        self.worklist.dedup();
        if self.worklist.is_empty() {
            return;
        }
        let level = self.level;
        let met = level.run(Renew {
            order: self,
            began: tick.began,
            parted: tick.parted,
            done,
        });
        let asked = self.worklist.len() as u64;
        // Counts below the usual are subtracted too, so that stretches of the order which always meet more do not count
        // as wear.
        self.excess = (self.excess + met).saturating_sub(asked * self.usual / 16);
    }

    /// Renews every lane, after a sort; the blocks met by a query now become the usual number.
    pub(super) fn renew_all<P>(&mut self, tick: &mut Tick<'_, P>, done: &mut Work) {
        self.worklist.clear();
        for block in 0..self.live.len() {
            self.renewing[block] = 0;
            self.mark(block, self.live[block]);
        }
        let level = self.level;
        let met = level.run(Renew {
            order: self,
            began: tick.began,
            parted: tick.parted,
            done,
        });
        self.usual = met * 16 / (self.worklist.len() as u64).max(1);
        self.excess = 0;
    }

    /// Restores the bits of pairs that lost their lanes while their boxes overlapped; those whose boxes do not overlap
    /// now have parted. Afterwards a bit that the list does not know of belongs to boxes that overlap, so the look
    /// finds it.
    pub(super) fn restore<P: Proxies>(&mut self, tick: &mut Tick<'_, P>) {
        for at in 0..self.carried.len() {
            let (one, other) = self.carried[at];
            let (one, other) = (BodySlot(one), BodySlot(other));
            let (Some(first), Some(second)) = (self.rank(one), self.rank(other)) else {
                continue;
            };
            if !tick.proxies.aabb(one).overlaps(tick.proxies.aabb(other)) {
                tick.parted.push(PairKey::new(one, other));
                continue;
            }
            let ((a, row), (b, lane)) = (parts(first.min(second)), parts(first.max(second)));
            let record = self.links.find(small(a), small(b));
            debug_assert!(record.is_some(), "boxes that overlap are candidates");
            if let Some(record) = record {
                let hit = &mut self.links.bits_mut(record).hit[row];
                self.hits += usize::from(*hit >> lane & 1 == 0);
                *hit |= 1 << lane;
            }
        }
    }

    /// Reports the pairs of the given bits as parted.
    fn tell_parted(&self, blocks: [u32; 2], gone: &Matrix, parted: &mut Vec<PairKey>) {
        let [a, b] = blocks.map(|block| block as usize * WIDTH);
        for (row, lanes) in gone.iter().enumerate() {
            for lane in ones(*lanes) {
                let (one, other) = (self.slot_of[a + row], self.slot_of[b + lane]);
                parted.push(PairKey::new(BodySlot(one), BodySlot(other)));
            }
        }
    }
}

struct Renew<'a> {
    order: &'a mut Order,
    began: &'a mut Vec<PairKey>,
    parted: &'a mut Vec<PairKey>,
    done: &'a mut Work,
}

impl Kernel for Renew<'_> {
    type Out = u64;

    /// Returns the number of blocks that all queries met.
    #[inline(always)]
    fn run<L: Lanes>(mut self, lanes: L) -> u64 {
        for at in 0..self.order.worklist.len() {
            let block = self.order.worklist[at] as usize;
            self.fatten(lanes, block);
        }
        self.order.tree.refit(lanes);
        let mut met = 0;
        let mut scratch = std::mem::take(&mut self.order.scratch);
        scratch.mark.resize(self.order.live.len(), (0, NONE));
        for at in 0..self.order.worklist.len() {
            let block = self.order.worklist[at];
            if self.order.renewing[block as usize] != 0 {
                met += self.ask(lanes, &mut scratch, block);
            }
        }
        self.order.scratch = scratch;
        met
    }
}

impl Renew<'_> {
    /// Writes the fat boxes of the renewed lanes of a block, and its bound.
    #[inline(always)]
    fn fatten<L: Lanes>(&mut self, lanes: L, block: usize) {
        let order = &mut *self.order;
        let renewing = order.renewing[block];
        let horizon = order.horizon(block);
        for lane in ones(renewing) {
            let rank = block * WIDTH + lane;
            let now = order.exact[rank];
            let held = &mut order.held[order.slot_of[rank] as usize];
            let hold = order.gaits[rank].renew(&now, order.beat, horizon, &held.hold());
            *held = Held::of(&hold);
            order.fat[block].set(lane, &loose(&hold.fat).corners());
            if order.listed {
                order.sure[block].set(lane, &sure(&hold));
            }
            order.ages[rank] = order.ages[rank].wrapping_add(1);
        }
        self.done.renewed += u64::from(renewing.count_ones());
        let bound = lanes.bound(&order.fat[block], u16::MAX);
        order.tree.set(block, bound);
    }

    /// Overwrites the candidates of the renewed lanes of a block; returns how many blocks its query met.
    #[inline(always)]
    fn ask<L: Lanes>(&mut self, lanes: L, scratch: &mut Scratch, block: u32) -> u64 {
        let order = &mut *self.order;
        let renewing = order.renewing[block as usize];
        let around = lanes.bound(&order.fat[block as usize], renewing);
        let stamp = scratch.next_stamp();
        scratch.have.clear();
        let (have, mark) = (&mut scratch.have, &mut scratch.mark);
        for (other, record) in order.links.of(block) {
            have.push((other, record));
            prefetch(order.links.bits(record));
            mark[other as usize] = (stamp, record);
        }
        scratch.near.clear();
        order.tree.query(lanes, &around, &mut scratch.near);
        let met = scratch.near.len() as u64;
        self.sift(lanes, scratch, block);
        for at in 0..scratch.close.len() {
            if let Some(next) = scratch.close.get(at + 2) {
                prefetch(&self.order.fat[next.block as usize]);
            }
            self.pair(lanes, block, scratch.close[at], renewing);
        }
        for at in 0..scratch.have.len() {
            let (other, record) = scratch.have[at];
            if scratch.mark[other as usize].0 == stamp {
                self.part(lanes, block, other, record, renewing);
            }
        }
        met
    }

    /// Selects from the blocks near a block those with anything near a renewed lane, or with a record to update. Most
    /// have neither; there is no branch on it here.
    #[inline(always)]
    fn sift<L: Lanes>(&mut self, lanes: L, scratch: &mut Scratch, block: u32) {
        let order = &*self.order;
        let (mine, renewing) = (&order.fat[block as usize], order.renewing[block as usize]);
        scratch.close.clear();
        let none = Close {
            block: 0,
            record: NONE,
            lanes: 0,
        };
        scratch.close.resize(scratch.near.len(), none);
        let mut kept = 0;
        for other in &scratch.near {
            let at = *other as usize;
            let known = &mut scratch.mark[at];
            let record = if known.0 == scratch.stamp {
                known.1
            } else {
                NONE
            };
            *known = (scratch.stamp + 1, NONE);
            // The other block is renewed completely in this tick, and has queried already.
            let asked = (*other < block) & (order.renewing[at] == order.live[at]);
            let close = lanes.meets(mine, order.tree.bound(at)) & renewing;
            scratch.close[kept] = Close {
                block: *other,
                record,
                lanes: close,
            };
            kept += usize::from(!asked & ((close != 0) | (record != NONE)));
        }
        scratch.close.truncate(kept);
        self.done.tests += scratch.near.len() as u64;
    }

    /// Finds the candidates between the renewed lanes of a block and another block, or within it.
    #[inline(always)]
    fn pair<L: Lanes>(&mut self, lanes: L, block: u32, close: Close, renewing: u16) {
        let order = &*self.order;
        let (other, record, sifted) = (close.block, close.record, close.lanes);
        let (mine, theirs) = (&order.fat[block as usize], &order.fat[other as usize]);
        self.done.tests += u64::from(sifted.count_ones());
        let mut cand: Matrix = if record == NONE {
            EMPTY
        } else {
            order.links.bits(record).cand
        };
        if block == other {
            for lane in ones(renewing) {
                let meets = lanes.meets(mine, &mine.get(lane)) & !(1 << lane);
                set_column(lanes, &mut cand, lane, meets & below(lane));
                cand[lane] = meets & !below(lane);
            }
        } else if block < other {
            clear(lanes, &mut cand, renewing, u16::MAX);
            for lane in ones(sifted) {
                cand[lane] = lanes.meets(theirs, &mine.get(lane));
            }
        } else {
            clear(lanes, &mut cand, u16::MAX, renewing);
            for lane in ones(sifted) {
                let meets = lanes.meets(theirs, &mine.get(lane));
                if meets != 0 {
                    set_column(lanes, &mut cand, lane, meets);
                }
            }
        }
        self.write(lanes, block, other, record, &cand, renewing);
    }

    /// Clears the candidates of the renewed lanes of a block in another block.
    #[inline(always)]
    fn part<L: Lanes>(&mut self, lanes: L, block: u32, other: u32, record: u32, renewing: u16) {
        let mut cand = self.order.links.bits(record).cand;
        if block < other {
            clear(lanes, &mut cand, renewing, u16::MAX);
        } else {
            clear(lanes, &mut cand, u16::MAX, renewing);
        }
        self.write(lanes, block, other, record, &cand, renewing);
    }

    /// Writes a matrix of candidates, and lists those of renewed lanes; pairs that overlapped and are no longer
    /// candidates have parted.
    #[inline(always)]
    fn write<L: Lanes>(
        &mut self,
        lanes: L,
        block: u32,
        other: u32,
        record: u32,
        cand: &Matrix,
        renewing: u16,
    ) {
        let (a, b) = (block.min(other), block.max(other));
        let any = *cand != EMPTY;
        let order = &mut *self.order;
        let record = if record == NONE {
            if !any {
                return;
            }
            let bits = Bits {
                cand: *cand,
                hit: EMPTY,
            };
            order.links.add(a, b, bits)
        } else {
            // Whole matrices, copied to locals and back: the compiler keeps each in one wide register.
            let bits = order.links.bits_mut(record);
            let hit = bits.hit;
            let gone = zip(&hit, cand, |hit, cand| hit & !cand);
            bits.hit = zip(&hit, cand, |hit, cand| hit & cand);
            bits.cand = *cand;
            if gone != EMPTY {
                let ones = gone.iter().map(|row| row.count_ones() as usize);
                order.hits -= ones.sum::<usize>();
                order.tell_parted([a, b], &gone, self.parted);
            }
            if !any {
                order.links.remove(record);
                return;
            }
            record
        };
        if order.listed {
            let mut chosen = *cand;
            if a == b {
                keep_either(lanes, &mut chosen, renewing);
            } else if block < other {
                clear(lanes, &mut chosen, !renewing, u16::MAX);
            } else {
                // If both lanes are renewed, the lower block lists the pair.
                let theirs = order.renewing[other as usize];
                clear(lanes, &mut chosen, theirs, u16::MAX);
                clear(lanes, &mut chosen, u16::MAX, !renewing);
            }
            order.list_bits(lanes, record, &chosen, self.began);
        }
    }
}

/// Combines two matrices row by row.
#[inline(always)]
fn zip(one: &Matrix, other: &Matrix, with: impl Fn(u16, u16) -> u16) -> Matrix {
    let mut out = [0; WIDTH];
    for row in 0..WIDTH {
        out[row] = with(one[row], other[row]);
    }
    out
}

/// Clears the bits that are in one of the given rows and one of the given columns.
#[inline(always)]
fn clear<L: Lanes>(lanes: L, matrix: &mut Matrix, rows: u16, columns: u16) {
    *matrix = zip(matrix, &lanes.spread(rows), |line, row| {
        line & !(row & columns)
    });
}

/// Keeps the bits whose row or column is in `chosen`.
#[inline(always)]
fn keep_either<L: Lanes>(lanes: L, matrix: &mut Matrix, chosen: u16) {
    *matrix = zip(matrix, &lanes.spread(chosen), |line, row| {
        line & (chosen | row)
    });
}

/// Bits below a lane.
#[inline(always)]
fn below(lane: usize) -> u16 {
    (1_u16 << lane).wrapping_sub(1)
}

/// Sets bit `lane` of each row.
#[inline(always)]
fn set_column<L: Lanes>(lanes: L, matrix: &mut Matrix, lane: usize, bits: u16) {
    let mask = 1 << lane;
    *matrix = zip(matrix, &lanes.spread(bits), |line, row| {
        line & !mask | row & mask
    });
}
