//! Basic numeric types: poses, boxes, intervals, outward rounding, and the only place that uses glamx.
//!
//! f64 everywhere, metres and radians, right-handed, z up.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// A vector or a direction, metres unless said otherwise.
pub type Vec3 = Vector3<f64>;
/// A point in the frame given by its name or doc, metres.
pub type Point = Point3<f64>;
/// A rotation.
pub type Quat = UnitQuaternion<f64>;
/// A rigid transform. `pos12` is the pose of 2 seen from 1.
pub type Pose = Isometry3<f64>;

/// Unit roundoff of f64, 2^-53.
pub const ROUND: f64 = f64::EPSILON / 2.0;

/// The lesser of two numbers: one instruction, unlike `f64::min`, which handles NaN.
#[inline(always)]
pub(crate) fn lesser<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

/// The greater of two numbers, likewise.
#[inline(always)]
pub(crate) fn greater<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// Length of the component of a vector orthogonal to z. For lengths up to some hundred kilometres nothing overflows, so
/// `hypot` would only be slow.
#[inline]
pub(crate) fn across_z(v: &Vec3) -> f64 {
    (v.x * v.x + v.y * v.y).sqrt()
}

/// The largest f32 not above `x`.
#[must_use]
pub fn f32_down(x: f64) -> f32 {
    #[allow(
        clippy::cast_possible_truncation,
        reason = "this is the one cast, corrected below"
    )]
    let nearest = x as f32;
    if f64::from(nearest) > x {
        nearest.next_down()
    } else {
        nearest
    }
}

/// The f32 nearest to `x`: one instruction, where [`f32_down`] takes a branch that is practically random.
#[must_use]
#[inline]
#[allow(
    clippy::cast_possible_truncation,
    reason = "the one cast to the nearest"
)]
pub fn f32_near(x: f64) -> f32 {
    x as f32
}

/// The smallest f32 not below `x`.
#[must_use]
pub fn f32_up(x: f64) -> f32 {
    -f32_down(-x)
}

/// The pose of 2 seen from 1, from two world poses.
///
/// The translations are subtracted first: far from the origin a product of world matrices loses digits.
#[must_use]
pub fn relative(pose1: &Pose, pose2: &Pose) -> Pose {
    let inverse = pose1.rotation.inverse();
    let translation = inverse * (pose2.translation.vector - pose1.translation.vector);
    Pose::from_parts(Translation3::from(translation), inverse * pose2.rotation)
}

/// A pose from a position and a quaternion x, y, z, w, which is normalised; `None` when not finite or zero.
#[must_use]
pub fn pose_from(position: [f64; 3], xyzw: [f64; 4]) -> Option<Pose> {
    let finite = position.iter().chain(&xyzw).all(|v| v.is_finite());
    let quaternion = Quaternion::new(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
    let largest = quaternion.coords.amax();
    if !finite || largest == 0.0 {
        return None;
    }
    // Scaled by the largest component first if squares need it: neither 1e-200 nor 1e200 may lose the direction.
    let squares_fit = (1e-100..1e100).contains(&largest);
    let scaled = if squares_fit {
        quaternion
    } else {
        quaternion / largest
    };
    let rotation = UnitQuaternion::new_normalize(scaled);
    Some(Pose::from_parts(
        Translation3::from(Vec3::from(position)),
        rotation,
    ))
}

/// An upper bound on how far any point within `radius` of `centre` (frame of the body) moves between two poses.
///
/// Displacement of the centre, plus the chord `2 r sin(theta / 2)` of the rotation, rounded up.
#[must_use]
pub fn displacement(from: &Pose, to: &Pose, centre: &Point, radius: f64) -> f64 {
    let moved = (to * centre) - (from * centre);
    let turn = chord(&from.rotation, &to.rotation);
    // Each difference has a few roundings of coordinates as large as the positions themselves.
    let magnitude = from
        .translation
        .vector
        .amax()
        .max(to.translation.vector.amax())
        + centre.coords.amax()
        + radius;
    let way = moved.norm() + turn * radius;
    // Poses are compared only if they may be equal: that takes as long as all the rest.
    if way == 0.0 && from == to {
        0.0
    } else {
        way * (1.0 + 8.0 * ROUND) + 16.0 * ROUND * magnitude
    }
}

/// `2 sin(theta / 2)` of the rotation between two orientations: the greatest motion of a point at radius 1.
#[must_use]
pub fn chord(from: &Quat, to: &Quat) -> f64 {
    let (a, b) = (from.as_vector(), to.as_vector());
    // |a - b| = 2 sin(theta / 4) for unit quaternions on the same side: stable near zero, where acos is not.
    let square = (a - b).norm_squared().min((a + b).norm_squared()) / 4.0;
    4.0 * (square * (1.0 - square).max(0.0)).sqrt()
}

/// A closed interval of metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end; may be minus infinity.
    pub min: f64,
    /// Upper end; may be infinity.
    pub max: f64,
}

