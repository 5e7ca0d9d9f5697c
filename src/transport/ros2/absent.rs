//! Participants that DDS gave up although they may be alive: a computer that slept, a network that was down, a process
//! that was stopped. In: participants whose lease ended, and those that are heard. Out: whether one of them is back.
//! Pure.
//!
//! rustdds 0.15 never accepts a participant again that announces itself as before: it remembers announcements by
//! sequence number, and Fast DDS and Cyclone DDS repeat theirs with the same number, so they are dropped as duplicates.
//! The same holds for announcements of its writers and readers. A new node remembers nothing and accepts all.

use std::collections::VecDeque;
use std::time::Duration;

/// Most lost participants that are remembered: the oldest give way to newer ones, as most of them have ended.
const ABSENT_MAX: usize = 256;

/// Participants that were lost and not heard since, by GUID prefix in hexadecimal digits.
#[derive(Debug, Default)]
pub(super) struct Absent {
    prefixes: VecDeque<String>,
    /// Texts about participants that were lost since the last call of [`Self::take_lost`].
    lost: Vec<String>,
    is_back: bool,
}

impl Absent {
    /// Records a participant whose lease ended.
    pub(super) fn lose(&mut self, prefix: &str, lease: Duration) {
        // If DDS accepted it again and lost it again in between, it is listed once.
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

    /// Removes a participant that announced its end.
    pub(super) fn part(&mut self, prefix: &str) {
        self.prefixes.retain(|absent| absent != prefix);
    }

    /// Records a participant that is heard and known to DDS; its endpoints are not announced again.
    pub(super) fn meet(&mut self, prefix: &str) {
        self.is_back |= self.prefixes.iter().any(|absent| absent == prefix);
    }

    /// Records participants that are heard and unknown to DDS.
    pub(super) fn hear(&mut self, unknown: &[String]) {
        self.is_back |= unknown.iter().any(|prefix| self.prefixes.contains(prefix));
    }

    /// Whether one of them is back.
    pub(super) fn is_back(&self) -> bool {
        self.is_back
    }

    /// Texts about participants that were lost since the last call.
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
        // A new participant is unknown for a moment, too.
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
