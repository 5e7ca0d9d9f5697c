//! Kernels that work on many numbers at once, each beside a scalar twin of equal bits.
//!
//! The one room where `unsafe` is lifted, for calls of code that is compiled for more than the least of its processor
//! family; what is called is ordinary safe code in every case. No kernel multiplies and adds in one rounding, so the
//! same bits come out on every machine.

pub mod boxes;
pub mod obb;
