//! The curve along which bodies are sorted: size classes, and within a class the Morton curve through cells.

use crate::math::morton_bits;

/// Bits of the curve on each axis. A cell is then an eighth of a block's side at a million bodies.
const AXIS_BITS: u32 = 10;
/// Bits of a position on the curve.
pub(super) const CURVE_BITS: u32 = 3 * AXIS_BITS;
/// Octaves of size: the longest sides from 2^-32 to 2^31 metres, all others at the ends.
const OCTAVES: usize = 64;
/// Octaves below one metre.
const OCTAVES_BELOW_ONE: i32 = 32;
/// Most cells of the curve along the side of a small body: finer ones improve no body's place.
const CELLS_A_SIDE: f64 = 8.0;
/// Octaves per class. Boxes of a block then differ by a factor of 4 at most, and scenes whose sizes vary around a power
/// of two are not split in two.
const OCTAVES_A_CLASS: usize = 2;
/// Most classes: the bits that a sorted word has for them.
pub(super) const CLASSES_MAX: usize = 64;
/// Most bodies sampled to find how far apart they lie.
pub(super) const SAMPLE: usize = 1023;
/// One in this many of the sample may lie far from all others, on either side.
const FAR_AWAY: usize = 32;

/// Cells along the three axes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cells {
    low: [f32; 3],
    /// Cells per metre.
    scale: [f32; 3],
}

/// The frame of the curve: gives each box its key.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    cells: Cells,
    /// The most cells per metre that are useful.
    finest: f64,
    /// By octave: its class.
    classes: [u8; OCTAVES],
}

impl Cells {
    /// Cells for bodies with these centres. A few bodies far away do not make the cells coarse for all: they go to the
    /// edge.
    ///
    /// * `middle` - centre of one of `count` bodies.
    /// * `finest` - most cells per metre.
    pub(super) fn of(count: usize, middle: impl Fn(usize) -> [f32; 3], finest: f64) -> Self {
        let mut cells = Self::default();
        let mut sample = [0.0; SAMPLE];
        for k in 0..3 {
            let sample = fill(&mut sample, sampled(count).map(|at| middle(at)[k]));
            sample.sort_unstable_by(f32::total_cmp);
            let (Some(low), Some(high)) = (sample.first(), sample.last()) else {
                break;
            };
            let far = sample.len() / FAR_AWAY;
            let (from, to) = (sample[far], sample[sample.len() - 1 - far]);
            let wide = to - from;
            let (from, to) = (low.max(from - wide), high.min(to + wide));
            let even = f64::from(1_u32 << AXIS_BITS)
                / f64::from(to - from).max(f64::from(f32::MIN_POSITIVE));
            cells.low[k] = from;
            #[allow(
                clippy::cast_possible_truncation,
                reason = "a place on a curve, not a bound"
            )]
            {
                cells.scale[k] = even.min(finest) as f32;
            }
        }
        cells
    }

    /// The position of a point along the curve.
    #[inline(always)]
    pub(super) fn place(&self, middle: [f32; 3]) -> u64 {
        let mut place = 0;
        for (k, middle) in middle.into_iter().enumerate() {
            let cell = (middle - self.low[k]) * self.scale[k];
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "the cast saturates, NaN becomes 0: a place on a curve, not a bound"
            )]
            let cell = (cell as u32).min((1 << AXIS_BITS) - 1);
            place |= u64::from(morton_bits(cell)) << k;
        }
        place
    }

    /// Returns whether finer cells could improve the order.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a place on a curve, not a bound"
    )]
    pub(super) fn are_coarse(&self, finest: f64) -> bool {
        self.scale.iter().any(|scale| *scale < finest as f32)
    }
}

impl Default for Frame {
    fn default() -> Self {
        Self {
            cells: Cells::default(),
            finest: f64::INFINITY,
            classes: [0; OCTAVES],
        }
    }
}

impl Frame {
    /// The frame for these boxes.
    pub(super) fn of(boxes: &[[f32; 6]]) -> Self {
        let mut frame = Self::default();
        let mut seen = [0_u32; OCTAVES];
        for one in boxes {
            seen[octave(one)] += 1;
        }
        let count = boxes.len();
        frame.finest = cells_a_metre(&seen, count);
        frame.cells = Cells::of(count, |at| centre(&boxes[at]), frame.finest);
        frame.lay_classes(&seen);
        frame
    }

    /// Returns whether the origin is so near that rounding moves no face by more than a thousandth of a cell.
    pub(super) fn is_near_origin(&self) -> bool {
        let cells = f32::from(1_u16 << AXIS_BITS);
        let near = |(low, scale): (&f32, &f32)| low.abs() <= 2.0 * cells / scale;
        self.cells.low.iter().zip(&self.cells.scale).all(near)
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

    /// The sort key of a box: its class above its position on the curve.
    pub(super) fn key(&self, one: &[f32; 6]) -> u64 {
        let class = self.classes[octave(one)];
        u64::from(class) << CURVE_BITS | self.cells.place(centre(one))
    }

    /// The most cells per metre that are useful, if this frame has fewer.
    pub(super) fn finer(&self) -> Option<f64> {
        self.cells.are_coarse(self.finest).then_some(self.finest)
    }

    /// Moves the frame to another origin.
    ///
    /// * `by` - the new origin minus the old one.
    pub(super) fn shift(&mut self, by: [f64; 3]) {
        for (low, by) in self.cells.low.iter_mut().zip(by) {
            #[allow(
                clippy::cast_possible_truncation,
                reason = "a place on a curve, not a bound"
            )]
            let by = by as f32;
            *low -= by;
        }
    }
}

/// Most cells of the curve per metre: where bodies lie in a sheet or a line, finer cells across it would separate
/// neighbours by less than their size.
///
/// * `seen` - how many of `count` boxes have their longest side in each octave.
fn cells_a_metre(seen: &[u32; OCTAVES], count: usize) -> f64 {
    let mut left = count / 4;
    for (octave, bodies) in seen.iter().enumerate() {
        let bodies = *bodies as usize;
        if bodies > left {
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
    // The exponent of an f32 is in its upper bits; NaN and values beyond the octaves go to the ends.
    let exponent = (side.to_bits() >> 23) & 0xFF;
    (exponent.clamp(127 - 32, 127 + 31) - (127 - 32)) as usize
}

/// The centre of a box; arbitrary for an infinite one.
#[inline(always)]
pub(super) fn centre(one: &[f32; 6]) -> [f32; 3] {
    std::array::from_fn(|k| {
        let middle = one[k] * 0.5 + one[k + 3] * 0.5;
        if middle.is_finite() { middle } else { 0.0 }
    })
}

/// Evenly spaced indices below `count`, at most `SAMPLE`.
pub(super) fn sampled(count: usize) -> impl Iterator<Item = usize> {
    (0..count).step_by(count.div_ceil(SAMPLE).max(1))
}

/// Copies items to the front of a list; those that do not fit are left out.
pub(super) fn fill<T: Copy>(list: &mut [T], items: impl Iterator<Item = T>) -> &mut [T] {
    let mut len = 0;
    for (place, item) in list.iter_mut().zip(items) {
        (*place, len) = (item, len + 1);
    }
    &mut list[..len]
}
