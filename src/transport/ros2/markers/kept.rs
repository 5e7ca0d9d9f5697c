//! How long markers stay without new ones. In: how far apart they are. Out: their lifetime. Pure.

/// A marker stays for so many times what lies between two without a new one.
const PERIODS_KEPT: u64 = 3;
/// Longest time between two markers that is one, nanoseconds: after a longer one somebody has just begun to look.
const GAP_NS_MAX: u64 = 5_000_000_000;

/// How long markers stay without new ones, nanoseconds: where ticks are rarer than markers may be, new ones come with
/// ticks, which are never further apart than a heartbeat unless they are late.
///
/// * `since_ns` - time since the markers before.
pub(in super::super) fn kept_ns(period_ns: u64, heartbeat_ns: u64, since_ns: u64) -> u64 {
    let gap_ns = if since_ns <= GAP_NS_MAX { since_ns } else { 0 };
    let apart_ns = period_ns.max(heartbeat_ns).max(gap_ns);
    apart_ns.saturating_mul(PERIODS_KEPT)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn bug_markers_went_out_between_ticks_that_are_rarer_than_their_period() {
        // A heartbeat of a second; a simulator at 8 Hz whose markers may come at 50 Hz.
        assert_eq!(kept_ns(100 * MS, 1000 * MS, 1000 * MS), 3000 * MS);
        assert_eq!(kept_ns(20 * MS, 100 * MS, 125 * MS), 375 * MS);
        assert_eq!(kept_ns(100 * MS, 20 * MS, 100 * MS), 300 * MS);
        // Somebody looks for the first time since an hour.
        assert_eq!(kept_ns(100 * MS, 20 * MS, 3_600_000 * MS), 300 * MS);
        assert_eq!(kept_ns(u64::MAX, 0, 0), u64::MAX);
    }
}
