//! Two cores in one frame: the Minkowski difference B - A that every method here works on.
//!
//! In: two shapes and the pose of B seen from A. Out: supports of the difference, and the rounding to allow for.

use nalgebra::Matrix3;

use crate::math::{Pose, Vec3, f32_down};
use crate::shape::Convex;

/// A point of the Minkowski difference with the points it comes from, A's frame; or one that represents its
/// surroundings, and comes from no points.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Vertex {
    /// `b - a`.
    pub(super) w: Vec3,
    /// On the core of A.
    pub(super) a: Vec3,
    /// On the core of B.
    pub(super) b: Vec3,
    /// Element of A it lies on, see `Core::support`; [`NO_ELEMENT`]: on no single one.
    pub(super) of_a: u32,
    /// Element of B it lies on.
    pub(super) of_b: u32,
}

/// The element of a point that lies on no single one. Not valid as a query of a core, which returns some element for
/// any number.
pub(super) const NO_ELEMENT: u32 = u32::MAX >> 1;

impl Vertex {
    /// Whether it is a point of one element of each core.
    pub(super) fn lies_on_elements(&self) -> bool {
        self.of_a != NO_ELEMENT && self.of_b != NO_ELEMENT
    }
}

/// The elements behind an answer: enough to begin from there the next time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Held {
    /// Element of A, element of B.
    pub(super) of: [(u32, u32); 3],
    pub(super) weights: [f32; 3],
    pub(super) count: u8,
    /// A polytope ended at them: the cores overlapped.
    pub(super) deep: bool,
}

impl Held {
    /// The first three of the vertices.
    pub(super) fn of(vertices: &[Vertex], weights: &[f64]) -> Self {
        let mut held = Self::default();
        for (vertex, weight) in vertices.iter().zip(weights) {
            held.push(vertex.of_a, vertex.of_b, *weight);
        }
        held
    }

    pub(super) fn push(&mut self, of_a: u32, of_b: u32, weight: f64) {
        let place = usize::from(self.count);
        if place < self.of.len() {
            self.of[place] = (of_a, of_b);
            self.weights[place] = f32_down(weight);
            self.count += 1;
        }
    }
}

/// The result of a method for two cores.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoreGap {
    /// `f(normal)` as computed: the gap is not below it, up to [`Pair::pad`].
    pub(super) lower: f64,
    /// The gap is not above it, up to [`Pair::pad`].
    pub(super) upper: f64,
    /// Unit, A to B.
    pub(super) normal: Vec3,
    /// On the core of A.
    pub(super) point_a: Vec3,
    /// On the core of B; `point_b - point_a` is the gap times the normal.
    pub(super) point_b: Vec3,
    /// The start of the next query.
    pub(super) held: Held,
}

/// Width at which curved cores stop, as a share of the size; polytopes stop at roundoff.
const CURVED: f64 = 5e-8;
/// Width from which more work is worthwhile, as a share of the size.
const LOOSE: f64 = 5e-7;
/// Closest points displaced from the normal by more than this are searched again, as a share of the size.
const STRAIGHT: f64 = 1e-7;

impl CoreGap {
    /// Whether both ends are as close as curved cores require.
    pub(super) fn is_tight(&self, pair: &Pair<'_>) -> bool {
        self.upper - self.lower <= pair.share(LOOSE)
    }

    /// Distance of the closest points along the normal, metres.
    pub(super) fn along(&self) -> f64 {
        self.normal.dot(&(self.point_b - self.point_a))
    }

    /// Displacement of the closest points from being opposite along the normal, metres.
    pub(super) fn off(&self) -> f64 {
        (self.point_b - self.point_a - self.normal * self.lower).norm()
    }

    /// Combines two answers for cores that overlap: normal and points of the other if its normal is better.
    pub(super) fn meet(&self, other: &Self, pair: &Pair<'_>) -> Self {
        let better = if other.lower > self.lower + pair.tiny() {
            other
        } else {
            self
        };
        Self {
            upper: self.upper.min(other.upper).max(better.lower),
            ..*better
        }
    }

    pub(super) fn is_straight(&self, pair: &Pair<'_>) -> bool {
        self.off() <= pair.share(STRAIGHT)
    }
}

/// Two cores in A's frame.
#[derive(Debug)]
pub(super) struct Pair<'a> {
    pub(super) a: &'a Convex,
    pub(super) b: &'a Convex,
    /// From B's frame to A's.
    pub(super) rotation: Matrix3<f64>,
    /// Origin of B, A's frame.
    pub(super) at: Vec3,
    /// Greatest distance from A's origin of the coordinates of both, metres: rounding is a multiple of it.
    pub(super) scale: f64,
    /// Whether both cores are hulls of finitely many points.
    pub(super) polytopes: bool,
}

