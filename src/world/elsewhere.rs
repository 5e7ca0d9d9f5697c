//! Bodies as they would be elsewhere, for queries: the world does not change.
//!
//! In: a body, a pose. Out: a body at rest there, and the bodies attached to it.

use super::World;
use super::body::{Body, Motion};
use super::leg::Leg;
use super::parts::Parts;
use super::path::Path;
use super::place::{new_body, tight_box};
use crate::ids::{BodyId, BodySlot};
use crate::math::{Point, Pose, Quat, Vec3};
use crate::scene::BodySpec;
use crate::wire::BodyStatus;

impl Body {
    /// A copy without its path since the last tick: a few pointers and numbers, whatever its shapes are.
    #[must_use]
    pub fn still(&self) -> Self {
        Self {
            path: None,
            name: self.name.clone(),
            shapes: self.shapes.clone(),
            vertices: self.vertices.clone(),
            ..*self
        }
    }

    /// The body as it would be at a pose: its place certain, its box tight.
    #[must_use]
    pub fn at(&self, pose: &Pose) -> Self {
        Self {
            pose: *pose,
            proxy: tight_box(&self.shapes, pose),
            motion: Motion {
                bent_m: self.motion.bent_m,
                ..Motion::at(pose)
            },
            status: BodyStatus::Known,
            reach_m: 0.0,
            reject: None,
            ..self.still()
        }
    }

    /// The body moving from where it is: the centre of its geometry straight, its turn at a constant rate.
    ///
    /// * `linear` - velocity of its frame's origin now, scene frame, metres per second.
    /// * `angular` - scene frame, radians per second.
    #[must_use]
    pub fn on_way(&self, linear: Vec3, angular: Vec3, seconds: f64) -> Self {
        self.on_way_about(&self.centre, linear, angular, seconds)
    }

    /// As [`Body::on_way`], but another point than the centre of its geometry moves straight.
    ///
    /// * `pivot` - body frame, metres.
    #[must_use]
    pub fn on_way_about(&self, pivot: &Point, linear: Vec3, angular: Vec3, seconds: f64) -> Self {
        let arm = self.pose.rotation * pivot.coords;
        let (travel, spin) = ((linear + angular.cross(&arm)) * seconds, angular * seconds);
        let at = self.pose * pivot;
        let turned = Quat::from_scaled_axis(spin) * self.pose.rotation;
        let end = at + travel - turned * pivot.coords;
        let leg = Leg {
            from: self.pose,
            to: Pose::from_parts(end.coords.into(), turned),
            pivot: at,
            travel,
            spin,
            extra: Vec3::zeros(),
            jump: false,
            lapse: false,
            frame: 1,
        };
        let reach = if *pivot == self.centre {
            self.radius
        } else {
            (self.radius + (pivot - self.centre).norm()) * (1.0 + 8.0 * f64::EPSILON)
        };
        Self {
            path: Some(Box::new(Path::of_leg(leg, *pivot, reach))),
            ..self.still()
        }
    }

    /// A body made of shapes that belong to no body of the scene.
    #[must_use]
    pub fn of_shapes(shapes: Parts, pose: &Pose) -> Self {
        let spec = BodySpec {
            moves: false,
            ..BodySpec::new(String::new(), BodyId(0), Vec::new())
        };
        new_body(&spec, shapes, 0).0.at(pose)
    }
}

impl World {
    /// The root of the body's chain of attachments, or itself, and its pose relative to that.
    #[must_use]
    pub fn root_of(&self, slot: BodySlot) -> (BodySlot, Pose) {
        let entry = self.entries.get(slot.index());
        entry.map_or((slot, Pose::identity()), |entry| {
            (entry.root, entry.root_pose)
        })
    }

    /// The bodies attached to a body, directly or through others, each with its pose relative to it; by slot.
    ///
    /// Cost: O(bodies with the same root), times the length of their chains unless this body is the root.
    #[must_use]
    pub fn hanging_on(&self, slot: BodySlot) -> Vec<(BodySlot, Pose)> {
        let Some(entry) = self.entries.get(slot.index()) else {
            return Vec::new();
        };
        let kin = self.attached.of_root(entry.root).iter().map(|of| of.1);
        if entry.root == slot {
            let pose = |other: BodySlot| self.entries[other.index()].root_pose;
            return kin.map(|other| (other, pose(other))).collect();
        }
        kin.filter_map(|other| {
            let (_, pose) = self.above(other).find(|(at, _)| *at == slot)?;
            Some((other, pose))
        })
        .collect()
    }
}
