//! Newton on the features: the normal that makes `f` greatest, once it is known which vertices and circles take part.
//!
//! In: the vertices of the last simplex or face, their weights, a normal near the best one. Out: a better normal and
//! witnesses, to ten and more digits after two or three steps, apart and overlapping alike.
//!
//! Each pair of elements `i` (a vertex or circle of A and one of B) has `f_i(n) = n . w_i(n)`, smooth, with the
//! support point `w_i` as gradient, and `f = min f_i`. At the best unit `n` the active ones are equal and
//! `sum(l_i w_i) = f n` with weights `l_i >= 0` of sum 1. That is a system in the two tangent coordinates of `n` and
//! the weights; its matrix is the Lagrangian's: minus the circles' curvatures, minus `f`.

use super::pair::{CoreGap, Held, Pair, Vertex, across, unit};
use super::simplex::Simplex;
use crate::math::Vec3;
use crate::shape::Core;

/// Newton steps of one active set; convergence is quadratic, so more means that it does not converge.
const STEPS_MAX: usize = 10;
/// Changes of the active set.
const SETS_MAX: usize = 4;
/// A tangent step longer than this leaves the region in which the model is meant.
const STEP_LENGTH_MAX: f64 = 0.5;

/// A pair of elements that takes part, with its weight.
#[derive(Clone, Copy, Debug, Default)]
struct Active {
    of_a: u32,
    of_b: u32,
    weight: f64,
    /// `f_i` at the current normal.
    value: f64,
    a: Vec3,
    b: Vec3,
    /// Gradient along the two tangents.
    slope: [f64; 2],
    /// Curvature along the two tangents: xx, xy, yy.
    bend: [f64; 3],
}

/// The elements that take part.
#[derive(Clone, Copy, Debug, Default)]
struct Set {
    actives: [Active; 3],
    count: usize,
}

/// What the method ended at.
#[derive(Clone, Copy)]
pub(super) struct Refined {
    /// Unit, A to B.
    pub(super) normal: Vec3,
    /// `f(normal)`, over all elements.
    pub(super) value: f64,
    /// Convex combination of points of A.
    pub(super) point_a: Vec3,
    /// Convex combination of points of B.
    pub(super) point_b: Vec3,
    /// The elements that take part.
    pub(super) held: Held,
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

    /// The closest point of the difference; it lies on no one element.
    pub(super) fn corner(&self) -> Vertex {
        Vertex {
            w: self.point_b - self.point_a,
            a: self.point_a,
            b: self.point_b,
            of_a: u32::MAX >> 1,
            of_b: u32::MAX >> 1,
        }
    }
}

/// A better gap of two cores that are apart.
pub(super) fn refine(pair: &Pair<'_>, simplex: &Simplex, normal: &Vec3) -> Option<CoreGap> {
    Some(solve(pair, simplex.used(), &simplex.weights, normal)?.apart())
}

/// A better answer than an earlier one, from the features it rested on.
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
    climb(pair, set, normal)
}

/// The local greatest `f` near `normal`, with the features of the given vertices; `None` when it does not converge.
pub(super) fn solve(
    pair: &Pair<'_>,
    vertices: &[Vertex],
    weights: &[f64],
    normal: &Vec3,
) -> Option<Refined> {
    climb(pair, Set::of(vertices, weights), normal)
}

fn climb(pair: &Pair<'_>, mut set: Set, normal: &Vec3) -> Option<Refined> {
    let mut normal = *normal;
    let mut best: Option<Refined> = None;
    for _ in 0..SETS_MAX {
        let Some(end) = converge(pair, &mut set, &normal) else {
            break;
        };
        let all = pair.support(&end.normal);
        let value = end.normal.dot(&all.w);
        let least = set.least();
        if best.is_none_or(|b| value > b.value) {
            best = Some(Refined { value, ..end });
        }
        normal = end.normal;
        // An element outside the set that reaches further must join it.
        if value >= least - pair.tiny() || !set.join(&all) {
            break;
        }
    }
    best
}

impl Set {
    /// Vertices on one pair of elements are one: they cluster where a circle is being approached.
    fn of(vertices: &[Vertex], weights: &[f64]) -> Self {
        let mut set = Self::default();
        for (vertex, weight) in vertices.iter().zip(weights) {
            set.add(vertex.of_a, vertex.of_b, *weight);
        }
        set
    }

    fn add(&mut self, of_a: u32, of_b: u32, weight: f64) {
        let same = self.actives[..self.count]
            .iter_mut()
            .find(|x| x.of_a == of_a && x.of_b == of_b);
        if let Some(same) = same {
            same.weight += weight;
        } else if self.count < 3 {
            self.actives[self.count] = Active {
                of_a,
                of_b,
                weight,
                ..Active::default()
            };
            self.count += 1;
        }
    }

    fn held(&self) -> Held {
        let mut held = Held::default();
        for x in &self.actives[..self.count] {
            held.push(x.of_a, x.of_b, x.weight);
        }
        held
    }

