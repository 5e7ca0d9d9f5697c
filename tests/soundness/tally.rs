//! Faults: counted, and printed when they occur.

/// Number of faults printed in full; further ones are only counted.
const TOLD_MAX: u64 = 10;

/// Kinds of faults in the result for a pair.
#[derive(Clone, Copy, Debug)]
pub enum Fault {
    /// A missed or false collision, or a pair left open without a reason.
    Verdict,
    /// An interval that excludes the truth.
    Interval,
    /// Leaf pairs that a front does not cover exactly once.
    Cover,
}

/// Faults so far.
#[derive(Debug, Default)]
pub struct Tally {
    /// By [`Fault`].
    counts: [u64; 3],
    told: u64,
    first: Option<String>,
}

impl Tally {
    /// * `count` - number of faults; for 0 nothing is printed.
    pub fn note(&mut self, fault: Fault, count: u64, tell: impl FnOnce() -> String) {
        if count == 0 {
            return;
        }
        self.counts[fault as usize] += count;
        self.told += 1;
        if self.told <= TOLD_MAX {
            let text = format!("{fault:?}: {}", tell());
            println!("{text}");
            self.first.get_or_insert(text);
        }
    }

    /// Panics with the text of the first fault, if there was any.
    pub fn assert_none(&self) {
        assert_eq!(
            self.counts,
            [0; 3],
            "{}",
            self.first.as_deref().unwrap_or_default()
        );
    }
}

impl std::fmt::Display for Tally {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [verdicts, intervals, leaves] = self.counts;
        write!(
            f,
            "{verdicts} wrong verdicts, {intervals} intervals without the truth, {leaves} pairs of leaves not covered just once"
        )
    }
}
