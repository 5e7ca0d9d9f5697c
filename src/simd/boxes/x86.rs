//! The kernels in AVX2 and AVX-512. Only sums, products, compares and maxima, in the order of the twin, so that every
//! bit equals the twin's.

mod hold;
mod number;

use std::arch::asm;
use std::arch::x86_64::{
    __m256, __m256d, __m256i, __m512, _CMP_GT_OQ, _CMP_LE_OQ, _CMP_LT_OQ, _CMP_NLT_UQ,
    _mm_cvtsi32_si128, _mm_cvtss_f32, _mm_max_ps, _mm_max_ss, _mm_movehl_ps, _mm_shuffle_ps,
    _mm256_add_ps, _mm256_and_ps, _mm256_and_si256, _mm256_andnot_ps, _mm256_blendv_ps,
    _mm256_castps256_ps128, _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_cmpeq_epi16,
    _mm256_cmpeq_epi32, _mm256_cvtpd_ps, _mm256_extractf128_ps, _mm256_load_ps, _mm256_loadu_ps,
    _mm256_loadu_si256, _mm256_maskload_pd, _mm256_max_ps, _mm256_movemask_epi8, _mm256_movm_epi16,
    _mm256_mul_ps, _mm256_or_ps, _mm256_packs_epi16, _mm256_permute2f128_ps, _mm256_set_m128,
    _mm256_set1_epi16, _mm256_set1_epi32, _mm256_set1_ps, _mm256_setr_epi16, _mm256_setr_epi32,
    _mm256_setr_epi64x, _mm256_setr_pd, _mm256_setzero_ps, _mm256_setzero_si256, _mm256_sll_epi16,
    _mm256_slli_epi32, _mm256_store_ps, _mm256_storeu_si256, _mm256_sub_pd, _mm256_sub_ps,
    _mm256_test_epi16_mask, _mm256_xor_ps, _mm512_loadu_ps, _mm512_mask_cmp_ps_mask,
    _mm512_set1_ps,
};

use super::Kernel;
use super::hold::Held;
use super::lanes::{Boxes16, Down, LEAST, Lanes, SLACK_LEAST, SLACK_SHARE, STEP, WIDTH};
use hold::{keeps_avx2, take_avx2};
use number::{number_avx2, number_avx512};

/// Two halves of eight lanes or, if `WIDE`, sixteen at once where that is faster. Only [`run_avx2`] and [`run_avx512`]
/// make one: so the processor has AVX2, and for a wide one also AVX-512 F, BW, DQ and VL.
#[derive(Clone, Copy)]
struct Vectors<const WIDE: bool>(());

/// Runs a loop built for AVX2.
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn run_avx2<K: Kernel>(kernel: K) -> K::Out {
    kernel.run(Vectors::<false>(()))
}

/// Runs a loop built for AVX-512.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn run_avx512<K: Kernel>(kernel: K) -> K::Out {
    kernel.run(Vectors::<true>(()))
}

#[inline]
#[target_feature(enable = "avx2")]
fn half(face: &[f32; WIDTH], at: usize) -> __m256 {
    debug_assert!(at + 8 <= WIDTH);
    // SAFETY: `at` is 0 or 8, so eight floats from there lie inside the array.
    unsafe { _mm256_loadu_ps(face.as_ptr().add(at)) }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn all(face: &[f32; WIDTH]) -> __m512 {
    // SAFETY: the array holds sixteen floats.
    unsafe { _mm512_loadu_ps(face.as_ptr()) }
}

/// The sign bits of eight lanes. By its own instruction: compiled code for two such masks combined, or for one that is
/// compared with all ones with AVX-512 (by a mask register), is nearly twice as long.
#[inline]
#[target_feature(enable = "avx2")]
fn sign_bits(lanes: __m256) -> u32 {
    let bits: u32;
    // SAFETY: it reads a register and writes another; the instruction is part of AVX, which AVX2 includes.
    unsafe {
        asm!(
            "vmovmskps {bits:e}, {lanes}",
            bits = lateout(reg) bits,
            lanes = in(ymm_reg) lanes,
            options(pure, nomem, nostack, preserves_flags)
        );
    }
    bits
}

/// The sign bits of two halves as sixteen bits.
#[inline]
#[target_feature(enable = "avx2")]
#[allow(
    clippy::cast_possible_truncation,
    reason = "eight bits above eight bits"
)]
fn bits(low: __m256, high: __m256) -> u16 {
    (sign_bits(low) | sign_bits(high) << 8) as u16
}

