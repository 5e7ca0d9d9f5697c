//! Which of eight words equal a given one.
//!
//! In: eight words and one. Out: a bit for each that equals it. Compiled from the twin it takes three times as long:
//! the compiler vectorises some compares and leaves others.

#![allow(
    unsafe_code,
    reason = "instructions by name, which every x86-64 processor has"
)]

/// Words that are compared at once.
pub(crate) const WORDS: usize = 8;

/// The indices of those that equal `one`, as bits.
#[inline(always)]
pub(crate) fn same(words: &[u32; WORDS], one: u32) -> u32 {
    #[cfg(target_arch = "x86_64")]
    {
        x86(words, one)
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        plain(words, one)
    }
}

/// The twin in plain Rust.
#[cfg(any(test, not(target_arch = "x86_64")))]
fn plain(words: &[u32; WORDS], one: u32) -> u32 {
    let equal = words.iter().enumerate();
    equal.fold(0, |bits, (at, word)| bits | u32::from(*word == one) << at)
}

/// By SSE2, which every x86-64 has: safe to call everywhere there.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn x86(words: &[u32; WORDS], one: u32) -> u32 {
    use std::arch::x86_64::{
        _mm_cmpeq_epi32, _mm_movemask_epi8, _mm_packs_epi16, _mm_packs_epi32, _mm_set1_epi32,
        _mm_setr_epi32, _mm_setzero_si128,
    };
    let [a, b, c, d, e, f, g, h] = words.map(u32::cast_signed);
    // SAFETY: SSE2 is part of x86-64.
    let bytes = unsafe {
        let one = _mm_set1_epi32(one.cast_signed());
        let low = _mm_cmpeq_epi32(_mm_setr_epi32(a, b, c, d), one);
        let high = _mm_cmpeq_epi32(_mm_setr_epi32(e, f, g, h), one);
        // Packing preserves all ones.
        let halves = _mm_packs_epi32(low, high);
        _mm_movemask_epi8(_mm_packs_epi16(halves, _mm_setzero_si128()))
    };
    bytes.cast_unsigned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_set_of_equal_words_is_told() {
        for one in [0, 7, u32::MAX, 1 << 31] {
            for bits in 0..1_u32 << WORDS {
                let words = std::array::from_fn(|at| if bits >> at & 1 == 1 { one } else { 5 });
                assert_eq!((same(&words, one), plain(&words, one)), (bits, bits));
            }
        }
    }
}
