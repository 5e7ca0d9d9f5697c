//! How the two bodies of an impact query move on. In: the world between two ticks, the velocities that the question
//! gives. Out: a velocity and a pivot for each, and warnings.
//!
//! What the question says of one body also holds for the other, if that one hangs on it and nothing is said of it.
//! Otherwise a body moves on as it was sent, and one that hangs on another as the body at the root moves it: on an arc
//! about that body's centre. Two that hang on the same body are at rest relative to each other.

use super::measure::age_ns;
use crate::ids::BodySlot;
use crate::math::{Point, Vec3};
use crate::scene::Velocity;
use crate::wire::BodyStatus;
use crate::world::{Body, World};

/// The motion of a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Going {
    /// Of its frame's origin, scene frame, metres a second.
    pub(super) linear: Vec3,
    /// Scene frame, radians a second.
    pub(super) angular: Vec3,
    /// The point that moves straight, body frame.
    pub(super) pivot: Point,
}

/// One of the two bodies.
#[derive(Clone, Copy)]
pub(super) struct Goer<'q> {
    pub(super) slot: BodySlot,
    pub(super) body: &'q Body,
    pub(super) asked: &'q Velocity,
}

impl Goer<'_> {
    /// Whether the question gives its motion: then nothing else counts.
    fn is_told(&self) -> bool {
        self.asked.linear.is_some() || self.asked.angular.is_some()
    }

    fn as_told(&self) -> Going {
        let vector = |told: Option<[f64; 3]>| told.map(Vec3::from).unwrap_or_default();
        Going {
            linear: vector(self.asked.linear),
            angular: vector(self.asked.angular),
            pivot: self.body.centre,
        }
    }

    /// Its motion as it was sent, or as that of its root was.
    fn as_sent(&self, world: &World) -> Going {
        let (root, local) = world.root_of(self.slot);
        let centre = world
            .body(root)
            .map_or(self.body.centre, |root| root.centre);
        let pivot = if root == self.slot {
            self.body.centre
        } else {
            local.inverse_transform_point(&centre)
        };
        let sent = self.body.velocity.unwrap_or_default();
        Going {
            linear: sent.linear_mps,
            angular: sent.angular_radps,
            pivot,
        }
    }

    /// Its motion when it hangs on another body and is carried by it.
    fn carried(&self, by: &Self) -> Going {
        let Going {
            linear, angular, ..
        } = by.as_told();
        let arm = self.body.pose.translation.vector - by.body.pose.translation.vector;
        Going {
            linear: linear + angular.cross(&arm),
            angular,
            pivot: self
                .body
                .pose
                .inverse_transform_point(&(by.body.pose * by.body.centre)),
        }
    }

    /// Warning about the velocity that it was sent with.
    fn doubts(&self, world: &World) -> Option<String> {
        let body = self.body;
        if !body.moves {
            return None;
        }
        let name = &body.name;
        if body.velocity.is_none() {
            let (root, _) = world.root_of(self.slot);
            let who = match world.body(root).filter(|_| root != self.slot) {
                Some(root) => format!("the source of \"{}\", on which it hangs,", root.name),
                None => "its source".to_owned(),
            };
            return Some(format!(
                "body \"{name}\" is taken to be at rest: {who} sends no velocity, and the question says none"
            ));
        }
        let age_ns = age_ns(body, world.now_ns()).filter(|_| body.status == BodyStatus::Held)?;
        #[allow(
            clippy::cast_precision_loss,
            reason = "told to a thousandth of a second"
        )]
        let age_s = age_ns as f64 * 1e-9;
        Some(format!(
            "body \"{name}\" is taken to go on as it was sent: that velocity was {age_s:.3} s old at this tick, and the question says none"
        ))
    }
}

/// The motions of both, and whether they are at rest relative to each other; adds warnings.
pub(super) fn goings(
    world: &World,
    [a, b]: [Goer<'_>; 2],
    warnings: &mut Vec<String>,
) -> ([Going; 2], bool) {
    for goer in [a, b].iter().filter(|goer| goer.body.vertices.is_some()) {
        warnings.push(format!(
            "body \"{}\" deforms: its vertices are taken as they are, whatever way they go",
            goer.body.name
        ));
    }
    let hangs = |one: &Goer<'_>, on: &Goer<'_>| {
        let hanging = world.hanging_on(on.slot);
        hanging.iter().any(|(slot, _)| *slot == one.slot)
    };
    match (a.is_told(), b.is_told()) {
        (true, false) if hangs(&b, &a) => return ([a.as_told(), b.carried(&a)], true),
        (false, true) if hangs(&a, &b) => return ([a.carried(&b), b.as_told()], true),
        (false, false) if world.root_of(a.slot).0 == world.root_of(b.slot).0 => {
            return ([a.as_sent(world), b.as_sent(world)], true);
        }
        _ => {}
    }
    let mut of = |goer: Goer<'_>| {
        if goer.is_told() {
            return goer.as_told();
        }
        warnings.extend(goer.doubts(world));
        goer.as_sent(world)
    };
    ([of(a), of(b)], false)
}
