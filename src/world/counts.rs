//! How many bodies are in which state, and what that makes of the answers.
//!
//! In: the counts by status and the sources, kept by who changes them. Out: [`Counts`], once a tick.

use super::World;
use crate::wire::{BodyStatus, Reason};

/// How many bodies are in which state; what the tick row says of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Bodies in the scene.
    pub bodies: u64,
    /// Bodies whose place is not known: not received, rejected or stale.
    pub unknown: u64,
    /// Bits of `wire::Reason` that the bodies and sources give.
    pub reasons: u32,
    /// Bodies by `BodyStatus`.
    pub by_status: [u64; BodyStatus::ALL.len()],
}

impl World {
    /// What the bodies and sources make of the tick.
    #[must_use]
    pub fn counts(&self) -> Counts {
        let of = |status: BodyStatus| self.by_status[usize::from(status.code())];
        let bodies: u64 = self.by_status.iter().sum();
        let silent = !self.sources.is_empty() && self.sources.iter().all(|s| s.frames == 0);
        let reasons = [
            (Reason::NotReceived, of(BodyStatus::NotReceived) > 0),
            (Reason::Rejected, of(BodyStatus::Rejected) > 0),
            (Reason::Stale, of(BodyStatus::Stale) > 0),
            (Reason::Held, of(BodyStatus::Held) > 0),
            (Reason::RemovedByAge, of(BodyStatus::RemovedByAge) > 0),
            // Whatever stands beside the way that is gone may have been hit.
            (Reason::Truncated, self.sources.iter().any(|s| s.cut)),
            (
                Reason::NoInput,
                bodies == of(BodyStatus::Disabled) || silent,
            ),
        ];
        Counts {
            bodies,
            unknown: of(BodyStatus::NotReceived) + of(BodyStatus::Rejected) + of(BodyStatus::Stale),
            reasons: reasons
                .iter()
                .filter(|(_, holds)| *holds)
                .fold(0, |bits, (reason, _)| bits | reason.bit()),
            by_status: self.by_status,
        }
    }
}
