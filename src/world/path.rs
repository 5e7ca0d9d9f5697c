//! The path of a continuous body since the last tick: what lies between its poses, and the box around it.
//!
//! In: the pose of the last tick and each one admitted since. Out: legs from pose to pose, along which the pivot (the
//! centre of the body's geometry; of an attached body that of the body it hangs on) goes straight and the body turns
//! about a fixed axis at a constant rate; and a box that holds the body all the way.
//!
//! The share `s` of the motion runs from 0 (the last tick's pose) to 1 (this one's); legs take equal parts of it, one
//! leg a pose, also where the body stood still: so two bodies of one source are in step.

use crate::limits::{LEG_TURNS_MAX, LEGS_MAX};
use crate::math::{Aabb, Point, Pose, Quat, ROUND, Vec3};

use super::parts::PlacedShape;
use super::place::tight_box;

/// A turn below this has no axis that could be told from rounding (32-bit senders: 1e-7), radians.
const AXIS_MIN_RAD: f64 = 1e-3;

/// The way from one pose to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Where it begins.
    pub from: Pose,
    /// Where it ends.
    pub to: Pose,
    /// The pivot at the begin, scene frame.
    pub pivot: Point,
    /// What the pivot goes, scene frame, metres.
    pub travel: Vec3,
    /// The turn, scene frame: axis times angle, radians.
    pub spin: Vec3,
    /// Whole turns on top, about an axis of their own: only where the turn itself has none that could be told.
    pub extra: Vec3,
    /// A step beyond the body's `teleport_m`, or over a reset: what lies between is not asked.
    pub jump: bool,
    /// A step over a reset.
    pub lapse: bool,
}

impl Leg {
    /// The pose at a share of the leg.
    #[must_use]
    pub fn at(&self, share: f64, pivot: &Point) -> Pose {
        // Both ends to the last bit: certificates were made there.
        if share >= 1.0 {
            return self.to;
        } else if share <= 0.0 {
            return self.from;
        }
        let turned = Quat::from_scaled_axis(self.spin * share) * self.from.rotation;
        let turned = if self.extra == Vec3::zeros() {
            turned
        } else {
            Quat::from_scaled_axis(self.extra * share) * turned
        };
        let at = self.pivot + self.travel * share - turned * pivot.coords;
        Pose::from_parts(at.coords.into(), turned)
    }

    /// The whole angle that it turns by, radians.
    #[must_use]
    pub fn angle(&self) -> f64 {
        self.spin.norm() + self.extra.norm()
    }

    fn is_still(&self) -> bool {
        self.travel == Vec3::zeros() && self.angle() == 0.0 && self.from == self.to
    }
}

/// How far a body's surface is from its pivot, and what the scene says of its motion.
#[derive(Clone, Debug)]
pub struct Path {
    legs: Vec<Leg>,
    /// Body frame.
    pivot: Point,
    /// Greatest distance of the body's surface from the pivot, metres, rounded up.
    reach: f64,
    /// Steps of the body's centre beyond it are teleports, metres.
    teleport_m: f64,
    /// Whether the body itself is swept; else its path is kept for what hangs on it.
    swept: bool,
    /// Its end is where a velocity leads, and no pose that was sent.
    ahead: bool,
    /// The body is not in the broad phase now: its way counts for what hangs on it alone.
    pub(super) aside: bool,
    /// Not every pose found room: only the box knows of the rest.
    blurred: bool,
    /// Holds the body at the newest pose.
    end: Aabb,
    /// Holds it all the way.
    hull: Aabb,
    /// Holds the pivot all the way, also where legs found no room.
    pivots: Aabb,
}

impl Path {
    /// Of a body at rest.
    ///
    /// * `radius` - of a ball about `pivot` that holds the body, metres.
    pub(super) fn new(pivot: Point, radius: f64, teleport_m: Option<f64>, swept: bool) -> Self {
        Self {
            legs: Vec::with_capacity(LEGS_MAX),
            pivot,
            reach: radius,
            teleport_m: teleport_m.unwrap_or(f64::INFINITY),
            swept,
            ahead: false,
            aside: false,
            blurred: false,
            end: Aabb::empty(),
            hull: Aabb::empty(),
            pivots: Aabb::empty(),
        }
    }

    /// Of one leg, of a body that is asked for.
    pub(super) fn of_leg(leg: Leg, pivot: Point, radius: f64) -> Self {
        Self {
            legs: vec![leg],
            ahead: true,
            ..Self::new(pivot, radius, None, true)
        }
    }

    /// The legs since the last tick, oldest first.
    #[must_use]
    pub fn legs(&self) -> &[Leg] {
        &self.legs
    }

