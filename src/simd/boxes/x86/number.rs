//! The numbers of the selected lanes, one after the other.
//!
//! In: a mask. Out: as many numbers as it has ones, without a branch on their count.

use std::arch::x86_64::{
    _mm_loadl_epi64, _mm256_add_epi32, _mm256_cvtepu8_epi32, _mm256_set1_epi32,
    _mm256_storeu_si256, _mm512_add_epi32, _mm512_maskz_compress_epi32, _mm512_set1_epi32,
    _mm512_setr_epi32, _mm512_storeu_si512,
};

use crate::simd::boxes::WIDTH;

/// By eight bits: the indices of the ones, followed by arbitrary values.
const PLACES: [[u8; 8]; 256] = {
    let mut places = [[0; 8]; 256];
    let mut bits = 0;
    while bits < places.len() {
        let (mut at, mut place) = (0, 0);
        while place < 8 {
            if bits >> place & 1 == 1 {
                places[bits][at] = place;
                at += 1;
            }
            place += 1;
        }
        bits += 1;
    }
    places
};

#[inline]
#[target_feature(enable = "avx2,popcnt")]
pub(super) fn number_avx2(lanes: u16, first: u32, place: &mut [u32; WIDTH]) {
    let [low, high] = lanes.to_le_bytes();
    let eight = |bits: u8, first: u32| {
        // SAFETY: a row of the table is eight bytes.
        let places = unsafe { _mm_loadl_epi64(PLACES[usize::from(bits)].as_ptr().cast()) };
        let first = _mm256_set1_epi32(first.cast_signed());
        _mm256_add_epi32(first, _mm256_cvtepu8_epi32(places))
    };
    let at = low.count_ones() as usize;
    let from = place.as_mut_ptr();
    // SAFETY: eight numbers from the start, and eight behind the up to eight that stay, lie inside the array.
    unsafe {
        _mm256_storeu_si256(from.cast(), eight(low, first));
        _mm256_storeu_si256(from.add(at).cast(), eight(high, first.wrapping_add(8)));
    }
}

#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn number_avx512(lanes: u16, first: u32, place: &mut [u32; WIDTH]) {
    let places = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    let all = _mm512_add_epi32(_mm512_set1_epi32(first.cast_signed()), places);
    // To a register first: some processors take a hundred steps to write it to memory directly.
    let some = _mm512_maskz_compress_epi32(lanes, all);
    // SAFETY: the array holds sixteen numbers.
    unsafe { _mm512_storeu_si512(place.as_mut_ptr().cast(), some) };
}
