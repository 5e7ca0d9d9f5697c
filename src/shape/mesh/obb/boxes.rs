//! A tree over oriented boxes: those of a body's shapes. Leaves are aligned with each box's own axes, the boxes above
//! them with those of the frame.

use nalgebra::Matrix3;

use super::fit::{Fitted, around};
use super::{LEAF, ObbPack, ObbTree, parts_of, split};
use crate::math::{Aabb, Point, Pose, Vec3};
use crate::simd::obb::LANES;

impl ObbTree {
    /// A tree over at least one box, each at its pose; a leaf holds the `u32` given with it.
    ///
    /// Boxes contain the corners as computed by `pose * corner`: the caller allows for that rounding.
    ///
    /// Cost: O(n log n).
    pub(crate) fn over(boxes: &[(u32, Pose, Aabb)]) -> Self {
        let mut order: Vec<(u32, Vec3)> = (0..)
            .zip(boxes)
            .map(|(at, (_, pose, aabb))| (at, (pose * aabb.centre()).coords))
            .collect();
        let mut tree = Self {
            packs: Vec::with_capacity(boxes.len() / 6 + 2),
        };
        tree.packs.push(ObbPack::empty());
        let root = tree.grow(&mut order, boxes);
        tree.packs[0] = ObbPack::of(&[root]);
        tree
    }

    /// Appends everything below a box over `order`; returns that box and its contents.
    fn grow(&mut self, order: &mut [(u32, Vec3)], boxes: &[(u32, Pose, Aabb)]) -> (Fitted, u32) {
        if let [(at, _)] = order {
            let (name, pose, aabb) = &boxes[*at as usize];
            let axes = *pose.rotation.to_rotation_matrix().matrix();
            return (around(axes, corners(pose, aabb)), *name | LEAF);
        }
        let place = self.packs.len();
        self.packs.push(ObbPack::empty());
        let mut below = Vec::with_capacity(LANES);
        for part in split(order, parts_of(order.len())) {
            below.push(self.grow(part, boxes));
        }
        self.packs[place] = ObbPack::of(&below);
        let all = below.into_iter().flat_map(|(fitted, _)| fitted.corners);
        let (mut low, mut high) = (
            Point::from(Vec3::repeat(f64::INFINITY)),
            -Point::from(Vec3::repeat(f64::INFINITY)),
        );
        for corner in all {
            (low, high) = (low.inf(&corner), high.sup(&corner));
        }
        let whole = Aabb {
            min: low,
            max: high,
        };
        let fitted = around(Matrix3::identity(), corners(&Pose::identity(), &whole));
        (fitted, u32::try_from(place).unwrap_or(0))
    }
}

fn corners(pose: &Pose, aabb: &Aabb) -> Vec<Point> {
    let corner = |k: u32| {
        let side = |axis: usize| {
            if k >> axis & 1 == 0 {
                aabb.min[axis]
            } else {
                aabb.max[axis]
            }
        };
        pose * Point::new(side(0), side(1), side(2))
    };
    (0..8).map(corner).collect()
}
