//! How far two bodies surely move on without touching: conservative advancement, from one share of the motion.
//!
//! In: a moment of the motion. Out: a time for which they stay apart, or that they touch. Each shape pair has its own
//! time, and the least counts. Three bounds, of which the first good enough is used:
//! - balls around the shapes, along the line between them;
//! - convex pairs: the slab between them along the normal of the exact query. Its width shrinks no faster than the
//!   support points in a slightly turned direction allow (see [`Slab::free_for`]), so the advance ends at the touch
//!   after a few queries, also when bodies rotate;
//! - meshes: a lower bound of the gap from the trees, divided by the greatest speed of any point.
//!
//! Source: Mirtich 1996, "Impulse-based dynamic simulation of rigid body systems", section 2.3 (conservative
//! advancement); the slab is the directional bound of Zhang, Lee and Kim 2006 (FAST), with one term more.

use crate::math::{Interval, Pose, ROUND, Vec3};
use crate::narrow::Counters;
use crate::narrow::compound::{PairWalk, Waiting};
use crate::narrow::exact::Warm;
use crate::narrow::holdings::Holdings;
use crate::narrow::mesh::{FrontStore, Goal, MeshQuery};
use crate::narrow::query::{is_simple, shape_gap, shape_pose, sound, sphere_bound};
use crate::shape::Geometry;
use crate::time::Meter;
use crate::world::{Body, PlacedShape};

use super::motion::{Moment, Span, arm, balls, reach_of, time_of};

/// Balls are good enough while they are apart by this share of the smaller radius: beyond it a query would gain little.
const BALLS_ENOUGH: f64 = 0.5;
/// A mesh pair's bound is good enough at this share of the distance: more work would advance little farther.
const BOUND_ENOUGH: f64 = 0.75;
/// Units between two checks of a mesh pair's bound.
const MESH_UNITS: u64 = 16;

/// What is known of two bodies from a moment on.
#[derive(Clone, Copy, Debug)]
pub(super) enum Ahead {
    /// They do not touch for `time` (in shares of the motion); at their nearest they are apart by `gap_m` now.
    Free { time: f64, gap_m: f64 },
    /// They touch here: whatever rounding did to the way, or at poses that were received.
    Touch,
    /// Rounding leaves open whether they touch here.
    Unsure,
    /// The meter closed.
    Cut,
}

/// Working memory of queries, kept over pairs and ticks. It has its own fronts: in the store of carried fronts, the
/// short-lived ones would find different room in each tick.
#[derive(Debug, Default)]
pub(super) struct Tools {
    fronts: FrontStore,
    meshes: MeshQuery,
    waiting: Waiting,
}

impl Tools {
    pub(super) fn validate(&self) -> Result<(), String> {
        let mut held = Holdings::default();
        self.meshes.tell(&mut held);
        self.fronts.validate(&held)
    }
}

/// A query's tools, counters and meter.
pub(super) struct Work<'w, 'm> {
    pub(super) tools: &'w mut Tools,
    pub(super) counters: &'w mut Counters,
    pub(super) meter: &'w mut Meter<'m>,
}

impl Work<'_, '_> {
    /// Looks ahead from a moment.
    ///
    /// * `wanted` - a time that is enough: a longer one is not searched for.
    pub(super) fn look(
        &mut self,
        (a, b): (&Body, &Body),
        moment: &Moment,
        wanted: f64,
        warm: &mut Warm,
    ) -> Ahead {
        let (mut least, mut nearest_m, mut unsure) = (wanted, f64::INFINITY, false);
        // Two boxes approach no faster than any points of the two bodies.
        let speed = moment.speed(reach_of(a), reach_of(b));
        let mut waiting = std::mem::take(&mut self.tools.waiting);
        let mut walk = PairWalk::new((a, b), &moment.rel, &mut waiting);
        let (mut end, mut refused) = (None, false);
        let soon = |low_m: f64, least: f64| low_m <= 0.0 || low_m / speed < least;
        loop {
            let test = || {
                refused = !self.meter.open();
                self.meter.charge(u64::from(!refused));
                !refused
            };
            let next = walk.next(test, |low_m| soon(low_m - moment.slop, least));
            if refused || (next.is_some() && !self.meter.open()) {
                end = Some(Ahead::Cut);
                break;
            }
            let Some((i, j)) = next else { break };
            let pair = (&a.shapes[i as usize], &b.shapes[j as usize]);
            match self.shapes(pair, moment, least, warm) {
                Ahead::Free { time, gap_m } => {
                    if time < least || gap_m < nearest_m {
                        nearest_m = gap_m;
                    }
                    least = least.min(time);
                }
                Ahead::Unsure => unsure = true,
                touches_or_cut => {
                    end = Some(touches_or_cut);
                    break;
                }
            }
        }
        self.tools.waiting = waiting;
        if let Some(end) = end {
            return end;
        }
        if unsure {
            return Ahead::Unsure;
        }
        Ahead::Free {
            time: least,
            gap_m: nearest_m,
        }
    }

