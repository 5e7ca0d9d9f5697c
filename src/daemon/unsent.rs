//! Messages that could not be handed over: told when it begins, then now and then while it goes on. In: how many of a
//! tick. Out: a line in the log.

/// Time between two lines while it goes on, nanoseconds.
const TOLD_NS: u64 = 10_000_000_000;

/// What was lost since the last line.
#[derive(Debug, Default)]
pub(super) struct Unsent {
    count: u64,
    told_ns: Option<u64>,
}

impl Unsent {
    /// Counts the messages that were lost with a tick; how many are to be told of now, if any.
    pub(super) fn note(&mut self, lost: u64, now_ns: u64) -> Option<u64> {
        self.count += lost;
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
    fn bug_lost_messages_are_told_at_once_and_then_seldom() {
        let mut unsent = Unsent::default();
        assert_eq!(unsent.note(0, 5), None);
        assert_eq!(unsent.note(2, 6), Some(2));
        let told: Vec<u64> = (1..=25_000)
            .filter_map(|ms| unsent.note(1, 6 + ms * 1_000_000))
            .collect();
        assert_eq!(told, [10_000, 10_000]);
        // What was lost after the last line is told, though nothing is lost any more; then there is silence.
        assert_eq!(unsent.note(0, 6 + 30_000_000_000), Some(5_000));
        assert_eq!(unsent.note(0, 6 + 90_000_000_000), None);
    }
}
