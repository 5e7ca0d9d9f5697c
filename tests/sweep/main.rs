//! Goal: what a continuous body touches between two poses is never missed, and when it touched is right. Method: bodies
//! through thin walls by the thousand and cases whose answer is known by hand, against a motion and distances of their
//! own (`truth`); budgets from nothing to enough.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::print_stdout,
    clippy::cast_precision_loss,
    missing_docs,
    missing_debug_implementations,
    unreachable_pub,
    reason = "a test"
)]

#[path = "../oracle/mod.rs"]
mod oracle;
#[allow(dead_code, reason = "shared with another test")]
#[path = "../law_engine/rig.rs"]
mod rig;

mod boxes;
mod budgets;
mod cases;
mod frames;
mod lost;
mod pairs;
mod runs;
mod sheets;
mod truth;
mod walls;
