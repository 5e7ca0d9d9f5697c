//! Converts the answer of a gap question to the response of `~/gap`. Pure.

use crate::wire::Answer;
use crate::wire::ros::{GapTold, tick_header};

/// The response. Unknown values are NaN, and unknown bounds infinite.
pub(super) fn told(answer: Answer) -> GapTold {
    let none = [f64::NAN; 3];
    let Some(gap) = answer.gap else {
        return GapTold {
            message: answer.error.unwrap_or_default(),
            gap_min_m: f64::NEG_INFINITY,
            gap_max_m: f64::INFINITY,
            gap_best_m: f64::NAN,
            point_a: none.into(),
            point_b: none.into(),
            normal: none.into(),
            ..GapTold::default()
        };
    };
    let known = gap.known;
    GapTold {
        success: answer.ok,
        message: answer.warnings.join("; "),
        tick_header: tick_header(&gap.tick_header),
        verdict: known.verdict,
        touching: known.touching,
        gap_min_m: known.gap_min_m.unwrap_or(f64::NEG_INFINITY),
        gap_max_m: known.gap_max_m.unwrap_or(f64::INFINITY),
        gap_best_m: known.gap_best_m.unwrap_or(f64::NAN),
        point_a: known.point_a.unwrap_or(none).into(),
        point_b: known.point_b.unwrap_or(none).into(),
        normal: known.normal.unwrap_or(none).into(),
    }
}
