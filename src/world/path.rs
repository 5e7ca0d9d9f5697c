//! The path of a continuous body since the last tick: the motion between its poses, and the box around it.
//!
//! In: the pose of the last tick and each one admitted since. Out: legs from pose to pose, along which the pivot (the
//! centre of the body's geometry; for an attached body that of the body it is attached to) moves straight and the body
//! turns about a fixed axis at a constant rate; and a box that contains the whole motion.
//!
//! The share `s` of the motion runs from 0 (the last tick's pose) to 1 (this one's). The frames with poses that the
//! body's source sent meanwhile divide it into equal parts, whether they contain the body or not: each leg takes the
//! part of the frame that it ends at, and in all other parts the body stands still. So two bodies of one source are in
//! step. For two sources, parts of one cannot be matched with parts of the other (see `narrow::sweep::in_step`).

use crate::ids::SourceSlot;
use crate::limits::LEGS_MAX;
use crate::math::{Aabb, Point, Pose, ROUND, Vec3};

use super::leg::{Leg, swept_box, turn_of};
use super::parts::PlacedShape;
use super::place::tight_box;

/// The path of a body, the distance of its surface from its pivot, and what the scene says about its motion.
#[derive(Clone, Debug)]
pub struct Path {
    legs: Vec<Leg>,
    /// The source whose frames it follows.
    source: Option<SourceSlot>,
    /// Number of frames with poses that this source sent in this tick.
    frames: u32,
    /// A tick, and which of its frames had the body's first pose, which ends no leg; 0: none.
    entered: (u64, u32),
    /// The pivot, body frame.
    pivot: Point,
    /// Greatest distance of the body's surface from the pivot, metres, rounded up.
    reach: f64,
    /// Steps of the body's centre beyond it are teleports, metres.
    teleport_m: f64,
    /// Whether the body itself is swept; otherwise its path is kept for bodies attached to it.
    swept: bool,
    /// Its end was predicted from a velocity; no pose was sent for it.
    ahead: bool,
    /// The body is not in the broad phase now: its path only matters to bodies attached to it.
    pub(super) aside: bool,
    /// Not every pose fitted, or some were dropped before: the rest is covered only by the box, if at all.
    blurred: bool,
    /// Contains the body at the newest pose.
    end: Aabb,
    /// Contains the body along the whole path.
    hull: Aabb,
    /// Contains the pivot along the whole path, including legs that did not fit.
    pivots: Aabb,
}

impl Path {
    /// For a body at rest.
    ///
    /// * `radius` - of a ball around `pivot` that contains the body, metres.
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

    /// A path of one leg, for a query.
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

    /// The source whose frames it follows.
    #[must_use]
    pub fn source(&self) -> Option<SourceSlot> {
        self.source
    }

    /// Number of frames with poses that this source sent in this tick: the number of equal parts of the share.
    #[must_use]
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Sets the source whose frames it follows and their number in a tick.
    pub(super) fn set_frames(&mut self, source: Option<SourceSlot>, frames: u32, tick: u64) {
        let last = self.legs.last().map_or(1, |leg| leg.frame);
        (self.source, self.frames) = (source, frames.max(last));
        if self.entered.0 != tick {
            self.entered = (0, 0);
        }
    }

    /// Returns whether the body's first pose came with this frame, by number in this tick: no leg ends there.
    #[must_use]
    pub fn has_entered_with(&self, frame: u32) -> bool {
        self.entered.1 == frame && frame != 0
    }

    /// Starts again at the body's place, with a first pose.
    ///
    /// * `entered` - the tick, and which of its frames had that pose.
    pub(super) fn enter(&mut self, end: Aabb, entered: (u64, u32)) {
        self.restart(end);
        self.entered = entered;
    }

    /// The point that moves straight, body frame.
    #[must_use]
    pub fn pivot(&self) -> &Point {
        &self.pivot
    }

    /// Greatest distance of the body's surface from the pivot, metres.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Returns whether the pose at a share of a leg was reported: at its ends, except a predicted one.
    #[must_use]
    pub fn is_told_at(&self, share: f64) -> bool {
        share <= 0.0 || (share >= 1.0 && !self.ahead)
    }

    /// Returns whether more poses came than are kept, or some are gone: the legs do not cover the whole path.
    #[must_use]
    pub fn is_blurred(&self) -> bool {
        self.blurred
    }

    /// Returns whether the path must be swept: the body is continuous and did not stand still.
    #[must_use]
    pub fn is_swept(&self) -> bool {
        self.counts() && self.has_moved()
    }

    /// Returns whether the body is continuous; otherwise its path is kept for bodies attached to it.
    #[must_use]
    pub fn is_of_continuous(&self) -> bool {
        self.swept
    }

    /// Returns whether a step of it is not swept.
    #[must_use]
    pub fn has_jumped(&self) -> bool {
        self.counts() && self.legs.iter().any(|leg| leg.jump)
    }

    /// Returns whether a step of it exceeded its `teleport_m`.
    #[must_use]
    pub fn has_teleported(&self) -> bool {
        self.counts() && self.legs.iter().any(|leg| leg.jump && !leg.lapse)
    }

    /// Returns whether it is the path of a continuous body in the broad phase.
    fn counts(&self) -> bool {
        self.swept && !self.aside
    }

    /// Sets whether the body is out of the broad phase: what it moved meanwhile is no motion of its own.
    pub(super) fn set_aside(&mut self, aside: bool) {
        if self.aside && !aside {
            self.enter(self.end, self.entered);
        }
        self.aside = aside;
    }

    /// A box that contains the body along the whole path.
    #[must_use]
    pub fn hull(&self) -> &Aabb {
        &self.hull
    }

    /// Starts again at the body's place.
    pub(super) fn restart(&mut self, end: Aabb) {
        self.legs.clear();
        self.entered = (0, 0);
        self.blurred = false;
        (self.end, self.hull) = (end, end);
        self.pivots = Aabb::empty();
    }

    /// As [`Path::restart`], at the newest pose; returns whether the hull was wider.
    pub(super) fn rest(&mut self) -> bool {
        let wider = self.hull != self.end;
        self.restart(self.end);
        wider
    }

    /// Takes the box of changed vertices at the newest pose.
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

    /// Adds the leg to a new pose; returns whether the hull grew.
    ///
    /// * `declared` - angular velocity times the time since the last pose, scene frame, if the sender gives both.
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

    /// Adds the first pose after a reset to the path before it, which is still swept; returns whether the hull grew.
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

    /// Returns whether it has moved in this tick.
    pub(super) fn has_moved(&self) -> bool {
        self.blurred || self.legs.iter().any(|leg| !leg.is_still())
    }

    /// Adds a leg; returns whether the hull grew.
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

    /// Takes the path of the body it is attached to.
    ///
    /// * `local` - its pose relative to that body.
    /// * `centre` - its own centre, whose steps may be teleports; body frame, metres.
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
            // Legs that did not fit: it was no farther than this from the places of the pivot.
            let pivots = &root.pivots;
            let far = pivots.min.coords.amax().max(pivots.max.coords.amax());
            let reach = self.reach + 64.0 * ROUND * (self.reach + far);
            self.hull = self.hull.merged(&pivots.widened(reach));
        }
    }
}
