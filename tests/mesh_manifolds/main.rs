//! Goal: manifolds on meshes without internal-edge artefacts: on a flat floor normals equal that of the floor
//! regardless of its triangle edges, few points span the contact area, and a contact keeps its id while the body
//! slides.
//!
//! Method: an engine with two bodies and no limit; bodies of every kind rest on, slide over, spin on and penetrate
//! floors of random triangles. The expected results follow from the construction of the scene.

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
