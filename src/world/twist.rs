//! Velocity of a body, from a frame or from the body it is attached to.

use crate::math::{Point, Pose, Vec3};

/// Velocities of a frame that is fixed to a body: scene frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Linear velocity of its origin, metres per second.
    pub linear_mps: Vec3,
    /// Angular velocity, radians per second.
    pub angular_radps: Vec3,
}

impl Twist {
    /// From a frame's row: linear, then angular.
    pub(super) fn of_row(&[x, y, z, rx, ry, rz]: &[f64; 6]) -> Self {
        Self {
            linear_mps: Vec3::new(x, y, z),
            angular_radps: Vec3::new(rx, ry, rz),
        }
    }

    /// Velocity of another frame that is fixed to the same body.
    ///
    /// * `pose` - this frame's, scene frame.
    /// * `point` - the other frame's origin in this one, metres.
    pub(super) fn at(&self, pose: &Pose, point: &Point) -> Self {
        let arm = pose.rotation * point.coords;
        Self {
            linear_mps: self.linear_mps + self.angular_radps.cross(&arm),
            ..*self
        }
    }

    /// Returns whether two are equal to the last bit: only then are results computed from one valid for the other.
    pub(super) fn is_same(a: Option<Self>, b: Option<Self>) -> bool {
        let bits = |v: Vec3| v.data.0[0].map(f64::to_bits);
        let bits = |t: Self| [bits(t.linear_mps), bits(t.angular_radps)];
        a.map(bits) == b.map(bits)
    }
}
