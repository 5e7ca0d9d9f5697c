//! Goal: each rule of the contract (`msgs/README.md`) that the world keeps, with the counter-example that it must
//! withstand. Method: a world of cubes is fed frames and edits by hand; its structure is checked after every tick.
#![allow(
    clippy::unwrap_used,
    clippy::float_cmp,
    reason = "helpers of tests, and numbers that must come through bit by bit"
)]

mod churn;
#[path = "../common/mod.rs"]
mod common;
mod edits;
mod filters;
mod frames;
mod requests;
mod rules;
mod sources;
mod support;
mod unknown;
mod vertices;
