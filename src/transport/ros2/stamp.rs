//! What `header.stamp` says: the oldest pose on the node's clock. In: a tick. Out: a time that goes with `/tf`.
//!
//! Sources may stamp on clocks of their own: a simulator's seconds since its start are no time that a ROS 2 program
//! could look a transform up for.

use super::RosSourceSpec;
use crate::wire::TickRow;
use crate::wire::ros::Time;

/// The oldest stamp of sources on the node's clock; the node's time where none has any.
///
/// On the node's clock are sources that ROS 2 feeds by common types; in a scene without one, those that name no other
/// clock.
pub(super) fn stamp_of(row: &TickRow, sources: &[RosSourceSpec], now: Time) -> Time {
    let any_ros = sources.iter().any(|spec| spec.ros2.is_some());
    let rows = row.sources.iter().take(usize::from(row.sources_len));
    let sending = rows.zip(sources).filter(|(row, _)| row.stamp_ns != 0);
    let (mut oldest_ns, mut all_ours) = (None, true);
    for (row, spec) in sending {
        let ours = row.clock_id == 0 && (spec.ros2.is_some() || !any_ros);
        all_ours &= ours;
        if ours {
            oldest_ns = Some(oldest_ns.unwrap_or(u64::MAX).min(row.stamp_ns));
        }
    }
    // Where no other clock is about, the tick's own word holds bodies that are older than their source's newest frame.
    let of_tick = Some(row.header.oldest_stamp_ns).filter(|ns| all_ours && *ns != 0);
    of_tick.or(oldest_ns).map_or(now, Time::from_ns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{RosKind, RosSource};

    fn spec(is_ros: bool) -> RosSourceSpec {
        RosSourceSpec {
            name: String::new(),
            timeout_ns: 1,
            ros2: is_ros.then(|| RosSource {
                kind: RosKind::Tf,
                topic: String::new(),
                static_topic: String::new(),
                max_skew_ns: 0,
            }),
        }
    }

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
        let now = Time::from_ns(900);
        let stamp = |row: &TickRow, is_ros: &[bool]| {
            let sources: Vec<_> = is_ros.iter().map(|is_ros| spec(*is_ros)).collect();
            stamp_of(row, &sources, now).to_ns()
        };
        // One clock: the oldest body, which may be older than its source's newest frame.
        assert_eq!(stamp(&row(&[(700, 0)], 650), &[true]), 650);
        assert_eq!(stamp(&row(&[(700, 0), (0, 0)], 650), &[true, false]), 650);
        // A simulator beside it.
        assert_eq!(stamp(&row(&[(700, 0), (5, 0)], 5), &[true, false]), 700);
        assert_eq!(stamp(&row(&[(700, 0), (5, 1)], 5), &[false, false]), 700);
        // Nothing on the node's clock.
        assert_eq!(stamp(&row(&[(5, 1)], 5), &[false]), 900);
        assert_eq!(stamp(&row(&[(0, 0)], 0), &[true]), 900);
        assert_eq!(stamp(&row(&[], 0), &[]), 900);
    }
}