#[inline]
#[target_feature(enable = "avx2")]
fn meets_half(block: &Boxes16, one: &[f32; 6], at: usize) -> __m256 {
    let f = &block.faces;
    // `one[k + 3] < face[k]` means apart, `one[k] <= face[k + 3]` means not: the face is the second operand of both,
    // the only one that may be in memory.
    let parted =
        |k: usize| _mm256_cmp_ps::<_CMP_LT_OQ>(_mm256_set1_ps(one[k + 3]), half(&f[k], at));
    let high = |k: usize| _mm256_cmp_ps::<_CMP_LE_OQ>(_mm256_set1_ps(one[k]), half(&f[k + 3], at));
    // A tree of independent compares: a chain would wait for each.
    let x = _mm256_andnot_ps(parted(0), high(0));
    let y = _mm256_andnot_ps(parted(1), high(1));
    let z = _mm256_andnot_ps(parted(2), high(2));
    _mm256_and_ps(_mm256_and_ps(x, y), z)
}

#[inline]
#[target_feature(enable = "avx2")]
fn meets_avx2(block: &Boxes16, one: &[f32; 6]) -> u16 {
    bits(meets_half(block, one, 0), meets_half(block, one, 8))
}

#[inline]
#[target_feature(enable = "avx512f")]
fn meets_avx512(block: &Boxes16, one: &[f32; 6]) -> u16 {
    let f = &block.faces;
    // Each compare within the lanes left by another, which takes no further instruction; in two chains of three.
    let low = |left, k: usize| {
        _mm512_mask_cmp_ps_mask::<_CMP_NLT_UQ>(left, _mm512_set1_ps(one[k + 3]), all(&f[k]))
    };
    let high = |left, k: usize| {
        _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(left, _mm512_set1_ps(one[k]), all(&f[k + 3]))
    };
    low(high(low(u16::MAX, 0), 0), 1) & high(low(high(u16::MAX, 1), 2), 2)
}

#[inline]
#[target_feature(enable = "avx2")]
fn one(down: &Down) -> __m256 {
    // SAFETY: a `Down` is eight floats, aligned to their size.
    unsafe { _mm256_load_ps(down.faces.as_ptr()) }
}

/// A corner, and zero.
#[inline]
#[target_feature(enable = "avx2")]
fn corner(p: &[f64; 3]) -> __m256d {
    // SAFETY: the lanes that the mask leaves out are not read, and the three others are the array.
    unsafe { _mm256_maskload_pd(p.as_ptr(), _mm256_setr_epi64x(-1, -1, -1, 0)) }
}

/// A box rounded to nearest; the spare lanes become -1.
#[inline]
#[target_feature(enable = "avx2")]
fn nearest_avx2(min: &[f64; 3], max: &[f64; 3], origin: &[f64; 3]) -> __m256 {
    let [x, y, z] = *origin;
    let low = _mm256_sub_pd(corner(min), _mm256_setr_pd(x, y, z, 1.0));
    let high = _mm256_sub_pd(_mm256_setr_pd(x, y, z, -1.0), corner(max));
    _mm256_set_m128(_mm256_cvtpd_ps(high), _mm256_cvtpd_ps(low))
}

#[inline]
#[target_feature(enable = "avx2")]
fn outward_avx2(min: &[f64; 3], max: &[f64; 3], origin: &[f64; 3]) -> __m256 {
    // The spare lanes become a step less than -1.
    let nearest = nearest_avx2(min, max, origin);
    let far = _mm256_andnot_ps(_mm256_set1_ps(-0.0), nearest);
    let off = _mm256_add_ps(
        _mm256_mul_ps(far, _mm256_set1_ps(STEP)),
        _mm256_set1_ps(LEAST),
    );
    _mm256_sub_ps(nearest, off)
}

#[inline]
#[target_feature(enable = "avx2")]
fn store(faces: __m256, place: &mut Down) {
    // SAFETY: a `Down` is eight floats, aligned to their size.
    unsafe { _mm256_store_ps(place.faces.as_mut_ptr(), faces) };
}

