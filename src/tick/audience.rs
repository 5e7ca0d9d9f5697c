//! Which messages had readers recently: input of the plan.

use crate::plan::Readers;
use crate::wire::Demand;

/// Ticks without a reader of a message before the plan drops it: a reader that comes back does not make the plan switch
/// back and forth.
const QUIET_TICKS: u32 = 64;

/// Ticks since the last reader, for each result that is computed for readers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Audience {
    bounds: u32,
    contacts: u32,
    regions: u32,
}

impl Default for Audience {
    fn default() -> Self {
        Self {
            bounds: QUIET_TICKS,
            contacts: QUIET_TICKS,
            regions: QUIET_TICKS,
        }
    }
}

impl Audience {
    /// Records the demand of this tick; returns what had readers recently.
    pub(super) fn note(&mut self, now: Demand) -> Readers {
        let whole = now.tells_contacts() || now.regions;
        Readers {
            bounds: lately(&mut self.bounds, now.pairs || now.changes || whole),
            contacts: lately(&mut self.contacts, now.tells_contacts()),
            regions: lately(&mut self.regions, now.regions),
        }
    }
}

fn lately(quiet: &mut u32, is_read: bool) -> bool {
    *quiet = if is_read {
        0
    } else {
        quiet.saturating_add(1).min(QUIET_TICKS)
    };
    *quiet < QUIET_TICKS
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reads(contacts: bool, pairs: bool) -> Demand {
        Demand {
            contacts,
            pairs,
            changes_anew: true,
            ..Demand::default()
        }
    }

    #[test]
    fn who_comes_counts_at_once_and_who_goes_for_63_ticks_more_each_for_itself() {
        let mut audience = Audience::default();
        let nobody = Readers::default();
        assert_eq!(audience.note(reads(false, false)), nobody);
        let both = audience.note(reads(true, true));
        assert!(both.contacts && both.bounds && !both.regions);
        // The contract says 64 ticks (`msgs/README.md`, Plan): the 64th without a reader is the first that says so.
        for tick in 1..64 {
            assert_eq!(audience.note(reads(false, true)), both, "tick {tick}");
        }
        // The reader of pairs is away from here on: this is its first tick away.
        let pairs = Readers {
            bounds: true,
            ..nobody
        };
        assert_eq!(audience.note(reads(false, false)), pairs);
        for tick in 2..64 {
            assert_eq!(audience.note(reads(false, false)), pairs, "tick {tick}");
        }
        assert_eq!(audience.note(reads(false, false)), nobody);
        assert_eq!(audience.note(reads(false, false)), nobody);
        // A short visit restarts the count.
        assert_eq!(audience.note(reads(false, true)), pairs);
        for tick in 1..64 {
            assert_eq!(audience.note(reads(false, false)), pairs, "tick {tick}");
        }
        assert_eq!(audience.note(reads(false, false)), nobody);
    }
}
