//! Which lanes of which blocks are candidates: one record for each two blocks whose boxes are near each other.
//!
//! A record is two matrices of 16 by 16 bits: `cand` (the fat boxes overlap) and `hit` (the boxes themselves overlapped
//! at the last look). Begins and ends are differences of bits; a pair keeps its bit while both bodies keep their lanes,
//! whatever is renewed around it, so no map from pairs to places is needed.

use super::NONE;
use super::idle::shed;
use crate::ids::small;
use crate::simd::boxes::{LANES, WIDTH, prefetch};

/// Bits of lanes by lane.
pub(super) type Matrix = [u16; WIDTH];

/// No bit.
pub(super) const EMPTY: Matrix = [0; WIDTH];

/// The two matrices: rows are lanes of the lower block, bits those of the higher. Within one block only bits above the
/// row's own are used.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(super) struct Bits {
    /// The fat boxes overlap.
    pub(super) cand: Matrix,
    /// The boxes overlap; always within `cand`.
    pub(super) hit: Matrix,
}

/// Two blocks, the lower first, and the index of the record in the list of each.
#[derive(Clone, Copy, Debug)]
struct Ends {
    blocks: [u32; 2],
    places: [u32; 2],
}

/// Records per block that memory is reserved for at first: where few boxes overlap there are about five, and growth by
/// doubling would hold twice as many meanwhile.
const RECORDS: usize = 6;

/// Entries of a piece of a block's list.
const PIECE: usize = 15;

/// A piece of a block's list of records: only the first piece of a list may be partly filled.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(128))]
struct Piece {
    others: [u32; PIECE],
    records: [u32; PIECE],
    next: u32,
    len: u32,
}

/// All records and the lists of the blocks.
#[derive(Clone, Debug, Default)]
pub(super) struct Links {
    ends: Vec<Ends>,
    bits: Vec<Bits>,
    free: Vec<u32>,
    heads: Vec<u32>,
    pieces: Vec<Piece>,
    free_pieces: Vec<u32>,
}

impl Links {
    /// Drops every record and makes empty lists for `blocks` blocks.
    pub(super) fn reset(&mut self, blocks: usize) {
        self.ends.clear();
        self.bits.clear();
        self.free.clear();
        self.pieces.clear();
        self.free_pieces.clear();
        self.heads.clear();
        self.heads.resize(blocks, NONE);
    }

    /// One more than the highest record in use.
    pub(super) fn len(&self) -> u32 {
        small(self.ends.len())
    }

    /// Reserves half as many records again, so that the ticks until the next sort allocate nothing.
    pub(super) fn reserve(&mut self) {
        let blocks = self.heads.len();
        let (records, pieces) = (self.ends.len(), self.pieces.len());
        spare(&mut self.ends, records, blocks);
        spare(&mut self.bits, records, blocks);
        spare(&mut self.free, records, blocks);
        spare(&mut self.pieces, pieces, blocks);
        spare(&mut self.free_pieces, pieces, blocks);
    }

    /// Gives all memory back.
    pub(super) fn give_back(&mut self) {
        shed(&mut self.ends);
        shed(&mut self.bits);
        shed(&mut self.free);
        shed(&mut self.heads);
        shed(&mut self.pieces);
        shed(&mut self.free_pieces);
    }

    /// Reserves the lists of `blocks` blocks.
    pub(super) fn reserve_blocks(&mut self, blocks: usize) {
        room(&mut self.heads, blocks);
        room(&mut self.ends, RECORDS * blocks);
        room(&mut self.bits, RECORDS * blocks);
    }

    /// The matrices of a record.
    #[inline(always)]
    pub(super) fn bits(&self, record: u32) -> &Bits {
        &self.bits[record as usize]
    }

    /// The matrices of a record, to be changed.
    #[inline(always)]
    pub(super) fn bits_mut(&mut self, record: u32) -> &mut Bits {
        &mut self.bits[record as usize]
    }

    /// The two blocks of a record, the lower first.
    #[inline(always)]
    pub(super) fn blocks(&self, record: u32) -> [u32; 2] {
        self.ends[record as usize].blocks
    }

    /// Overlaps in all records.
    pub(super) fn hits(&self) -> usize {
        let used = self.ends.iter().zip(&self.bits);
        let used = used.filter(|(ends, _)| ends.blocks[0] != NONE);
        used.map(|(_, bits)| {
            bits.hit
                .iter()
                .map(|row| row.count_ones() as usize)
                .sum::<usize>()
        })
        .sum()
    }

