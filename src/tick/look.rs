//! Read access to the engine's data: for answers to clients, benches and tests.

use super::{EditOutcome, Engine};
use crate::narrow::{Counters, Narrow};
use crate::pairs::PairSet;
use crate::plan::Plan;
use crate::wire::Outbox;
use crate::world::World;

impl Engine {
    /// Outcomes of the edits of the last tick.
    #[must_use]
    pub fn outcomes(&self) -> &[EditOutcome] {
        &self.outcomes
    }

    /// The bodies, sources and filters.
    #[must_use]
    pub fn world(&self) -> &World {
        &self.world
    }

    /// The narrow phase's findings.
    #[must_use]
    pub fn narrow(&self) -> &Narrow {
        &self.narrow
    }

    /// The candidate pairs.
    #[must_use]
    pub fn pairs(&self) -> &PairSet {
        &self.pairs
    }

    /// The outbox of the last tick.
    #[must_use]
    pub fn outbox(&self) -> &Outbox {
        &self.out
    }

    /// The plan in force.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// What the narrow phase did in the last tick.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.narrow.counters()
    }

    /// The time of the last tick, nanoseconds of `CLOCK_BOOTTIME`; before the first, the time when the engine was made.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Number of ticks so far.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        self.tick
    }
}
