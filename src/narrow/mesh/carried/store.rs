//! Storage for the entries of all fronts: three arenas of blocks, so that a tick at constant scene allocates nothing
//! and memory released by ended pairs serves the others.

use crate::narrow::arena::Arena;
use crate::narrow::cover::{Cover, Entries};
use crate::narrow::holdings::Holdings;
use crate::narrow::mesh::LeafContact;
use crate::narrow::mesh::manifold::Walks;
use crate::time::Meter;

/// Groups of all fronts together, 24 bytes each: some 10,000 pairs of 20,000-triangle meshes. Beyond it, proofs are
/// lumped together, pair by pair.
const GROUPS_MAX: usize = 1 << 22;
/// Open pairs of boxes of all fronts together, 16 bytes each; depth first needs some hundred per pair. A pair that
/// finds no room is not decided in this tick and starts again in the next.
const OPEN_MAX: usize = 1 << 24;
/// Contacts of leaves of all fronts together, some 200 bytes each; beyond it a pair keeps the deepest of what it has.
const CONTACTS_MAX: usize = 1 << 20;
/// The entries of all fronts. A [`super::CarriedFront`] is used with one store from its start to its release.
#[derive(Debug)]
pub struct FrontStore {
    pub(in crate::narrow) entries: Entries,
    pub(in crate::narrow::mesh) contacts: Arena<LeafContact>,
    /// Of the search in progress.
    pub(super) walks: Walks,
}

impl Default for FrontStore {
    fn default() -> Self {
        Self::with_room(GROUPS_MAX, OPEN_MAX)
    }
}

impl FrontStore {
    /// A store for at most this many groups and open pairs of all fronts.
    #[must_use]
    pub fn with_room(groups: usize, open: usize) -> Self {
        Self {
            entries: Entries::with_room(groups, open),
            contacts: Arena::new(CONTACTS_MAX),
            walks: Walks::default(),
        }
    }

    /// Touches memory ahead for what the next work will store.
    pub(in crate::narrow) fn touch_ahead(&mut self, meter: &mut Meter<'_>) {
        self.entries.touch_ahead(meter);
        self.contacts.touch_ahead(meter);
    }

    /// Structure check of the arenas, and of each front's entries in them.
    ///
    /// # Errors
    /// The first violation, in words.
    pub(in crate::narrow) fn validate(&self, held: &Holdings<'_>) -> Result<(), String> {
        let covers = held.covers.iter();
        let groups: Vec<_> = covers.clone().flat_map(|c| c.runs_of_groups()).collect();
        let open: Vec<_> = covers.clone().flat_map(|c| c.runs_of_open()).collect();
        self.entries.groups.validate(&groups)?;
        self.entries.open.validate(&open)?;
        self.contacts.validate(&held.leaves)?;
        covers
            .copied()
            .try_for_each(|cover: &Cover| cover.validate(&self.entries))
    }

    /// Bytes in use by blocks, free ones included.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.entries.bytes() + self.contacts.bytes()
    }
}
