//! Narrow phase.
pub mod exact;
pub mod mesh;
