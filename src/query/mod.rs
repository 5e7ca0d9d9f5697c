//! Queries: offline, of shape pairs; and of a running daemon, of two of its bodies.
pub mod batch;
mod gap;

pub use gap::GapQuestion;
