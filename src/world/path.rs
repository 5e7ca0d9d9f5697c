//! The path of a continuous body since the last tick: what lies between its poses, and the box around it.
//!
//! In: the pose of the last tick and each one admitted since. Out: legs from pose to pose, along which the pivot (the
//! centre of the body's geometry; of an attached body that of the body it hangs on) goes straight and the body turns
//! about a fixed axis at a constant rate; and a box that holds the body all the way.
//!
//! The share `s` of the motion runs from 0 (the last tick's pose) to 1 (this one's). The frames with poses that the
//! body's source sent meanwhile divide it into equal parts, whether they hold the body or not: each leg takes the part
//! of the frame that it ends at, and in all others the body stands still. So two bodies of one source are in step. Of
//! two sources no part of the one is known to be a certain part of the other (see `narrow::sweep::in_step`).

use crate::ids::SourceSlot;
use crate::limits::LEGS_MAX;
use crate::math::{Aabb, Point, Pose, ROUND, Vec3};

use super::leg::{Leg, swept_box, turn_of};
use super::parts::PlacedShape;
use super::place::tight_box;

/// How far a body's surface is from its pivot, and what the scene says of its motion.
#[derive(Clone, Debug)]
pub struct Path {
    legs: Vec<Leg>,
    /// Whose frames it follows.
    source: Option<SourceSlot>,
    /// How many frames with poses that source sent in this tick.
    frames: u32,
    /// A tick, and which of its frames had the body's first pose, which no leg leads to; 0: none.
    entered: (u64, u32),
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
    /// Not every pose found room, or some were dropped before: at most the box knows of the rest.
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
            source: None,
            frames: 0,
            entered: (0, 0),
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
            frames: leg.frame,
            ahead: true,
            ..Self::new(pivot, radius, None, true)
        }
    }

    /// The legs since the last tick, oldest first.
    #[must_use]
    pub fn legs(&self) -> &[Leg] {
        &self.legs
    }

    /// Whose frames it follows.
    #[must_use]
    pub fn source(&self) -> Option<SourceSlot> {
        self.source
    }

    /// How many frames with poses that source sent in this tick: parts of equal length that the share consists of.
    #[must_use]
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Says whose frames it follows and how many there were in a tick.
    pub(super) fn set_frames(&mut self, source: Option<SourceSlot>, frames: u32, tick: u64) {
        let last = self.legs.last().map_or(1, |leg| leg.frame);
        (self.source, self.frames) = (source, frames.max(last));
        if self.entered.0 != tick {
            self.entered = (0, 0);
        }
    }

    /// Whether a pose of the body came with a frame, by number in this tick, as its first one: no leg ends there.
    #[must_use]
    pub fn has_entered_with(&self, frame: u32) -> bool {
        self.entered.1 == frame && frame != 0
    }

    /// Begins anew where the body is, with a first pose.
    ///
    /// * `entered` - the tick, and which of its frames had that pose.
    pub(super) fn enter(&mut self, end: Aabb, entered: (u64, u32)) {
        self.restart(end);
        self.entered = entered;
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

    /// Whether more poses came than are kept, or some are gone: the legs do not tell the whole way.
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
            self.enter(self.end, self.entered);
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
        self.entered = (0, 0);
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
        self.legs.is_empty() && !self.blurred
    }

    /// A part of the way is not known.
    pub(super) fn blur(&mut self) {
        self.blurred = true;
    }

    pub(super) fn set_pivot(&mut self, pivot: Point, radius: f64) {
        (self.pivot, self.reach) = (pivot, radius);
    }

    /// Adds the way to a new pose; whether the hull grew.
    ///
    /// * `declared` - angular velocity times the time since the last pose, scene frame, where the sender says both.
    /// * `end` - box of the body at the new pose.
    /// * `frame` - number of the frame that the new pose is from, in this tick.
    pub(super) fn push(
        &mut self,
        (from, to): (Pose, Pose),
        declared: Option<Vec3>,
        end: Aabb,
        frame: u32,
    ) -> bool {
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
            frame,
        };
        self.add(leg, end, !followed)
    }

    /// Adds the first pose after a reset to the way before it, which was gone and is asked for; whether the hull grew.
    pub(super) fn lapse(&mut self, (from, to): (Pose, Pose), end: Aabb, frame: u32) -> bool {
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
            frame,
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
        self.enter(begin, root.entered);
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
        if root.blurred && self.swept && !root.legs.is_empty() {
            // Legs that found no room: it was no farther than this from where the pivot was.
            let pivots = &root.pivots;
            let far = pivots.min.coords.amax().max(pivots.max.coords.amax());
            let reach = self.reach + 64.0 * ROUND * (self.reach + far);
            self.hull = self.hull.merged(&pivots.widened(reach));
        }
    }
}
