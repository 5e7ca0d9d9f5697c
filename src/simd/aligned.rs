//! Eight axis-aligned boxes, from two corners of each to the form stored in a pack: centres and half sides.
//!
//! In: corners by rows, in the order they are found. Out: a pack's columns, the reach of its boxes, and their surface.
//! Transposing rows into columns takes the time: left to the compiler, it takes more than everything else in a refit of
//! a mesh.

use super::greater;
use super::obb::{LANES, Pack};

/// Centres and half sides are sums and differences of f32, each off by half an ulp at most: four ulps are added.
const GROW: f32 = 1.0 + 4.0 * f32::EPSILON;

/// Added to every half side, metres. Its square is still a normal number: with smaller ones a product in [`set`] takes
/// some hundred cycles.
const LEAST: f32 = 1e-18;

/// A point of a frame, metres; the last number is padding.
pub type Row = [f32; 4];

/// Sets centres and half sides of a pack to those of eight boxes; axes are unchanged.
///
/// * `low`, `high` - the corners of each, metres, finite.
/// * `surface` - an eighth of each box's surface is added to its lane, m2.
/// * returns - the greatest sum of a centre's coordinates and half sides, metres, rounded up.
#[inline]
pub fn set(
    pack: &mut Pack,
    low: &[Row; LANES],
    high: &[Row; LANES],
    surface: &mut [f32; LANES],
) -> f32 {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2; the function needs nothing else.
        #[allow(
            unsafe_code,
            reason = "measured on Zen 4: a whole refit takes half of what it does with the twin"
        )]
        return unsafe { x86::set(pack, low, high, surface) };
    }
    scalar(pack, low, high, surface)
}

/// [`set`] without vector instructions.
fn scalar(
    pack: &mut Pack,
    low: &[Row; LANES],
    high: &[Row; LANES],
    surface: &mut [f32; LANES],
) -> f32 {
    let mut most = 0.0;
    for lane in 0..LANES {
        let mut half = [0.0_f32; 3];
        let mut reach = 0.0;
        for k in 0..3 {
            let (low, high) = (low[lane][k], high[lane][k]);
            let centre = 0.5 * low + 0.5 * high;
            half[k] = greater(high - centre, centre - low) * GROW + LEAST;
            reach += centre.abs() + half[k];
            pack.centre[k][lane] = centre;
            pack.half[k][lane] = half[k];
        }
        let [x, y, z] = half;
        surface[lane] += (x * y + y * z) + z * x;
        most = greater(most, reach);
    }
    most * GROW * GROW
}

#[cfg(target_arch = "x86_64")]
#[allow(
    unsafe_code,
    reason = "loads and stores of whole registers, each inside its array"
)]
mod x86 {
    use std::arch::x86_64::{
        __m256, _mm_cvtss_f32, _mm_loadu_ps, _mm_max_ps, _mm_max_ss, _mm_movehl_ps, _mm_shuffle_ps,
        _mm256_add_ps, _mm256_andnot_ps, _mm256_castps256_ps128, _mm256_extractf128_ps,
        _mm256_loadu_ps, _mm256_max_ps, _mm256_mul_ps, _mm256_set_m128, _mm256_set1_ps,
        _mm256_setzero_ps, _mm256_shuffle_ps, _mm256_storeu_ps, _mm256_sub_ps, _mm256_unpackhi_ps,
        _mm256_unpacklo_ps,
    };

    use super::{GROW, LANES, LEAST, Pack, Row};

    /// Eight rows as columns.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn columns(rows: &[Row; LANES]) -> [__m256; 3] {
        // SAFETY: a row holds four floats.
        let row = |i: usize| unsafe { _mm_loadu_ps(rows[i].as_ptr()) };
        let both = |i: usize| _mm256_set_m128(row(i + 4), row(i));
        let (a, b, c, d) = (both(0), both(1), both(2), both(3));
        let (xy_ab, xy_cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
        let (zw_ab, zw_cd) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
        [
            _mm256_shuffle_ps::<0b01_00_01_00>(xy_ab, xy_cd),
            _mm256_shuffle_ps::<0b11_10_11_10>(xy_ab, xy_cd),
            _mm256_shuffle_ps::<0b01_00_01_00>(zw_ab, zw_cd),
        ]
    }

