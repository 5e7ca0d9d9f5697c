//! A pair set that is too small: when the pairs that found no room are looked for again.
//!
//! In: how full the set is. Out: whether the bodies that miss pairs are asked for all of theirs in this tick. That
//! tells every overlap of a crowd, which may be many times what the set holds. So it is done in each tick only where
//! pairs are few; else at times, and only when something of them may have changed: a crowd at rest costs nothing.
//!
//! In the ticks between nothing is lost: whoever missed a pair stays marked, and so is what is said of it. A pair of
//! two marked bodies waits, for it may be one that was missed before; any other is new, and is stored or missed as
//! ever.
//!
//! What decides is counted and the same for every method, so that all store alike, and so does a replay.

use super::BroadPhase;
use super::members::{ASKED, IN};
use crate::pairs::PairSet;
use crate::world::ChangeSet;

/// Pairs, stored and missing, that may be counted anew in each tick: some 2 ms.
const PAIRS: u64 = 1 << 16;
/// So much of a full set is left, and what is missing is looked for at once: the crowd goes apart.
const ROOMY: usize = 8;

/// When what is missing was counted.
#[derive(Clone, Debug)]
pub(super) struct Short {
    /// Pairs that may be counted anew in each tick.
    most: u64,
    /// Pairs that were stored and missing when they were last counted; and ticks since.
    pairs: u64,
    ticks: u64,
    /// What is missing may have become less since.
    stirred: bool,
    /// Pairs are missing, and are not counted in this tick.
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
    /// Sets how many pairs may be counted anew in each tick.
    pub(super) fn use_most(&mut self, most: u64) {
        self.most = most;
    }

    /// A body that misses pairs moved, left or was edited, or the pairs of rules are others.
    pub(super) fn stir(&mut self) {
        self.stirred = true;
    }

    /// Begins a tick; returns whether all pairs of the bodies that miss some are to be looked for.
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

    /// Whether pairs are missing that are not counted in this tick.
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
    /// Notes whom to ask again of those that miss pairs, so that these are counted exactly, and stored when there is
    /// room; once those that left are out, and their pairs.
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
