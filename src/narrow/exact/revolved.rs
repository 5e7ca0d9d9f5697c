//! Overlapping solids of revolution whose axes lie nearly on one line: a peg in its hole, a wheel on its axle.
//!
//! In: a pair. Out: the gap of the cores when both are segments, cylinders or cones and their axes agree, else `None`.
//!
//! On one axis the best direction is a whole circle of directions, and nearly so close to it: an expanding polytope
//! would have to resolve all of it, in thousands of faces and milliseconds. But a plane through A's axis shows both
//! cores as polygons, whose gap has a closed form, and every direction lies in such a plane. So the planes are bisected
//! by their angle until what lies between them is small enough:
//! * A disc of B that leans out of a plane shows an ellipse, which is replaced by its long diameter. That lies within
//!   the difference, so the gap of the polygons is an upper end for every direction of that plane. It is exact where
//!   sides touch; where caps do, a polytope finishes quickly.
//! * Between two planes the gap of two given corners along a given side's normal is a smooth function of the angle: it
//!   exceeds the greater of its ends by no more than its second derivative allows. Alternatively: the gap is convex in
//!   the offset of the axes, which is monotone between the two, and changes by no more than B's outline moves.
//!
//! Parallel axes need no bisection, whatever their offset: the difference is a solid of revolution itself.

mod outline;

use std::f64::consts::PI;

use super::closed::{Near, nearest};
use super::newton::{self, Refined};
use super::pair::{CoreGap, Held, Pair, unit};
use crate::math::Vec3;
use outline::{CORNERS_MAX, Flat, Outline, dot};

/// Sine of the lean up to which planes are tried; the bounds on derivatives below depend on it.
const LEAN_MAX: f64 = 0.3;
/// Offset and lean of the axes, as a share of the depth, from which the difference is so much flatter than a ball
/// around the origin that a polytope takes less time.
const ROUND: f64 = 0.15;
/// Swing of B's outline, as a share of the depth, up to which so few planes suffice that they are tried anyway.
const STIFF: f64 = 1e-3;
/// Most planes tried; the bound by then is sound, but wider.
const PLANES_MAX: usize = 512;
/// Most waiting planes: beyond 2^40 parts of the whole they could not be distinguished.
const WAITING_MAX: usize = 40;
/// Corners within this of the farthest along a normal belong to its edge, as a share of the size.
const SAME: f64 = 5e-7;
/// Distance from a normal at which its features are queried.
const ASIDE: f64 = 1e-2;

/// The best direction known.
struct Best {
    /// `f(normal)`.
    value: f64,
    normal: Vec3,
    /// Newton's result, if that is the best one.
    refined: Option<Refined>,
    /// Greatest `f` of a direction shown by a plane; the plane's angle, and the direction in it.
    seen: f64,
    plane: (f64, Flat),
    /// Greatest gap shown by a plane: no upper end is below it.
    shown: f64,
}

/// A candidate for the best direction of a plane: the normal of an edge, and the nearest corners along it.
#[derive(Clone, Copy, Default)]
struct Side {
    n: Flat,
    of_a: usize,
    of_b: usize,
}

/// One plane.
#[derive(Clone, Copy)]
struct Slice {
    /// Angle from the plane that holds the offset of the axes.
    angle: f64,
    /// B's origin.
    at: Flat,
    of_b: Outline,
    sides: [Side; 2 * CORNERS_MAX],
}

/// Both outlines and the relative position of their axes.
struct Planes<'a> {
    pair: &'a Pair<'a>,
    of_a: Outline,
    of_b: Outline,
    /// Along the offset of the axes, and across it; orthogonal to A's axis.
    one: Vec3,
    other: Vec3,
    /// Offset of B's origin from A's axis, metres.
    off: f64,
    /// B's axis, A's frame.
    axis: Vec3,
    /// Most that B's outline moves between planes, per radian, metres.
    swing: f64,
    /// Bound on the second derivative of a side's gap by the angle, metres.
    bend: f64,
}

