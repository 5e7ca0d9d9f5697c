//! Participants that DDS took as gone, while they may live: a computer that slept, a network that was down, a process
//! that was stopped. In: who was not heard for its lease, and who is heard. Out: whether one of them is back. Pure.
//!
//! rustdds 0.15 never takes one back that announces itself as before: it holds each announcement by its sequence
//! number, and Fast DDS and Cyclone DDS repeat theirs with the same, so that it is passed over as a duplicate; what
//! the participant said of its writers and readers is passed over likewise. A new node knows none of it and hears
//! all.

use std::collections::VecDeque;
use std::time::Duration;

/// Participants that are waited for: the oldest are given up for newer ones, as most of them are dead.
const ABSENT_MAX: usize = 256;

/// Who was lost and not heard since. All are told by their GUID prefixes, in hexadecimal digits.
#[derive(Debug, Default)]
pub(super) struct Absent {
    prefixes: VecDeque<String>,
    /// Words of those that were lost since the last look.
    lost: Vec<String>,
    is_back: bool,
}

impl Absent {
    /// One was not heard for its lease.
    pub(super) fn lose(&mut self, prefix: &str, lease: Duration) {
        // One that DDS took back, and lost again before it was seen here, is there once.
        self.part(prefix);
        if self.prefixes.len() == ABSENT_MAX {
            self.prefixes.pop_front();
        }
        self.prefixes.push_back(prefix.to_owned());
        self.lost.push(format!(
            "a DDS participant was not heard for its lease of {:.0} s and counts as gone with its nodes ({prefix})",
            lease.as_secs_f64(),
        ));
    }

    /// One said that it leaves.
    pub(super) fn part(&mut self, prefix: &str) {
        self.prefixes.retain(|absent| absent != prefix);
    }

    /// One is heard, and known to DDS: what it said of its endpoints before is not heard again for that.
    pub(super) fn meet(&mut self, prefix: &str) {
        self.is_back |= self.prefixes.iter().any(|absent| absent == prefix);
    }

    /// Those are heard, and unknown to DDS.
    pub(super) fn hear(&mut self, unknown: &[String]) {
        self.is_back |= unknown.iter().any(|prefix| self.prefixes.contains(prefix));
    }

    /// Whether one of them is back.
    pub(super) fn is_back(&self) -> bool {
        self.is_back
    }

    /// What to tell of those that were lost since the last call.
    pub(super) fn take_lost(&mut self) -> Vec<String> {
        std::mem::take(&mut self.lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEASE: Duration = Duration::from_secs(20);

    const ONE: &str = "010f0000000000000000a001";
    const TWO: &str = "010f0000000000000000a002";
    const THREE: &str = "010f0000000000000000a003";

    #[test]
    fn bug_one_that_was_lost_and_announces_itself_again_is_back() {
        let mut absent = Absent::default();
        // One that comes for the first time is unknown for a moment, too.
        absent.hear(&[ONE.to_owned()]);
        absent.lose(ONE, LEASE);
        absent.hear(&[TWO.to_owned()]);
        absent.meet(TWO);
        assert!(!absent.is_back());
        assert_eq!(absent.take_lost().len(), 1);
        absent.hear(&[ONE.to_owned()]);
        assert!(absent.is_back());
    }

    #[test]
    fn one_that_was_lost_and_that_dds_takes_back_is_back() {
        let mut absent = Absent::default();
        absent.lose(ONE, LEASE);
        absent.meet(ONE);
        assert!(absent.is_back());
    }

    #[test]
    fn one_that_says_that_it_leaves_and_one_of_long_ago_are_not_waited_for() {
        let mut absent = Absent::default();
        absent.lose(ONE, LEASE);
        absent.part(ONE);
        absent.hear(&[ONE.to_owned()]);
        absent.lose(TWO, LEASE);
        for _ in 0..ABSENT_MAX {
            absent.lose(THREE, LEASE);
        }
        assert_eq!(absent.prefixes, [TWO, THREE]);
        for n in 1..ABSENT_MAX {
            absent.lose(&format!("{n:024x}"), LEASE);
        }
        absent.hear(&[TWO.to_owned()]);
        assert!(!absent.is_back());
        assert_eq!(absent.prefixes.len(), ABSENT_MAX);
    }
}
