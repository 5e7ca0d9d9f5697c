//! What must not be: counted, and told as it comes.

/// Faults that are told in full; the others are only counted.
const TOLD_MAX: u64 = 10;

/// What can be wrong with what is said of a pair.
#[derive(Clone, Copy, Debug)]
pub enum Fault {
    /// A collision missed or made up, or a pair left open for no reason.
    Verdict,
    /// An interval without the truth.
    Interval,
    /// Pairs of leaves that a front does not cover just once.
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
    /// * `count` - how many there are; of 0 nothing is told.
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

    /// Panics, with the first in words, if there was any.
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