#[inline]
#[target_feature(enable = "avx2")]
fn parts_avx2(a: &Down, b: &Down) -> (bool, bool) {
    let (a, b) = (one(a), one(b));
    // Swap the halves of `b`: lower faces meet upper ones.
    let gap = _mm256_add_ps(a, _mm256_permute2f128_ps::<1>(b, b));
    let far_down = _mm256_or_ps(a, _mm256_set1_ps(-0.0));
    let least = _mm256_sub_ps(
        _mm256_mul_ps(far_down, _mm256_set1_ps(SLACK_SHARE)),
        _mm256_set1_ps(SLACK_LEAST),
    );
    let apart = sign_bits(_mm256_cmp_ps::<_CMP_GT_OQ>(gap, _mm256_setzero_ps()));
    let sure = sign_bits(_mm256_cmp_ps::<_CMP_LE_OQ>(gap, least));
    (apart != 0, sure == 0xFF)
}

#[inline]
#[target_feature(enable = "avx2")]
fn holds_avx2(outer: &Down, inner: &Down) -> bool {
    sign_bits(_mm256_cmp_ps::<_CMP_LE_OQ>(one(outer), one(inner))) == 0xFF
}

#[inline]
#[target_feature(enable = "avx2")]
fn rows(matrix: &[u16; WIDTH]) -> __m256i {
    // SAFETY: the array is as long as the register.
    unsafe { _mm256_loadu_si256(matrix.as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx2")]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "a place below sixteen; eight bits above eight bits"
)]
fn column_avx2(matrix: &[u16; WIDTH], lane: usize) -> u16 {
    // Shift the bit to the top of its row, which packing to bytes keeps as the sign.
    let up = _mm_cvtsi32_si128((WIDTH - 1 - lane % WIDTH) as i32);
    let top = _mm256_sll_epi16(rows(matrix), up);
    let bytes = _mm256_packs_epi16(top, _mm256_setzero_si256());
    let signs = _mm256_movemask_epi8(bytes).cast_unsigned();
    (signs & 0xFF | signs >> 8) as u16
}

#[inline]
#[target_feature(enable = "avx512bw,avx512vl")]
fn column_avx512(matrix: &[u16; WIDTH], lane: usize) -> u16 {
    let bit = (1_u16 << (lane % WIDTH)).cast_signed();
    _mm256_test_epi16_mask(rows(matrix), _mm256_set1_epi16(bit))
}

/// By its own instructions: the compiler handles the row of the sign bit separately, and takes four times as many.
#[inline]
#[target_feature(enable = "avx2")]
fn spread_avx2(rows: u16) -> [u16; WIDTH] {
    #[rustfmt::skip]
    let places = _mm256_setr_epi16(
        1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, i16::MIN,
    );
    let set = _mm256_and_si256(_mm256_set1_epi16(rows.cast_signed()), places);
    lines(_mm256_cmpeq_epi16(set, places))
}

#[inline]
#[target_feature(enable = "avx512bw,avx512vl")]
fn spread_avx512(rows: u16) -> [u16; WIDTH] {
    lines(_mm256_movm_epi16(rows))
}

/// A register as the rows of a matrix.
#[inline]
#[target_feature(enable = "avx2")]
fn lines(all: __m256i) -> [u16; WIDTH] {
    let mut matrix = [0; WIDTH];
    // SAFETY: the array is as long as the register.
    unsafe { _mm256_storeu_si256(matrix.as_mut_ptr().cast(), all) };
    matrix
}

/// The greatest of the chosen lanes; minus infinity if there is none. `set` is all ones in those lanes.
#[inline]
#[target_feature(enable = "avx2")]
fn greatest(low: __m256, high: __m256, set: [__m256; 2]) -> f32 {
    let none = _mm256_set1_ps(f32::NEG_INFINITY);
    // A maximum with NaN as the first operand returns the second: empty lanes drop out.
    let low = _mm256_max_ps(_mm256_blendv_ps(none, low, set[0]), none);
    let high = _mm256_max_ps(_mm256_blendv_ps(none, high, set[1]), none);
    let eight = _mm256_max_ps(low, high);
    let four = _mm_max_ps(
        _mm256_castps256_ps128(eight),
        _mm256_extractf128_ps::<1>(eight),
    );
    let two = _mm_max_ps(four, _mm_movehl_ps(four, four));
    _mm_cvtss_f32(_mm_max_ss(two, _mm_shuffle_ps::<1>(two, two)))
}

#[inline]
#[target_feature(enable = "avx2")]
fn bound_avx2(block: &Boxes16, chosen: u16) -> [f32; 6] {
    // Spread bit k of the mask to all of lane k.
    let bits = _mm256_set1_epi32(i32::from(chosen));
    let places = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    let set = |bits, places| {
        _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(bits, places), places))
    };
    let set = [set(bits, places), set(bits, _mm256_slli_epi32::<8>(places))];
    let turn = _mm256_set1_ps(-0.0);
    let mut bound = [0.0; 6];
    for (k, face) in block.faces.iter().enumerate() {
        let (low, high) = (half(face, 0), half(face, 8));
        bound[k] = if k < 3 {
            -greatest(_mm256_xor_ps(low, turn), _mm256_xor_ps(high, turn), set)
        } else {
            greatest(low, high, set)
        };
    }
    bound
}

