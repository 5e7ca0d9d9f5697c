//! Lower bounds on the gap of everything in one box and everything in another, at a fixed relative pose.
//!
//! In: nodes of two trees. Out: the greatest signed separation along 15 axes. For any unit axis the separation of
//! two boxes is a lower bound on the gap of what they hold: a distance when positive, and when negative minus a
//! translation that separates the boxes, so also whatever convex piece lies in the one from any in the other. The
//! depth of a point of A under the surface of B is at most the overlap of their extents along any axis too: going
//! that far along it leaves B's box, so the bound of two root boxes is sound for solids as well.
//!
//! Source: Gottschalk, Lin, Manocha 1996, OBBTree: a hierarchical structure for rapid interference detection; the
//! relative rotation is the same for all node pairs here, so its edge axes are made once.

use nalgebra::Matrix3;

use crate::math::{Point, Pose, ROUND, Vec3};
use crate::shape::Node;

/// One edge axis: unit direction in A's frame, and what a box of A and one of B extend along it.
#[derive(Clone, Copy, Debug)]
struct Axis {
    direction: Vec3,
    of_a: Vec3,
    of_b: Vec3,
}

/// What is the same for all boxes of a pair: the relative pose, and how much rounding stands behind each number.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pos12: Pose,
    /// Rotation of B's frame seen from A.
    rotation: Matrix3<f64>,
    rotation_abs: Matrix3<f64>,
    translation: Vec3,
    /// From the origin of A's tree to that of B's, A's frame.
    between: Vec3,
    edges: [Axis; 9],
    edge_count: usize,
    /// Bound on the rounding of any distance computed between the two, metres.
    pub(super) slop: f64,
}

impl Default for Frame {
    fn default() -> Self {
        Self {
            pos12: Pose::identity(),
            rotation: Matrix3::identity(),
            rotation_abs: Matrix3::identity(),
            translation: Vec3::zeros(),
            between: Vec3::zeros(),
            edges: [Axis {
                direction: Vec3::zeros(),
                of_a: Vec3::zeros(),
                of_b: Vec3::zeros(),
            }; 9],
            edge_count: 0,
            slop: 0.0,
        }
    }
}

impl Frame {
    /// * `origin_a`, `origin_b` - origins of the trees, each in its own frame.
    /// * `reach_a`, `reach_b` - greatest distance of a vertex from the local origin, metres.
    pub(super) fn new(
        pos12: &Pose,
        (origin_a, reach_a): (Point, f64),
        (origin_b, reach_b): (Point, f64),
    ) -> Self {
        let rotation = *pos12.rotation.to_rotation_matrix().matrix();
        let translation = pos12.translation.vector;
        let mut frame = Self {
            pos12: *pos12,
            rotation,
            rotation_abs: rotation.abs(),
            translation,
            between: rotation * origin_b.coords + translation - origin_a.coords,
            edge_count: 0,
            slop: 32.0 * ROUND * (translation.norm() + reach_a + reach_b),
            ..Self::default()
        };
        for i in 0..3 {
            for j in 0..3 {
                let cross = Vec3::ith(i, 1.0).cross(&rotation.column(j).into_owned());
                let length = cross.norm();
                // Nearly parallel edges: the face axes see what this one would, and its direction would be noise.
                if length < 1e-3 {
                    continue;
                }
                let direction = cross / length;
                frame.edges[frame.edge_count] = Axis {
                    direction,
                    of_a: direction.abs(),
                    of_b: (rotation.transpose() * direction).abs(),
                };
                frame.edge_count += 1;
            }
        }
        frame
    }

    /// Pose of B seen from A.
    pub(super) fn pos12(&self) -> &Pose {
        &self.pos12
    }

    /// A point of B's frame in A's.
    pub(super) fn to_a(&self, point: &Point) -> Point {
        Point::from(self.rotation * point.coords + self.translation)
    }

    /// A point of A's frame in B's.
    pub(super) fn to_b(&self, point: &Point) -> Point {
        Point::from(self.rotation.transpose() * (point.coords - self.translation))
    }

    /// A direction of A's frame in B's.
    pub(super) fn turn_to_b(&self, direction: &Vec3) -> Vec3 {
        self.rotation.transpose() * direction
    }

    /// Unit axes worth a look for the two as wholes, A's frame: those of A, those of B, and the line between them.
    pub(super) fn axes(&self) -> impl Iterator<Item = Vec3> {
        let rotation = self.rotation;
        let of_a = (0..3).map(|k| Vec3::ith(k, 1.0));
        let of_b = (0..3).map(move |k| rotation.column(k).into_owned());
        let line = self.between.try_normalize(self.slop);
        of_a.chain(of_b).chain(line)
    }

    /// From the middle of A's tree to that of B's, A's frame.
    pub(super) fn between(&self) -> Vec3 {
        self.between
    }

    /// A lower bound on the gap of all in box `a` and all in box `b`, metres, rounded down; negative where they
    /// overlap: minus the least overlap along the axes tried.
    pub(super) fn low(&self, a: &Node, b: &Node) -> f64 {
        let (half_a, half_b) = (a.half(), b.half());
        let middle = self.between + self.rotation * b.centre() - a.centre();

        // Along A's axes the boxes' distance is that of two aligned boxes; the same along B's.
        let along_a = middle.abs() - half_a - self.rotation_abs * half_b;
        let along_b =
            self.rotation.tr_mul(&middle).abs() - half_b - self.rotation_abs.tr_mul(&half_a);
        let mut best = along_a.max().max(along_b.max());
        if best > 0.0 {
            let positive = |v: &Vec3| v.map(|x| x.max(0.0)).norm_squared();
            best = positive(&along_a).max(positive(&along_b)).sqrt();
        } else {
            for axis in &self.edges[..self.edge_count] {
                let apart = axis.direction.dot(&middle).abs()
                    - axis.of_a.dot(&half_a)
                    - axis.of_b.dot(&half_b);
                best = best.max(apart);
            }
        }
        best - self.slop
    }
}
