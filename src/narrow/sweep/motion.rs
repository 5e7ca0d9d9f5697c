//! Two moving bodies: where they are at a share of the motion, and how fast they move there.
//!
//! In: bodies with their paths. Out: poses, velocities and the rounding to allow for. A body that is not continuous is
//! at this tick's pose all the way; during a jump nothing is tested.

use crate::math::{Point, Pose, ROUND, Vec3, relative};
use crate::shape::{Core, Geometry};
use crate::world::{Body, Leg, Path, PlacedShape};

/// Most shapes of a body that is checked at each look for rotation about one common axis: a wheel has few.
const PARTS_MAX: usize = 8;

/// A body's motion for a while, per unit of the share: the pivot moves straight, the body rotates about a fixed axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// Share at which it ends.
    pub(super) until: f64,
    pub(super) pose: Pose,
    /// Body frame.
    pub(super) pivot: Point,
    /// The pivot now, scene frame.
    pub(super) at: Point,
    /// Velocity of the pivot, scene frame.
    pub(super) velocity: Vec3,
    /// Angular velocity, scene frame; if `mixed`, only [`Span::rate`] is valid.
    pub(super) spin: Vec3,
    /// Greatest angular speed.
    pub(super) rate: f64,
    /// It rotates about two axes at once, so `spin` is no axis.
    pub(super) mixed: bool,
    pub(super) jump: bool,
    /// How far rounding may put a point of the body off the way, metres.
    pub(super) slop: f64,
    /// The pose was received, not interpolated: it has no error.
    pub(super) told: bool,
}

/// The path of a body, if it is to be swept.
pub(super) fn way(body: &Body) -> Option<&Path> {
    body.path.as_deref().filter(|path| path.is_swept())
}

impl Span {
    /// The motion of a body at share `s`.
    pub(super) fn at(body: &Body, s: f64) -> Self {
        let Some((path, place)) = way(body).and_then(|path| Some((path, place_at(path, s)?)))
        else {
            return Self::rest(body);
        };
        let Place {
            leg, share, until, ..
        } = place;
        let pose = leg.at(share, path.pivot());
        if !place.goes {
            // On a received pose, exactly. Behind its last pose it may be elsewhere by as much as any body at rest;
            // before it reappeared it was nowhere.
            let behind = share >= 1.0;
            let astray_m = if behind { body.reach_m } else { 0.0 };
            return Self {
                until,
                pose,
                pivot: *path.pivot(),
                at: pose * path.pivot(),
                jump: leg.lapse && !behind,
                slop: astray_m,
                told: astray_m == 0.0 && path.is_told_at(share),
                ..Self::rest(body)
            };
        }
        let per_share = f64::from(path.frames());
        let far = leg.from.translation.vector.amax();
        let far = far.max(leg.to.translation.vector.amax());
        let size = path.pivot().coords.amax() + (1.0 + leg.angle()) * path.reach();
        let mut span = Self {
            until,
            pose,
            pivot: *path.pivot(),
            at: pose * path.pivot(),
            velocity: leg.travel * per_share,
            spin: leg.spin * per_share,
            rate: leg.angle() * per_share * (1.0 + 8.0 * ROUND),
            mixed: leg.extra != Vec3::zeros(),
            jump: leg.jump,
            // Two sums of coordinates that far out; everything else is of the size of the body and its way.
            slop: 16.0 * ROUND * far + 64.0 * ROUND * (size + per_share * leg.travel.amax()),
            told: path.is_told_at(share),
        };
        if let Some(off_m) = span.astray(body, leg.angle(), path.reach()) {
            (span.spin, span.rate) = (Vec3::zeros(), 0.0);
            span.slop += off_m;
        }
        span
    }