impl<const WIDE: bool> Lanes for Vectors<WIDE> {
    #[inline(always)]
    fn meets(self, block: &Boxes16, one: &[f32; 6]) -> u16 {
        if WIDE {
            // SAFETY: a wide one is made only if AVX-512 F is available.
            unsafe { meets_avx512(block, one) }
        } else {
            // SAFETY: a `Vectors` is made only if AVX2 is available.
            unsafe { meets_avx2(block, one) }
        }
    }

    #[inline(always)]
    fn bound(self, block: &Boxes16, chosen: u16) -> [f32; 6] {
        // SAFETY: a `Vectors` is made only if AVX2 is available.
        unsafe { bound_avx2(block, chosen) }
    }

    #[inline(always)]
    fn outward(self, min: &[f64; 3], max: &[f64; 3], origin: &[f64; 3]) -> Down {
        let mut down = Down { faces: [0.0; 8] };
        // SAFETY: a `Vectors` is made only if AVX2 is available.
        unsafe { store(outward_avx2(min, max, origin), &mut down) };
        down
    }

    #[inline(always)]
    fn take(
        self,
        corners: [&[f64; 3]; 2],
        origin: &[f64; 3],
        held: &Held,
        place: &mut Down,
    ) -> bool {
        // SAFETY: a `Vectors` is made only if AVX2 is available.
        unsafe { take_avx2(corners, origin, held, place) }
    }

    #[inline(always)]
    fn keeps(self, corners: [&[f64; 3]; 2], origin: &[f64; 3], held: &Held) -> bool {
        // SAFETY: a `Vectors` is made only if AVX2 is available.
        unsafe { keeps_avx2(corners, origin, held) }
    }

    #[inline(always)]
    fn parts(self, a: &Down, b: &Down) -> (bool, bool) {
        // SAFETY: a `Vectors` is made only if AVX2 is available.
        unsafe { parts_avx2(a, b) }
    }

    #[inline(always)]
    fn holds(self, outer: &Down, inner: &Down) -> bool {
        // SAFETY: a `Vectors` is made only if AVX2 is available.
        unsafe { holds_avx2(outer, inner) }
    }

    #[inline(always)]
    fn column(self, matrix: &[u16; WIDTH], lane: usize) -> u16 {
        if WIDE {
            // SAFETY: a wide one is made only if AVX-512 BW and VL are available.
            unsafe { column_avx512(matrix, lane) }
        } else {
            // SAFETY: a `Vectors` is made only if AVX2 is available.
            unsafe { column_avx2(matrix, lane) }
        }
    }

    #[inline(always)]
    fn spread(self, rows: u16) -> [u16; WIDTH] {
        if WIDE {
            // SAFETY: a wide one is made only if AVX-512 BW and VL are available.
            unsafe { spread_avx512(rows) }
        } else {
            // SAFETY: a `Vectors` is made only if AVX2 is available.
            unsafe { spread_avx2(rows) }
        }
    }

    #[inline(always)]
    fn number(self, lanes: u16, first: u32, place: &mut [u32; WIDTH]) {
        if WIDE {
            // SAFETY: a wide one is made only if AVX-512 F is available.
            unsafe { number_avx512(lanes, first, place) }
        } else {
            // SAFETY: a `Vectors` is made only if AVX2 is available.
            unsafe { number_avx2(lanes, first, place) }
        }
    }
}
