//! Judges an answer: its interval and its verdict, against the truth.
//!
//! In: a [`Truth`], and what was published. Out: a [`Judgement`]. It depends on nothing else, so that tests can show
//! that made-up wrong answers are caught.

use super::dd::Dd;
use super::truth::Truth;
use crate::wire::Verdict;

/// The published answer for a pair.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// Lower end of the interval, metres.
    pub min_m: f64,
    /// Upper end, metres.
    pub max_m: f64,
    /// Best estimate, metres; NaN: none.
    pub best_m: f64,
    /// The verdict.
    pub verdict: Verdict,
}

/// The findings about an answer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "one independent finding each"
)]
pub struct Judgement {
    /// The interval excludes the truth.
    pub excluded: bool,
    /// The verdict is not the truth; a collision is wrong only if 0 is outside of the interval.
    pub wrong: bool,
    /// A collision where the truth is apart and 0 is in the interval: right only within rounding (law 3.4).
    pub touching: bool,
    /// Undecided, although nothing limited the work.
    pub open: bool,
    /// Distance of the best estimate from the truth, metres; without an estimate that of the interval's farther end,
    /// which may be infinite. NaN: the truth is not known exactly.
    pub error_m: f64,
    /// Width of the interval, metres.
    pub width_m: f64,
}

/// Compares an answer with the truth.
#[must_use]
pub fn judge(truth: &Truth, answer: &Answer) -> Judgement {
    let (min, max) = (Dd::from(answer.min_m), Dd::from(answer.max_m));
    let below = truth.low.is_some_and(|low| max < low);
    let excluded = below || truth.high < min || answer.min_m.is_nan() || answer.max_m.is_nan();
    let apart = truth.low.is_some_and(|low| low > Dd::ZERO);
    let overlap = truth.high <= Dd::ZERO;
    let around_zero = answer.min_m <= 0.0 && answer.max_m >= 0.0;
    let (wrong, touching, open) = match answer.verdict {
        Verdict::Colliding => (apart && !around_zero, apart && around_zero, false),
        Verdict::Apart | Verdict::Near => (overlap, false, false),
        Verdict::Possible => (false, false, true),
        Verdict::None => (true, false, false),
    };
    let known = truth.low.filter(|low| *low == truth.high);
    let off = |value: f64| match known {
        // `Dd` arithmetic with an infinite end would give NaN.
        Some(_) if value.is_infinite() => f64::INFINITY,
        Some(gap) => (Dd::from(value) - gap).abs().near(),
        None => f64::NAN,
    };
    Judgement {
        excluded,
        wrong,
        touching,
        open,
        error_m: if answer.best_m.is_finite() {
            off(answer.best_m)
        } else {
            off(answer.min_m).max(off(answer.max_m))
        },
        width_m: answer.max_m - answer.min_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(min_m: f64, max_m: f64, verdict: Verdict) -> Answer {
        Answer {
            min_m,
            max_m,
            best_m: (min_m + max_m) / 2.0,
            verdict,
        }
    }

    #[test]
    fn an_interval_beside_the_truth_is_caught_on_either_side_by_the_last_bit() {
        let truth = Truth::is(Dd::from(0.25));
        let good = judge(&truth, &answer(0.25, 0.25, Verdict::Apart));
        assert!(!good.excluded && !good.wrong && good.error_m == 0.0);
        let above = answer(0.25_f64.next_up(), 1.0, Verdict::Apart);
        let below = answer(0.0, 0.25_f64.next_down(), Verdict::Possible);
        assert!(judge(&truth, &above).excluded);
        assert!(judge(&truth, &below).excluded);
        assert!(judge(&truth, &answer(f64::NAN, 1.0, Verdict::Apart)).excluded);
    }

    #[test]
    fn bug_without_an_estimate_the_error_is_that_of_the_farther_end() {
        let truth = Truth::is(Dd::from(-0.5));
        let error = |min_m: f64| {
            let told = Answer {
                best_m: f64::NAN,
                ..answer(min_m, -0.25, Verdict::Colliding)
            };
            judge(&truth, &told).error_m
        };
        assert_eq!((error(-0.625), error(-2.5)), (0.25, 2.0));
        assert!(error(f64::NEG_INFINITY) > f64::MAX);
    }

    #[test]
    fn a_truth_below_the_last_bit_of_f64_decides() {
        let truth = Truth::is(Dd::from(0.25) + Dd::from(1e-25));
        assert!(judge(&truth, &answer(0.0, 0.25, Verdict::Apart)).excluded);
    }

    #[test]
    fn verdicts_that_are_not_the_truth_are_caught() {
        let (apart, overlap) = (Truth::is(Dd::from(0.1)), Truth::is(Dd::from(-0.1)));
        let colliding = answer(0.05, 0.2, Verdict::Colliding);
        assert!(judge(&apart, &colliding).wrong);
        assert!(judge(&overlap, &answer(-0.2, 0.0, Verdict::Apart)).wrong);
        assert!(judge(&overlap, &answer(-0.2, 0.0, Verdict::Near)).wrong);
        assert!(judge(&overlap, &answer(-0.2, 0.0, Verdict::Possible)).open);
        assert!(!judge(&overlap, &answer(-0.2, 0.0, Verdict::Colliding)).wrong);
        assert!(judge(&Truth::is(Dd::ZERO), &answer(0.0, 1.0, Verdict::Apart)).wrong);
    }

    #[test]
    fn touching_within_the_rounding_is_right_and_told() {
        let truth = Truth::is(Dd::from(1e-18));
        let told = judge(&truth, &answer(-1e-15, 1e-15, Verdict::Colliding));
        assert!(told.touching && !told.wrong && !told.excluded);
    }

    #[test]
    fn an_overlap_of_unknown_depth_excludes_what_is_above_it_only() {
        let truth = Truth {
            low: None,
            high: Dd::from(-0.1),
        };
        assert!(!judge(&truth, &answer(-9.0, -5.0, Verdict::Colliding)).excluded);
        assert!(judge(&truth, &answer(-0.05, 0.0, Verdict::Colliding)).excluded);
        assert!(
            judge(&truth, &answer(-9.0, -5.0, Verdict::Colliding))
                .error_m
                .is_nan()
        );
    }
}
