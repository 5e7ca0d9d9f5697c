//! Pairs that are far from the origin, nearly touching, large, small, or of very different sizes.

use super::kinds::{logs, stands};
use crate::report::stability::stage::Case;

pub(super) fn far_origin() -> Vec<Case> {
    let mut cases = Vec::new();
    for far_m in logs(0, 12, 1) {
        for stand in stands(1.0, 1.0) {
            for gap_m in [1e-3, -1e-3] {
                let mut case = stand.case(far_m, gap_m);
                for pos in &mut case.ticks[0] {
                    for (x, way) in pos.t.iter_mut().zip([0.6, 0.64, 0.48]) {
                        *x += way * far_m;
                    }
                }
                cases.push(case);
            }
        }
    }
    cases
}

pub(super) fn gap() -> Vec<Case> {
    let of = |gap_m| {
        stands(1.0, 1.0)
            .into_iter()
            .map(move |s| s.case(gap_m, gap_m))
    };
    logs(-12, 0, 2).flat_map(of).collect()
}

pub(super) fn depth() -> Vec<Case> {
    let of = |depth_m: f64| {
        let all = stands(1.0, 1.0).into_iter();
        all.map(move |s| s.case(depth_m, -depth_m))
    };
    logs(-12, -1, 2).flat_map(of).collect()
}

pub(super) fn scale() -> Vec<Case> {
    let of = |size_m: f64| {
        let all = stands(size_m, size_m).into_iter();
        all.flat_map(move |s| [1e-3, -1e-3].map(|gap| s.case(size_m, gap * size_m)))
    };
    logs(-6, 6, 1).flat_map(of).collect()
}

pub(super) fn size_ratio() -> Vec<Case> {
    /// Size of the larger body, metres.
    const HUGE_M: f64 = 1e4;
    let of = |ratio: f64| {
        let small_m = HUGE_M / ratio;
        let all = stands(HUGE_M, small_m).into_iter();
        all.flat_map(move |s| [0.1, -0.1].map(|gap| s.case(ratio, gap * small_m)))
    };
    logs(0, 10, 1).flat_map(of).collect()
}

pub(super) fn quaternion() -> Vec<Case> {
    let mut cases = Vec::new();
    for (step, off) in logs(-16, -3, 1).chain([9.9e-3]).enumerate() {
        for sign in [1.0, -1.0] {
            for (at, stand) in stands(1.0, 1.0).into_iter().enumerate() {
                // Too long and too short ones get both signs of the gap.
                let gap_m = if (step + at).is_multiple_of(2) {
                    1e-3
                } else {
                    -1e-3
                };
                let mut case = stand.case(off, gap_m);
                for pos in &mut case.ticks[0] {
                    pos.q = pos.q.map(|x| x * (1.0 + sign * off));
                }
                cases.push(case);
            }
        }
    }
    cases
}
