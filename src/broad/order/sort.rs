//! The order: classes of size, largest first, and within a class the Morton curve.

use super::idle::shed;
use crate::math::morton_bits;
use crate::simd::boxes::WIDTH;

/// Bits of the curve on each axis. A cell is then an eighth of a block's side at a million bodies.
const AXIS_BITS: u32 = 10;
/// Bits of a place on the curve.
const CURVE_BITS: u32 = 3 * AXIS_BITS;
/// Bits of a body's index in the sorted words: `limits::BODIES_MAX` and some.
const INDEX_BITS: u32 = 28;
/// Octaves of size: the longest sides from 2^-32 to 2^31 metres, all others at the ends.
const OCTAVES: usize = 64;
/// Those below a metre.
const OCTAVES_BELOW_ONE: i32 = 32;
/// Cells of the curve along the side of a small body, at most: finer ones put nobody in a better place.
const CELLS_A_SIDE: f64 = 8.0;
/// Octaves that share a class. Boxes of a block then differ by a factor of 4 at most, and scenes whose sizes lie about
/// a power of two are not torn in two.
const OCTAVES_A_CLASS: usize = 2;
/// Most classes: the bits left in a sorted word.
pub(super) const CLASSES_MAX: usize = 1 << (64 - CURVE_BITS - INDEX_BITS);
/// Bits that one pass of the radix sort takes.
const DIGIT_BITS: u32 = 11;

/// The frame of the curve: where a box belongs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    low: [f32; 3],
    scale: [f32; 3],
    /// By octave: its class.
    classes: [u8; OCTAVES],
}

/// A frame of the curve and the memory of the sort.
#[derive(Clone, Debug, Default)]
pub(super) struct Sorter {
    pub(super) frame: Frame,
    /// A key above an index each.
    words: Vec<u64>,
    spare: Vec<u64>,
    counts: Vec<u32>,
    middles: Vec<([f32; 3], u32)>,
}

impl Default for Frame {
    fn default() -> Self {
        Self {
            low: [0.0; 3],
            scale: [0.0; 3],
            classes: [0; OCTAVES],
        }
    }
}

impl Frame {
    /// The one that suits these boxes.
    pub(super) fn of(boxes: &[[f32; 6]]) -> Self {
        let mut frame = Self::default();
        let mut seen = [0_u32; OCTAVES];
        let (mut count, mut sum, mut squares) = (0_u32, [0.0_f64; 3], [0.0_f64; 3]);
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for one in boxes {
            seen[octave(one)] += 1;
            let centre = centre(one).map(f64::from);
            count += 1;
            for k in 0..3 {
                sum[k] += centre[k];
                squares[k] += centre[k] * centre[k];
                low[k] = low[k].min(centre[k]);
                high[k] = high[k].max(centre[k]);
            }
        }
        // Few bodies far away must not make the cells coarse for all: four deviations, the rest at the edge.
        let cells = f64::from(1_u32 << AXIS_BITS);
        let finest = cells_a_metre(&seen, count);
        for k in 0..3 {
            let mean = sum[k] / f64::from(count.max(1));
            let reach = 4.0
                * (squares[k] / f64::from(count.max(1)) - mean * mean)
                    .max(0.0)
                    .sqrt();
            let (from, to) = (low[k].max(mean - reach), high[k].min(mean + reach));
            #[allow(
                clippy::cast_possible_truncation,
                reason = "a place on a curve, not a bound"
            )]
            {
                frame.low[k] = from as f32;
                let even = cells / (to - from).max(f64::from(f32::MIN_POSITIVE));
                frame.scale[k] = even.min(finest) as f32;
            }
        }
        frame.lay_classes(&seen);
        frame
    }

    /// Whether the origin is so near that rounding moves no face by more than a thousandth of a cell.
    pub(super) fn is_near_origin(&self) -> bool {
        let cells = f32::from(1_u16 << AXIS_BITS);
        let near = |(low, scale): (&f32, &f32)| low.abs() <= 2.0 * cells / scale;
        self.low.iter().zip(&self.scale).all(near)
    }

    /// From the largest size down, each class begins at the next octave that has any body.
    fn lay_classes(&mut self, seen: &[u32; OCTAVES]) {
        let (mut class, mut left) = (0_usize, 0);
        let mut begun = false;
        for octave in (0..OCTAVES).rev() {
            if left == 0 && seen[octave] != 0 {
                class += usize::from(begun);
                begun = true;
                left = OCTAVES_A_CLASS;
            }
            left = left.saturating_sub(1);
            #[allow(clippy::cast_possible_truncation, reason = "at most CLASSES_MAX")]
            let name = class.min(CLASSES_MAX - 1) as u8;
            self.classes[octave] = name;
        }
    }

    /// Where a box belongs: its class above its place on the curve.
    pub(super) fn key(&self, one: &[f32; 6]) -> u64 {
        let class = self.classes[octave(one)];
        let centre = centre(one);
        let mut key = u64::from(class) << CURVE_BITS;
        for (k, centre) in centre.into_iter().enumerate() {
            let cell = (centre - self.low[k]) * self.scale[k];
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "the cast saturates, NaN becomes 0: a place on a curve, not a bound"
            )]
            let cell = (cell as u32).min((1 << AXIS_BITS) - 1);
            key |= u64::from(morton_bits(cell)) << k;
        }
        key
    }

    /// The same frame, told by another origin.
    ///
    /// * `by` - the new origin less the old one.
    pub(super) fn shift(&mut self, by: [f64; 3]) {
        for (low, by) in self.low.iter_mut().zip(by) {
            #[allow(
                clippy::cast_possible_truncation,
                reason = "a place on a curve, not a bound"
            )]
            let by = by as f32;
            *low -= by;
        }
    }
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
    }

    /// The rest, some of it: splits the bodies from one on, as many as asked for and what completes a stretch, into
    /// blocks. Returns where it ended.
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

    /// What the sort has yielded: of [`Sorter::begin`] as far as it is split.
    pub(super) fn sorted(&self) -> impl Iterator<Item = (u64, u32)> + Clone + '_ {
        self.words.iter().map(|word| unpacked(*word))
    }

    /// One pass, stable.
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

