//! The motion by Rodrigues' formula, and the first contact with a wall by sampling and bisection, without any code of
//! the library.

use sweepd::math::{Point, Pose, Vec3};

/// A motion: a translation of the centre along a line, and a rotation about an axis at a constant rate.
pub struct Motion {
    pub from: Pose,
    pub travel: Vec3,
    /// Unit vector.
    pub axis: Vec3,
    pub angle: f64,
}

impl Motion {
    /// Position of a point of the body at share `s` of the motion.
    pub fn place(&self, p: &Vec3, s: f64) -> Vec3 {
        let arm = self.from.rotation * p;
        let (sin, cos) = (self.angle * s).sin_cos();
        let turned = arm * cos
            + self.axis.cross(&arm) * sin
            + self.axis * (self.axis.dot(&arm) * (1.0 - cos));
        self.from.translation.vector + self.travel * s + turned
    }

    /// The final pose.
    pub fn end(&self) -> Pose {
        let turn = sweepd::math::Quat::from_scaled_axis(self.axis * self.angle);
        Pose::from_parts(
            (self.from.translation.vector + self.travel).into(),
            turn * self.from.rotation,
        )
    }
}

/// A plate: a box much wider than the body, so that the contact is with its face.
pub struct Plate {
    pub pose: Pose,
    pub half: Vec3,
}

impl Plate {
    /// Least signed height of points with radius `margin` above the upper or lower face of the plate, whichever the
    /// motion comes from.
    fn height(&self, points: &[Vec3], margin: f64, motion: &Motion, s: f64, side: f64) -> f64 {
        let up = self.pose.rotation * Vec3::z() * side;
        points
            .iter()
            .map(|p| up.dot(&(motion.place(p, s) - self.pose.translation.vector)))
            .fold(f64::INFINITY, f64::min)
            - margin
            - self.half.z
    }

    /// The share at which a body first touches the plate's face; the body starts in front of it and passes through.
    ///
    /// * `around` - a share at which it is in the plate, and a range before it that begins without contact.
    pub fn first_touch(
        &self,
        points: &[Vec3],
        margin: f64,
        motion: &Motion,
        around: (f64, f64),
    ) -> f64 {
        let up = self.pose.rotation * Vec3::z();
        let side = -up.dot(&motion.travel).signum();
        let at = |s: f64| self.height(points, margin, motion, s, side);
        let begin = (around.0 - around.1).max(0.0);
        let mut before = begin;
        for k in 0..=4000 {
            let s = begin + (around.0 - begin) * f64::from(k) / 4000.0;
            if at(s) <= 0.0 {
                let (mut low, mut high) = (before, s);
                for _ in 0..80 {
                    let middle = f64::midpoint(low, high);
                    if at(middle) <= 0.0 {
                        high = middle;
                    } else {
                        low = middle;
                    }
                }
                return high;
            }
            before = s;
        }
        around.0
    }
}

/// Distance of a point from a box.
pub fn point_box(p: &Point, pose: &Pose, half: &Vec3) -> f64 {
    let local = pose.rotation.inverse() * (p.coords - pose.translation.vector);
    (local.abs() - half).map(|v| v.max(0.0)).norm()
}
