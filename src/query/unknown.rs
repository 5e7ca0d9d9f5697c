//! Bodies of unknown place in an answer: named while there is room, then counted. In: bodies. Out: names and what is
//! known of each.

use crate::limits::UNKNOWN_ROWS_MAX;
use crate::wire::{BodyStatus, UnknownBody};
use crate::world::Body;

/// Where a body may be, for a query of a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Whereabouts {
    /// Only within its box.
    InItsBox,
    /// There, and elsewhere too: it is held at an old pose.
    HeldThere,
    /// Nothing bounds its place.
    Anywhere,
}

impl Whereabouts {
    pub(super) fn of(body: &Body) -> Self {
        match body.status {
            BodyStatus::Disabled => Self::InItsBox,
            BodyStatus::Held => Self::HeldThere,
            _ if body.reach_m.is_infinite() => Self::Anywhere,
            _ => Self::InItsBox,
        }
    }
}

/// The bodies found so far.
#[derive(Debug, Default)]
pub(super) struct Unknown {
    named: Vec<UnknownBody>,
    left_out: u64,
}

impl Unknown {
    /// Adds a body, unless its place is known.
    pub(super) fn note(&mut self, body: &Body) {
        if matches!(body.status, BodyStatus::Known | BodyStatus::Truncated) {
            return;
        }
        if self.named.len() < UNKNOWN_ROWS_MAX {
            self.named.push(UnknownBody {
                body: body.name.clone(),
                status: body.status.word().to_owned(),
            });
        } else {
            self.left_out += 1;
        }
    }

    /// Whether every body's place is known.
    pub(super) fn is_none(&self) -> bool {
        self.named.is_empty()
    }

    /// The names, and the number of further bodies.
    pub(super) fn take(self) -> (Vec<UnknownBody>, u64) {
        (self.named, self.left_out)
    }
}
