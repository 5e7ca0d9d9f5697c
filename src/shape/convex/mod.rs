//! Convex geometry: a core (point, segment, cuboid, cylinder, cone, hull, triangle) and a ball rolled around it.
//!
//! In: sizes in metres, own frame, axis along local z. Out: supports, boxes, bounding balls. The signed distance of two
//! rounded shapes is that of their cores minus both margins, outside and inside alike, so for every query a sphere is a
//! point and a capsule a segment.

mod bounds;
mod faces;
mod facets;
mod flat;
mod hull;

use std::sync::Arc;

use crate::math::{Point, Vec3, across_z};
use crate::shape::ShapeError;
use crate::shape::check::extent;

pub(crate) use faces::RING_MAX;
pub(crate) use hull::Hull;

/// A convex solid, or a triangle.
#[derive(Clone, Debug)]
pub struct Convex {
    core: Core,
    /// Radius of the ball rolled around the core, metres.
    margin_m: f64,
    /// Greatest distance of a point of the core from the local origin, metres, rounded up.
    reach_m: f64,
    /// Centre of the bounding ball, own frame.
    centre: Point,
    /// Radius of the bounding ball with the margin, metres, rounded up.
    radius_m: f64,
}

/// The shape that the ball is rolled around.
#[derive(Clone, Debug)]
pub(crate) enum Core {
    /// The local origin.
    Point,
    /// From `-half_m` to `half_m` along z.
    Segment {
        /// Metres, >= 0.
        half_m: f64,
    },
    /// Centred box.
    Cuboid {
        /// Half of each side, metres.
        half: Vec3,
    },
    /// Centred, along z.
    Cylinder {
        /// Metres.
        radius_m: f64,
        /// Metres.
        half_m: f64,
    },
    /// Along z, apex at `+half_m`, base at `-half_m`.
    Cone {
        /// Of the base, metres.
        radius_m: f64,
        /// Metres.
        half_m: f64,
    },
    /// Hull of points.
    Hull(Arc<Hull>),
    /// A triangle, possibly degenerate.
    Triangle([Vec3; 3]),
}

/// Marks a support element that is a circle rather than a vertex.
pub(crate) const CIRCLE: u32 = 1 << 31;

/// A full circle on the surface of a core: one of the elements whose hull the core is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Circle {
    /// Height of its plane along local z, metres.
    pub(crate) z_m: f64,
    /// Metres.
    pub(crate) radius_m: f64,
}

impl Convex {
    fn build(core: Core, margin_m: f64) -> Self {
        let (centre, core_radius_m) = bounds::ball(&core);
        let reach_m = bounds::reach(&core);
        Self {
            radius_m: (core_radius_m + margin_m) * (1.0 + 4.0 * f64::EPSILON),
            core,
            margin_m,
            reach_m,
            centre,
        }
    }

    /// A ball. Sizes are not checked here; see [`Convex::checked`].
    #[must_use]
    pub fn sphere(radius_m: f64) -> Self {
        Self::build(Core::Point, radius_m)
    }

    /// A box with half sides `half`, metres.
    #[must_use]
    pub fn cuboid(half: Vec3) -> Self {
        Self::build(Core::Cuboid { half }, 0.0)
    }

    /// A segment of half length `half_height_m` along z with a ball of `radius_m` rolled around it.
    #[must_use]
    pub fn capsule(radius_m: f64, half_height_m: f64) -> Self {
        Self::build(
            Core::Segment {
                half_m: half_height_m,
            },
            radius_m,
        )
    }

    /// A cylinder along z.
    #[must_use]
    pub fn cylinder(radius_m: f64, half_height_m: f64) -> Self {
        Self::build(
            Core::Cylinder {
                radius_m,
                half_m: half_height_m,
            },
            0.0,
        )
    }

    /// A cone along z: apex at `+half_height_m`, base at `-half_height_m`.
    #[must_use]
    pub fn cone(radius_m: f64, half_height_m: f64) -> Self {
        Self::build(
            Core::Cone {
                radius_m,
                half_m: half_height_m,
            },
            0.0,
        )
    }

