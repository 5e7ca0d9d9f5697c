//! All of our broad phases on the same boxes, one process per run. `benches/peers` compares them with other libraries.
//!
//! `cargo bench --bench broad -- [--bodies 1000,10000,100000] [--scene gas,pile] [--method order,sap] [--frames N]
//! [--save]`; for the output see `run`.

#![allow(
    missing_docs,
    missing_debug_implementations,
    unreachable_pub,
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    clippy::approx_constant,
    reason = "a bench prints, and stops at the first surprise"
)]

#[path = "../../tests/common/mod.rs"]
mod common;
mod exact;
mod methods;
mod run;
mod scenes;

fn main() {
    run::main(methods::NAMES, methods::runner, None);
}
