//! Goal: each rule of the contract (`msgs/README.md`) that the world implements, with the counter-example for it.
//! Method: a world of cubes is fed frames and edits by hand; its structure is validated after every tick.
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