impl Interval {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self {
        min: f64::NEG_INFINITY,
        max: f64::INFINITY,
    };

    /// The interval between two ends.
    #[must_use]
    pub fn new(min: f64, max: f64) -> Self {
        debug_assert!(min <= max, "interval ends in order: {min} {max}");
        Self { min, max }
    }

    /// Both ends moved out by `margin`, rounded outward.
    #[must_use]
    pub fn widened(self, margin: f64) -> Self {
        Self {
            min: (self.min - margin).next_down(),
            max: (self.max + margin).next_up(),
        }
    }

    /// The intersection of both intervals. Two sound intervals of one number always meet; if rounding separates them,
    /// `self` wins.
    #[must_use]
    pub fn meet(self, other: Self) -> Self {
        let both = Self {
            min: self.min.max(other.min),
            max: self.max.min(other.max),
        };
        if both.min <= both.max { both } else { self }
    }

    /// The interval of the lesser of two numbers.
    #[must_use]
    pub fn least(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.min(other.max),
        }
    }

    /// Upper end minus lower end.
    #[must_use]
    pub fn width(self) -> f64 {
        self.max - self.min
    }

    /// Whether `x` lies inside, ends included.
    #[must_use]
    pub fn contains(self, x: f64) -> bool {
        self.min <= x && x <= self.max
    }
}

/// An axis-aligned box, closed: touching counts as overlap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Lower corner, metres.
    pub min: Point,
    /// Upper corner, metres.
    pub max: Point,
}

impl Aabb {
    /// The empty box: the neutral element of [`Aabb::merged`].
    #[must_use]
    pub fn empty() -> Self {
        let (low, high) = (f64::INFINITY, f64::NEG_INFINITY);
        Self {
            min: Point::new(low, low, low),
            max: Point::new(high, high, high),
        }
    }

    /// The least box around points.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Point>) -> Self {
        points.into_iter().fold(Self::empty(), |all, p| Self {
            min: all.min.inf(p),
            max: all.max.sup(p),
        })
    }

    /// The least box around both.
    #[must_use]
    pub fn merged(&self, other: &Self) -> Self {
        Self {
            min: self.min.inf(&other.min),
            max: self.max.sup(&other.max),
        }
    }

    /// Each face moved out by `margin_m`, rounded outward.
    #[must_use]
    #[inline]
    pub fn widened(&self, margin_m: f64) -> Self {
        // An ulp or two; as a product, since stepping to the next float costs ten times as much. If the product is not
        // less, there is nothing to round: a sum so small is exact, and the ends of the empty box are infinite.
        let below = |v: f64| {
            let less = v - v.abs() * f64::EPSILON;
            if less < v { less } else { v }
        };
        Self {
            min: self.min.map(|v| below(v - margin_m)),
            max: self.max.map(|v| -below(-(v + margin_m))),
        }
    }

    /// Whether the two closed boxes share a point.
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|k| self.min[k] <= other.max[k] && other.min[k] <= self.max[k])
    }

    /// Whether `other` lies entirely inside.
    #[must_use]
    pub fn holds(&self, other: &Self) -> bool {
        (0..3).all(|k| self.min[k] <= other.min[k] && other.max[k] <= self.max[k])
    }

    /// A lower bound on the distance between the contents of both; 0 if they overlap.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        let apart = |k: usize| {
            (other.min[k] - self.max[k])
                .max(self.min[k] - other.max[k])
                .max(0.0)
        };
        let square = apart(0) * apart(0) + apart(1) * apart(1) + apart(2) * apart(2);
        square.sqrt() * (1.0 - 4.0 * f64::EPSILON)
    }

    /// Centre, metres.
    #[must_use]
    pub fn centre(&self) -> Point {
        nalgebra::center(&self.min, &self.max)
    }

    /// Half of each side, metres.
    #[must_use]
    pub fn half_extents(&self) -> Vec3 {
        (self.max - self.min) / 2.0
    }
}

