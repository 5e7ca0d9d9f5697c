//! One oriented box against eight: a signed separation for each.
//!
//! In: eight boxes in columns (a [`Pack`]) and one box seen from their frame. Out: for each of the eight the greatest
//! separation along the 15 axes of Gottschalk, Lin, Manocha 1996 (OBBTree), before rounding is subtracted.
//!
//! Positive: a lower bound on the distance of their contents, up to rounding. Along the face axes of one box the
//! separations are orthogonal and add up as squares. The edge axes are not normalised: their length is at most 1, so a
//! positive separation along one is too small at worst. Zero or less: the boxes may touch, and the number is only
//! useful as an order.

use super::greater;

/// Boxes in a pack.
pub const LANES: usize = 8;

/// Bound on the rounding of [`gaps`], as a share of its operands: `|centre|` of the one (sum of coordinates), its half
/// sides, and the pack's reach. A third more than the 51 units of roundoff (2^-24) that the worst chain of operations
/// adds up to, including axes and centre rounded to f32.
pub const GAP_ROUND: f64 = 4e-6;

/// A number for each lane.
type Lanes = [f32; LANES];

/// Eight boxes in columns. A box is where `|axis . (x - centre)| <= half` for its three axes, with the stored f32
/// numbers taken as exact; axes are unit and orthogonal up to rounding.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Pack {
    /// Centres relative to the pack's origin, metres.
    pub centre: [Lanes; 3],
    /// Axis by axis, coordinate by coordinate.
    pub axes: [[Lanes; 3]; 3],
    /// Half sides along the axes, metres.
    pub half: [Lanes; 3],
}

/// A single box, seen from the frame and the origin of a pack.
#[derive(Clone, Copy, Debug)]
pub struct One {
    /// Centre, metres.
    pub centre: [f32; 3],
    /// Unit axes.
    pub axes: [[f32; 3]; 3],
    /// Half sides, metres.
    pub half: [f32; 3],
}

impl Pack {
    /// No box at all: every lane is a point at the origin.
    pub const EMPTY: Self = Self {
        centre: [[0.0; LANES]; 3],
        axes: [[[0.0; LANES]; 3]; 3],
        half: [[0.0; LANES]; 3],
    };
}

/// The separation of `one` and each box of `pack`, metres, to be reduced by [`GAP_ROUND`] times its operands.
#[must_use]
pub fn gaps(one: &One, pack: &Pack) -> [f32; LANES] {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2; the function needs nothing else.
        #[allow(
            unsafe_code,
            reason = "measured: half the time of the least common denominator; safe twin below"
        )]
        return unsafe { gaps_avx2(one, pack) };
    }
    lanes(one, pack)
}

/// [`lanes`], compiled for registers of eight numbers.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn gaps_avx2(one: &One, pack: &Pack) -> [f32; LANES] {
    lanes(one, pack)
}

/// Eight numbers that go through every operation in parallel.
///
/// Plain loops over indices: closures passed to `array::map` are not inlined into a function compiled for more than the
/// rest, and cost ten times as much (measured).
#[derive(Clone, Copy)]
struct Wide(Lanes);

impl Wide {
    #[inline(always)]
    fn of(x: f32) -> Self {
        Self([x; LANES])
    }

    #[inline(always)]
    fn abs(mut self) -> Self {
        for x in &mut self.0 {
            *x = x.abs();
        }
        self
    }

    #[inline(always)]
    fn max(mut self, other: Self) -> Self {
        for (x, y) in self.0.iter_mut().zip(&other.0) {
            *x = greater(*x, *y);
        }
        self
    }

    #[inline(always)]
    fn sqrt(mut self) -> Self {
        for x in &mut self.0 {
            *x = x.sqrt();
        }
        self
    }

    /// `other` where this is positive, otherwise this.
    #[inline(always)]
    fn or_where_positive(mut self, other: Self) -> Self {
        for (x, y) in self.0.iter_mut().zip(&other.0) {
            *x = if *x > 0.0 { *y } else { *x };
        }
        self
    }
}

impl std::ops::Add for Wide {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        for (x, y) in self.0.iter_mut().zip(&other.0) {
            *x += *y;
        }
        self
    }
}

impl std::ops::Sub for Wide {
    type Output = Self;
    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        for (x, y) in self.0.iter_mut().zip(&other.0) {
            *x -= *y;
        }
        self
    }
}

impl std::ops::Mul for Wide {
    type Output = Self;
    #[inline(always)]
    fn mul(mut self, other: Self) -> Self {
        for (x, y) in self.0.iter_mut().zip(&other.0) {
            *x *= *y;
        }
        self
    }
}

/// Three products of lanes, summed from the left.
#[inline(always)]
fn dot(u: &[Wide; 3], v: &[Wide; 3]) -> Wide {
    u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
}

#[inline(always)]
fn spread(x: [f32; 3]) -> [Wide; 3] {
    [Wide::of(x[0]), Wide::of(x[1]), Wide::of(x[2])]
}

#[inline(always)]
fn column(rows: &[Lanes; 3]) -> [Wide; 3] {
    [Wide(rows[0]), Wide(rows[1]), Wide(rows[2])]
}

