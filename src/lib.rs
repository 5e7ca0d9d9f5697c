//! sweepd: a collision server. Body transforms come in over shared memory, colliding pairs and contacts go out
//! within a time budget per tick; every answer is a sound interval that motion widens and work narrows.
//!
//! Promised to users of the library: [`scene`], [`wire`], [`tick`] and [`transport::client`]. Data flows down this
//! list; a room names only rooms above it (`tests/rooms.rs` checks it).

// foundation
pub mod error;
pub mod ids;
pub mod limits;
pub mod math;
pub mod simd;
pub mod time;
// walls
pub mod config;
pub mod transport;
pub mod wire;
// corridor; data flows shape, scene, world, pairs, broad, narrow, publish
pub mod broad;
pub mod narrow;
pub mod pairs;
pub mod publish;
pub mod scene;
pub mod shape;
pub mod world;
// engine
pub mod plan;
pub mod tick;
// around
pub mod builtin;
pub mod cli;
pub mod daemon;
pub mod query;
pub mod record;
pub mod report;
