//! The sort: puts bodies along the curve, and splits them into blocks.

use super::curve::{CLASSES_MAX, CURVE_BITS, Cells, Frame, centre};
use super::idle::shed;
use crate::simd::boxes::WIDTH;

/// Bits of a body's index in the sorted words: `limits::BODIES_MAX` and more.
const INDEX_BITS: u32 = 28;
/// Bits per pass of the radix sort.
const DIGIT_BITS: u32 = 11;
const _: () = assert!(CLASSES_MAX.ilog2() + CURVE_BITS + INDEX_BITS <= u64::BITS);
/// How often cells are refined where bodies crowd in one: enough from any two to the finest.
const FINER: u32 = 8;

/// A frame of the curve and the memory of the sort.
#[derive(Clone, Debug, Default)]
pub(super) struct Sorter {
    pub(super) frame: Frame,
    /// A key in the upper bits, an index in the lower ones.
    words: Vec<u64>,
    spare: Vec<u64>,
    counts: Vec<u32>,
    middles: Vec<([f32; 3], u32)>,
}

impl Sorter {
    /// Gives all memory back; the frame stays.
    pub(super) fn give_back(&mut self) {
        shed(&mut self.words);
        shed(&mut self.spare);
    }

    /// The class in a key.
    pub(super) fn class_of(key: u64) -> u64 {
        key >> CURVE_BITS
    }

    /// Sorts; yields for each box, along the curve, its key and its index.
    pub(super) fn along_curve(
        &mut self,
        boxes: &[[f32; 6]],
    ) -> impl Iterator<Item = (u64, u32)> + '_ {
        self.begin(boxes);
        self.sorted()
    }

    /// Sorts; yields for each box, block by block, a key and its index. Keys ascend; all blocks of a stretch share one.
    pub(super) fn sort(&mut self, boxes: &[[f32; 6]]) -> impl Iterator<Item = (u64, u32)> + '_ {
        self.begin(boxes);
        self.split_some(boxes, 0, boxes.len());
        self.sorted()
    }

    /// The first part of [`Sorter::sort`]: along the curve.
    pub(super) fn begin(&mut self, boxes: &[[f32; 6]]) {
        self.words.clear();
        let all = boxes.iter().enumerate();
        (self.words).extend(all.map(|(index, one)| word(self.frame.key(one), index as u64)));
        let used = self.words.iter().fold(0, |all, word| all | word);
        let top = u64::BITS - used.leading_zeros();
        let mut shift = INDEX_BITS;
        while shift < top {
            self.pass(shift);
            shift += DIGIT_BITS;
        }
        if let Some(finest) = self.frame.finer() {
            refine(&mut self.words, boxes, finest, FINER);
        }
    }

    /// A portion of the second part of [`Sorter::sort`]: splits bodies from `from` on into blocks, `some` of them and
    /// the rest of a stretch. Returns where it ended.
    pub(super) fn split_some(&mut self, boxes: &[[f32; 6]], mut from: usize, some: usize) -> usize {
        let to = (from + some).min(self.words.len());
        while from < to {
            let (first, _) = unpacked(self.words[from]);
            let most = &self.words[from..(from + STRETCH).min(self.words.len())];
            let class = Self::class_of(first);
            let len = most.partition_point(|word| Self::class_of(unpacked(*word).0) == class);
            let stretch = &mut self.words[from..from + len];
            self.middles.clear();
            for word in &*stretch {
                let (_, index) = unpacked(*word);
                self.middles.push((centre(&boxes[index as usize]), index));
            }
            split(&mut self.middles, FILL);
            for (place, (_, index)) in stretch.iter_mut().zip(&self.middles) {
                *place = word(first, u64::from(*index));
            }
            from += len;
        }
        from
    }

    /// The result of the sort: that of [`Sorter::begin`], as far as it is split.
    pub(super) fn sorted(&self) -> impl Iterator<Item = (u64, u32)> + Clone + '_ {
        self.words.iter().map(|word| unpacked(*word))
    }

    /// One stable pass of the radix sort.
    fn pass(&mut self, shift: u32) {
        let digits = 1_usize << DIGIT_BITS;
        let digit = |word: u64| usize::try_from(word >> shift).unwrap_or(0) & (digits - 1);
        self.counts.clear();
        self.counts.resize(digits, 0);
        for word in &self.words {
            self.counts[digit(*word)] += 1;
        }
        let mut at = 0;
        for count in &mut self.counts {
            at += std::mem::replace(count, at);
        }
        self.spare.clear();
        self.spare.resize(self.words.len(), 0);
        for word in &self.words {
            let place = &mut self.counts[digit(*word)];
            self.spare[*place as usize] = *word;
            *place += 1;
        }
        std::mem::swap(&mut self.words, &mut self.spare);
    }
}

