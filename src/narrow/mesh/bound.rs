//! Lower bounds on the gap of everything in one box and everything in another, at a fixed relative pose.
//!
//! In: nodes of two trees. Out: the greatest signed separation along 15 axes. For any unit axis the separation of two
//! boxes is a lower bound on the gap of their contents: if positive, a distance; if negative, minus a translation that
//! separates the boxes, and so any convex piece in one from any in the other. The depth of a point of A under the
//! surface of B is also at most the overlap of their extents along any axis: moving that far along it leaves B's box.
//! So the bound of two root boxes is sound for solids as well.
//!
//! Source: Gottschalk, Lin, Manocha 1996, OBBTree: a hierarchical structure for rapid interference detection; here the
//! relative rotation is the same for all node pairs, so the edge axes are computed once.

use nalgebra::Matrix3;

use super::placed::Placed;
use crate::math::{Point, Pose, Vec3};
use crate::shape::Node;

/// One edge axis: unit direction in A's frame, and the extents of a box of A and of one of B along it.
#[derive(Clone, Copy, Debug)]
struct Axis {
    direction: Vec3,
    of_a: Vec3,
    of_b: Vec3,
}

/// What is the same for all boxes of a pair: the relative pose, and rounding bounds.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub(super) placed: Placed,
    rotation_abs: Matrix3<f64>,
    /// From the origin of A's tree to that of B's, A's frame.
    between: Vec3,
    edges: [Axis; 9],
    edge_count: usize,
}

impl Default for Frame {
    fn default() -> Self {
        Self {
            placed: Placed::default(),
            rotation_abs: Matrix3::identity(),
            between: Vec3::zeros(),
            edges: [Axis {
                direction: Vec3::zeros(),
                of_a: Vec3::zeros(),
                of_b: Vec3::zeros(),
            }; 9],
            edge_count: 0,
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
        let placed = Placed::new(pos12, reach_a, reach_b);
        let rotation = placed.rotation;
        let mut frame = Self {
            rotation_abs: rotation.abs(),
            between: placed.to_a(&origin_b) - origin_a,
            placed,
            edge_count: 0,
            ..Self::default()
        };
        for i in 0..3 {
            for j in 0..3 {
                let cross = Vec3::ith(i, 1.0).cross(&rotation.column(j).into_owned());
                let length = cross.norm();
                // Nearly parallel edges: the face axes cover this one, and its direction would be noise.
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

    /// Unit axes worth testing for the two whole shapes, A's frame: those of A, those of B, and the line between them.
    pub(super) fn axes(&self) -> impl Iterator<Item = Vec3> {
        let rotation = self.placed.rotation;
        let of_a = (0..3).map(|k| Vec3::ith(k, 1.0));
        let of_b = (0..3).map(move |k| rotation.column(k).into_owned());
        let line = self.between.try_normalize(self.placed.slop);
        of_a.chain(of_b).chain(line)
    }

    /// From the middle of A's tree to that of B's, A's frame.
    pub(super) fn between(&self) -> Vec3 {
        self.between
    }

    /// A lower bound on the gap of the contents of box `a` and box `b`, metres, rounded down; negative if they overlap:
    /// minus the least overlap along the axes tried.
    pub(super) fn low(&self, a: &Node, b: &Node) -> f64 {
        let (half_a, half_b) = (a.half(), b.half());
        let rotation = &self.placed.rotation;
        let middle = self.between + rotation * b.centre() - a.centre();

        // Along A's axes the boxes' distance is that of two aligned boxes; the same along B's.
        let along_a = middle.abs() - half_a - self.rotation_abs * half_b;
        let along_b = rotation.tr_mul(&middle).abs() - half_b - self.rotation_abs.tr_mul(&half_a);
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
        best - self.placed.slop
    }
}
