//! The feature of a core along a direction: a polygon, a segment or a point, for clipping.
//!
//! In: a core and the contact normal. Out: corners in A's frame with ids, and the plane they lie in.

use super::pair::Pair;
use crate::math::{Pose, Vec3, across_z};
use crate::shape::{Core, RING_MAX};

/// Most corners of one feature; hull faces with more keep those that span most of them (a manifold keeps four points
/// anyway).
pub(super) const CORNERS_MAX: usize = RING_MAX;

/// See [`Feature::spread`].
pub(super) const RIM: f64 = 1e-9;

/// A polygon (three corners and more), a segment or a point.
pub(super) struct Feature {
    corners: [Vec3; CORNERS_MAX],
    ids: [u32; CORNERS_MAX],
    pub(super) count: usize,
    /// Unit normal of its plane, outward; zero for a segment or a point.
    pub(super) normal: Vec3,
}

impl Feature {
    #[inline]
    fn empty() -> Self {
        Self {
            corners: [Vec3::zeros(); CORNERS_MAX],
            ids: [0; CORNERS_MAX],
            count: 0,
            normal: Vec3::zeros(),
        }
    }

    /// The feature of a core along a direction, its own frame.
    #[inline]
    pub(super) fn towards(core: &Core, dir: &Vec3) -> Self {
        let mut feature = Self::empty();
        feature.fill(core, dir);
        feature
    }

    /// The same for a core at a pose, in the outer frame.
    pub(super) fn seen(core: &Core, pose: &Pose, dir: &Vec3) -> Self {
        let mut feature = Self::towards(core, &pose.inverse_transform_vector(dir));
        for corner in &mut feature.corners[..feature.count] {
            *corner = pose.rotation * *corner + pose.translation.vector;
        }
        feature.normal = pose.rotation * feature.normal;
        feature
    }

    /// The feature of A towards B.
    #[inline]
    pub(super) fn of_a(pair: &Pair<'_>, normal: &Vec3) -> Self {
        Self::towards(pair.a.core(), normal)
    }

    /// The feature of B towards A, in A's frame.
    #[inline]
    pub(super) fn of_b(pair: &Pair<'_>, normal: &Vec3) -> Self {
        let mut feature = Self::towards(pair.b.core(), &-pair.to_b(normal));
        for corner in &mut feature.corners[..feature.count] {
            *corner = pair.rotation * *corner + pair.at;
        }
        feature.normal = pair.rotation * feature.normal;
        feature
    }

    pub(super) fn used(&self) -> &[Vec3] {
        &self.corners[..self.count]
    }

    pub(super) fn id(&self, place: usize) -> u32 {
        self.ids[place]
    }

    /// Cosine between its plane's normal and the contact normal's line; 0 for a segment or a point.
    pub(super) fn facing(&self, normal: &Vec3) -> f64 {
        self.normal.dot(normal).abs()
    }

    /// The same feature, enlarged by what rounding may take away at its rim: a corner over the common edge of two
    /// neighbours is over both.
    pub(super) fn spread(&self) -> Self {
        let middle = self.used().iter().sum::<Vec3>() / self.count.max(1) as f64;
        let corners = self.corners.map(|p| p + (p - middle) * RIM);
        Self { corners, ..*self }
    }

    fn push(&mut self, corner: Vec3, id: u32) {
        if self.count < CORNERS_MAX {
            self.corners[self.count] = corner;
            self.ids[self.count] = id;
            self.count += 1;
        }
    }

    /// Returns false, and adds nothing, for a triangle without an area.
    fn fill_triangle(&mut self, corners: &[Vec3; 3]) -> bool {
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        let length = normal.norm();
        if length <= 0.0 {
            return false;
        }
        for (place, corner) in (0_u32..).zip(corners) {
            self.push(*corner, place);
        }
        self.normal = normal / length;
        true
    }