/// Sorts bodies that share a cell by finer cells, if they are more than a stretch: a scene of two groups far from each
/// other would otherwise have two cells.
///
/// * `words` - sorted by their keys, which stay.
/// * `finest` - most cells per metre.
fn refine(words: &mut [u64], boxes: &[[f32; 6]], finest: f64, deeper: u32) {
    let Some(deeper) = deeper.checked_sub(1) else {
        return;
    };
    let mut from = 0;
    // More bodies than a stretch with one key cover two positions that are half a stretch apart.
    while let Some(ahead) = words.get(from + STRETCH / 2) {
        let (key, _) = unpacked(words[from]);
        if unpacked(*ahead).0 != key {
            from += STRETCH / 2;
            continue;
        }
        let first = words[..from].partition_point(|word| unpacked(*word).0 < key);
        let end = from + words[from..].partition_point(|word| unpacked(*word).0 == key);
        let cell = &mut words[first..end];
        from = end;
        if cell.len() <= STRETCH {
            continue;
        }
        let index = |word: &u64| unpacked(*word).1;
        let middle = |word: &u64| centre(&boxes[index(word) as usize]);
        let cells = Cells::of(cell.len(), |at| middle(&cell[at]), finest);
        for one in &mut *cell {
            *one = word(cells.place(middle(one)), u64::from(index(one)));
        }
        cell.sort_unstable();
        if cells.are_coarse(finest) {
            refine(cell, boxes, finest, deeper);
        }
        for one in cell {
            *one = word(key, u64::from(index(one)));
        }
    }
}

/// A key above an index.
fn word(key: u64, index: u64) -> u64 {
    key << INDEX_BITS | index
}

/// A key and an index.
fn unpacked(word: u64) -> (u64, u32) {
    let index = word & ((1 << INDEX_BITS) - 1);
    (word >> INDEX_BITS, u32::try_from(index).unwrap_or(0))
}

/// Bodies that a sort puts in a block: one lane stays free for bodies that come later.
pub(super) const FILL: usize = WIDTH - 1;

/// Bodies that are split into blocks together: as many blocks as a tree node has children.
const STRETCH: usize = FILL * WIDTH;

/// Orders a stretch so that each of its blocks is compact: recursively halves it at the median along the longest axis.
/// The curve alone gives blocks that meet twice as many others.
///
/// * `fill` - bodies per block.
pub(super) fn split(middles: &mut [([f32; 3], u32)], fill: usize) {
    if middles.len() <= fill {
        return;
    }
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (middle, _) in &*middles {
        for k in 0..3 {
            low[k] = low[k].min(middle[k]);
            high[k] = high[k].max(middle[k]);
        }
    }
    let side = |k: &usize| high[*k] - low[*k];
    let axis = (0..3)
        .max_by(|a, b| side(a).total_cmp(&side(b)))
        .unwrap_or(0);
    let half = middles.len().div_ceil(fill).div_ceil(2) * fill;
    if half >= middles.len() {
        return;
    }
    // Ties by index, so that equal scenes are laid out equally.
    let by = |a: &([f32; 3], u32), b: &([f32; 3], u32)| {
        a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1))
    };
    middles.select_nth_unstable_by(half, by);
    let (one, other) = middles.split_at_mut(half);
    split(one, fill);
    split(other, fill);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(at: [f32; 3], side: f32) -> [f32; 6] {
        std::array::from_fn(|k| if k < 3 { at[k] } else { at[k - 3] + side })
    }

    #[test]
    fn the_largest_come_first_and_neighbours_stand_together() {
        let mut boxes = vec![cube([0.0; 3], 1000.0)];
        for i in 0..64_u8 {
            let at = [i & 1, i >> 1 & 1, i >> 2 & 1].map(f32::from);
            let side = if i % 2 == 0 { 0.9 } else { 1.1 };
            boxes.push(cube(at.map(|v| v * 100.0 + f32::from(i)), side));
        }
        let mut sorter = Sorter {
            frame: Frame::of(&boxes),
            ..Sorter::default()
        };
        let order: Vec<(u64, u32)> = sorter.sort(&boxes).collect();
        assert_eq!(order[0].1, 0);
        assert!(order.is_sorted_by_key(|(key, _)| *key));
        let classes: Vec<u64> = order
            .iter()
            .map(|(key, _)| Sorter::class_of(*key))
            .collect();
        assert!(classes[0] == 0 && classes[1..].iter().all(|class| *class == 1));
        let mut seen: Vec<u32> = order.iter().map(|(_, index)| *index).collect();
        seen.sort_unstable();
        assert_eq!(seen, (0..65).collect::<Vec<_>>());
    }

    #[test]
    fn in_a_thin_sheet_height_does_not_part_neighbours() {
        let mut boxes = Vec::new();
        for i in 0..4096_u16 {
            let (x, y) = (f32::from(i % 64), f32::from(i / 64));
            boxes.push(cube([x, y, f32::from(i % 101) * 1e-3], 0.9));
        }
        let mut sorter = Sorter {
            frame: Frame::of(&boxes),
            ..Sorter::default()
        };
        let order: Vec<u32> = sorter.along_curve(&boxes).map(|(_, index)| index).collect();
        // Sixteen in a row form a square of four by four, or nearly so.
        let spread = |k: usize| {
            let blocks = order.chunks_exact(16).map(|block| {
                let at = block.iter().map(|index| boxes[*index as usize][k]);
                let (low, high) = at.fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(x), h.max(x)));
                high - low
            });
            blocks.sum::<f32>() / 256.0
        };
        assert!(
            spread(0) < 6.0 && spread(1) < 6.0,
            "{} {}",
            spread(0),
            spread(1)
        );
    }
}
