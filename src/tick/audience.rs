//! Who has listened lately: what the plan says of readers.

use crate::wire::Demand;

/// Ticks for which nobody must have read a message before the plan says so: a reader that comes back does not make the
/// plan go to and fro.
const QUIET_TICKS: u32 = 64;

/// What somebody has listened to lately.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Audience {
    lately: Demand,
    /// Ticks since less than that is listened to.
    quiet: u32,
}

impl Audience {
    /// Notes who listens to this tick; what somebody has listened to lately.
    pub(super) fn note(&mut self, now: Demand) -> Demand {
        let all = both(self.lately, now);
        // The one that came anew is no part of it: it says what one message is to hold.
        let now = both(now, Demand::default());
        self.quiet = if all == now { 0 } else { self.quiet + 1 };
        self.lately = if self.quiet < QUIET_TICKS { all } else { now };
        self.lately
    }
}

/// What the one or the other listens to.
fn both(a: Demand, b: Demand) -> Demand {
    Demand {
        pairs: a.pairs || b.pairs,
        contacts: a.contacts || b.contacts,
        regions: a.regions || b.regions,
        bodies: a.bodies || b.bodies,
        body_verdicts: a.body_verdicts || b.body_verdicts,
        changes: a.changes || b.changes,
        changes_anew: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_comes_counts_at_once_and_who_goes_after_a_while() {
        let reads = Demand {
            contacts: true,
            changes_anew: true,
            ..Demand::default()
        };
        let mut audience = Audience::default();
        assert!(audience.note(reads).contacts);
        for _ in 1..QUIET_TICKS {
            assert!(audience.note(Demand::default()).contacts);
        }
        assert_eq!(audience.note(Demand::default()), Demand::default());
        assert!(audience.note(reads).contacts);
        for _ in 0..QUIET_TICKS - 1 {
            audience.note(Demand::default());
        }
        audience.note(reads);
        assert!(audience.note(Demand::default()).contacts, "it came back");
    }
}