impl<'a> Pair<'a> {
    pub(super) fn new(a: &'a Convex, b: &'a Convex, pos12: &Pose) -> Self {
        let rotation = *pos12.rotation.to_rotation_matrix().matrix();
        let at = pos12.translation.vector;
        // A NaN anywhere in the pose ends up here.
        let turned = rotation.sum() * 0.0;
        Self {
            a,
            b,
            rotation,
            at,
            scale: a.reach() + b.reach() + at.norm() + turned,
            polytopes: a.core().is_polytope() && b.core().is_polytope(),
        }
    }

    /// Bound on every rounding between the true shapes at the true pose and a support value or point as computed.
    ///
    /// A relative pose from two normalised quaternions is off by some 8 ulps of 1 in each entry of its matrix, a dot
    /// product by 3 of the reach, the sums by a few more: 64 units of roundoff in all, measured below 8.
    #[inline]
    pub(super) fn pad(&self) -> f64 {
        32.0 * f64::EPSILON * self.scale
    }

    /// Anything smaller than this cannot be distinguished from 0.
    #[inline]
    pub(super) fn tiny(&self) -> f64 {
        4.0 * f64::EPSILON * self.scale
    }

    /// Radii of both cores and the distance of their middles, metres: the accuracy of methods that stop early is a
    /// share of it. Not of the scale: a hull may have coordinates far from its origin without being larger.
    pub(super) fn size(&self) -> f64 {
        let radius = |shape: &Convex| shape.radius() - shape.margin();
        radius(self.a) + radius(self.b) + self.between().norm()
    }

    /// A share of the size, but at least the rounding, metres.
    pub(super) fn share(&self, part: f64) -> f64 {
        (part * self.size()).max(self.pad())
    }

    /// Required distance of both ends of a depth, metres.
    pub(super) fn tolerance(&self) -> f64 {
        if self.polytopes {
            self.tiny()
        } else {
            self.share(CURVED)
        }
    }

    #[inline]
    pub(super) fn to_b(&self, dir: &Vec3) -> Vec3 {
        self.rotation.tr_mul(dir)
    }

    /// The point of the difference that is least along `n`: `f(n) = n . w`.
    #[inline]
    pub(super) fn support(&self, n: &Vec3) -> Vertex {
        let (a, of_a) = self.a.core().support(n);
        let (b, of_b) = self.b.core().support(&-self.to_b(n));
        let b = self.rotation * b + self.at;
        Vertex {
            w: b - a,
            a,
            b,
            of_a,
            of_b,
        }
    }

    /// The vertices of an earlier answer, at the present pose; circles are queried along its `normal`.
    pub(super) fn recall(&self, held: &Held, normal: &Vec3) -> impl Iterator<Item = Vertex> {
        let in_b = -self.to_b(normal);
        held.of
            .into_iter()
            .take(usize::from(held.count))
            .filter_map(move |(of_a, of_b)| {
                let a = self.a.core().element(of_a, normal)?;
                let b = self.rotation * self.b.core().element(of_b, &in_b)? + self.at;
                Some(Vertex {
                    w: b - a,
                    a,
                    b,
                    of_a,
                    of_b,
                })
            })
    }

    /// A first direction: from centre to centre.
    pub(super) fn guess(&self) -> Vec3 {
        unit(&self.between()).unwrap_or_else(Vec3::z)
    }

    /// From A's centre to B's.
    fn between(&self) -> Vec3 {
        self.rotation * self.b.centre().coords + self.at - self.a.centre().coords
    }
}

/// Range of squared lengths that lost nothing by underflow and are far from overflow.
const SQUARE_MIN: f64 = 1e-280;
const SQUARE_MAX: f64 = 1e280;

/// `v` at length 1; `None` for zero and non-finite vectors.
#[inline]
pub(super) fn unit(v: &Vec3) -> Option<Vec3> {
    let square = v.norm_squared();
    if (SQUARE_MIN..SQUARE_MAX).contains(&square) {
        return Some(v * (1.0 / square.sqrt()));
    }
    // Scaled first, so that 1e-170 m does not become 0 when squared.
    let largest = v.amax();
    if largest > 0.0 && largest.is_finite() {
        let v = v / largest;
        Some(v / v.norm())
    } else {
        None
    }
}

/// Two unit vectors that make a right-handed frame with unit `n`, which comes last.
///
/// Source: Duff et al. 2017, Building an orthonormal basis, revisited. It takes one division, no root and no branch.
#[inline]
pub(super) fn frame(n: &Vec3) -> (Vec3, Vec3) {
    let up = 1.0_f64.copysign(n.z);
    let part = -1.0 / (up + n.z);
    let mixed = n.x * n.y * part;
    (
        Vec3::new(1.0 + up * n.x * n.x * part, up * mixed, -up * n.x),
        Vec3::new(mixed, up + n.y * n.y * part, -n.y),
    )
}