    /// As [`Work::look`], for two shapes.
    fn shapes(
        &mut self,
        (one, other): (&PlacedShape, &PlacedShape),
        moment: &Moment,
        enough: f64,
        warm: &mut Warm,
    ) -> Ahead {
        let bound_m = sphere_bound(one, other, &moment.rel) - moment.slop;
        if bound_m > 0.0 {
            let time = balls(one, other, moment, bound_m);
            let near_m = BALLS_ENOUGH * one.shape.radius.min(other.shape.radius);
            if time >= enough || bound_m > near_m {
                self.meter.charge(1);
                return Ahead::Free {
                    time,
                    gap_m: bound_m,
                };
            }
        }
        let pos12 = shape_pose(one, other, &moment.rel);
        if !is_simple(&one.shape, &other.shape) {
            return self.mesh_pair((one, other), moment, &pos12, enough);
        }
        let Some(closest) = shape_gap(&one.shape, &other.shape, &pos12, warm) else {
            return Ahead::Unsure;
        };
        self.counters.queries += 1;
        self.meter.charge_dear(1);
        let here = sound(closest.gap, one, other, &moment.rel);
        let gap = widened(here, moment.slop);
        if gap.min > 0.0 {
            let normal = moment.a.pose.rotation * (one.pose.rotation * closest.normal);
            let slab = Slab::new((one, other), moment, normal, gap.min);
            let time = slab.free_for(closest.best_m);
            return Ahead::Free {
                time,
                gap_m: closest.best_m,
            };
        }
        touch(gap.max <= 0.0, here, closest.finished, moment)
    }

    /// As [`Work::shapes`], if one of the two is a mesh.
    fn mesh_pair(
        &mut self,
        (one, other): (&PlacedShape, &PlacedShape),
        moment: &Moment,
        pos12: &Pose,
        enough: f64,
    ) -> Ahead {
        let speed = moment.speed(arm(one, &moment.a).1, arm(other, &moment.b).1);
        let shapes = (&*one.shape, &*other.shape);
        let Tools { fronts, meshes, .. } = &mut *self.tools;
        meshes.start(fronts, shapes.0, shapes.1, pos12);
        self.counters.slices += 1;
        loop {
            let done = meshes.advance(fronts, shapes, Goal::Gap, MESH_UNITS, self.meter);
            let here = sound(meshes.interval(), one, other, &moment.rel);
            let gap = widened(here, moment.slop);
            let time = (gap.min / speed).max(0.0);
            let good = gap.min > 0.0 && (time >= enough || gap.min >= BOUND_ENOUGH * gap.max);
            if gap.max <= 0.0 {
                return Ahead::Touch;
            }
            if done && gap.min <= 0.0 {
                let sure = meshes.touches_despite(moment.slop);
                return touch(sure, here, meshes.is_certain(), moment);
            }
            if done || good {
                return Ahead::Free {
                    time,
                    gap_m: gap.min,
                };
            }
            if !self.meter.open() {
                return Ahead::Cut;
            }
        }
    }

    /// Releases memory.
    pub(super) fn release(&mut self) {
        let Tools { fronts, meshes, .. } = &mut *self.tools;
        meshes.release(fronts);
    }
}

/// Result for two shapes that may touch here on the way.
///
/// * `sure` - they touch whatever rounding did to the way.
/// * `here` - their gap at the poses without rounding allowance.
fn touch(sure: bool, here: Interval, finished: bool, moment: &Moment) -> Ahead {
    let touching = here.max <= 0.0 || (finished && here.min <= 0.0);
    if sure || (moment.told && touching) {
        Ahead::Touch
    } else {
        Ahead::Unsure
    }
}

fn widened(gap: Interval, slop: f64) -> Interval {
    if slop == 0.0 { gap } else { gap.widened(slop) }
}

/// The slab between two convex shapes that are apart: along a fixed direction, all of A lies below it, all of B above.
struct Slab<'a> {
    shapes: (&'a PlacedShape, &'a PlacedShape),
    moment: &'a Moment,
    /// Unit, scene frame, from A to B.
    normal: Vec3,
    /// A lower bound on its width, metres.
    width_m: f64,
    /// Greatest distances of the two from their pivots, metres.
    reach: (f64, f64),
}

impl<'a> Slab<'a> {
    fn new(
        shapes: (&'a PlacedShape, &'a PlacedShape),
        moment: &'a Moment,
        normal: Vec3,
        gap_m: f64,
    ) -> Self {
        let reach = (arm(shapes.0, &moment.a).1, arm(shapes.1, &moment.b).1);
        let mut slab = Self {
            shapes,
            moment,
            normal,
            width_m: gap_m,
            reach,
        };
        // Measured on the shapes themselves if they are bounded: the normal was rotated into the scene's frame.
        if reach.0.is_finite() && reach.1.is_finite() {
            let between = (moment.b.at - moment.a.at).dot(&normal);
            let width = between - slab.extent_b(&normal) - slab.extent_a(&normal);
            slab.width_m = gap_m.min(width - slab.rounding(1.0) - moment.slop);
        }
        slab
    }