/// The gap of two overlapping cores of revolution whose axes nearly agree; its ends may stay apart.
///
/// * `warm` - Newton's result from the features of an earlier answer, if any.
///
/// Cost: 1 us for parallel axes, 10 to 40 us where they lean.
pub(super) fn gap(pair: &Pair<'_>, warm: Option<&Refined>) -> Option<CoreGap> {
    let planes = Planes::of(pair)?;
    let tolerance = pair.tolerance();
    let mut best = Best::from(warm);
    // Otherwise one plane shows what all the others do.
    if planes.swing * PI > tolerance {
        planes.look_ahead(&mut best);
        if planes.off + planes.swing > ROUND * -best.value && planes.swing > STIFF * -best.value {
            return None;
        }
    }
    let mut from = planes.slice(0.0, &mut best);
    let mut waiting = [planes.slice(PI, &mut best); WAITING_MAX];
    let (mut count, mut looked_at) = (1, 2);
    let mut upper = f64::NEG_INFINITY;
    while count > 0 {
        let to = waiting[count - 1];
        let most = planes.bound(&from, &to);
        let close = most <= best.value.max(best.shown) + tolerance;
        if close || looked_at == PLANES_MAX || count == WAITING_MAX {
            upper = upper.max(most);
            from = to;
            count -= 1;
            continue;
        }
        let before = best.value;
        waiting[count] = planes.slice(from.angle + (to.angle - from.angle) / 2.0, &mut best);
        count += 1;
        looked_at += 1;
        if best.value > before + tolerance {
            planes.refine(&mut best);
        }
    }
    planes.refine(&mut best);
    Some(planes.answer(&best, upper))
}

impl<'a> Planes<'a> {
    fn of(pair: &'a Pair<'a>) -> Option<Self> {
        let (of_a, of_b) = (Outline::of(pair.a.core())?, Outline::of(pair.b.core())?);
        let axis: Vec3 = pair.rotation.column(2).into_owned();
        let lean = axis.x.hypot(axis.y);
        if lean > LEAN_MAX {
            return None;
        }
        let aside = Vec3::new(pair.at.x, pair.at.y, 0.0);
        let (off, one) = (aside.norm(), unit(&aside).unwrap_or_else(Vec3::x));
        // Per radian the axis moves by `lean` along the plane and turns by at most a bit more, as it is not upright.
        let upright = (1.0 - LEAN_MAX * LEAN_MAX).sqrt();
        let reaches = (of_b.corners().iter()).map(|[r, z]| r.abs() / upright + z.abs());
        let swing = lean * reaches.fold(0.0, f64::max);
        // A side's gap is n . w: n turns by less than 1.3 of the lean, its rate changes by less than 2, and |w| is
        // within the scale; the second derivative of w is at most `off` plus less than twice the swing.
        let bend = off + 2.6 * lean * (pair.scale + off) + 2.8 * swing;
        Some(Self {
            pair,
            of_a,
            of_b,
            one,
            other: Vec3::z().cross(&one),
            off,
            axis,
            swing,
            bend,
        })
    }

    fn along(&self, angle: f64) -> Vec3 {
        let (sin, cos) = angle.sin_cos();
        self.one * cos + self.other * sin
    }

    /// First looks for a good direction: in the planes where B's axis leans least and most.
    fn look_ahead(&self, best: &mut Best) {
        let upright = (self.axis.dot(&self.one)).atan2(-self.axis.dot(&self.other));
        for quarter in [0.0, 0.5, 1.0, 1.5] {
            self.slice(upright + quarter * PI, best);
        }
        self.refine(best);
    }