    /// How far its surface gets, in all of a leg's rotation, from where it would be without it, if that is no more than
    /// the rounding; `None`: it does not rotate, or not about its own axis, or is no solid of revolution.
    fn astray(&self, body: &Body, angle: f64, reach_m: f64) -> Option<f64> {
        let about = self.spin.try_normalize(0.0).filter(|_| !self.mixed)?;
        if body.shapes.len() > PARTS_MAX {
            return None;
        }
        let mut most_m = 0.0_f64;
        for placed in &*body.shapes {
            let Geometry::Convex(convex) = &placed.shape.geometry else {
                return None;
            };
            let axis = match convex.core() {
                Core::Point => about,
                Core::Segment { .. } | Core::Cylinder { .. } | Core::Cone { .. } => {
                    self.pose.rotation * (placed.pose.rotation * Vec3::z())
                }
                Core::Cuboid { .. } | Core::Hull(_) | Core::Triangle(_) => return None,
            };
            let arm = placed.pose * placed.shape.centre - self.pivot;
            let off_m = axis.cross(&(self.pose.rotation * arm)).norm();
            let rounded_m = 16.0 * ROUND * (reach_m + self.pivot.coords.amax());
            let off_m = off_m + axis.cross(&about).norm() * reach_m + rounded_m;
            most_m = most_m.max(angle * off_m);
            if most_m.is_nan() || most_m > self.slop {
                return None;
            }
        }
        Some(most_m)
    }

    fn rest(body: &Body) -> Self {
        Self {
            until: 1.0,
            pose: body.pose,
            pivot: body.centre,
            at: body.pose * body.centre,
            velocity: Vec3::zeros(),
            spin: Vec3::zeros(),
            rate: 0.0,
            mixed: false,
            jump: false,
            slop: 0.0,
            told: true,
        }
    }

    /// `rate` times a distance from the pivot, also if the distance is unbounded and the body does not rotate.
    pub(super) fn swing(&self, reach: f64) -> f64 {
        if self.rate == 0.0 {
            0.0
        } else {
            self.rate * reach
        }
    }
}

/// Where a body is on its way for a while.
#[derive(Clone, Copy, Debug)]
struct Place<'a> {
    leg: &'a Leg,
    /// How much of the leg is done.
    share: f64,
    /// Share of the motion at which the leg ends, or begins if the body waits before it.
    until: f64,
    /// Whether it moves along the leg; otherwise it stands at one end of it.
    goes: bool,
}

/// Where a body is at share `s`.
fn place_at(path: &Path, s: f64) -> Option<Place<'_>> {
    let frames = f64::from(path.frames());
    let end_of = |frame: u32| f64::from(frame) / frames;
    let Some(leg) = path.legs().iter().find(|leg| end_of(leg.frame) > s) else {
        let leg = path.legs().last()?;
        return Some(Place {
            leg,
            share: 1.0,
            until: 1.0,
            // Also when the motion is over: there it has its arrival speed.
            goes: leg.frame >= path.frames(),
        });
    };
    let before = leg.frame.saturating_sub(1);
    let goes = s >= end_of(before);
    let share = if goes {
        (s * frames - f64::from(before)).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let until = end_of(if goes { leg.frame } else { before });
    Some(Place {
        leg,
        share,
        until,
        goes,
    })
}

/// Both bodies of a pair at a share of the motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub(super) a: Span,
    pub(super) b: Span,
    /// Pose of B seen from A.
    pub(super) rel: Pose,
    /// The share.
    pub(super) share: f64,
    /// Share at which either changes its motion.
    pub(super) until: f64,
    /// Rounding and reach of both: the gap may be off by this much, metres.
    pub(super) slop: f64,
    /// Their places are certain and exact: a touch here counts as it would for any verdict (law 3.4).
    pub(super) told: bool,
}

impl Moment {
    pub(super) fn of((a, b): (&Body, &Body), s: f64) -> Self {
        let (of_a, of_b) = (Span::at(a, s), Span::at(b, s));
        // A body on a way between admitted poses is on that way, or at rest on it; one without a way may be elsewhere.
        let reach = |body: &Body| {
            if way(body).is_some() {
                0.0
            } else {
                body.reach_m
            }
        };
        let reach_m = reach(a) + reach(b);
        Self {
            a: of_a,
            b: of_b,
            rel: relative(&of_a.pose, &of_b.pose),
            share: s,
            until: of_a.until.min(of_b.until),
            slop: of_a.slop + of_b.slop + reach_m,
            told: reach_m == 0.0 && of_a.told && of_b.told,
        }
    }

