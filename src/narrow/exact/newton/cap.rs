//! The cap: how far around the best normal of overlapping cores no direction is better, proved by the elements alone.
//!
//! In: the elements at a local optimum of Newton's method. Out: an angle and the loss by rounding, or nothing.
//!
//! With `d` the depth, `m = -n` the way out and `h(m)` the support of the difference, any direction near `m` is
//! `m cos(x) + t sin(x)` with a unit tangent `t`. `h` there is not below the support of any element, nor below their
//! weighted sum. Two effects raise it to `d` again, which `d cos(x)` is not:
//! * Curvature. A circle whose axis leans from `m` by the sine `s` shows an ellipse in the plane of `m` and `t`, whose
//!   radius of curvature at an angle `x` is not below that at `m` times `(s / (s + x))^3`. With `k` the sum of them,
//!   `h >= d cos(x) + k (1 - cos(x))`, so that `k >= d` is enough.
//! * Breadth. An element whose support is displaced from `d m` by `r` along `t` gives `h >= d cos(x) + r sin(x)`, so
//!   that `r >= d tan(x / 2)` is enough.
//!
//! Three elements have breadth all around, one has curvature only, and two have breadth along the line through them and
//! need curvature across it.

use super::set::Set;

/// What the elements prove of the directions around the best one.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Cap {
    /// Tangent of half the angle from the normal up to which the depth is not less: all that is needed of the angle,
    /// without computing an arc.
    half: f64,
    /// How much less it may be all the same, since Newton ends at its resolution, metres.
    pub(in super::super) loss_m: f64,
}

/// Tangents of half the angles that are tried, from 46 degrees down. The wider the cap, the less is left for a
/// polytope.
const HALVES: [f64; 6] = [0.42, 0.25, 0.15, 0.1, 0.05, 0.025];
/// Share of the cap covered by the points that represent it in a polytope.
const COVERED: f64 = 0.8;
/// Allows for the rounding of what is compared here, which is 1e-15 of it.
const SAFE: f64 = 1.0 + 1e-9;

impl Cap {
    /// * `value` - `f` at the normal for which the set was evaluated last: minus the depth.
    pub(super) fn of(set: &Set, value: f64) -> Option<Self> {
        let depth = -value;
        if depth <= 0.0 {
            return None;
        }
        let actives = &set.actives[..set.count];
        let weights: f64 = actives.iter().map(|x| x.weight.max(0.0)).sum();
        let (mut mean, mut aside, mut above) = (0.0, [0.0; 2], 0.0_f64);
        for x in actives {
            let weight = x.weight.max(0.0) / weights;
            mean += weight * x.value;
            aside[0] += weight * x.slope[0];
            aside[1] += weight * x.slope[1];
            above = above.max(x.value - value);
        }
        let off = (mean - value).abs() + aside[0].abs() + aside[1].abs();
        let (loss_m, wanted) = (off + above, depth * SAFE);
        let holds = |&half: &f64| {
            // The angle, or a little more.
            let angle = 2.0 * half;
            let reach = wanted * half;
            match actives {
                [_] => least_of(&curvature(set, weights, angle)) >= wanted,
                [one, other] => {
                    let line = [other.slope[0] - one.slope[0], other.slope[1] - one.slope[1]];
                    let length = (line[0] * line[0] + line[1] * line[1]).sqrt();
                    let along = [line[0] / length, line[1] / length];
                    let at = |slope: &[f64; 2]| slope[0] * along[0] + slope[1] * along[1];
                    let breadth = (-at(&one.slope)).min(at(&other.slope));
                    // Directions with a smaller cosine to the line lack breadth.
                    let narrow = reach / breadth;
                    let bent = curvature(set, weights, angle);
                    let across = across_least(&bent, along, narrow);
                    (breadth > 0.0 && narrow < 1.0 && across >= wanted) || least_of(&bent) >= wanted
                }
                [one, other, third] => inradius([one.slope, other.slope, third.slope]) >= reach,
                _ => false,
            }
        };
        let half = HALVES.iter().copied().find(holds)?;
        loss_m.is_finite().then_some(Self { half, loss_m })
    }

    #[cfg(test)]
    pub(super) fn half(&self) -> f64 {
        self.half
    }

    /// * `breadth_m` - how far the face reaches around the touching point, in every direction.
    /// * `loss_m` - see [`Cap::loss_m`].
    pub(super) fn of_face(depth_m: f64, breadth_m: f64, loss_m: f64) -> Option<Self> {
        let half = (breadth_m / (depth_m * SAFE)).min(HALVES[0]);
        (depth_m > 0.0 && half >= HALVES[HALVES.len() - 1]).then_some(Self { half, loss_m })
    }

    /// How far from the normal, as a share of the depth, points may lie that represent the cap, in the plane that
    /// touches a ball of the depth's radius: the ball reaches beyond them in every direction outside the cap.
    ///
    /// A polytope with such corners still gives a lower bound on the reach of the difference: in the cap by the
    /// elements, outside by its other corners, as long as no more than [`Cap::lift`] is needed there.
    pub(in super::super) fn rise(&self) -> f64 {
        COVERED * self.half
    }

    /// Greatest support of those points in any direction outside the cap, as a share of the depth; below 1.
    pub(in super::super) fn lift(&self) -> f64 {
        // cos(x) + rise * sin(x) at the cap's angle; beyond it is less.
        let square = self.half * self.half;
        (1.0 - square + 2.0 * self.rise() * self.half) / (1.0 + square)
    }
}

/// Lower bounds on the weighted curvature of all elements, up to an angle: xx, xy, yy.
fn curvature(set: &Set, weights: f64, angle: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for x in &set.actives[..set.count] {
        for rim in &x.rims {
            let [p, q] = rim.along;
            let shown = rim.lean / (rim.lean + angle).min(1.0);
            let bent = x.weight.max(0.0) / weights * rim.bend_m * shown * shown * shown;
            sum[0] += bent * p * p;
            sum[1] += bent * p * q;
            sum[2] += bent * q * q;
        }
    }
    sum
}

/// The least curvature in any direction.
fn least_of([xx, xy, yy]: &[f64; 3]) -> f64 {
    let (middle, half) = ((xx + yy) / 2.0, (xx - yy) / 2.0);
    middle - (half * half + xy * xy).sqrt()
}

/// The least curvature in directions that lean from across a line by a sine of at most `narrow`.
fn across_least([xx, xy, yy]: &[f64; 3], [x, y]: [f64; 2], narrow: f64) -> f64 {
    // Across the line is (-y, x).
    let straight = xx * y * y - 2.0 * xy * x * y + yy * x * x;
    let mixed = (yy - xx) * x * y + xy * (x * x - y * y);
    straight * (1.0 - narrow * narrow) - 2.0 * mixed.abs() * narrow
}

/// Distance from the origin to the sides of a triangle that holds it; negative if it does not.
fn inradius(corners: [[f64; 2]; 3]) -> f64 {
    let cross = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - p[1] * q[0];
    let minus = |p: [f64; 2], q: [f64; 2]| [p[0] - q[0], p[1] - q[1]];
    let [p, q, r] = corners;
    let turn = cross(minus(q, p), minus(r, p)).signum();
    let from_side = |p: [f64; 2], q: [f64; 2]| {
        let side = minus(q, p);
        turn * cross(p, side) / (side[0] * side[0] + side[1] * side[1]).sqrt()
    };
    from_side(p, q).min(from_side(q, r)).min(from_side(r, p))
}
