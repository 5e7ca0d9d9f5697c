//! How fast a body moves, as a frame said or what it hangs on moves it.

use crate::math::{Point, Pose, Vec3};

/// Velocities of a frame that is fixed to a body: scene frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Of its origin, metres a second.
    pub linear_mps: Vec3,
    /// Radians a second.
    pub angular_radps: Vec3,
}

impl Twist {
    /// Of a frame's row: linear, then angular.
    pub(super) fn of_row(&[x, y, z, rx, ry, rz]: &[f64; 6]) -> Self {
        Self {
            linear_mps: Vec3::new(x, y, z),
            angular_radps: Vec3::new(rx, ry, rz),
        }
    }

    /// Of a frame beside it that is fixed to the same body.
    ///
    /// * `pose` - this frame's, scene frame.
    /// * `point` - the other's origin in this frame, metres.
    pub(super) fn at(&self, pose: &Pose, point: &Point) -> Self {
        let arm = pose.rotation * point.coords;
        Self {
            linear_mps: self.linear_mps + self.angular_radps.cross(&arm),
            ..*self
        }
    }

    /// Whether two are the same to the last bit: only then is what was computed from one that of the other.
    pub(super) fn is_same(a: Option<Self>, b: Option<Self>) -> bool {
        let bits = |v: Vec3| v.data.0[0].map(f64::to_bits);
        let bits = |t: Self| [bits(t.linear_mps), bits(t.angular_radps)];
        a.map(bits) == b.map(bits)
    }
}
