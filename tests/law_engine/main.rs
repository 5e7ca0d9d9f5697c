//! Goal: the law of meaning and time, rule by rule, as the whole engine obeys it. Method: small scenes whose truth is
//! known by hand, and for each rule the counter-example that once spoke against it.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::cast_precision_loss,
    reason = "a test"
)]

mod events;
mod rig;
mod state;
mod verdicts;
