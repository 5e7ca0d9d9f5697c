//! Compares one tick of a limited engine with the truth of the same tick. Pure: it depends on nothing else.
//!
//! In: rows of both, and a function for the gap of a pair that the twin did not report. Out: a [`Checked`].

use std::collections::BTreeMap;

use crate::math::Interval;
use crate::wire::{PairRow, Verdict, pair_flags};

/// Ids of a pair, the smaller one first.
pub type Key = (u64, u64);

/// The statement of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Told {
    /// The pair.
    pub key: Key,
    /// Its verdict.
    pub verdict: Verdict,
    /// Its last certified verdict.
    pub last: Verdict,
    /// Its interval, metres.
    pub gap: Interval,
    /// Whether the pose of one of its bodies is unknown: then no work decides it.
    pub unknown: bool,
}

impl Told {
    /// The statement to compare with the truth; `None`: the row only carries an event.
    #[must_use]
    pub fn of(row: &PairRow) -> Option<Self> {
        let verdict = Verdict::from_code(row.verdict)?;
        let gone = row.flags & pair_flags::GONE != 0 || verdict == Verdict::None;
        (!gone).then(|| Self {
            key: (row.body_a, row.body_b),
            verdict,
            last: Verdict::from_code(row.certified_verdict).unwrap_or(Verdict::None),
            gap: Interval {
                min: row.gap_min_m,
                max: row.gap_max_m,
            },
            unknown: row.flags & pair_flags::UNKNOWN_BODY != 0,
        })
    }
}

/// The counts of a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Checked {
    /// Undecided pairs that the twin decided.
    pub undecided: u64,
    /// Of them, those whose last verdict is not the truth.
    pub guess_errors: u64,
    /// Verdicts that are not the truth, and colliding pairs without a row.
    pub wrong: u64,
    /// Intervals that exclude the truth.
    pub excluded: u64,
}

/// Compares a tick with the truth.
///
/// * `told` - rows of the tick, sorted by key.
/// * `truth` - rows of the twin, by key.
/// * `ask` - the gap of a pair that the twin did not report, or reported with an open end.
pub fn check(
    told: &[Told],
    truth: &BTreeMap<Key, Told>,
    mut ask: impl FnMut(Key) -> Interval,
) -> Checked {
    let mut found = Checked::default();
    for told in told.iter().filter(|told| !told.unknown) {
        let known = truth.get(&told.key);
        let whole = known.filter(|known| known.gap.min.is_finite() && known.gap.max.is_finite());
        let gap = whole.map_or_else(|| ask(told.key), |known| known.gap);
        let collides = known.is_some_and(|known| known.verdict == Verdict::Colliding);
        let past = told.gap.max < gap.min || told.gap.min > gap.max;
        found.excluded += u64::from(past || told.gap.min.is_nan() || told.gap.max.is_nan());
        let wrong = match told.verdict {
            Verdict::Colliding => gap.min > 0.0,
            Verdict::Apart | Verdict::Near => gap.max <= 0.0,
            Verdict::Possible | Verdict::None => false,
        };
        found.wrong += u64::from(wrong);
        let open_too = known.is_some_and(|known| known.verdict == Verdict::Possible);
        if told.verdict == Verdict::Possible && !open_too {
            found.undecided += 1;
            found.guess_errors += u64::from((told.last == Verdict::Colliding) != collides);
        }
    }
    // A missing row also says that the pair is apart.
    let left_out = truth.values().filter(|known| {
        let proved = known.verdict == Verdict::Colliding && known.gap.max <= 0.0 && !known.unknown;
        proved
            && told
                .binary_search_by_key(&known.key, |told| told.key)
                .is_err()
    });
    found.wrong += left_out.count() as u64;
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: Key = (3, 7);

    fn told(verdict: Verdict, min: f64, max: f64) -> Told {
        Told {
            key: KEY,
            verdict,
            last: Verdict::Apart,
            gap: Interval { min, max },
            unknown: false,
        }
    }

    fn against(told: &[Told], truth: &[Told], asked: Interval) -> Checked {
        let truth = truth.iter().map(|t| (t.key, *t)).collect();
        check(told, &truth, |_| asked)
    }

    const FAR: Interval = Interval {
        min: 0.1,
        max: 0.1000001,
    };

    #[test]
    fn made_up_wrong_answers_are_caught() {
        let overlap = [told(Verdict::Colliding, -0.2, -0.2)];
        let left_out = against(&[], &overlap, FAR);
        assert_eq!((left_out.wrong, left_out.excluded), (1, 0));
        let missed = against(&[told(Verdict::Near, 0.01, 0.02)], &overlap, FAR);
        assert_eq!((missed.wrong, missed.excluded), (1, 1));
        let invented = against(&[told(Verdict::Colliding, -0.1, 0.0)], &[], FAR);
        assert_eq!((invented.wrong, invented.excluded), (1, 1));
        let beside = against(&[told(Verdict::Possible, -1.0, 0.09)], &[], FAR);
        assert_eq!((beside.wrong, beside.excluded), (0, 1));
    }

    #[test]
    fn undecided_pairs_are_right_and_their_last_verdict_is_a_guess() {
        let overlap = [told(Verdict::Colliding, -0.2, -0.2)];
        let open = [told(Verdict::Possible, -1.0, 0.3)];
        let found = against(&open, &overlap, FAR);
        assert_eq!(
            (found.undecided, found.guess_errors, found.wrong),
            (1, 1, 0)
        );
        let found = against(&open, &[], FAR);
        assert_eq!(
            (found.undecided, found.guess_errors, found.wrong),
            (1, 0, 0)
        );
    }

    #[test]
    fn what_is_right_or_not_to_be_told_from_touching_is_not_wrong() {
        let overlap = [told(Verdict::Colliding, -0.2, -0.2)];
        assert_eq!(against(&overlap, &overlap, FAR), Checked::default());
        let touching = [told(Verdict::Colliding, -1e-16, 1e-16)];
        assert_eq!(against(&[], &touching, FAR), Checked::default());
        let unknown = Told {
            unknown: true,
            ..told(Verdict::Possible, 5.0, 9.0)
        };
        assert_eq!(against(&[unknown], &[], FAR), Checked::default());
    }
}