    /// The records of a block: the other block (or itself), the record.
    #[inline(always)]
    pub(super) fn of(&self, block: u32) -> Listed<'_> {
        let head = self.heads[block as usize];
        Listed {
            pieces: &self.pieces,
            piece: self.pieces.get(head as usize),
            at: 0,
        }
    }

    /// Prefetches a block's list.
    #[inline(always)]
    pub(super) fn prefetch_list(&self, block: u32) {
        if let Some(piece) = self.pieces.get(self.heads[block as usize] as usize) {
            prefetch(piece);
        }
    }

    /// The record of two blocks. Scans both lists in step up to the shorter one's end, as the block of a huge body is
    /// near all others.
    pub(super) fn find(&self, a: u32, b: u32) -> Option<u32> {
        for (one, other) in self.of(a).zip(self.of(b)) {
            if one.0 == b {
                return Some(one.1);
            }
            if other.0 == a {
                return Some(other.1);
            }
        }
        None
    }

    /// A new record of two blocks that have none, `a <= b`.
    pub(super) fn add(&mut self, a: u32, b: u32, bits: Bits) -> u32 {
        debug_assert!(a <= b && self.find(a, b).is_none());
        let ends = Ends {
            blocks: [a, b],
            places: [NONE; 2],
        };
        let record = if let Some(record) = self.free.pop() {
            self.ends[record as usize] = ends;
            self.bits[record as usize] = bits;
            record
        } else {
            self.ends.push(ends);
            self.bits.push(bits);
            small(self.ends.len() - 1)
        };
        let first = self.push(a, b, record);
        let second = if a == b {
            first
        } else {
            self.push(b, a, record)
        };
        self.ends[record as usize].places = [first, second];
        record
    }

    /// Removes a record.
    pub(super) fn remove(&mut self, record: u32) {
        let Ends { blocks, .. } = self.ends[record as usize];
        self.unlist(blocks[0], record, 0);
        if blocks[0] != blocks[1] {
            self.unlist(blocks[1], record, 1);
        }
        self.ends[record as usize].blocks = [NONE; 2];
        self.free.push(record);
    }

    /// Appends to a block's list; returns the index.
    fn push(&mut self, block: u32, other: u32, record: u32) -> u32 {
        let head = self.heads[block as usize];
        let room = self
            .pieces
            .get(head as usize)
            .is_some_and(|piece| (piece.len as usize) < PIECE);
        let at = if room {
            head
        } else {
            let piece = Piece {
                others: [NONE; PIECE],
                records: [NONE; PIECE],
                next: head,
                len: 0,
            };
            let at = if let Some(at) = self.free_pieces.pop() {
                self.pieces[at as usize] = piece;
                at
            } else {
                self.pieces.push(piece);
                small(self.pieces.len() - 1)
            };
            self.heads[block as usize] = at;
            at
        };
        let piece = &mut self.pieces[at as usize];
        let k = piece.len as usize;
        piece.others[k] = other;
        piece.records[k] = record;
        piece.len += 1;
        at * LANES + small(k)
    }

    /// Removes a record from the list of one of its blocks: the list's last entry takes its place.
    fn unlist(&mut self, block: u32, record: u32, end: usize) {
        let place = self.ends[record as usize].places[end];
        let head = self.heads[block as usize];
        let piece = &mut self.pieces[head as usize];
        piece.len -= 1;
        let last = piece.len as usize;
        let (other, moved) = (piece.others[last], piece.records[last]);
        if piece.len == 0 {
            self.heads[block as usize] = piece.next;
            self.free_pieces.push(head);
        }
        if moved == record {
            return;
        }
        let hole = &mut self.pieces[place as usize / WIDTH];
        hole.others[place as usize % WIDTH] = other;
        hole.records[place as usize % WIDTH] = moved;
        let ends = &mut self.ends[moved as usize];
        for side in 0..2 {
            // A record within one block is in one list, for both ends.
            if ends.blocks[side] == block {
                ends.places[side] = place;
            }
        }
    }

    /// Checks lists, places and that every hit is a candidate.
    pub(super) fn validate(&self, live: &[u16]) -> Result<(), String> {
        let mut seen = 0;
        for block in 0..small(self.heads.len()) {
            for (other, record) in self.of(block) {
                let ends = self.ends[record as usize];
                let side = usize::from(ends.blocks[0] != block);
                seen += if other == block { 2 } else { 1 };
                let piece = self.pieces.get(ends.places[side] as usize / WIDTH);
                let stands =
                    piece.is_some_and(|p| p.records[ends.places[side] as usize % WIDTH] == record);
                if !stands || ends.blocks[side] != block || ends.blocks[1 - side] != other {
                    return Err(format!("record {record} stands wrong in block {block}"));
                }
            }
        }
        if seen != 2 * (self.ends.len() - self.free.len()) {
            return Err(format!("{seen} ends listed, not twice the records"));
        }
        for (ends, bits) in self.ends.iter().zip(&self.bits) {
            if ends.blocks[0] == NONE {
                continue;
            }
            let [a, b] = ends.blocks.map(|block| live[block as usize]);
            for row in 0..WIDTH {
                let wrong = bits.hit[row] & !bits.cand[row] != 0 || bits.cand[row] & !b != 0;
                if wrong || (bits.cand[row] != 0 && a >> row & 1 == 0) {
                    return Err(format!(
                        "row {row} of blocks {:?} holds stray bits",
                        ends.blocks
                    ));
                }
            }
        }
        Ok(())
    }
}

/// Iterates over the list of a block. A type of its own and no closures, so that it is inlined into loops for wide
/// lanes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Listed<'a> {
    pieces: &'a [Piece],
    piece: Option<&'a Piece>,
    at: usize,
}

impl Iterator for Listed<'_> {
    type Item = (u32, u32);

    #[inline(always)]
    fn next(&mut self) -> Option<(u32, u32)> {
        let piece = self.piece?;
        // A piece is never empty.
        let item = (piece.others[self.at], piece.records[self.at]);
        self.at += 1;
        if self.at >= (piece.len as usize).min(PIECE) {
            self.piece = self.pieces.get(piece.next as usize);
            self.at = 0;
        }
        Some(item)
    }
}

/// Reserves room in a list for `len` entries in all.
pub(super) fn room<T>(list: &mut Vec<T>, len: usize) {
    list.reserve(len.saturating_sub(list.len()));
}

/// Reserves what a list of `len` entries may grow to until the next sort: half as many again, plus `some`. If more is
/// needed, twice that is reserved, so that a sort which finds a few more entries than the last one allocates nothing.
pub(super) fn spare<T>(list: &mut Vec<T>, len: usize, some: usize) {
    if list.capacity() < len + len / 2 + some {
        room(list, 2 * len + 2 * some);
    }
}
