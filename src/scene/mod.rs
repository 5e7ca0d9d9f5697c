//! Scenes: which bodies, sources and pair rules there are, and how the daemon runs them.
//!
//! In: a TOML file (strict). Out: a checked [`Scene`]; every error names file, line, body and the mend.

mod model;

pub use model::{BodySpec, PairAction, PairRule, PlacedSpec, Scene, SourceSpec};
