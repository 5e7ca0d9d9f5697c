//! Kernels over sixteen boxes at a time.
//!
//! In: blocks of sixteen boxes as a structure of arrays (`Boxes16`), single boxes (`Down`). Out: masks of sixteen bits,
//! one per lane or row, and plain results. `Portable` is the safe twin in plain Rust; every other set of `Lanes` gives
//! the same bits, which tests compare. The level is chosen once, by the processor's features (`Level::best`).
//!
//! How: a caller writes its loop once as a `Kernel`, generic over `Lanes`, all of it `#[inline(always)]`; `Level::run`
//! compiles it once per level inside a function with the level's instructions enabled, so that the whole loop, not only
//! a kernel, is built for them. AVX2 is the main path, AVX-512 halves its instructions. On aarch64 NEON is part of
//! every target, and the compiler builds the twin with it.
//!
//! Why `std::arch` and not a crate: four kernels need a compare that ends in a bit mask, which no portable layer gives
//! without a detour on AVX2; everything else here the compiler vectorises by itself.

#![allow(
    unsafe_code,
    reason = "instructions that only some processors have; each block names what it relies on"
)]

mod hold;
mod lanes;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use hold::{Held, Hold};
pub(crate) use lanes::{Boxes16, Down, LANES, Lanes, Portable, SPARE, WIDTH, slack};

/// A loop that is built once for each set of lanes.
pub(crate) trait Kernel {
    /// Its result type.
    type Out;
    /// Runs it. Mark it `#[inline(always)]`, like what it calls in its hot part.
    fn run<L: Lanes>(self, lanes: L) -> Self::Out;
}

/// Which instructions are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Plain Rust.
    Portable,
    /// Eight lanes at a time, x86-64 with AVX2.
    Avx2,
    /// Sixteen lanes at a time, x86-64 with AVX-512 F, BW, DQ and VL.
    Avx512,
}

impl Level {
    /// Every level, the best last.
    const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// The best level of this processor.
    #[must_use]
    pub fn best() -> Self {
        Self::Avx512.checked()
    }

    /// Every level of this processor, the best last.
    #[must_use]
    pub fn available() -> Vec<Self> {
        let all = Self::ALL.into_iter();
        all.filter(|level| level.checked() == *level).collect()
    }

    /// Runs a loop with these instructions; any that the processor lacks are never used.
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Out {
        match self.checked() {
            // SAFETY: `checked` has tested that the processor has each feature that the function is built with.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { x86::run_avx512(kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { x86::run_avx2(kernel) },
            _ => kernel.run(Portable),
        }
    }

    /// The level itself if the processor has it, else the best it has: anyone can name a level. The standard library
    /// caches the processor's features in one word; testing them costs a load.
    fn checked(self) -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            let avx2 = is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("lzcnt")
                && is_x86_feature_detected!("popcnt");
            let avx512 = is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl");
            match self {
                Self::Avx512 if avx2 && avx512 => return self,
                Self::Avx512 | Self::Avx2 if avx2 => return Self::Avx2,
                _ => {}
            }
        }
        Self::Portable
    }
}

/// Prefetches what a loop reads a few steps later. A hint, without effect on results.
#[inline(always)]
pub(crate) fn prefetch<T>(place: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let first = std::ptr::from_ref(place).cast::<i8>();
        for at in (0..size_of::<T>()).step_by(64) {
            // SAFETY: a prefetch faults on no address, and this one lies inside `place`; SSE is part of x86-64.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(first.add(at)) };
        }
        // Data that is not aligned to cache lines ends in a further line half of the time, unless it is no longer than
        // its alignment.
        if align_of::<T>() < 64 && size_of::<T>() > align_of::<T>() {
            // SAFETY: as above.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(first.add(size_of::<T>() - 1)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = place;
}

#[cfg(test)]
mod tests;
