//! When two bodies first touch if they move on as they do, or as a question says. In: the question, and the world
//! between two ticks. Out: a self-contained question; then a proved interval of the time, or a proof of none.
//!
//! The motion is that of continuous bodies: the centre of a body's geometry, or of the body on which it hangs, moves
//! straight, and the body rotates about one axis at a constant rate. So is the method: conservative advancement.

use super::gap::both;
use super::going::{Goer, Going, goings};
use super::measure::{WORK_NS, age_ns};
use crate::limits::LEG_TURNS_MAX;
use crate::math::Vec3;
use crate::narrow::{Passage, touch_on_way};
use crate::scene::Impact;
use crate::shape::{Core, Geometry};
use crate::time::{Clock, Meter};
use crate::wire::{ImpactFound, MessageHeader, Verdict};
use crate::world::{Body, World};

/// Two bodies as of one tick, with their motion from there.
#[derive(Clone, Debug)]
pub struct ImpactQuestion {
    a: Body,
    b: Body,
    within_s: f64,
    /// The part of the answer that needs no work.
    found: ImpactFound,
    /// Warnings: what is odd, but allowed.
    pub warnings: Vec<String>,
}

impl ImpactQuestion {
    /// Copies the bodies at their present poses.
    ///
    /// * `tick_header` - of the tick that left the world in this state.
    ///
    /// # Errors
    /// As for a gap; also a half-space that is to move, or a rotation too far to follow.
    pub fn new(world: &World, tick_header: MessageHeader, asked: &Impact) -> Result<Self, String> {
        let ((slot_a, a), (slot_b, b), mut warnings) = both(world, &asked.a, &asked.b)?;
        let goer = |slot, body, asked| Goer { slot, body, asked };
        let goers = [
            goer(slot_a, a, &asked.velocity_a),
            goer(slot_b, b, &asked.velocity_b),
        ];
        let ([of_a, of_b], together) = goings(world, goers, &mut warnings);
        let go = |body: &Body, going: &Going| {
            if together {
                Ok(body.still())
            } else {
                on_way(body, going, asked.within_s)
            }
        };
        Ok(Self {
            a: go(a, &of_a)?,
            b: go(b, &of_b)?,
            within_s: asked.within_s,
            found: ImpactFound {
                tick_header,
                linear_a: of_a.linear.into(),
                angular_a: of_a.angular.into(),
                linear_b: of_b.linear.into(),
                angular_b: of_b.angular.into(),
                ..ImpactFound::default()
            },
            warnings,
        })
    }

    /// As for a gap query.
    pub(super) fn bodies_mut(&mut self) -> impl Iterator<Item = &mut Body> {
        [&mut self.a, &mut self.b].into_iter()
    }

    /// Works on the answer, for a second at most.
    #[must_use]
    pub fn answer(&self, clock: &dyn Clock) -> ImpactFound {
        self.answer_within(clock, None)
    }

    /// As [`ImpactQuestion::answer`], with at most `units` units of work.
    #[must_use]
    pub fn answer_within(&self, clock: &dyn Clock, units: Option<u64>) -> ImpactFound {
        let now_ns = clock.boottime_ns();
        let end_ns = clock.monotonic_ns().saturating_add(WORK_NS);
        let mut meter = Meter::new(clock, Some(end_ns), units);
        let (verdict, from, until) = match touch_on_way(&self.a, &self.b, &mut meter) {
            Passage::Free => (Verdict::Apart, 1.0, None),
            Passage::Touched(shares) => (Verdict::Colliding, shares.min, Some(shares.max)),
            Passage::Open(shares) => (Verdict::Possible, shares.min, None),
        };
        let earliest_s = (from * self.within_s).next_down();
        ImpactFound {
            age_ns: age_ns(&self.a, now_ns).max(age_ns(&self.b, now_ns)),
            verdict: verdict.code(),
            t_min_s: if from >= 1.0 {
                self.within_s
            } else {
                earliest_s.max(0.0)
            },
            t_max_s: until.map(|share| (share * self.within_s).next_up().min(self.within_s)),
            ..self.found
        }
    }
}

fn on_way(body: &Body, going: &Going, within_s: f64) -> Result<Body, String> {
    let name = &body.name;
    let Going {
        linear,
        angular,
        pivot,
    } = *going;
    let (linear, angular) = if pivot == body.centre && is_ball(body) {
        // A body that rotates about its middle stays in place, and no bound needs to allow for the rotation.
        let arm = body.pose.rotation * body.centre.coords;
        (linear + angular.cross(&arm), Vec3::zeros())
    } else {
        (linear, angular)
    };
    if linear == Vec3::zeros() && angular == Vec3::zeros() {
        return Ok(body.still());
    }
    if body.unbounded {
        return Err(format!(
            "body \"{name}\" has a half-space, which is not followed on a way: let the other body move"
        ));
    }
    if angular.norm() * within_s > LEG_TURNS_MAX * std::f64::consts::TAU {
        return Err(format!(
            "body \"{name}\" turns more than {LEG_TURNS_MAX} times in {within_s} s: ask for a shorter time"
        ));
    }
    Ok(body.on_way_about(&pivot, linear, angular, within_s))
}

/// Whether the body is one sphere that rotates about its middle.
fn is_ball(body: &Body) -> bool {
    let [placed] = &*body.shapes else {
        return false;
    };
    let Geometry::Convex(convex) = &placed.shape.geometry else {
        return false;
    };
    matches!(convex.core(), Core::Point) && placed.pose.translation.vector == body.centre.coords
}
