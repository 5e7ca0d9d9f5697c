//! Offline queries.
pub mod batch;