    /// The solid hull of points, which must span a volume.
    ///
    /// Every corner is kept as given, and only points proved not to be corners are left out, so the hull is exactly the
    /// hull of the points also if it is very thin.
    ///
    /// Cost: usually O(n log n).
    ///
    /// # Errors
    /// `NotFinite`, `TooFewPoints`, `FlatHull`, `TooManyHullVertices`, `Extent`.
    pub fn hull(points: &[Point]) -> Result<Self, ShapeError> {
        Ok(Self::build(
            Core::Hull(Arc::new(Hull::build_solid(points)?)),
            0.0,
        ))
    }

    /// The hull of points, which may be flat, duplicated or a single one: as in offline queries.
    ///
    /// # Errors
    /// `NotFinite`, `TooFewPoints` (none at all), `TooManyHullVertices`, `Extent`.
    pub fn hull_of_any(points: &[Point]) -> Result<Self, ShapeError> {
        Ok(Self::build(Core::Hull(Arc::new(Hull::build(points)?)), 0.0))
    }

    /// A triangle, a surface; it may be degenerate.
    #[must_use]
    pub fn triangle(corners: [Point; 3]) -> Self {
        Self::build(Core::Triangle(corners.map(|p| p.coords)), 0.0)
    }

    /// This shape, if all its sizes are usable.
    ///
    /// # Errors
    /// `NotFinite` or `Extent`, which names the size.
    pub fn checked(self) -> Result<Self, ShapeError> {
        if !matches!(self.core, Core::Triangle(_)) && self.margin_m != 0.0 {
            extent("radius", self.margin_m)?;
        }
        match &self.core {
            Core::Point => extent("radius", self.margin_m)?,
            Core::Segment { half_m } => {
                extent("radius", self.margin_m)?;
                if *half_m != 0.0 {
                    extent("half_height", *half_m)?;
                }
            }
            Core::Cuboid { half } => {
                for k in 0..3 {
                    extent(&format!("half_extents[{k}]"), half[k])?;
                }
            }
            Core::Cylinder { radius_m, half_m } | Core::Cone { radius_m, half_m } => {
                extent("radius", *radius_m)?;
                extent("half_height", *half_m)?;
            }
            Core::Hull(_) => {}
            Core::Triangle(corners) => {
                for (k, corner) in corners.iter().enumerate() {
                    hull::check_point(k, corner)?;
                }
            }
        }
        Ok(self)
    }

    /// The point farthest along `dir` (any length; own frame). Ties are broken by index, always the same way.
    #[must_use]
    pub fn support(&self, dir: &Vec3) -> Point {
        let core = self.core.support(dir).0;
        if self.margin_m == 0.0 {
            return Point::from(core);
        }
        let length = dir.norm();
        let along = if length > 0.0 {
            dir / length
        } else {
            Vec3::zeros()
        };
        Point::from(core + along * self.margin_m)
    }

    /// Centre of its bounding ball, own frame.
    #[must_use]
    pub fn centre(&self) -> Point {
        self.centre
    }

    /// Greatest distance of any of its points from [`Convex::centre`], metres, rounded up.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius_m
    }

    /// The stored corners of a hull, own frame; empty for every other core.
    #[must_use]
    pub fn vertices(&self) -> &[Vec3] {
        match &self.core {
            Core::Hull(hull) => hull.points(),
            Core::Triangle(corners) => corners,
            _ => &[],
        }
    }

    /// Whether it is more than a triangle.
    pub(crate) fn is_solid(&self) -> bool {
        !matches!(self.core, Core::Triangle(_))
    }

    /// Radius of the ball rolled around the core, metres.
    #[must_use]
    pub fn margin(&self) -> f64 {
        self.margin_m
    }

    pub(crate) fn core(&self) -> &Core {
        &self.core
    }

    pub(crate) fn reach(&self) -> f64 {
        self.reach_m
    }
}

