//! The plan: the methods chosen for a scene, and the parts that it does not need.
//!
//! In: the world's bodies, the configuration, the readers and the measurements of the broad phase. Out: a [`Plan`] that
//! `check` prints and the daemon publishes when it changes. It is made again when an input changes, never during a
//! tick.

use serde::Serialize;

use crate::broad::Method;
use crate::config::Config;
use crate::world::World;

mod choices;
mod facts;
mod left_out;

use facts::Facts;
pub use facts::Kinds;

/// Up to this many boxes every pair is compared: for so few, any structure costs more than it saves (24 bodies are 276
/// comparisons of boxes).
const BRUTE_FORCE_MAX: usize = 24;
/// Hysteresis: brute force is kept until the scene has more boxes than this.
const BRUTE_FORCE_STAY_MAX: usize = 32;

/// What was chosen for a part, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Choice {
    /// The part of the engine.
    pub part: &'static str,
    /// What it does.
    pub chosen: String,
    /// The measured reason.
    pub why: String,
}

/// What was not built, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// The part of the engine.
    pub part: &'static str,
    /// The measured reason.
    pub why: String,
    /// Memory not taken, bytes.
    pub saved_bytes: u64,
}

/// The methods chosen for a scene, and what is left out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    #[serde(skip)]
    method: Method,
    #[serde(skip)]
    facts: Facts,
    /// Bodies in the scene.
    pub bodies: u64,
    /// Bodies that can move.
    pub moving: u64,
    /// Shapes by kind: convex, mesh, half-space.
    pub shapes: [u64; 3],
    /// Triangles in all meshes, each shared mesh counted once a body.
    pub triangles: u64,
    /// Sizes of the bodies, half-spaces left aside: diameters of the least and the largest ball around one, metres,
    /// to three figures; `None`: there is no such body.
    pub size_m: Option<[f64; 2]>,
    /// What was chosen.
    pub choices: Vec<Choice>,
    /// What was left out.
    pub left_out: Vec<LeftOut>,
}

/// What is computed for readers, and whether there are readers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Readers {
    /// Intervals narrower than a verdict needs: of `pairs`, `changes`, `contacts` or `regions`.
    pub bounds: bool,
    /// `contacts`.
    pub contacts: bool,
    /// `regions`.
    pub regions: bool,
}

/// What is known beside the scene while a daemon runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// What has been read recently.
    pub readers: Readers,
    /// The axis that sweep-and-prune skips because it measured that nearly all boxes overlap on it: 0 to 2.
    pub skipped_axis: Option<usize>,
}

impl Plan {
    /// The plan for the current world.
    ///
    /// * `kinds` - those of its bodies.
    #[must_use]
    pub fn of(world: &World, kinds: &Kinds, config: &Config) -> Self {
        Self::decide(None, Facts::of(world, kinds), config, Seen::default())
    }

    /// The plan after edits, with hysteresis against this one.
    ///
    /// * `kinds` - those of the world's bodies.
    #[must_use]
    pub fn after_edits(&self, world: &World, kinds: &Kinds, config: &Config, seen: Seen) -> Self {
        Self::decide(Some(self.method), Facts::of(world, kinds), config, seen)
    }

    /// The plan for the same bodies after another input has changed.
    #[must_use]
    pub fn anew(&self, config: &Config, seen: Seen) -> Self {
        Self::decide(Some(self.method), self.facts.clone(), config, seen)
    }

    fn decide(before: Option<Method>, facts: Facts, config: &Config, seen: Seen) -> Self {
        let few = if before == Some(Method::BruteForce) {
            BRUTE_FORCE_STAY_MAX
        } else {
            BRUTE_FORCE_MAX
        };
        let fitting = if facts.boxes <= few {
            Method::BruteForce
        } else {
            Method::Order
        };
        let method = config.broad_phase.unwrap_or(fitting);
        Self {
            method,
            bodies: facts.bodies,
            moving: facts.moving,
            shapes: facts.shapes,
            triangles: facts.triangles,
            size_m: facts.size_m,
            choices: choices::of(&facts, method, config, seen),
            left_out: left_out::of(&facts, method, seen),
            facts,
        }
    }

    /// The broad phase.
    #[must_use]
    pub fn method(&self) -> Method {
        self.method
    }

    /// As JSON, one object.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }
}
