//! Boxes and bounding balls of cores.
//!
//! In: a core and a pose. Out: tight boxes and balls, rounded outward.

use super::{Convex, Core};
use crate::math::{Aabb, Point, Pose, Vec3, across_z, greater, lesser};

/// Factor that covers the rounding of a norm.
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
        // position.
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
                let half = across_z(dir) * radius_m + dir.z.abs() * half_m;
                (-half, half)
            }
            Self::Cone { radius_m, half_m } => {
                let (across, apex) = (across_z(dir) * radius_m, dir.z * half_m);
                (apex.min(-apex - across), apex.max(-apex + across))
            }
            Self::Hull(hull) => span_of(hull.points(), dir),
            Self::Triangle(corners) => span_of(corners, dir),
        }
    }
}

fn span_of(points: &[Vec3], dir: &Vec3) -> (f64, f64) {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for p in points {
        let v = p.dot(dir);
        (low, high) = (lesser(v, low), greater(v, high));
    }
    (low, high)
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
            // The ball through apex and rim, or around the base if that is wider.
            let z_m = if *half_m > 0.0 {
                (-radius_m * radius_m / (4.0 * half_m)).max(-half_m)
            } else {
                0.0
            };
            let radius_m = (half_m - z_m).max(radius_m.hypot(half_m + z_m));
            (Point::new(0.0, 0.0, z_m), radius_m * UP)
        }
        Core::Hull(hull) => ball_of(hull.points()),
        Core::Triangle(corners) => ball_of_triangle(corners),
        _ => (Point::origin(), reach(core)),
    }
}

/// Starts at the middle of the box and moves towards the farthest point in shrinking steps: within a few per cent of
/// the least ball, which is enough for a bound. Source: Badoiu and Clarkson 2003, Smaller core-sets for balls.
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

/// The least ball around three points: about the longest side, or through all three if they are acute.
fn ball_of_triangle(corners: &[Vec3; 3]) -> (Point, f64) {
    let [a, b, c] = corners;
    let (u, v) = (b - a, c - a);
    let (ab, ac, bc) = (u.norm_squared(), v.norm_squared(), (c - b).norm_squared());
    let centre = if ab >= ac + bc {
        a + u / 2.0
    } else if ac >= ab + bc {
        a + v / 2.0
    } else if bc >= ab + ac {
        b + (c - b) / 2.0
    } else {
        let across = u.cross(&v);
        a + (across.cross(&u) * ac + v.cross(&across) * ab) / (2.0 * across.norm_squared())
    };
    // NaN if the squares of the sides underflow.
    let centre = if centre.iter().all(|x| x.is_finite()) {
        centre
    } else {
        a + (u + v) / 3.0
    };
    // However the centre was rounded, the ball contains them.
    (Point::from(centre), farthest(corners, &centre) * UP)
}

/// The greatest distance; a NaN makes it infinite.
fn farthest(points: &[Vec3], from: &Vec3) -> f64 {
    points.iter().fold(0.0, |most, p| {
        let distance = (p - from).norm();
        if distance.is_nan() {
            return f64::INFINITY;
        }
        greater(most, distance)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_bounds_of_tiny_triangles_are_numbers() {
        for side in [1e-30, 1e-82, 1e-170, 1e-300] {
            let corners = [
                Vec3::zeros(),
                Vec3::new(side, 0.0, 0.0),
                Vec3::new(0.5 * side, 0.87 * side, 0.0),
            ];
            let (centre, radius) = ball_of_triangle(&corners);
            assert!(centre.iter().all(|x| x.is_finite()), "{side:e}: {centre}");
            assert!(radius < 2.0 * side, "{side:e}: {radius:e}");
        }
        let none = Vec3::repeat(f64::NAN);
        let bound = farthest(&[Vec3::x(), none, Vec3::y()], &Vec3::zeros());
        assert!(bound.is_infinite());
    }

    /// The least ball of a triangle, by trial: about each pair, and through all three.
    #[test]
    fn the_ball_of_a_triangle_holds_it_and_is_the_least() {
        let mut random = crate::builtin::Random::new(3);
        let mut point = || Vec3::from_fn(|_, _| random.unit() * 2.0 - 1.0);
        for round in 0..500 {
            let mut corners = [point(), point(), point()];
            if round % 5 == 0 {
                // In one line, or two in one place.
                corners[2] = corners[0] + (corners[1] - corners[0]) * f64::from(round % 3);
            }
            let (centre, radius) = ball_of_triangle(&corners);
            let all = |c: Vec3| farthest(&corners, &c);
            assert!(all(centre.coords) <= radius, "{corners:?}");
            for _ in 0..20 {
                assert!(all(centre.coords + point() * 0.01) >= radius * (1.0 - 1e-9));
            }
        }
    }
}
