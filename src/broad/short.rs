//! A pair set that is too small: when to search again for the pairs that did not fit.
//!
//! In: how full the set is. Out: whether the bodies that miss pairs are queried for all of theirs in this tick. Such a
//! query reports every overlap of a crowd, possibly many times what the set holds. So it runs in each tick only where
//! pairs are few; otherwise now and then, and only when the result may have changed: a crowd at rest costs nothing.
//!
//! Nothing is lost in the ticks between: a body that missed a pair stays marked and is still reported as truncated. A
//! pair of two marked bodies waits, for it may be one that was missed before; any other pair is new, and is stored or
//! counted as missing as usual.
//!
//! The decision depends on counts only, which are the same for every method, so all methods and a replay store alike.

use super::BroadPhase;
use super::members::{ASKED, IN};
use crate::pairs::PairSet;
use crate::world::ChangeSet;

/// Pairs, stored and missing, that may be recounted in each tick: about 2 ms.
const PAIRS: u64 = 1 << 16;
/// When one part in `ROOMY` of the set is free, missing pairs are searched at once: the crowd is dispersing.
const ROOMY: usize = 8;

/// When the missing pairs were last counted.
#[derive(Clone, Debug)]
pub(super) struct Short {
    /// Pairs that may be recounted in each tick.
    most: u64,
    /// Pairs stored and missing at the last count; and ticks since.
    pairs: u64,
    ticks: u64,
    /// The number of missing pairs may have fallen since.
    stirred: bool,
    /// Pairs are missing and are not counted in this tick.
    waits: bool,
}

impl Default for Short {
    fn default() -> Self {
        Self {
            most: PAIRS,
            pairs: 0,
            ticks: 0,
            stirred: false,
            waits: false,
        }
    }
}

impl Short {
    /// Sets how many pairs may be recounted in each tick.
    pub(super) fn use_most(&mut self, most: u64) {
        self.most = most;
    }

    /// A body that misses pairs moved, left or was edited, or the forced pairs changed.
    pub(super) fn stir(&mut self) {
        self.stirred = true;
    }

    /// Begins a tick; returns whether to search all pairs of the bodies that miss some.
    ///
    /// * `misses` - whether a body that is in misses pairs.
    fn open_tick(&mut self, misses: bool, pairs: &PairSet) -> bool {
        self.ticks += 1;
        let room = pairs.limit().saturating_sub(pairs.len());
        let is_due = self.ticks.saturating_mul(self.most) >= self.pairs;
        let counts = self.pairs <= self.most
            || room.saturating_mul(ROOMY) >= pairs.limit()
            || is_due && (self.stirred || room > 0);
        self.waits = misses && !counts;
        misses && !self.waits
    }

    /// Returns whether pairs are missing that are not counted in this tick.
    pub(super) fn waits(&self) -> bool {
        self.waits
    }

    /// Ends a tick.
    pub(super) fn close_tick(&mut self, pairs: &PairSet) {
        if !self.waits {
            self.ticks = 0;
            self.stirred = false;
            self.pairs = pairs.len() as u64 + pairs.missing();
        }
    }
}

impl BroadPhase {
    /// Marks the bodies that miss pairs for a new query, so that missing pairs are counted exactly, and stored when
    /// there is room. Called after bodies that left were removed with their pairs.
    pub(super) fn ask_missing(&mut self, changes: &ChangeSet, pairs: &PairSet) {
        let members = &mut self.members;
        if !(pairs.truncated().iter()).any(|slot| members.has(*slot, IN)) {
            self.short.open_tick(false, pairs);
            return;
        }
        let told = changes.moved.iter().chain(&changes.requery);
        let mut told = told.chain(changes.removed.iter().map(|removed| &removed.slot));
        if told.any(|slot| pairs.is_truncated(*slot)) {
            self.short.stir();
        }
        if self.short.open_tick(true, pairs) {
            for slot in pairs.truncated() {
                if members.has(*slot, IN) {
                    members.touch(*slot, ASKED);
                }
            }
        }
    }
}
