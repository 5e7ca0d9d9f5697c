//! Data derived from chains of attachment, valid until one of the bodies is attached or placed elsewhere.

use std::collections::{BTreeMap, BTreeSet};

/// Derived data of bodies, and which of them are attached to which.
#[derive(Clone, Debug)]
pub(super) struct Chain<K, V> {
    pub(super) known: BTreeMap<K, V>,
    /// By body: the bodies attached to it.
    below: BTreeMap<K, BTreeSet<K>>,
}

impl<K, V> Default for Chain<K, V> {
    fn default() -> Self {
        Self {
            known: BTreeMap::new(),
            below: BTreeMap::new(),
        }
    }
}

impl<K: Copy + Ord, V> Chain<K, V> {
    /// Records that one is attached to another; returns whether that is new.
    pub(super) fn hang(&mut self, upper: K, lower: K) -> bool {
        self.below.entry(upper).or_default().insert(lower)
    }

    /// Drops a body and everything attached to it, directly or indirectly.
    pub(super) fn forget(&mut self, body: K) {
        let mut all = vec![body];
        while let Some(at) = all.pop() {
            self.known.remove(&at);
            all.extend(self.below.remove(&at).into_iter().flatten());
        }
    }

    pub(super) fn clear(&mut self) {
        self.known.clear();
        self.below.clear();
    }
}