    /// See [`super::set`].
    #[target_feature(enable = "avx2")]
    pub(super) fn set(
        pack: &mut Pack,
        low: &[Row; LANES],
        high: &[Row; LANES],
        surface: &mut [f32; LANES],
    ) -> f32 {
        let (low, high) = (columns(low), columns(high));
        let (middle, grow, least) = (
            _mm256_set1_ps(0.5),
            _mm256_set1_ps(GROW),
            _mm256_set1_ps(LEAST),
        );
        let mut half = [_mm256_setzero_ps(); 3];
        let mut reach = _mm256_setzero_ps();
        for k in 0..3 {
            let centre = _mm256_add_ps(
                _mm256_mul_ps(middle, low[k]),
                _mm256_mul_ps(middle, high[k]),
            );
            let side = _mm256_max_ps(
                _mm256_sub_ps(high[k], centre),
                _mm256_sub_ps(centre, low[k]),
            );
            half[k] = _mm256_add_ps(_mm256_mul_ps(side, grow), least);
            let far = _mm256_andnot_ps(_mm256_set1_ps(-0.0), centre);
            reach = _mm256_add_ps(reach, _mm256_add_ps(far, half[k]));
            // SAFETY: a column holds eight floats.
            unsafe {
                _mm256_storeu_ps(pack.centre[k].as_mut_ptr(), centre);
                _mm256_storeu_ps(pack.half[k].as_mut_ptr(), half[k]);
            }
        }
        let [x, y, z] = half;
        let sides = _mm256_add_ps(_mm256_mul_ps(x, y), _mm256_mul_ps(y, z));
        let area = _mm256_add_ps(sides, _mm256_mul_ps(z, x));
        // SAFETY: there are eight floats.
        unsafe {
            let sum = _mm256_add_ps(_mm256_loadu_ps(surface.as_ptr()), area);
            _mm256_storeu_ps(surface.as_mut_ptr(), sum);
        }
        let four = _mm_max_ps(
            _mm256_castps256_ps128(reach),
            _mm256_extractf128_ps::<1>(reach),
        );
        let two = _mm_max_ps(four, _mm_movehl_ps(four, four));
        let one = _mm_max_ss(two, _mm_shuffle_ps::<1>(two, two));
        _mm_cvtss_f32(one) * GROW * GROW
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::numbers;

    #[test]
    fn the_kernel_and_its_twin_agree_bit_for_bit() {
        let mut next = numbers(7);
        for round in 0..if cfg!(miri) { 10 } else { 2_000 } {
            // Up to the largest reach of a body, and down to sides whose squares are subnormal.
            let exponent = if round % 2 == 0 {
                9.0 * next()
            } else {
                -30.0 * next().abs()
            };
            let scale = 10.0_f32.powf(exponent);
            let mut low = [[0.0; 4]; LANES];
            let mut high = low;
            // Some lanes without a box.
            for lane in 0..LANES - round % 3 {
                for k in 0..3 {
                    low[lane][k] = scale * next();
                    // Some boxes without thickness, and some barely thicker.
                    let side = match (round + lane + k) % 7 {
                        0 => 0.0,
                        1 => 1e-7 * next().abs(),
                        _ => next().abs(),
                    };
                    high[lane][k] = low[lane][k] + scale * side;
                }
            }
            let (mut one, mut other) = (Pack::EMPTY, Pack::EMPTY);
            let (mut of_one, mut of_other) = ([1.0; LANES], [1.0; LANES]);
            let reach = set(&mut one, &low, &high, &mut of_one);
            let twin = scalar(&mut other, &low, &high, &mut of_other);
            assert_eq!(reach.to_bits(), twin.to_bits(), "round {round}");
            assert_eq!(of_one.map(f32::to_bits), of_other.map(f32::to_bits));
            for k in 0..3 {
                let bits = |columns: &[[f32; LANES]; 3]| columns[k].map(f32::to_bits);
                assert_eq!(bits(&one.centre), bits(&other.centre), "round {round}");
                assert_eq!(bits(&one.half), bits(&other.half), "round {round}");
            }
            for lane in 0..LANES {
                let mut sum = 0.0;
                for k in 0..3 {
                    let (centre, half) =
                        (f64::from(one.centre[k][lane]), f64::from(one.half[k][lane]));
                    assert!(centre - half <= f64::from(low[lane][k]), "round {round}");
                    assert!(centre + half >= f64::from(high[lane][k]), "round {round}");
                    sum += centre.abs() + half;
                }
                assert!(sum <= f64::from(reach), "round {round}");
            }
        }
    }
}
