//! Kernels that work on many numbers at once, each with a scalar twin of equal bits.
//!
//! The only room where `unsafe` is allowed, each block with what it relies on: calls of code that is compiled for more
//! than the baseline of its processor family, inside it loads and stores of whole registers, and instructions by name
//! (`boxes/x86.rs`, `aligned.rs`, `words.rs`). No kernel fuses multiply and add, so the same bits come out on every
//! machine.

pub mod aligned;
pub mod boxes;
pub mod obb;
pub(crate) mod words;

/// Queries the processor's features, as the first kernel would: in a virtual machine the first query takes 0.1 ms,
/// which must not be spent in a tick.
pub fn prepare() {
    let _best = boxes::Level::best();
}

/// The greater of two; of a NaN and a number: the second. One instruction.
#[inline(always)]
fn greater(x: f32, y: f32) -> f32 {
    if x > y { x } else { y }
}

/// Numbers from a seed, in [-1, 1).
#[cfg(test)]
fn numbers(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        #[allow(clippy::cast_precision_loss, reason = "24 bits")]
        let x = (state >> 40) as f32;
        x / 8_388_608.0 - 1.0
    }
}
