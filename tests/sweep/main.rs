//! Goal: a contact of a continuous body between two poses is never missed, and its time is right. Method: thousands of
//! bodies through thin walls, and cases with answers computed by hand, compared with independent code for motions and
//! distances (`truth`); budgets from nothing to enough.
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
