//! Goal: the daemon as a client sees it, over shared memory between processes. Method: the real binary as a child, the
//! Rust client in this process. The few limits on durations are wide, because other load may slow the machine.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::disallowed_methods,
    reason = "tests"
)]

mod live;

#[path = "daemon/bad_input.rs"]
mod bad_input;
#[path = "daemon/bullets.rs"]
mod bullets;
#[path = "daemon/changes.rs"]
mod changes;
#[path = "daemon/cloths.rs"]
mod cloths;
#[path = "daemon/edits.rs"]
mod edits;
#[path = "daemon/ends.rs"]
mod ends;
#[path = "daemon/gaps.rs"]
mod gaps;
#[path = "daemon/silence.rs"]
mod silence;
#[path = "daemon/steps.rs"]
mod steps;
#[path = "daemon/touches.rs"]
mod touches;
