//! Input of a tick, and the outcome of its edits.

use crate::time::Budget;
use crate::wire::{Demand, Inbox, TickCause, TickRow};
use crate::world::{Applied, Edit};

/// One request's edits: all of them are done, or none.
#[derive(Clone, Debug)]
pub struct EditBatch {
    /// The requester's number, echoed in the outcome.
    pub token: u64,
    /// The edits, in their order.
    pub edits: Vec<Edit>,
    /// Check every structure first, and rebuild those that fail; reported in the outcome's warnings.
    pub validate: bool,
    /// Hints for the requester that stop nothing.
    pub warnings: Vec<String>,
}

/// Outcome of a batch.
#[derive(Clone, Debug)]
pub struct EditOutcome {
    /// The requester's number.
    pub token: u64,
    /// The scene revision from which on it is done, or what to change.
    pub result: Result<Applied, String>,
    /// As in the batch.
    pub warnings: Vec<String>,
}

/// Input of one tick.
pub struct TickInput<'a> {
    /// Frames to admit, in order.
    pub inbox: &'a Inbox,
    /// Edits to apply, each batch whole or not at all.
    pub edits: &'a [EditBatch],
    /// Which messages have readers.
    pub demand: Demand,
    /// What may be spent.
    pub budget: Budget,
    /// Why this tick.
    pub cause: TickCause,
    /// Index of the source whose frame caused it.
    pub cause_source: Option<usize>,
    /// When the daemon woke for it, `CLOCK_MONOTONIC` nanoseconds.
    pub woke_ns: u64,
    /// Receives a bare `unknown` tick at least each heartbeat while this tick goes on.
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