    /// The point that goes straight, body frame.
    #[must_use]
    pub fn pivot(&self) -> &Point {
        &self.pivot
    }

    /// Greatest distance of the body's surface from the pivot, metres.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Whether the body was told to be where a share of a leg puts it: at its ends, but for one that was worked out.
    #[must_use]
    pub fn is_told_at(&self, share: f64) -> bool {
        share <= 0.0 || (share >= 1.0 && !self.ahead)
    }

    /// Whether more poses came than are kept: the legs do not tell the whole way.
    #[must_use]
    pub fn is_blurred(&self) -> bool {
        self.blurred
    }

    /// Whether the body is to be asked for on the way: it is continuous and did not stand still.
    #[must_use]
    pub fn is_swept(&self) -> bool {
        self.counts() && self.has_moved()
    }

    /// Whether the body is continuous; else its path is kept for what hangs on it.
    #[must_use]
    pub fn is_of_continuous(&self) -> bool {
        self.swept
    }

    /// Whether there is a step of which nothing is asked.
    #[must_use]
    pub fn has_jumped(&self) -> bool {
        self.counts() && self.legs.iter().any(|leg| leg.jump)
    }

    /// Whether a step of it was beyond its `teleport_m`.
    #[must_use]
    pub fn has_teleported(&self) -> bool {
        self.counts() && self.legs.iter().any(|leg| leg.jump && !leg.lapse)
    }

    /// Whether it is the way of a body that is continuous and takes part.
    fn counts(&self) -> bool {
        self.swept && !self.aside
    }

    /// Says whether the body is out of the broad phase: what it went meanwhile is no motion of its own.
    pub(super) fn set_aside(&mut self, aside: bool) {
        if self.aside && !aside {
            self.restart(self.end);
        }
        self.aside = aside;
    }

    /// A box that holds the body all the way.
    #[must_use]
    pub fn hull(&self) -> &Aabb {
        &self.hull
    }

    /// Begins anew where the body is.
    pub(super) fn restart(&mut self, end: Aabb) {
        self.legs.clear();
        self.blurred = false;
        (self.end, self.hull) = (end, end);
        self.pivots = Aabb::empty();
    }

    /// As [`Path::restart`], at the newest pose; whether the hull was wider.
    pub(super) fn rest(&mut self) -> bool {
        let wider = self.hull != self.end;
        self.restart(self.end);
        wider
    }

    /// Takes the box of other vertices at the newest pose.
    pub(super) fn take_end(&mut self, end: Aabb) {
        self.end = end;
        self.hull = if self.is_empty() {
            end
        } else {
            self.hull.merged(&end)
        };
    }

    /// The box at the newest pose.
    pub(super) fn end(&self) -> &Aabb {
        &self.end
    }

    pub(super) fn is_empty(&self) -> bool {
        self.legs.is_empty()
    }

    pub(super) fn set_pivot(&mut self, pivot: Point, radius: f64) {
        (self.pivot, self.reach) = (pivot, radius);
    }

    /// Adds the way to a new pose; whether the hull grew.
    ///
    /// * `declared` - angular velocity times the time since the last pose, scene frame, where the sender says both.
    /// * `end` - box of the body at the new pose.
    pub(super) fn push(&mut self, from: Pose, to: Pose, declared: Option<Vec3>, end: Aabb) -> bool {
        let (at, goal) = (from * self.pivot, to * self.pivot);
        let travel = goal - at;
        let (spin, extra, followed) = turn_of(&from.rotation, &to.rotation, declared);
        let leg = Leg {
            from,
            to,
            pivot: at,
            travel,
            spin,
            extra,
            jump: travel.norm() > self.teleport_m,
            lapse: false,
        };
        self.add(leg, end, !followed)
    }

    /// Adds the first pose after a reset to the way before it, which was gone and is asked for; whether the hull grew.
    pub(super) fn lapse(&mut self, from: Pose, to: Pose, end: Aabb) -> bool {
        let (at, goal) = (from * self.pivot, to * self.pivot);
        let leg = Leg {
            from,
            to,
            pivot: at,
            travel: goal - at,
            spin: Vec3::zeros(),
            extra: Vec3::zeros(),
            jump: true,
            lapse: true,
        };
        self.add(leg, end, false)
    }

    /// Whether it has gone anywhere in this tick.
    pub(super) fn has_moved(&self) -> bool {
        self.blurred || self.legs.iter().any(|leg| !leg.is_still())
    }

