//! Whether a box keeps to a hold, eight lanes at a time: its faces against those of the fat box and of the core.

use std::arch::x86_64::{
    __m256, _CMP_LE_OQ, _mm_loadu_ps, _mm_permute_ps, _mm256_and_ps, _mm256_cmp_ps, _mm256_set_m128,
};

use super::super::hold::Held;
use super::super::lanes::Down;
use super::{nearest_avx2, outward_avx2, sign_bits, store};

/// The lanes of a [`Down`] that are not spare.
const FACES: u32 = 0x77;

/// The fat box and the core, with arbitrary values in the spare lanes next to a corner.
#[inline]
#[target_feature(enable = "avx2")]
fn both(held: &Held) -> [__m256; 2] {
    let from = held.faces.as_ptr();
    // SAFETY: twelve floats, of which four are read from the first, fourth, seventh and ninth on.
    let [x, u, r, t] = unsafe {
        [
            _mm_loadu_ps(from),
            _mm_loadu_ps(from.add(3)),
            _mm_loadu_ps(from.add(6)),
            _mm_loadu_ps(from.add(8)),
        ]
    };
    // The last three are a lane too high, because nothing follows them in memory.
    let l = _mm_permute_ps::<0b11_11_10_01>(t);
    [_mm256_set_m128(u, x), _mm256_set_m128(l, r)]
}

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn take_avx2(
    corners: [&[f64; 3]; 2],
    origin: &[f64; 3],
    held: &Held,
    place: &mut Down,
) -> bool {
    // Compared from the register: reading back in halves what was just written would wait for both.
    let faces = outward_avx2(corners[0], corners[1], origin);
    store(faces, place);
    is_within(faces, held)
}

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn keeps_avx2(corners: [&[f64; 3]; 2], origin: &[f64; 3], held: &Held) -> bool {
    is_within(nearest_avx2(corners[0], corners[1], origin), held)
}

#[inline]
#[target_feature(enable = "avx2")]
fn is_within(faces: __m256, held: &Held) -> bool {
    let [fat, core] = both(held);
    let inside = _mm256_cmp_ps::<_CMP_LE_OQ>(fat, faces);
    let around = _mm256_cmp_ps::<_CMP_LE_OQ>(faces, core);
    sign_bits(_mm256_and_ps(inside, around)) & FACES == FACES
}
