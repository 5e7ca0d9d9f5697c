//! Newton on the features: the normal that maximises `f`, once the active vertices and circles are known.
//!
//! In: the vertices of the last simplex or face, their weights, a normal near the best one. Out: a better normal and
//! witnesses, to ten and more digits after two or three steps, for cores apart and overlapping alike.
//!
//! Each pair of elements `i` (a vertex or circle of A and one of B) has `f_i(n) = n . w_i(n)`, smooth, with the
//! support point `w_i` as gradient, and `f = min f_i`. At the best unit `n` the active ones are equal and
//! `sum(l_i w_i) = f n` with weights `l_i >= 0` of sum 1. That is a system in the two tangent coordinates of `n` and
//! the weights; its matrix is the Lagrangian's: minus the circles' curvatures, minus `f`.

mod cap;
mod disc;
mod set;

use super::pair::{CoreGap, Held, NO_ELEMENT, Pair, Vertex, frame, unit};
use super::simplex::Simplex;
use crate::math::Vec3;

pub(super) use cap::Cap;
use set::{Active, Set};

/// Most Newton steps of one active set; convergence is quadratic, so more means that it does not converge.
const STEPS_MAX: usize = 10;
/// Most changes of the active set.
const SETS_MAX: usize = 4;
/// A shorter tangent step is the last one.
const STEP_LENGTH_MIN: f64 = 3e-9;
/// A tangent step longer than this leaves the region in which the model is valid.
const STEP_LENGTH_MAX: f64 = 0.5;

/// The result of the method.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refined {
    /// Unit, A to B.
    pub(super) normal: Vec3,
    /// `f(normal)`, over all elements.
    pub(super) value: f64,
    /// Convex combination of points of A.
    pub(super) point_a: Vec3,
    /// Convex combination of points of B.
    pub(super) point_b: Vec3,
    /// The active elements.
    pub(super) held: Held,
    /// Around the normal of cores that overlap, if the elements prove one.
    pub(super) cap: Option<Cap>,
}

impl Refined {
    /// As the gap of cores that are apart.
    pub(super) fn apart(&self) -> CoreGap {
        CoreGap {
            lower: self.value,
            upper: (self.point_b - self.point_a).norm(),
            normal: self.normal,
            point_a: self.point_a,
            point_b: self.point_b,
            held: self.held,
        }
    }

    /// The closest point of the difference; it lies on no single element.
    pub(super) fn corner(&self) -> Vertex {
        Vertex {
            w: self.point_b - self.point_a,
            a: self.point_a,
            b: self.point_b,
            of_a: NO_ELEMENT,
            of_b: NO_ELEMENT,
        }
    }
}

/// A better gap of two cores that are apart.
pub(super) fn refine(pair: &Pair<'_>, simplex: &Simplex, normal: &Vec3) -> Option<CoreGap> {
    Some(solve(pair, simplex.used(), &simplex.weights, normal)?.apart())
}

/// A better answer than an earlier one, from that one's features.
pub(super) fn resume(pair: &Pair<'_>, held: &Held, normal: &Vec3) -> Option<Refined> {
    let mut set = Set::default();
    for ((of_a, of_b), weight) in held
        .of
        .iter()
        .zip(&held.weights)
        .take(usize::from(held.count))
    {
        set.add(*of_a, *of_b, f64::from(*weight));
    }
    if set.count == 0 {
        return None;
    }
    climb(pair, &mut set, normal)
}

/// The local maximum of `f` near `normal`, with the features of the given vertices; `None` if it does not converge.
pub(super) fn solve(
    pair: &Pair<'_>,
    vertices: &[Vertex],
    weights: &[f64],
    normal: &Vec3,
) -> Option<Refined> {
    climb(pair, &mut Set::of(vertices, weights), normal)
}

fn climb(pair: &Pair<'_>, set: &mut Set, normal: &Vec3) -> Option<Refined> {
    if let Some(found) = disc::face_on(pair, set, normal) {
        return Some(found);
    }
    let mut normal = *normal;
    let mut best: Option<Refined> = None;
    for _ in 0..SETS_MAX {
        let Some(end) = converge(pair, set, &normal) else {
            break;
        };
        let all = pair.support(&end.normal);
        let value = end.normal.dot(&all.w);
        let least = set.least();
        if best.is_none_or(|b| value > b.value) {
            let cap = Cap::of(set, value);
            best = Some(Refined { value, cap, ..end });
        }
        normal = end.normal;
        // An element outside the set that reaches further must join it.
        if value >= least - pair.tiny() || !set.join(&all) {
            break;
        }
    }
    best
}

