//! Limits log lines about a repeated failure: one when it begins, then one now and then while it goes on. In: numbers
//! of failures. Out: the number that a log line is to report.

/// Least time between two log lines, nanoseconds.
const TOLD_NS: u64 = 10_000_000_000;

/// Number of failures since the last log line.
#[derive(Debug, Default)]
pub struct Seldom {
    count: u64,
    told_ns: Option<u64>,
}

impl Seldom {
    /// Adds failures, which the next [`Seldom::note`] reports.
    pub fn add(&mut self, count: u64) {
        self.count += count;
    }

    /// Adds failures; returns the number to report now, if any.
    ///
    /// * `now_ns` - nanoseconds, always of the same clock.
    pub fn note(&mut self, count: u64, now_ns: u64) -> Option<u64> {
        self.add(count);
        let due = |told_ns: u64| now_ns.saturating_sub(told_ns) >= TOLD_NS;
        if self.count == 0 || !self.told_ns.is_none_or(due) {
            return None;
        }
        self.told_ns = Some(now_ns);
        Some(std::mem::take(&mut self.count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_what_happens_again_and_again_is_told_at_once_and_then_seldom() {
        let mut seldom = Seldom::default();
        assert_eq!(seldom.note(0, 5), None);
        seldom.add(1);
        assert_eq!(seldom.note(1, 6), Some(2));
        let told: Vec<u64> = (1..=25_000)
            .filter_map(|ms| seldom.note(1, 6 + ms * 1_000_000))
            .collect();
        assert_eq!(told, [10_000, 10_000]);
        // Failures after the last line are reported, even if no new ones come; then there is silence.
        assert_eq!(seldom.note(0, 6 + 30_000_000_000), Some(5_000));
        assert_eq!(seldom.note(0, 6 + 90_000_000_000), None);
    }
}