impl Core {
    /// Farthest point of the core along `dir` and the element (vertex, or circle with [`CIRCLE`] set) it lies on.
    #[inline]
    pub(crate) fn support(&self, dir: &Vec3) -> (Vec3, u32) {
        match self {
            Self::Point => (Vec3::zeros(), 0),
            Self::Segment { half_m } => {
                let up = dir.z >= 0.0;
                let z = if up { *half_m } else { -half_m };
                (Vec3::new(0.0, 0.0, z), u32::from(up))
            }
            Self::Cuboid { half } => {
                let (x, y, z) = (dir.x >= 0.0, dir.y >= 0.0, dir.z >= 0.0);
                let side = |up: bool, half: f64| if up { half } else { -half };
                (
                    Vec3::new(side(x, half.x), side(y, half.y), side(z, half.z)),
                    u32::from(x) | u32::from(y) << 1 | u32::from(z) << 2,
                )
            }
            Self::Cylinder { radius_m, half_m } => {
                let bottom = dir.z < 0.0;
                let z = if bottom { -half_m } else { *half_m };
                (rim(dir, *radius_m, z), CIRCLE | u32::from(bottom))
            }
            Self::Cone { radius_m, half_m } => {
                let across = across_z(dir);
                if dir.z * half_m >= across * radius_m - dir.z * half_m {
                    (Vec3::new(0.0, 0.0, *half_m), 0)
                } else {
                    (rim(dir, *radius_m, -half_m), CIRCLE | 1)
                }
            }
            Self::Hull(hull) => hull.support(dir),
            Self::Triangle(corners) => {
                let along = corners.map(|p| p.dot(dir));
                let mut best = 0;
                if along[1] > along[best] {
                    best = 1;
                }
                if along[2] > along[best] {
                    best = 2;
                }
                (corners[best], [0, 1, 2][best])
            }
        }
    }

    /// The circle behind a support element; `None` for a vertex.
    pub(crate) fn circle(&self, element: u32) -> Option<Circle> {
        if element & CIRCLE == 0 {
            return None;
        }
        match self {
            Self::Cylinder { radius_m, half_m } => Some(Circle {
                z_m: if element == CIRCLE { *half_m } else { -half_m },
                radius_m: *radius_m,
            }),
            Self::Cone { radius_m, half_m } => Some(Circle {
                z_m: -half_m,
                radius_m: *radius_m,
            }),
            _ => None,
        }
    }

    /// The point of a vertex element.
    pub(crate) fn vertex(&self, element: u32) -> Option<Vec3> {
        let side = |up: bool, half: f64| if up { half } else { -half };
        match self {
            Self::Point => Some(Vec3::zeros()),
            Self::Segment { half_m } => Some(Vec3::new(0.0, 0.0, side(element == 1, *half_m))),
            Self::Cuboid { half } => Some(Vec3::new(
                side(element & 1 != 0, half.x),
                side(element & 2 != 0, half.y),
                side(element & 4 != 0, half.z),
            )),
            Self::Cylinder { .. } => None,
            Self::Cone { half_m, .. } => Some(Vec3::new(0.0, 0.0, *half_m)),
            Self::Hull(hull) => hull.points().get(element as usize).copied(),
            Self::Triangle(corners) => corners.get(element as usize).copied(),
        }
    }

    /// The point of an element: the vertex, or the farthest one of the circle along `dir`.
    pub(crate) fn element(&self, element: u32, dir: &Vec3) -> Option<Vec3> {
        match self.circle(element) {
            Some(circle) => Some(rim(dir, circle.radius_m, circle.z_m)),
            None => self.vertex(element),
        }
    }

    /// Whether it is the hull of finitely many points.
    pub(crate) fn is_polytope(&self) -> bool {
        !matches!(self, Self::Cylinder { .. } | Self::Cone { .. })
    }
}

/// The point of the circle of `radius_m` at height `z_m` that is farthest along `dir`.
#[inline]
fn rim(dir: &Vec3, radius_m: f64, z_m: f64) -> Vec3 {
    let across = across_z(dir);
    if across > 0.0 {
        let scale = radius_m / across;
        Vec3::new(dir.x * scale, dir.y * scale, z_m)
    } else {
        Vec3::new(radius_m, 0.0, z_m)
    }
}