/// Newton steps with one active set, which may lose elements.
fn converge(pair: &Pair<'_>, set: &mut Set, start: &Vec3) -> Option<Refined> {
    let mut n = *start;
    let mut last = f64::INFINITY;
    for _ in 0..STEPS_MAX {
        let (e1, e2) = frame(&n);
        set.evaluate(pair, &n, &e1, &e2)?;
        let (dx, dy, change) = step(set)?;
        let length = (dx * dx + dy * dy).sqrt();
        if length > STEP_LENGTH_MAX || !length.is_finite() {
            return None;
        }
        for (x, d) in set.actives[..set.count].iter_mut().zip(change) {
            x.weight += d;
        }
        if set.drop_negative() {
            last = f64::INFINITY;
            continue;
        }
        n = unit(&(n + e1 * dx + e2 * dy))?;
        // Convergence is quadratic: the remaining error is the square of this step, or rounding.
        if length < STEP_LENGTH_MIN || (length < 1e-7 && length >= last / 2.0) {
            break;
        }
        last = length;
    }
    let (e1, e2) = frame(&n);
    set.evaluate(pair, &n, &e1, &e2)?;
    let (point_a, point_b) = set.witnesses();
    Some(Refined {
        normal: n,
        value: set.least(),
        point_a,
        point_b,
        held: set.held(),
        cap: None,
    })
}

/// One Newton step: tangent coordinates and the change of each weight.
///
/// The active values are to become equal, which gives one linear equation in two coordinates for each element except
/// the first, and the tangent part of `sum(l_i w_i)` is to become 0. So with three elements the equations alone
/// determine the step, with two they leave one coordinate to the curvature, with one both.
fn step(set: &Set) -> Option<(f64, f64, [f64; 3])> {
    let actives = &set.actives[..set.count];
    let first = actives.first()?;
    // The sum of curvatures, and the residual of the slopes.
    let (mut bend, mut rest) = ([0.0; 3], [0.0; 2]);
    let mut mean = 0.0;
    for x in actives {
        for (sum, term) in bend.iter_mut().zip(x.bend()) {
            *sum -= x.weight * term;
        }
        for (sum, term) in rest.iter_mut().zip(x.slope) {
            *sum -= x.weight * term;
        }
        mean += x.weight * x.value;
    }
    bend[0] -= mean;
    bend[2] -= mean;
    let line = |x: &Active| {
        let slope = [x.slope[0] - first.slope[0], x.slope[1] - first.slope[1]];
        (slope, first.value - x.value)
    };
    let bent = |d: [f64; 2]| {
        [
            rest[0] - bend[0] * d[0] - bend[1] * d[1],
            rest[1] - bend[1] * d[0] - bend[2] * d[1],
        ]
    };
    let (d, change) = match actives {
        [_] => (
            solve_two([[bend[0], bend[1]], [bend[1], bend[2]]], rest)?,
            [0.0; 3],
        ),
        [_, second] => {
            let (slope, ahead) = line(second);
            let square = slope[0] * slope[0] + slope[1] * slope[1];
            // Along the slope by the linear equation, across it by the curvature.
            let along = [slope[0] * ahead / square, slope[1] * ahead / square];
            let across = [-slope[1], slope[0]];
            let left = bent(along);
            let curved = across[0] * (bend[0] * across[0] + bend[1] * across[1])
                + across[1] * (bend[1] * across[0] + bend[2] * across[1]);
            let aside = (left[0] * across[0] + left[1] * across[1]) / curved;
            let d = [along[0] + across[0] * aside, along[1] + across[1] * aside];
            let left = bent(d);
            let weight = (left[0] * slope[0] + left[1] * slope[1]) / square;
            (d, [-weight, weight, 0.0])
        }
        [_, second, third, ..] => {
            let ((s, ahead_s), (t, ahead_t)) = (line(second), line(third));
            let d = solve_two([s, t], [ahead_s, ahead_t])?;
            let [one, other] = solve_two([[s[0], t[0]], [s[1], t[1]]], bent(d))?;
            (d, [-(one + other), one, other])
        }
        [] => return None,
    };
    let finite = d.iter().chain(&change).all(|v| v.is_finite());
    finite.then_some((d[0], d[1], change))
}

/// Two linear equations in two unknowns; `None` if singular.
fn solve_two(m: [[f64; 2]; 2], right: [f64; 2]) -> Option<[f64; 2]> {
    let swap = m[0][0].abs() < m[1][0].abs();
    let ([a, b], [c, d]) = if swap { (m[1], m[0]) } else { (m[0], m[1]) };
    let (p, q) = if swap {
        (right[1], right[0])
    } else {
        (right[0], right[1])
    };
    let factor = c / a;
    let pivot = d - factor * b;
    let y = (q - factor * p) / pivot;
    let x = (p - b * y) / a;
    (x.is_finite() && y.is_finite()).then_some([x, y])
}

#[cfg(test)]
mod tests;
