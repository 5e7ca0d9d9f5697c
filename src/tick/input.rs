//! What a tick is given, and what becomes of its edits.

use crate::time::Budget;
use crate::wire::{Demand, Inbox, TickCause, TickRow};
use crate::world::{Applied, Edit};

/// One request's edits: all of them are done, or none.
#[derive(Clone, Debug)]
pub struct EditBatch {
    /// The asker's number, echoed in the outcome.
    pub token: u64,
    /// The edits, in their order.
    pub edits: Vec<Edit>,
    /// Check every structure first, and build anew what does not hold: said in the outcome's warnings.
    pub validate: bool,
    /// Things the asker should know that stop nothing.
    pub warnings: Vec<String>,
}

/// What became of a batch.
#[derive(Clone, Debug)]
pub struct EditOutcome {
    /// The asker's number.
    pub token: u64,
    /// Done from which scene revision on, or what to change.
    pub result: Result<Applied, String>,
    /// As in the batch.
    pub warnings: Vec<String>,
}

/// What one tick is given.
pub struct TickInput<'a> {
    /// Frames to admit, in order.
    pub inbox: &'a Inbox,
    /// Edits to apply, each batch whole or not at all.
    pub edits: &'a [EditBatch],
    /// Who listens.
    pub demand: Demand,
    /// What may be spent.
    pub budget: Budget,
    /// Why this tick.
    pub cause: TickCause,
    /// Place of the source whose frame caused it.
    pub cause_source: Option<usize>,
    /// When the daemon woke for it, `CLOCK_MONOTONIC` nanoseconds.
    pub woke_ns: u64,
    /// Gets a bare `unknown` tick at least each heartbeat while this tick goes on.
    pub pulse: Option<&'a mut dyn FnMut(&TickRow)>,
}

impl std::fmt::Debug for TickInput<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TickInput")
            .field("frames", &self.inbox.frames().len())
            .field("edits", &self.edits.len())
            .field("demand", &self.demand)
            .field("budget", &self.budget)
            .field("cause", &self.cause)
            .finish_non_exhaustive()
    }
}
