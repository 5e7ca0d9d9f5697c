//! Boxes and bounding balls of cores.
//!
//! In: a core and a pose. Out: tight boxes and balls, rounded outward.

use super::{Convex, Core};
use crate::math::{Aabb, Point, Pose, Vec3};

/// Factor that takes up the roundings of a norm.
const UP: f64 = 1.0 + 4.0 * f64::EPSILON;

impl Convex {
    /// Its tight box at `pose` (that of the frame the box is wanted in), rounded outward.
    ///
    /// Cost: O(1), O(vertices) for a hull; no allocation.
    #[must_use]
    pub fn aabb_at(&self, pose: &Pose) -> Aabb {
        let rotation = pose.rotation.to_rotation_matrix();
        let (rotation, at) = (rotation.matrix(), &pose.translation.vector);
        let (mut low, mut high) = (Vec3::zeros(), Vec3::zeros());
        for k in 0..3 {
            let row = Vec3::new(rotation[(k, 0)], rotation[(k, 1)], rotation[(k, 2)]);
            (low[k], high[k]) = self.core.span(&row);
        }
        // Entries of the matrix are off by some ulps of 1, dot products by some of the reach, the sum by one of the
        // place.
        let pad = 16.0 * f64::EPSILON * self.reach_m + self.margin_m;
        // Two ulps further out for the sums; as a product, since stepping to the next float costs ten times as much.
        let ulps = |v: f64| 2.0 * f64::EPSILON * v.abs();
        Aabb {
            min: Point::from((at + low).map(|v| (v - pad) - ulps(v))),
            max: Point::from((at + high).map(|v| (v + pad) + ulps(v))),
        }
    }
}

impl Core {
    /// Least and greatest dot product of its points with `dir` (unit), as computed.
    fn span(&self, dir: &Vec3) -> (f64, f64) {
        match self {
            Self::Point => (0.0, 0.0),
            Self::Segment { half_m } => {
                let half = dir.z.abs() * half_m;
                (-half, half)
            }
            Self::Cuboid { half } => {
                let half = dir.x.abs() * half.x + dir.y.abs() * half.y + dir.z.abs() * half.z;
                (-half, half)
            }
            Self::Cylinder { radius_m, half_m } => {
                let half = across(dir) * radius_m + dir.z.abs() * half_m;
                (-half, half)
            }
            Self::Cone { radius_m, half_m } => {
                let (across, apex) = (across(dir) * radius_m, dir.z * half_m);
                (apex.min(-apex - across), apex.max(-apex + across))
            }
            Self::Hull(hull) => span_of(hull.points(), dir),
            Self::Triangle(corners) => span_of(corners, dir),
        }
    }
}

/// Length of the part of a unit vector that is across z; nothing in it overflows, so `hypot` would only be slow.
fn across(dir: &Vec3) -> f64 {
    (dir.x * dir.x + dir.y * dir.y).sqrt()
}

fn span_of(points: &[Vec3], dir: &Vec3) -> (f64, f64) {
    points
        .iter()
        .map(|p| p.dot(dir))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        })
}

/// Greatest distance of a point of the core from the local origin, rounded up.
pub(super) fn reach(core: &Core) -> f64 {
    let reach = match core {
        Core::Point => 0.0,
        Core::Segment { half_m } => half_m.abs(),
        Core::Cuboid { half } => half.norm(),
        Core::Cylinder { radius_m, half_m } | Core::Cone { radius_m, half_m } => {
            radius_m.hypot(*half_m)
        }
        Core::Hull(hull) => farthest(hull.points(), &Vec3::zeros()),
        Core::Triangle(corners) => farthest(corners, &Vec3::zeros()),
    };
    reach * UP
}

/// A small ball around the core: centre and radius, rounded up.
pub(super) fn ball(core: &Core) -> (Point, f64) {
    match core {
        Core::Cone { radius_m, half_m } => {
            // The ball through apex and rim, or around the base where that is wider.
            let z_m = if *half_m > 0.0 {
                (-radius_m * radius_m / (4.0 * half_m)).max(-half_m)
            } else {
                0.0
            };
            let radius_m = (half_m - z_m).max(radius_m.hypot(half_m + z_m));
            (Point::new(0.0, 0.0, z_m), radius_m * UP)
        }
        Core::Hull(hull) => ball_of(hull.points()),
        Core::Triangle(corners) => ball_of(corners),
        _ => (Point::origin(), reach(core)),
    }
}

/// Starts at the middle of the box and walks towards the farthest point in shrinking steps: within a few per cent of
/// the least ball, which is all that a bound needs. Source: Badoiu and Clarkson 2003, Smaller core-sets for balls.
fn ball_of(points: &[Vec3]) -> (Point, f64) {
    let (mut low, mut high) = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
    for p in points {
        low = low.inf(p);
        high = high.sup(p);
    }
    let mut centre = low + (high - low) / 2.0;
    let mut best = (centre, farthest(points, &centre));
    for step in 1..32_u32 {
        let Some(far) = points.iter().max_by(|a, b| {
            (*a - centre)
                .norm_squared()
                .total_cmp(&(*b - centre).norm_squared())
        }) else {
            break;
        };
        centre += (far - centre) / f64::from(step + 4);
        let radius = farthest(points, &centre);
        if radius < best.1 {
            best = (centre, radius);
        }
    }
    (Point::from(best.0), best.1 * UP)
}

fn farthest(points: &[Vec3], from: &Vec3) -> f64 {
    points.iter().map(|p| (p - from).norm()).fold(0.0, f64::max)
}
