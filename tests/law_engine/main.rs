//! Goal: the law of meaning and time, rule by rule, as the whole engine obeys it. Method: small scenes whose truth is
//! known by hand, and for each rule the counter-example that once spoke against it.
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
