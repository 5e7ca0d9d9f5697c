//! The value of `header.stamp`: the oldest pose in use, on the node's clock. In: a tick. Out: a time that fits `/tf`.
//!
//! Sources may use other clocks: with a simulator's seconds since its start, a ROS 2 program cannot look up a
//! transform. And a source that has fallen silent must not hold the stamp back.

use crate::wire::ros::Time;
use crate::wire::{Reason, TickRow};

/// Reasons with which a body's last pose may be in use although it is not current.
const OLD: [Reason; 4] = [
    Reason::Stale,
    Reason::Held,
    Reason::RemovedByAge,
    Reason::Rejected,
];

/// The oldest stamp of the live sources on the node's clock; the node's time if they have none.
///
/// Sources on the node's clock are those that name no other clock: their frames have `clock_id` 0.
pub(super) fn stamp_of(row: &TickRow, now: Time) -> Time {
    let rows = row.sources.iter().take(usize::from(row.sources_len));
    let is_old = OLD.iter().any(|reason| row.reasons & reason.bit() != 0);
    let (mut oldest_ns, mut all_ours) = (None, !is_old);
    for row in rows.filter(|row| row.stamp_ns != 0) {
        let ours = row.clock_id == 0 && row.alive != 0;
        all_ours &= ours;
        if ours {
            oldest_ns = Some(oldest_ns.unwrap_or(u64::MAX).min(row.stamp_ns));
        }
    }
    // If all sources use the node's clock and none is silent, the tick's own oldest stamp is used: it includes bodies
    // older than their source's newest frame, and excludes bodies whose poses are void.
    let stamp_ns = if all_ours {
        Some(row.header.oldest_stamp_ns).filter(|ns| *ns != 0)
    } else {
        oldest_ns
    };
    stamp_ns.map_or(now, Time::from_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tick with the stamps and clocks of sources, and the oldest stamp of all bodies.
    fn row(sources: &[(u64, u32)], oldest_stamp_ns: u64) -> TickRow {
        let mut row = TickRow::default();
        row.header.oldest_stamp_ns = oldest_stamp_ns;
        row.sources_len = u8::try_from(sources.len()).unwrap();
        for (to, &(stamp_ns, clock_id)) in row.sources.iter_mut().zip(sources) {
            (to.stamp_ns, to.clock_id, to.alive) = (stamp_ns, clock_id, 1);
        }
        row
    }

    #[test]
    fn bug_a_simulators_seconds_and_no_stamp_do_not_stamp_what_ros_2_reads() {
        let stamp = |row: &TickRow| stamp_of(row, Time::from_ns(900)).to_ns();
        // One clock: the oldest stamp of a body, which may be older than its source's newest frame.
        assert_eq!(stamp(&row(&[(700, 0)], 650)), 650);
        assert_eq!(stamp(&row(&[(700, 0), (0, 0)], 650)), 650);
        // A simulator's clock in addition.
        assert_eq!(stamp(&row(&[(700, 0), (5, 1)], 5)), 700);
        // No source on the node's clock, or no valid pose.
        assert_eq!(stamp(&row(&[(700, 0)], 0)), 900);
        assert_eq!(stamp(&row(&[(5, 1)], 5)), 900);
        assert_eq!(stamp(&row(&[(0, 0)], 0)), 900);
        assert_eq!(stamp(&row(&[], 0)), 900);
    }

    #[test]
    fn bug_a_silent_source_or_body_does_not_hold_the_stamp_back() {
        let stamp = |row: &TickRow| stamp_of(row, Time::from_ns(900)).to_ns();
        let mut two = row(&[(100, 0), (800, 0)], 100);
        two.sources[0].alive = 0;
        assert_eq!(stamp(&two), 800);
        two.sources[1].alive = 0;
        assert_eq!(stamp(&two), 900);
        // A live source with a body that is not live.
        for reason in [Reason::Stale, Reason::Held, Reason::Rejected] {
            let mut one = row(&[(800, 0)], 100);
            assert_eq!(stamp(&one), 100);
            one.reasons = reason.bit();
            assert_eq!(stamp(&one), 800);
        }
    }
}