    fn fill(&mut self, core: &Core, dir: &Vec3) {
        match core {
            Core::Point => self.push(Vec3::zeros(), 0),
            Core::Segment { half_m } => {
                if dir.z.abs() > 0.9 {
                    self.push_support(core, dir);
                } else {
                    self.push(Vec3::new(0.0, 0.0, -half_m), 0);
                    self.push(Vec3::new(0.0, 0.0, *half_m), 1);
                }
            }
            Core::Cuboid { half } => self.cuboid_face(half, dir),
            Core::Cylinder { radius_m, half_m } => {
                if dir.z.abs() > 0.7 {
                    let up = 1.0_f64.copysign(dir.z);
                    self.cap(*radius_m, half_m * up, dir, up);
                } else {
                    let (rim, _) = core.support(&Vec3::new(dir.x, dir.y, 0.0));
                    self.push(Vec3::new(rim.x, rim.y, -half_m), 0);
                    self.push(Vec3::new(rim.x, rim.y, *half_m), 1);
                }
            }
            Core::Cone { radius_m, half_m } => {
                let length = radius_m.hypot(2.0 * half_m);
                let off = across_z(dir);
                let slant = (2.0 * half_m * off + radius_m * dir.z) / length;
                if -dir.z > slant {
                    self.cap(*radius_m, -half_m, dir, -1.0);
                } else if dir.z > 0.99 {
                    self.push(Vec3::new(0.0, 0.0, *half_m), 0);
                } else {
                    let (rim, _) = core.support(&Vec3::new(dir.x, dir.y, -1.0));
                    self.push(rim, 1);
                    self.push(Vec3::new(0.0, 0.0, *half_m), 0);
                }
            }
            Core::Hull(hull) => {
                let faces = hull.faces().iter();
                let best = faces.max_by(|x, y| x.normal.dot(dir).total_cmp(&y.normal.dot(dir)));
                match best {
                    Some(face) => {
                        for &place in hull.ring(face) {
                            if let Some(corner) = hull.points().get(place as usize) {
                                self.push(*corner, place);
                            }
                        }
                        self.normal = face.normal;
                    }
                    None => self.push_support(core, dir),
                }
            }
            Core::Triangle(corners) => {
                if !self.fill_triangle(corners) {
                    self.push_support(core, dir);
                }
            }
        }
    }

    fn push_support(&mut self, core: &Core, dir: &Vec3) {
        let (corner, id) = core.support(dir);
        self.push(corner, id & 0x7fff);
    }

    /// The face of a box whose normal is closest to `dir`.
    fn cuboid_face(&mut self, half: &Vec3, dir: &Vec3) {
        let k = dir.iamax();
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let up = 1.0_f64.copysign(dir[k]);
        #[allow(clippy::cast_possible_truncation, reason = "0, 1 or 2")]
        let face = (k as u32) << 1 | u32::from(up > 0.0);
        for (corner, (x, y)) in (0_u32..).zip([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
        {
            let mut at = Vec3::zeros();
            at[k] = half[k] * up;
            at[i] = half[i] * x;
            at[j] = half[j] * y;
            self.push(at, face << 2 | corner);
        }
        self.normal[k] = up;
    }

    /// The regular octagon in a circle, one corner at the circle's deepest point.
    fn cap(&mut self, radius_m: f64, z_m: f64, dir: &Vec3, up: f64) {
        let off = across_z(dir);
        // Lying flat, there is no deepest point; a fixed start keeps the ids constant.
        let (x, y) = if off > 1e-3 {
            (radius_m * dir.x / off, radius_m * dir.y / off)
        } else {
            (radius_m, 0.0)
        };
        let first = u32::from(up > 0.0) << 4;
        // Eighths of a turn from there.
        let h = std::f64::consts::FRAC_1_SQRT_2;
        let turns = [
            (1., 0.),
            (h, h),
            (0., 1.),
            (-h, h),
            (-1., 0.),
            (-h, -h),
            (0., -1.),
            (h, -h),
        ];
        for ((cos, sin), id) in turns.into_iter().zip(first..) {
            self.push(Vec3::new(x * cos - y * sin, x * sin + y * cos, z_m), id);
        }
        self.normal = Vec3::z() * up;
    }
}
