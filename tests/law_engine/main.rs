//! Goal: each rule on the meaning and time of results, tested on the whole engine. Method: small scenes whose truth is
//! known by hand, and for each rule the counter-example that once violated it.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::cast_precision_loss,
    missing_docs,
    missing_debug_implementations,
    unreachable_pub,
    reason = "a test"
)]

#[path = "../oracle/mod.rs"]
mod oracle;

mod ask;
mod contacts;
mod deadline;
mod degrade;
mod edits;
mod events;
mod far;
mod floors;
mod impacts;
mod limits;
mod motion;
mod order;
mod plan;
mod pulse;
mod rays;
mod rest;
mod rig;
mod schedule;
mod search;
mod shapes;
mod state;
mod threads;
mod touching;
mod undelivered;
mod used;
mod verdicts;
mod vertices;
