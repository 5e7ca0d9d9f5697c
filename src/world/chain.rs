//! What is known of bodies by what they hang on, until one of those hangs or is elsewhere.

use std::collections::{BTreeMap, BTreeSet};

/// Something known of bodies, and which of them hang on which.
#[derive(Clone, Debug)]
pub(super) struct Chain<K, V> {
    pub(super) known: BTreeMap<K, V>,
    /// By a body those that hang on it.
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
    /// Notes that one hangs on another; whether that is new.
    pub(super) fn hang(&mut self, upper: K, lower: K) -> bool {
        self.below.entry(upper).or_default().insert(lower)
    }

    /// Forgets a body and what hangs on it, and that in turn.
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