    pub(super) fn jumps(&self) -> bool {
        self.a.jump || self.b.jump
    }

    /// Velocity of B's pivot seen from A's.
    pub(super) fn closing_velocity(&self) -> Vec3 {
        self.b.velocity - self.a.velocity
    }

    /// Greatest speed of any point of one relative to any point of the other, per unit of the share.
    pub(super) fn speed(&self, reach_a: f64, reach_b: f64) -> f64 {
        let speed = self.closing_velocity().norm() + self.a.swing(reach_a) + self.b.swing(reach_b);
        speed * (1.0 + 16.0 * ROUND)
    }
}

/// Over the whole way, no point of one moves farther than this seen from the other, metres.
pub(super) fn length(bodies: (&Body, &Body)) -> f64 {
    let (mut s, mut sum) = (0.0, 0.0);
    while s < 1.0 {
        let moment = Moment::of(bodies, s);
        sum += moment.speed(reach_of(bodies.0), reach_of(bodies.1)) * (moment.until - s);
        sum += 2.0 * moment.slop;
        s = moment.until;
    }
    sum * (1.0 + 1e-12)
}

/// Like [`length`], for two bodies that are not in step: the sum of both path lengths.
pub(super) fn length_apart((a, b): (&Body, &Body)) -> f64 {
    let of = |body: &Body| {
        let legs = way(body).map_or(&[][..], Path::legs);
        let along = |leg: &Leg| {
            let far = leg.pivot.coords.amax() + leg.travel.amax();
            leg.travel.norm() + leg.angle() * reach_of(body) + 64.0 * ROUND * (far + reach_of(body))
        };
        legs.iter().map(along).sum::<f64>()
    };
    (of(a) + of(b)) * (1.0 + 1e-12)
}

/// Greatest distance of a body's surface from its pivot.
pub(super) fn reach_of(body: &Body) -> f64 {
    way(body).map_or(body.radius, Path::reach)
}

/// Distance of a shape's centre from the pivot, and of its farthest point from it.
pub(super) fn arm(placed: &PlacedShape, span: &Span) -> (f64, f64) {
    let arm = (placed.pose * placed.shape.centre - span.pivot).norm();
    let arm = arm * (1.0 + 8.0 * ROUND) + 8.0 * ROUND * span.pivot.coords.amax();
    (arm, arm + placed.shape.radius)
}

/// For how long two balls stay apart, along the line between their present centres.
pub(super) fn balls(one: &PlacedShape, other: &PlacedShape, moment: &Moment, bound_m: f64) -> f64 {
    let (from, to) = (
        moment.a.pose * (one.pose * one.shape.centre),
        moment.b.pose * (other.pose * other.shape.centre),
    );
    let direction = (to - from).try_normalize(0.0).unwrap_or_else(Vec3::z);
    // The farther apart, the more accurate the line; its possible rotation by rounding costs as much of the speed.
    let velocity = moment.closing_velocity();
    let turned = moment.a.swing(arm(one, &moment.a).0) + moment.b.swing(arm(other, &moment.b).0);
    let off = 16.0 * ROUND * (velocity.amax() + turned);
    let closing = -velocity.dot(&direction) + turned + off;
    // A slab between two balls along one direction, as wide as the distance between them.
    let far = |placed: &PlacedShape, pose: &Pose| pose.translation.vector.amax() + placed.reach_m();
    let slack = 64.0 * ROUND * (far(one, &moment.a.pose) + far(other, &moment.b.pose));
    time_of(bound_m - slack, closing)
}

pub(super) fn time_of(gap_m: f64, closing: f64) -> f64 {
    if gap_m <= 0.0 {
        0.0
    } else if closing <= 0.0 {
        f64::INFINITY
    } else {
        gap_m / closing
    }
}
