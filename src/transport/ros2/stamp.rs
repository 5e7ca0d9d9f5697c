//! What `header.stamp` says: the oldest pose on the node's clock. In: a tick. Out: a time that goes with `/tf`.
//!
//! Sources may stamp on clocks of their own: a simulator's seconds since its start are no time that a ROS 2 program
//! could look a transform up for.

use crate::wire::TickRow;
use crate::wire::ros::Time;

/// The oldest stamp of sources on the node's clock; the node's time where none has any.
///
/// On the node's clock are sources that name no other: their frames have `clock_id` 0.
pub(super) fn stamp_of(row: &TickRow, now: Time) -> Time {
    let rows = row.sources.iter().take(usize::from(row.sources_len));
    let (mut oldest_ns, mut all_ours) = (None, true);
    for row in rows.filter(|row| row.stamp_ns != 0) {
        let ours = row.clock_id == 0;
        all_ours &= ours;
        if ours {
            oldest_ns = Some(oldest_ns.unwrap_or(u64::MAX).min(row.stamp_ns));
        }
    }
    // Where no other clock is about, the tick's own word holds bodies that are older than their source's newest frame,
    // and none whose poses are void.
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

    /// Stamps and clocks of sources, and the oldest of all bodies.
    fn row(sources: &[(u64, u32)], oldest_stamp_ns: u64) -> TickRow {
        let mut row = TickRow::default();
        row.header.oldest_stamp_ns = oldest_stamp_ns;
        row.sources_len = u8::try_from(sources.len()).unwrap();
        for (to, &(stamp_ns, clock_id)) in row.sources.iter_mut().zip(sources) {
            (to.stamp_ns, to.clock_id) = (stamp_ns, clock_id);
        }
        row
    }

    #[test]
    fn bug_a_simulators_seconds_and_no_stamp_do_not_stamp_what_ros_2_reads() {
        let stamp = |row: &TickRow| stamp_of(row, Time::from_ns(900)).to_ns();
        // One clock: the oldest body, which may be older than its source's newest frame.
        assert_eq!(stamp(&row(&[(700, 0)], 650)), 650);
        assert_eq!(stamp(&row(&[(700, 0), (0, 0)], 650)), 650);
        // A simulator beside it.
        assert_eq!(stamp(&row(&[(700, 0), (5, 1)], 5)), 700);
        // Nothing on the node's clock, or nothing that is not void.
        assert_eq!(stamp(&row(&[(700, 0)], 0)), 900);
        assert_eq!(stamp(&row(&[(5, 1)], 5)), 900);
        assert_eq!(stamp(&row(&[(0, 0)], 0)), 900);
        assert_eq!(stamp(&row(&[], 0)), 900);
    }
}
