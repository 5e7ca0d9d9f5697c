//! Goal: manifolds on meshes without internal-edge artefacts: normals of a flat floor are the floor's wherever the
//! edges of its triangles lie, few points span what touches, and a contact keeps its id while the body slides.
//!
//! Method: an engine with two bodies and no limit; bodies of every kind rest, slide, spin and are pushed in over floors
//! of random triangles. What must come out is known from how the scene was made.

#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_precision_loss,
    unreachable_pub,
    reason = "a test; the shared parts are used in part"
)]

#[path = "../harness/mod.rs"]
mod harness;
#[path = "../oracle/mod.rs"]
mod oracle;

mod flat;
mod fresh;
mod on_surface;
mod support;
mod surfaces;