/// To parry's vector.
#[must_use]
pub(crate) fn to_glam_vec(v: &Vec3) -> glamx::DVec3 {
    glamx::DVec3::new(v.x, v.y, v.z)
}

/// The lower ten bits of a number, with two zeros between any two: one coordinate of a Morton code (Morton 1966).
#[must_use]
pub(crate) fn morton_bits(cell: u32) -> u32 {
    let mut bits = cell & 0x3FF;
    bits = (bits | bits << 16) & 0x0300_00FF;
    bits = (bits | bits << 8) & 0x0300_F00F;
    bits = (bits | bits << 4) & 0x030C_30C3;
    (bits | bits << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn casts_to_f32_never_cross_the_number() {
        for x in [0.1, -0.1, 1e7 + 0.3, -1e-40, 16_777_217.0, 3.5e38, -3.5e38] {
            assert!(f64::from(f32_down(x)) <= x, "{x}");
            assert!(f64::from(f32_up(x)) >= x, "{x}");
        }
    }

    #[test]
    fn a_widened_box_is_rounded_outward_and_an_empty_one_stays_empty() {
        for exponent in -1074..1000 {
            for (v, margin_m) in [(1.0, 0.0), (1.0, 0.1), (-1.7, 0.3), (0.9, 1.1), (0.0, 1.0)] {
                let scale =
                    2.0_f64.powi(exponent.max(-1000)) * 2.0_f64.powi(exponent.min(-1000) + 1000);
                let (v, margin_m) = (v * scale, margin_m * scale);
                let at = Point::new(v, v, v);
                let wide = Aabb { min: at, max: at }.widened(margin_m);
                // The exact error of a sum (Knuth).
                let low = v - margin_m;
                let back = low - v;
                let off = (v - (low - back)) + (-margin_m - back);
                assert!(wide.min.x < low || (off.abs() <= 0.0 && wide.min.x <= low));
                assert!(low - wide.min.x <= 2.1 * (low - low.next_down()));
                let mirrored = Aabb { min: -at, max: -at }.widened(margin_m);
                assert!((mirrored.max.x + wide.min.x).abs() <= 0.0);
            }
        }
        let empty = Aabb::empty().widened(1.0);
        assert!(empty.min.x > empty.max.x);
        let all = Aabb {
            min: Aabb::empty().max,
            max: Aabb::empty().min,
        };
        assert_eq!(all.widened(1.0), all);
    }

    #[test]
    fn a_chord_is_twice_the_sine_of_half_the_angle() {
        for angle in [0.0_f64, 1e-9, 0.01, 1.0, 3.0, std::f64::consts::PI] {
            let turned = Quat::from_axis_angle(&Vec3::z_axis(), angle);
            let wanted = 2.0 * (angle / 2.0).sin();
            assert!(
                (chord(&Quat::identity(), &turned) - wanted).abs() < 1e-14,
                "{angle}"
            );
        }
    }

    #[test]
    fn a_quaternion_of_any_length_is_normalised_and_a_zero_one_is_refused() {
        assert!(pose_from([0.0; 3], [0.0; 4]).is_none());
        assert!(pose_from([f64::NAN, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]).is_none());
        let tiny = pose_from([0.0; 3], [0.0, 0.0, 3e-200, 4e-200]).unwrap();
        assert!((tiny.rotation.k - 0.6).abs() < 1e-15);
    }

    #[test]
    fn a_relative_pose_keeps_its_digits_far_from_the_origin() {
        let far = Vec3::new(1e7, -1e7, 1e7);
        let (a, b) = (
            Pose::translation(far.x, far.y, far.z),
            Vec3::new(0.25, 0.5, 0.125),
        );
        let b = Pose::from_parts((far + b).into(), Quat::identity());
        assert_eq!(
            relative(&a, &b).translation.vector,
            Vec3::new(0.25, 0.5, 0.125)
        );
    }

    #[test]
    fn bits_of_the_curve_are_spread_by_three() {
        assert_eq!(morton_bits(0b11), 0b1001);
        assert_eq!(morton_bits(0x3FF), 0x0924_9249);
    }
}
