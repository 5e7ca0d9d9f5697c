//! Lanes as bits: iteration over single bits, and over bits of matrices as pairs of table entries at their ranks.
//!
//! In: matrices of bits by two blocks. Out: a pair for each bit, in a list.
//!
//! The number of bits in a matrix is unpredictable, and most have one or two. So words that are not empty are gathered
//! first and then scanned bit by bit as if they were one matrix, with no branch that depends on where one ends and the
//! next begins.

use super::links::Matrix;
use crate::ids::small;
use crate::simd::boxes::{LANES, WIDTH};

/// Block and lane.
#[inline(always)]
pub(super) fn parts(rank: u32) -> (usize, usize) {
    (rank as usize / WIDTH, rank as usize % WIDTH)
}

/// The positions of the one bits, lowest first.
#[inline(always)]
pub(super) fn ones(bits: u16) -> Ones {
    Ones(bits)
}

/// See [`ones`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Ones(u16);

impl Iterator for Ones {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let at = self.0.trailing_zeros() as usize % WIDTH;
        self.0 &= self.0 - 1;
        Some(at)
    }
}

/// Iterates over the bits of some words as if they were one: each word with the position of each of its bits.
///
/// * `words` - with one extra word after the last that has a bit: it is read, and its value is not used.
/// * `ones` - how many bits they have.
#[inline(always)]
pub(super) fn each_bit<W: Copy>(
    words: &[W],
    ones: usize,
    bits: impl Fn(&W) -> u64,
) -> impl Iterator<Item = (W, u32)> {
    let (mut at, mut word) = (0, words[0]);
    let mut left = bits(&word);
    (0..ones).map(move |_| {
        let told = (word, left.trailing_zeros());
        left &= left.wrapping_sub(1);
        at += usize::from(left == 0);
        let next = words[at];
        (word, left) = if left == 0 {
            (next, bits(&next))
        } else {
            (word, left)
        };
        told
    })
}

/// Rows of a matrix in one word.
const ROWS: usize = u64::BITS as usize / WIDTH;
/// Words of a matrix.
const WORDS: usize = WIDTH / ROWS;

/// The rows of a matrix as words, the first in the lowest bits.
#[inline(always)]
pub(super) fn words(matrix: &Matrix) -> [u64; WORDS] {
    let rows = matrix.as_chunks::<ROWS>().0;
    std::array::from_fn(|word| {
        let lines = rows[word].iter().rev().map(|row| u64::from(*row));
        lines.fold(0, |bits, row| bits << WIDTH | row)
    })
}

/// Words that are gathered before they are scanned: they stay in the first-level cache.
const TOGETHER: usize = 256;

/// Some rows of a matrix, with the ranks of its first row and of its first lane.
#[derive(Clone, Copy, Debug, Default)]
struct Word {
    bits: u64,
    row: u32,
    lane: u32,
}

/// Words of matrices that have any bit, reported together: one pair per bit, made from the table entries of its two
/// ranks.
pub(super) struct Gathered<'a, T, F> {
    table: &'a [u32],
    pair: F,
    list: &'a mut Vec<T>,
    /// The last word is read after all are reported, and never written.
    words: [Word; TOGETHER + WORDS + 1],
    len: usize,
    bits: usize,
}

impl<'a, T, F: Fn(u32, u32) -> T> Gathered<'a, T, F> {
    /// Empty.
    ///
    /// * `table` - by rank.
    /// * `list` - pairs are appended to it.
    pub(super) fn new(table: &'a [u32], list: &'a mut Vec<T>, pair: F) -> Self {
        Self {
            table,
            pair,
            list,
            words: [Word::default(); TOGETHER + WORDS + 1],
            len: 0,
            bits: 0,
        }
    }

    /// Gathers the bits of a matrix.
    ///
    /// * `blocks` - that of the rows, and that of the lanes.
    #[inline(always)]
    pub(super) fn put(&mut self, matrix: &Matrix, blocks: [usize; 2]) {
        self.put_words(words(matrix), blocks);
    }

    /// Gathers the bits of a matrix that is given as words; see [`Gathered::put`].
    #[inline(always)]
    pub(super) fn put_words(&mut self, words: [u64; WORDS], blocks: [usize; 2]) {
        let [row, lane] = blocks.map(|block| small(block * WIDTH));
        for (row, bits) in (row..).step_by(ROWS).zip(words) {
            self.words[self.len] = Word { bits, row, lane };
            self.len += usize::from(bits != 0);
            self.bits += bits.count_ones() as usize;
        }
        if self.len > TOGETHER {
            self.tell();
        }
    }

    /// Reports what is left.
    #[inline(always)]
    pub(super) fn finish(mut self) {
        self.tell();
    }

    /// Reports what is gathered, and clears it.
    #[inline(always)]
    fn tell(&mut self) {
        let (table, pair) = (self.table, &self.pair);
        let bits = each_bit(&self.words, self.bits, |word| word.bits);
        self.list.extend(bits.map(|(word, bit)| {
            let (row, lane) = (word.row + bit / LANES, word.lane + bit % LANES);
            pair(table[row as usize], table[lane as usize])
        }));
        (self.len, self.bits) = (0, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::Random;

    #[test]
    fn every_bit_is_told_once_however_many_are_gathered() {
        let mut random = Random::new(1);
        // Each table entry is its own rank.
        let table: Vec<u32> = (0..64 * LANES).collect();
        for matrices in [0, 1, 2, 63, 500] {
            let (mut told, mut wanted) = (Vec::new(), Vec::new());
            let mut gathered = Gathered::new(&table, &mut told, |one, other| (one, other));
            for _ in 0..matrices {
                let blocks = [(); 2].map(|()| usize::try_from(random.bits() % 64).unwrap());
                // Empty matrices, full ones, and some of all densities between.
                let share = random.bits() % 5;
                let matrix = Matrix::map([0; WIDTH], |_: u16| {
                    (0..LANES).fold(0, |bits, _| {
                        bits << 1 | u16::from(random.bits() % 4 < share)
                    })
                });
                let [row, lane] = blocks.map(|block| small(block * WIDTH));
                for (row, bits) in (row..).zip(matrix) {
                    wanted.extend(ones(bits).map(|at| (row, lane + small(at))));
                }
                gathered.put(&matrix, blocks);
            }
            gathered.finish();
            assert_eq!(told, wanted, "{matrices} matrices");
        }
    }
}