    /// One plane; its best direction is evaluated on the pair itself.
    fn slice(&self, angle: f64, best: &mut Best) -> Slice {
        let along = self.along(angle);
        let of_b = self.of_b.along([along.dot(&self.axis), self.axis.z]);
        let mut slice = Slice {
            angle,
            at: [self.off * angle.cos(), self.pair.at.z],
            of_b,
            sides: [Side::default(); 2 * CORNERS_MAX],
        };
        let mut most = (f64::NEG_INFINITY, [0.0, 1.0]);
        let outward_of_b = of_b.normals().map(|[x, y]| [-x, -y]);
        let normals = self.of_a.normals().chain(outward_of_b);
        for (side, n) in slice.sides.iter_mut().zip(normals) {
            *side = Side {
                n,
                of_a: self.of_a.farthest(n),
                of_b: of_b.farthest([-n[0], -n[1]]),
            };
        }
        for side in self.sides(&slice) {
            let value = self.value(&slice, side.n, side);
            if value > most.0 {
                most = (value, side.n);
            }
        }
        let (shown, flat) = most;
        let normal = along * flat[0] + Vec3::z() * flat[1];
        let value = normal.dot(&self.pair.support(&normal).w);
        if value > best.seen {
            best.seen = value;
            best.plane = (angle, flat);
        }
        if value > best.value {
            best.value = value;
            best.normal = normal;
            best.refined = None;
        }
        best.shown = best.shown.max(shown);
        slice
    }