/// A key above an index.
fn word(key: u64, index: u64) -> u64 {
    key << INDEX_BITS | index
}

/// A key and an index.
fn unpacked(word: u64) -> (u64, u32) {
    let index = word & ((1 << INDEX_BITS) - 1);
    (word >> INDEX_BITS, u32::try_from(index).unwrap_or(0))
}

/// Bodies put in a block by a sort: one lane stays free for who comes later.
pub(super) const FILL: usize = WIDTH - 1;

/// Bodies that are split into blocks together: as many blocks as a node of the tree has children.
const STRETCH: usize = FILL * WIDTH;

/// Orders a stretch so that each block of it is compact: halves by the middle along the longest axis, and so on. The
/// curve alone gives blocks that meet twice as many others.
///
/// * `fill` - bodies of a block.
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

/// Most cells of the curve a metre: where bodies lie in a sheet or a line, finer cells across it would part neighbours
/// by what is less than their size.
///
/// * `seen` - how many of `count` boxes have their longest side in each octave.
fn cells_a_metre(seen: &[u32; OCTAVES], count: u32) -> f64 {
    let mut left = count / 4;
    for (octave, bodies) in seen.iter().enumerate() {
        if *bodies > left {
            let exponent = i32::try_from(octave).unwrap_or(0) - OCTAVES_BELOW_ONE;
            return CELLS_A_SIDE / f64::from(exponent).exp2();
        }
        left -= bodies;
    }
    f64::INFINITY
}

/// The octave of the longest side.
fn octave(one: &[f32; 6]) -> usize {
    let side = (one[3] - one[0]).max(one[4] - one[1]).max(one[5] - one[2]);
    // The exponent of an f32 is its upper bits; NaN and what is beyond the octaves go to the ends.
    let exponent = (side.to_bits() >> 23) & 0xFF;
    (exponent.clamp(127 - 32, 127 + 31) - (127 - 32)) as usize
}

/// The middle of a box; of an infinite one, anything.
#[inline(always)]
pub(super) fn centre(one: &[f32; 6]) -> [f32; 3] {
    std::array::from_fn(|k| {
        let middle = one[k] * 0.5 + one[k + 3] * 0.5;
        if middle.is_finite() { middle } else { 0.0 }
    })
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
        // Sixteen in a row stand in a square of four by four, or nearly so.
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