#[inline(always)]
fn lanes(one: &One, pack: &Pack) -> [f32; LANES] {
    let zero = Wide::of(0.0);
    let half_a = spread(one.half);
    let half_b = column(&pack.half);
    let (to, from) = (column(&pack.centre), spread(one.centre));
    let between = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];

    // Cosines between the axes of the two, and the vector between the centres along each.
    let (mut cosine, mut abs) = ([[zero; 3]; 3], [[zero; 3]; 3]);
    let (mut along_a, mut along_b) = ([zero; 3], [zero; 3]);
    for i in 0..3 {
        let axis_a = spread(one.axes[i]);
        along_a[i] = dot(&axis_a, &between);
        for j in 0..3 {
            cosine[i][j] = dot(&axis_a, &column(&pack.axes[j]));
            abs[i][j] = cosine[i][j].abs();
        }
        along_b[i] = dot(&column(&pack.axes[i]), &between);
    }

    let mut most = Wide::of(f32::NEG_INFINITY);
    let (mut square_a, mut square_b) = (zero, zero);
    for k in 0..3 {
        let gap_a = along_a[k].abs() - (half_a[k] + dot(&abs[k], &half_b));
        let seen = [abs[0][k], abs[1][k], abs[2][k]];
        let gap_b = along_b[k].abs() - (half_b[k] + dot(&seen, &half_a));
        most = most.max(gap_a).max(gap_b);
        let (over_a, over_b) = (gap_a.max(zero), gap_b.max(zero));
        square_a = square_a + over_a * over_a;
        square_b = square_b + over_b * over_b;
    }
    // If a face separates them, the distance is at least each single separation, up to rounding.
    let distance = square_a.max(square_b).sqrt();
    let mut best = most.or_where_positive(distance);
    for i in 0..3 {
        let (i1, i2) = ((i + 1) % 3, (i + 2) % 3);
        for j in 0..3 {
            let (j1, j2) = ((j + 1) % 3, (j + 2) % 3);
            let way = along_a[i2] * cosine[i1][j] - along_a[i1] * cosine[i2][j];
            let of_a = half_a[i1] * abs[i2][j] + half_a[i2] * abs[i1][j];
            let of_b = half_b[j1] * abs[i][j2] + half_b[j2] * abs[i][j1];
            best = best.max(way.abs() - (of_a + of_b));
        }
    }
    best.0
}

/// The twin: one lane after the other, in scalar code. Equal to [`gaps`] bit for bit.
#[must_use]
pub fn gaps_scalar(one: &One, pack: &Pack) -> [f32; LANES] {
    std::array::from_fn(|lane| {
        let axes_b = pack.axes.map(|axis| axis.map(|row| row[lane]));
        let half_b = pack.half.map(|row| row[lane]);
        let between: [f32; 3] = std::array::from_fn(|k| pack.centre[k][lane] - one.centre[k]);
        let dot = |u: &[f32; 3], v: &[f32; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
        let c = one.axes.map(|u| axes_b.map(|v| dot(&u, &v)));
        let abs = c.map(|row| row.map(f32::abs));
        let t = one.axes.map(|u| dot(&u, &between));
        let mut most = f32::NEG_INFINITY;
        let mut square = [0.0_f32; 2];
        for k in 0..3 {
            let gap_a = t[k].abs() - (one.half[k] + dot(&abs[k], &half_b));
            let seen = [abs[0][k], abs[1][k], abs[2][k]];
            let gap_b = dot(&axes_b[k], &between).abs() - (half_b[k] + dot(&seen, &one.half));
            most = greater(greater(most, gap_a), gap_b);
            square[0] += greater(gap_a, 0.0) * greater(gap_a, 0.0);
            square[1] += greater(gap_b, 0.0) * greater(gap_b, 0.0);
        }
        let mut best = if most > 0.0 {
            greater(square[0], square[1]).sqrt()
        } else {
            most
        };
        for i in 0..3 {
            let (i1, i2) = ((i + 1) % 3, (i + 2) % 3);
            for j in 0..3 {
                let (j1, j2) = ((j + 1) % 3, (j + 2) % 3);
                let way = t[i2] * c[i1][j] - t[i1] * c[i2][j];
                let of_a = one.half[i1] * abs[i2][j] + one.half[i2] * abs[i1][j];
                let of_b = half_b[j1] * abs[i][j2] + half_b[j2] * abs[i][j1];
                best = greater(best, way.abs() - (of_a + of_b));
            }
        }
        best
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::numbers;

    fn axes(next: &mut impl FnMut() -> f32) -> [[f32; 3]; 3] {
        let turn = nalgebra::UnitQuaternion::from_scaled_axis(nalgebra::Vector3::new(
            3.0 * f64::from(next()),
            3.0 * f64::from(next()),
            3.0 * f64::from(next()),
        ));
        let m = turn.to_rotation_matrix();
        #[allow(clippy::cast_possible_truncation, reason = "a test")]
        std::array::from_fn(|i| std::array::from_fn(|k| m[(k, i)] as f32))
    }

    #[test]
    fn the_kernel_and_its_twin_agree_bit_for_bit() {
        // Miri is some thousand times slower.
        let rounds = if cfg!(miri) { 10 } else { 2_000 };
        for seed in 0..rounds {
            let mut next = numbers(seed);
            let scale = 10.0_f32.powf(6.0 * next());
            let mut pack = Pack::EMPTY;
            for lane in 0..LANES {
                let turned = axes(&mut next);
                for (k, axis) in turned.iter().enumerate() {
                    pack.centre[k][lane] = scale * next();
                    pack.half[k][lane] = scale * next().abs() * 0.4;
                    for (j, x) in axis.iter().enumerate() {
                        pack.axes[k][j][lane] = *x;
                    }
                }
            }
            let one = One {
                centre: [scale * next(), scale * next(), scale * next()],
                axes: axes(&mut next),
                half: [scale * next().abs(), 0.0, scale * 0.1],
            };
            let twin = gaps_scalar(&one, &pack).map(f32::to_bits);
            assert_eq!(gaps(&one, &pack).map(f32::to_bits), twin, "seed {seed}");
            assert_eq!(lanes(&one, &pack).map(f32::to_bits), twin, "seed {seed}");
        }
    }
}