    fn sides<'s>(&self, slice: &'s Slice) -> &'s [Side] {
        &slice.sides[..self.of_a.corners().len() + self.of_b.corners().len()]
    }

    /// The gap along `n` of a side's two corners: an upper bound on the gap of the outlines along it.
    fn value(&self, slice: &Slice, n: Flat, side: &Side) -> f64 {
        let (a, b) = (
            self.of_a.corners()[side.of_a],
            slice.of_b.corners()[side.of_b],
        );
        dot(n, [slice.at[0] + b[0] - a[0], slice.at[1] + b[1] - a[1]])
    }

    /// Upper end of the gap along every direction between two planes.
    fn bound(&self, from: &Slice, to: &Slice) -> f64 {
        let width = to.angle - from.angle;
        let (bent, moved) = (self.bend * width * width / 8.0, self.swing * width);
        let mut most = f64::NEG_INFINITY;
        for (one, other) in self.sides(from).iter().zip(self.sides(to)) {
            // The same two corners at both ends.
            let smooth = [one, other].map(|corners| {
                let (start, end) = (
                    self.value(from, one.n, corners),
                    self.value(to, other.n, corners),
                );
                start.max(end)
            });
            // The outline of one end, at the offsets of both.
            let stiff = [(from, to, one), (to, from, other)].map(|(here, there, side)| {
                let aside = side.n[0] * (there.at[0] - here.at[0]);
                self.value(here, side.n, side) + aside.max(0.0)
            });
            let smooth = smooth[0].min(smooth[1]) + bent;
            let stiff = stiff[0].max(stiff[1]) + moved;
            most = most.max(smooth.min(stiff));
        }
        most
    }

    /// Runs Newton on the features to either side of the best direction, if a plane showed it.
    fn refine(&self, best: &mut Best) {
        if best.refined.is_some() {
            return;
        }
        let (angle, flat) = best.plane;
        let aside = (self.along(angle) * -flat[1] + Vec3::z() * flat[0]) * ASIDE;
        let features = [best.normal + aside, best.normal - aside].map(|n| self.pair.support(&n));
        if let Some(found) = newton::solve(self.pair, &features, &[0.5, 0.5], &best.normal) {
            best.take(&found);
        }
    }

    fn answer(&self, best: &Best, upper: f64) -> CoreGap {
        let mut gap = CoreGap {
            lower: best.value,
            upper: upper.max(best.value),
            normal: best.normal,
            point_a: Vec3::zeros(),
            point_b: Vec3::zeros(),
            held: Held::default(),
        };
        if let Some(found) = &best.refined {
            (gap.point_a, gap.point_b, gap.held) = (found.point_a, found.point_b, found.held);
        }
        // Newton may know the direction, but not where on a cap the two would touch.
        if best.refined.is_none() || !gap.is_straight(self.pair) {
            (gap.point_a, gap.point_b) = self.witnesses(best, &gap);
        }
        gap
    }

    /// Opposite points: where edges would touch, or a corner, if that lies better on both cores.
    fn witnesses(&self, best: &Best, gap: &CoreGap) -> (Vec3, Vec3) {
        let across = gap.normal * gap.lower;
        let corner = self.pair.support(&gap.normal);
        let (a, b) = self.shared(best.plane, &across);
        let mut least = (self.off_cores(&a, &b), (a, b));
        let of_b = corner.b - across;
        for (a, b) in [(corner.a, corner.a + across), (of_b, corner.b)] {
            let off = self.off_cores(&a, &b);
            if off + self.pair.tolerance() < least.0 {
                least = (off, (a, b));
            }
        }
        least.1
    }

    /// Distance of two points from the surfaces of A and of B, metres.
    fn off_cores(&self, a: &Vec3, b: &Vec3) -> f64 {
        let pair = self.pair;
        let of_a = nearest(pair.a.core(), a);
        let of_b = nearest(pair.b.core(), &pair.to_b(&(b - pair.at)));
        let off = |near: Option<Near>| near.map_or(f64::INFINITY, |near| near.distance.abs());
        off(of_a).max(off(of_b))
    }

    /// The middle of the overlap, in their plane, of the features that would touch; on the shorter one.
    fn shared(&self, (angle, flat): (f64, Flat), across: &Vec3) -> (Vec3, Vec3) {
        let along = self.along(angle);
        let of_b = self.of_b.along([along.dot(&self.axis), self.axis.z]);
        let tangent = [-flat[1], flat[0]];
        let same = SAME * self.pair.scale;
        let lift = dot([self.off * angle.cos(), self.pair.at.z], tangent);
        let shown_a = self.of_a.shown(flat, tangent, same);
        let shown_b = of_b.shown([-flat[0], -flat[1]], tangent, same);
        let spread = |shown: [(f64, usize); 2]| shown[1].0 - shown[0].0;
        let low = shown_a[0].0.max(shown_b[0].0 + lift);
        let high = shown_a[1].0.min(shown_b[1].0 + lift);
        // A corner of B itself, with the part that leans out of the plane.
        let side = self.axis.cross(&along.cross(&self.axis)).normalize();
        let side = side * self.axis.z.signum();
        let on_b = |corner: usize| {
            let [r, z] = self.of_b.corners()[corner];
            self.pair.at + side * r + self.axis * z
        };
        // Where an edge of B crosses the plane.
        let beyond = along.cross(&Vec3::z());
        let [start, end] = shown_b.map(|(_, corner)| on_b(corner).dot(&beyond));
        let part = start / (start - end);
        let middle = if (0.0..=1.0).contains(&part) {
            (lift + shown_b[0].0 + spread(shown_b) * part)
                .max(low)
                .min(high)
        } else {
            (low + high) / 2.0
        };
        if spread(shown_a) < spread(shown_b) {
            let on_a = |corner: usize| {
                let [x, z] = self.of_a.corners()[corner];
                along * x + Vec3::z() * z
            };
            let point = between(shown_a, middle, on_a);
            (point, point + across)
        } else {
            let point = between(shown_b, middle - lift, on_b);
            (point - across, point)
        }
    }
}

/// The point at parameter `t` of the edge between two corners, each given with its own `t`.
fn between(ends: [(f64, usize); 2], t: f64, place: impl Fn(usize) -> Vec3) -> Vec3 {
    let [(from, first), (to, last)] = ends;
    let part = ((t - from) / (to - from)).clamp(0.0, 1.0);
    let part = if part.is_finite() { part } else { 0.0 };
    place(first) * (1.0 - part) + place(last) * part
}

impl Best {
    fn from(warm: Option<&Refined>) -> Self {
        let mut best = Self {
            value: f64::NEG_INFINITY,
            normal: Vec3::z(),
            refined: None,
            seen: f64::NEG_INFINITY,
            plane: (0.0, [0.0, 1.0]),
            shown: f64::NEG_INFINITY,
        };
        if let Some(found) = warm {
            best.take(found);
        }
        best
    }

    fn take(&mut self, found: &Refined) {
        if found.value > self.value {
            self.value = found.value;
            self.normal = found.normal;
            self.refined = Some(*found);
        }
    }
}

#[cfg(test)]
mod tests;