    fn join(&mut self, vertex: &Vertex) -> bool {
        let known = self.actives[..self.count]
            .iter()
            .any(|x| x.of_a == vertex.of_a && x.of_b == vertex.of_b);
        if known || self.count == 3 {
            return false;
        }
        self.actives[self.count] = Active {
            of_a: vertex.of_a,
            of_b: vertex.of_b,
            ..Active::default()
        };
        self.count += 1;
        true
    }

    fn least(&self) -> f64 {
        self.actives[..self.count]
            .iter()
            .map(|x| x.value)
            .fold(f64::INFINITY, f64::min)
    }

    /// Supports, slopes and curvatures at `n`; `None` where a circle is seen along its axis.
    fn evaluate(&mut self, pair: &Pair<'_>, n: &Vec3, e1: &Vec3, e2: &Vec3) -> Option<()> {
        let in_b = -pair.to_b(n);
        for x in &mut self.actives[..self.count] {
            let (a, ta, ka) = element(pair.a.core(), x.of_a, n)?;
            let (b, tb, kb) = element(pair.b.core(), x.of_b, &in_b)?;
            x.a = a;
            x.b = pair.rotation * b + pair.at;
            let tb = pair.rotation * tb;
            let w = x.b - x.a;
            x.value = n.dot(&w);
            x.slope = [w.dot(e1), w.dot(e2)];
            let (a1, a2, b1, b2) = (ta.dot(e1), ta.dot(e2), tb.dot(e1), tb.dot(e2));
            x.bend = [
                ka * a1 * a1 + kb * b1 * b1,
                ka * a1 * a2 + kb * b1 * b2,
                ka * a2 * a2 + kb * b2 * b2,
            ];
        }
        Some(())
    }

    /// Drops the first element with a negative weight, if another is left.
    fn drop_negative(&mut self) -> bool {
        let place = self.actives[..self.count]
            .iter()
            .position(|x| x.weight < -1e-9);
        match place {
            Some(place) if self.count > 1 => {
                self.actives[place..self.count].rotate_left(1);
                self.count -= 1;
                true
            }
            _ => false,
        }
    }

    fn witnesses(&self) -> (Vec3, Vec3) {
        let actives = &self.actives[..self.count];
        let whole: f64 = actives.iter().map(|x| x.weight.max(0.0)).sum();
        let (mut a, mut b) = (Vec3::zeros(), Vec3::zeros());
        for x in actives {
            let weight = if whole > 0.0 {
                x.weight.max(0.0) / whole
            } else {
                f64::from(u8::from(actives.len() == 1))
            };
            a += x.a * weight;
            b += x.b * weight;
        }
        (a, b)
    }
}

/// Farthest point of an element along `dir`, the tangent it moves along when `dir` turns, and by how much.
fn element(core: &Core, element: u32, dir: &Vec3) -> Option<(Vec3, Vec3, f64)> {
    let Some(circle) = core.circle(element) else {
        return Some((core.vertex(element)?, Vec3::zeros(), 0.0));
    };
    let across = (dir.x * dir.x + dir.y * dir.y).sqrt();
    if across < 1e-12 {
        return None;
    }
    let (x, y) = (dir.x / across, dir.y / across);
    Some((
        Vec3::new(x * circle.radius_m, y * circle.radius_m, circle.z_m),
        Vec3::new(-y, x, 0.0),
        circle.radius_m / across,
    ))
}

/// Newton steps with one active set, which may lose members.
fn converge(pair: &Pair<'_>, set: &mut Set, start: &Vec3) -> Option<Refined> {
    let mut n = *start;
    let mut last = f64::INFINITY;
    for _ in 0..STEPS_MAX {
        let e1 = across(&n);
        let e2 = n.cross(&e1);
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
        if length < 1e-15 || (length < 1e-7 && length >= last / 2.0) {
            break;
        }
        last = length;
    }
    let e1 = across(&n);
    let e2 = n.cross(&e1);
    set.evaluate(pair, &n, &e1, &e2)?;
    let (point_a, point_b) = set.witnesses();
    Some(Refined {
        normal: n,
        value: set.least(),
        point_a,
        point_b,
        held: set.held(),
    })
}

/// One Newton step: tangent coordinates and the change of each weight.
///
/// The active values are to become equal, which is one line of two coordinates for each member but the first, and the
/// tangent part of `sum(l_i w_i)` is to become 0. So with three members the lines alone tell where to go, with two they
/// leave one coordinate to the curvature, with one both.
fn step(set: &Set) -> Option<(f64, f64, [f64; 3])> {
    let actives = &set.actives[..set.count];
    let first = actives.first()?;
    // What bends, and what is left of the slopes.
    let (mut bend, mut rest) = ([0.0; 3], [0.0; 2]);
    let mut mean = 0.0;
    for x in actives {
        for (sum, term) in bend.iter_mut().zip(x.bend) {
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
            // Along the slope as far as the line says, across it as far as the curvature does.
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

/// Two lines with two unknowns; `None` when singular.
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