    /// Rounding of extents along a direction of this length, metres.
    fn rounding(&self, length: f64) -> f64 {
        let of = |reach: f64| if reach.is_finite() { reach } else { 0.0 };
        let far = (self.moment.b.at - self.moment.a.at).amax();
        64.0 * ROUND * length * (of(self.reach.0) + of(self.reach.1) + far)
    }

    /// How far A extends from its pivot along `m`.
    fn extent_a(&self, m: &Vec3) -> f64 {
        extent(self.shapes.0, &self.moment.a, m)
    }

    /// How far B extends from its pivot against `m`.
    fn extent_b(&self, m: &Vec3) -> f64 {
        extent(self.shapes.1, &self.moment.b, &-m)
    }

    /// For how long the slab surely stays open.
    ///
    /// For a point `a` of A and `b` of B, the width `n . (b - a)` is `f + t f'` up to an error of `t^2 / 2` times the
    /// greatest centripetal acceleration; and `f + t f'` is a dot product with `n + t n x w`: so the least over all
    /// pairs of points again follows from support points, in a slightly turned direction. It is concave in `t`, hence
    /// no less than the smaller of its values at both ends.
    ///
    /// * `best_m` - the distance, for a first guess.
    fn free_for(&self, best_m: f64) -> f64 {
        let (a, b) = (&self.moment.a, &self.moment.b);
        let (across_a, across_b) = (self.normal.cross(&a.spin), self.normal.cross(&b.spin));
        let closing = -self.moment.closing_velocity().dot(&self.normal);
        let off = 16.0 * ROUND * self.moment.closing_velocity().amax();
        let side = |span: &Span, across: &Vec3, reach: f64| {
            if span.mixed {
                span.swing(reach)
            } else {
                (across.norm() * (1.0 + 8.0 * ROUND) + 8.0 * ROUND * span.rate)
                    * if span.rate == 0.0 { 0.0 } else { reach }
            }
        };
        let swing = side(a, &across_a, self.reach.0) + side(b, &across_b, self.reach.1);
        let plain = time_of(self.width_m, closing + swing + off);
        let left = self.moment.until - self.moment.share;
        if swing == 0.0 || a.mixed || b.mixed || plain >= left {
            return plain;
        }
        let bend = (a.rate * a.swing(self.reach.0) + b.rate * b.swing(self.reach.1)) / 2.0
            * (1.0 + 16.0 * ROUND);
        // The closing speed at the nearest points: the first guess of when the slab closes.
        let near = closing + self.closing_of_extremes(&across_a, &across_b);
        let mut time = root(best_m.min(self.width_m).max(0.0), near, bend).min(left);
        for _ in 0..4 {
            if time <= plain {
                return plain;
            }
            if self.holds(time, (closing + off, bend), (&across_a, &across_b)) {
                return time;
            }
            time *= 0.7;
        }
        plain
    }

    /// Closing speed that the rotations add at the points that touch the slab.
    fn closing_of_extremes(&self, across_a: &Vec3, across_b: &Vec3) -> f64 {
        let at = |placed: &PlacedShape, span: &Span, m: &Vec3| {
            point(placed, span, m).unwrap_or_default()
        };
        at(self.shapes.0, &self.moment.a, &self.normal).dot(across_a)
            - at(self.shapes.1, &self.moment.b, &-self.normal).dot(across_b)
    }

    fn holds(
        &self,
        time: f64,
        (closing, bend): (f64, f64),
        (across_a, across_b): (&Vec3, &Vec3),
    ) -> bool {
        let change = |now: f64, then: f64| then - now;
        let turned = |across: &Vec3| self.normal + across * time;
        let (m_a, m_b) = (turned(across_a), turned(across_b));
        let mut lost = closing * time;
        if self.moment.a.rate != 0.0 {
            lost += change(self.extent_a(&self.normal), self.extent_a(&m_a));
        }
        if self.moment.b.rate != 0.0 {
            lost += change(self.extent_b(&self.normal), self.extent_b(&m_b));
        }
        let length = 2.0 + m_a.norm() + m_b.norm();
        let curve = bend * time * time + self.rounding(length);
        self.width_m - lost.max(0.0) > curve
    }
}

/// Least positive root of `gap - closing t - bend t^2`; `bend` is positive.
fn root(gap: f64, closing: f64, bend: f64) -> f64 {
    let disc = (closing * closing + 4.0 * bend * gap).max(0.0).sqrt();
    // The form without cancellation.
    if closing > 0.0 {
        2.0 * gap / (closing + disc)
    } else {
        (disc - closing) / (2.0 * bend)
    }
}

/// The point of a shape farthest along `m`, from the pivot, scene frame; `None` for a shape without such a point.
fn point(placed: &PlacedShape, span: &Span, m: &Vec3) -> Option<Vec3> {
    let Geometry::Convex(convex) = &placed.shape.geometry else {
        return None;
    };
    let local = placed.pose.rotation.inverse() * (span.pose.rotation.inverse() * m);
    let point = placed.pose * convex.support(&local);
    Some(span.pose.rotation * (point - span.pivot))
}

fn extent(placed: &PlacedShape, span: &Span, m: &Vec3) -> f64 {
    point(placed, span, m).map_or(0.0, |point| point.dot(m))
}
