//! The pose of B seen from A, prepared for points and boxes, with rounding bounds.

use nalgebra::Matrix3;

use super::retest::reach_of;
use crate::math::{Point, Pose, ROUND, Vec3, displacement, f32_near};
use crate::shape::{Obb, ObbPack, Shape};
use crate::simd::obb::{GAP_ROUND, LANES, One, gaps};

/// A relative pose as matrix and vector.
#[derive(Clone, Debug)]
pub(in crate::narrow) struct Placed {
    pub(in crate::narrow) pos12: Pose,
    /// Rotation of B's frame seen from A.
    pub(in crate::narrow) rotation: Matrix3<f64>,
    pub(in crate::narrow) translation: Vec3,
    /// Bound on the rounding of any distance computed between the two, metres.
    pub(in crate::narrow) slop: f64,
    /// How far the contents of boxes may extend beyond them, both sides together, metres: for meshes that deform.
    pub(in crate::narrow) lag_m: f64,
}

impl Default for Placed {
    fn default() -> Self {
        Self {
            pos12: Pose::identity(),
            rotation: Matrix3::identity(),
            translation: Vec3::zeros(),
            slop: 0.0,
            lag_m: 0.0,
        }
    }
}

impl Placed {
    /// * `reach_a`, `reach_b` - greatest distance of a vertex from the local origin, metres.
    pub(in crate::narrow) fn new(pos12: &Pose, reach_a: f64, reach_b: f64) -> Self {
        let translation = pos12.translation.vector;
        Self {
            pos12: *pos12,
            rotation: *pos12.rotation.to_rotation_matrix().matrix(),
            translation,
            slop: 32.0 * ROUND * (translation.norm() + reach_a + reach_b),
            lag_m: 0.0,
        }
    }

    /// Of two shapes in their present state.
    pub(super) fn of(a: &Shape, b: &Shape, pos12: &Pose) -> Self {
        Self {
            lag_m: lag_of(a, b),
            ..Self::new(pos12, reach_of(a), reach_of(b))
        }
    }

    /// A point of B's frame in A's.
    pub(in crate::narrow) fn to_a(&self, point: &Point) -> Point {
        Point::from(self.rotation * point.coords + self.translation)
    }

    /// A point of A's frame in B's.
    pub(in crate::narrow) fn to_b(&self, point: &Point) -> Point {
        Point::from(self.rotation.tr_mul(&(point.coords - self.translation)))
    }

    /// A direction of A's frame in B's.
    pub(in crate::narrow) fn turn_to_b(&self, direction: &Vec3) -> Vec3 {
        self.rotation.tr_mul(direction)
    }

    /// Sound lower bounds on the gaps of the contents of `one` and of each box of `pack`, metres; zero or less if they
    /// may touch, and then only meaningful as an order. Lanes without a box yield arbitrary values.
    ///
    /// * `pack_is_b` - the pack is of B and `one` of A, else the other way round.
    pub(in crate::narrow) fn gaps(
        &self,
        one: &Obb,
        pack: &ObbPack,
        pack_is_b: bool,
    ) -> [f64; LANES] {
        let (centre, axes) = if pack_is_b {
            (self.to_b(&one.centre), self.rotation.tr_mul(&one.axes))
        } else {
            (self.to_a(&one.centre), self.rotation * one.axes)
        };
        let from = centre - pack.origin;
        let axis = |k: usize| {
            let column = axes.column(k);
            [f32_near(column.x), f32_near(column.y), f32_near(column.z)]
        };
        let seen = One {
            centre: [f32_near(from.x), f32_near(from.y), f32_near(from.z)],
            axes: [axis(0), axis(1), axis(2)],
            half: one.half,
        };
        let half = one.half[0] + one.half[1] + one.half[2];
        let size = from.lp_norm(1) + f64::from(half) + f64::from(pack.reach);
        let slop = GAP_ROUND * size + self.slop + self.lag_m;
        let mut low = [0.0; LANES];
        for (low, gap) in low.iter_mut().zip(gaps(&seen, &pack.boxes)) {
            *low = f64::from(gap) - slop;
        }
        low
    }
}

/// How far the contents of boxes may extend beyond them, both sides together, metres, rounded up.
pub(super) fn lag_of(a: &Shape, b: &Shape) -> f64 {
    (a.lag_m() + b.lag_m()) * (1.0 + 2.0 * ROUND)
}

/// How far any point of the smaller one's surface moves, seen from the other, metres, rounded up.
pub(super) fn moved(a: &Shape, b: &Shape, from: &Pose, to: &Pose) -> f64 {
    if a.radius < b.radius {
        displacement(&from.inverse(), &to.inverse(), &a.centre, a.radius)
    } else {
        displacement(from, to, &b.centre, b.radius)
    }
}
