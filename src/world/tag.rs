//! Tags: the few data of both bodies of every pair that publishing needs, in one array.
//!
//! In: the settled state of a body. Out: sixteen bytes per body, which stay in the cache; the bodies themselves (some
//! hundred times as much memory, accessed in random order) do not.

use super::body::Body;
use crate::ids::{BodyId, BodySlot};
use crate::wire::BodyStatus;

/// The essential data of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tag {
    /// Its id.
    pub id: BodyId,
    /// What is known of its place.
    pub status: BodyStatus,
    /// Whether the velocity of its surface is known: given by its sender, or zero because it cannot move. For a body
    /// that deforms the velocities of its vertices are unknown.
    pub has_velocity: bool,
}

const _: () = assert!(size_of::<Tag>() == 16, "four share a cache line");

impl Tag {
    pub(super) fn of(body: &Body) -> Self {
        Self {
            id: body.id,
            status: body.status,
            has_velocity: (body.velocity.is_some() || !body.moves) && body.vertices.is_none(),
        }
    }
}

/// Tags by slot.
#[derive(Clone, Debug, Default)]
pub(super) struct Tags {
    list: Vec<Option<Tag>>,
}

impl Tags {
    pub(super) fn grow(&mut self, len: usize) {
        self.list.resize(len.max(self.list.len()), None);
    }

    pub(super) fn set(&mut self, slot: BodySlot, tag: Option<Tag>) {
        self.list[slot.index()] = tag;
    }

    pub(super) fn get(&self, slot: BodySlot) -> Option<&Tag> {
        self.list.get(slot.index())?.as_ref()
    }
}
