//! Scenes: the bodies, sources and pair rules, and the settings of the daemon that runs them.
//!
//! In: a TOML file (unknown keys are errors). Out: a checked [`Scene`]; every error names file, line, body and the fix.
//! Requests to edit a running scene are JSON with the same keys; a request is applied as a whole or not at all.

mod build;
mod model;
mod node;
mod notes;
mod pattern;
mod question;
mod read_body;
mod read_ros;
mod read_rule;
mod read_scene;
mod read_shape;
mod read_text;
mod read_viewpoint;
mod request;
mod resolve;
mod table;

pub use build::BuiltShapes;
pub use model::{BodySpec, Origin, PairAction, PairRule, PlacedSpec, Scene, SourceSpec};
pub(crate) use pattern::literal_ends;
pub use pattern::{is_pattern, pattern_matches};
pub use question::{Impact, Question, Ray, Subject, Touching, Velocity};
pub use read_body::{BODY_NAME_BYTES_MAX, BodyDraft, SOURCE_NAME_BYTES_MAX};
pub(crate) use read_ros::no_lockstep;
pub use request::{EDITS_MAX, Edit, EditRequest, Request};