    /// Adds a leg; whether the hull grew.
    fn add(&mut self, leg: Leg, end: Aabb, blurred: bool) -> bool {
        let before = self.hull;
        self.hull = if leg.jump || !self.counts() {
            self.hull.merged(&end)
        } else {
            let swept = swept_box(&leg, &self.pivot, self.reach, (&self.end, &end));
            self.hull.merged(&swept)
        };
        if !self.counts() {
            self.hull = end;
        }
        self.end = end;
        let goal = leg.pivot + leg.travel;
        self.pivots = self.pivots.merged(&Aabb::of([&leg.pivot, &goal]));
        self.blurred |= blurred || self.legs.len() == LEGS_MAX;
        if self.legs.len() < LEGS_MAX {
            self.legs.push(leg);
        }
        self.hull != before
    }

    /// Takes the path of the body it hangs on.
    ///
    /// * `local` - its pose seen from there.
    /// * `centre` - of its own, whose steps may be teleports; body frame, metres.
    /// * `end` - its box at the newest pose.
    pub(super) fn follow(
        &mut self,
        root: &Self,
        local: &Pose,
        (shapes, centre): (&[PlacedShape], &Point),
        end: Aabb,
    ) {
        let begin = root
            .legs
            .first()
            .map_or(end, |leg| tight_box(shapes, &(leg.from * local)));
        self.restart(begin);
        for leg in &root.legs {
            let (from, to) = (leg.from * local, leg.to * local);
            let step_m = (to * centre - from * centre).norm();
            let leg = Leg {
                from,
                to,
                jump: leg.jump || step_m > self.teleport_m,
                ..*leg
            };
            let there = tight_box(shapes, &leg.to);
            self.add(leg, there, root.blurred);
        }
        self.hull = self.hull.merged(&end);
        self.end = end;
        self.blurred = root.blurred;
        if root.blurred && self.swept {
            // Legs that found no room: it was no farther than this from where the pivot was.
            let pivots = &root.pivots;
            let far = pivots.min.coords.amax().max(pivots.max.coords.amax());
            let reach = self.reach + 64.0 * ROUND * (self.reach + far);
            self.hull = self.hull.merged(&pivots.widened(reach));
        }
    }
}

/// A box that holds a body all along a leg, from those at its ends.
///
/// A point at distance `r` from the pivot leaves the straight line between its two ends by at most `angle^2 r / 8`; and
/// it never leaves the ball about the pivot. Both hold, so their intersection does.
fn swept_box(leg: &Leg, pivot: &Point, reach: f64, (begin, end): (&Aabb, &Aabb)) -> Aabb {
    let angle = leg.angle() * (1.0 + 8.0 * ROUND);
    let far = leg.from.translation.vector.amax() + leg.to.translation.vector.amax();
    // Poses on the way are products of rounded numbers as large as these.
    let rounding = 64.0 * ROUND * (far + pivot.coords.amax() + (1.0 + angle) * reach);
    let straight = begin
        .merged(end)
        .widened(angle * angle * reach / 8.0 * (1.0 + 8.0 * ROUND) + rounding);
    let goal = leg.pivot + leg.travel;
    let ball = Aabb::of([&leg.pivot, &goal]).widened(reach + rounding);
    Aabb {
        min: straight.min.sup(&ball.min),
        max: straight.max.inf(&ball.max),
    }
}

/// The turn between two orientations: the shortest, or the one nearest to what the sender says; whole turns about the
/// sender's own axis where the turn has none that could be told; and whether it can be followed.
fn turn_of(from: &Quat, to: &Quat, declared: Option<Vec3>) -> (Vec3, Vec3, bool) {
    // Rounding turns nothing that was sent as it was.
    let is_same = from.coords == to.coords;
    let shortest = if is_same {
        Vec3::zeros()
    } else {
        (to * from.inverse()).scaled_axis()
    };
    let Some(declared) = declared.filter(|turn| *turn != Vec3::zeros()) else {
        return (shortest, Vec3::zeros(), true);
    };
    let full = std::f64::consts::TAU;
    let angle = shortest.norm();
    let has_axis = angle > AXIS_MIN_RAD;
    let axis = if has_axis {
        shortest / angle
    } else {
        declared / declared.norm()
    };
    let turns = ((declared - shortest).dot(&axis) / full).round();
    if turns.is_nan() || turns.abs() > LEG_TURNS_MAX {
        // Its box is the ball about its centre's way, and nothing else is known.
        return (shortest, Vec3::repeat(LEG_TURNS_MAX * full), false);
    }
    let more = axis * (turns * full);
    // What stands as it did has turned about the sender's axis alone.
    if has_axis || is_same {
        (shortest + more, Vec3::zeros(), true)
    } else {
        (shortest, more, true)
    }
}
