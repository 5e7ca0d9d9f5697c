//! Pairs that are candidates whatever the boxes say: those of a rule with a larger `report_within_m`.
//!
//! In: the whole list when it changed. Out: which keys to test in the next update, and lookups.

use crate::ids::{BodySlot, PairKey};

/// The forced pairs.
#[derive(Clone, Debug, Default)]
pub(super) struct Forced {
    /// Sorted.
    keys: Vec<PairKey>,
    /// Each pair twice, once under each body; sorted.
    sides: Vec<(BodySlot, BodySlot)>,
    /// Keys that came or went since the last update.
    changed: Vec<PairKey>,
}

impl Forced {
    /// Replaces the whole list.
    pub(super) fn replace(&mut self, keys: &[PairKey]) {
        self.changed.append(&mut self.keys);
        self.keys.extend_from_slice(keys);
        self.keys.sort_unstable();
        self.keys.dedup();
        self.changed.extend_from_slice(&self.keys);
        self.sides.clear();
        for key in &self.keys {
            let (low, high) = key.slots();
            self.sides.extend([(low, high), (high, low)]);
        }
        self.sides.sort_unstable();
    }

    /// Returns whether the pair is forced.
    pub(super) fn has(&self, key: PairKey) -> bool {
        self.keys.binary_search(&key).is_ok()
    }

    /// The forced pairs of one body.
    pub(super) fn of(&self, slot: BodySlot) -> impl Iterator<Item = PairKey> + '_ {
        let from = self.sides.partition_point(|(body, _)| *body < slot);
        self.sides[from..]
            .iter()
            .take_while(move |(body, _)| *body == slot)
            .map(|(body, other)| PairKey::new(*body, *other))
    }

    /// Keys that came or went since the last update.
    pub(super) fn changed(&self) -> &[PairKey] {
        &self.changed
    }

    /// Marks the changes as handled.
    pub(super) fn settle(&mut self) {
        self.changed.clear();
    }
}
