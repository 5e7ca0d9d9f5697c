//! The outline of a solid of revolution in a plane: a convex polygon.
//!
//! In: a core, the direction of its axis in the plane. Out: corners, edge normals, supports.

use crate::shape::Core;

/// A vector in a plane through an axis, metres: along the plane, along the axis.
pub(super) type Flat = [f64; 2];

pub(super) fn dot(a: Flat, b: Flat) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Most corners of an outline.
pub(super) const CORNERS_MAX: usize = 4;

/// A convex polygon, counter-clockwise, or a segment.
#[derive(Clone, Copy)]
pub(super) struct Outline {
    corners: [Flat; CORNERS_MAX],
    count: usize,
}

impl Outline {
    /// In a plane through its axis, which lies along `[0, 1]`; `None` for a core that is not of revolution.
    pub(super) fn of(core: &Core) -> Option<Self> {
        let (corners, count) = match *core {
            Core::Segment { half_m: h } => ([[0.0, -h], [0.0, h], [0.0, 0.0], [0.0, 0.0]], 2),
            Core::Cylinder {
                radius_m: r,
                half_m: h,
            } => ([[r, -h], [r, h], [-r, h], [-r, -h]], 4),
            Core::Cone {
                radius_m: r,
                half_m: h,
            } => ([[r, -h], [0.0, h], [-r, -h], [0.0, 0.0]], 3),
            _ => return None,
        };
        Some(Self { corners, count })
    }

    /// The same with its axis along `axis`, which is shorter than 1 if it leans out of the plane.
    pub(super) fn along(&self, axis: Flat) -> Self {
        let length = axis[0].hypot(axis[1]);
        let side = [axis[1] / length, -axis[0] / length];
        let turned = |[r, z]: Flat| [r * side[0] + z * axis[0], r * side[1] + z * axis[1]];
        Self {
            corners: self.corners.map(turned),
            count: self.count,
        }
    }

    pub(super) fn corners(&self) -> &[Flat] {
        &self.corners[..self.count]
    }

    /// Outward unit normals of its edges; a segment has two.
    pub(super) fn normals(&self) -> impl Iterator<Item = Flat> {
        let corners = self.corners();
        let next = corners.iter().cycle().skip(1);
        corners.iter().zip(next).map(|(p, q)| {
            let (x, y) = (q[1] - p[1], p[0] - q[0]);
            let length = x.hypot(y);
            [x / length, y / length]
        })
    }

    /// The corner that is farthest along `n`.
    pub(super) fn farthest(&self, n: Flat) -> usize {
        let mut best = 0;
        for (place, corner) in self.corners().iter().enumerate() {
            if dot(*corner, n) > dot(self.corners[best], n) {
                best = place;
            }
        }
        best
    }

    /// Of the corners within `same` of the farthest along `n`, the first and the last along `tangent`: the position
    /// along it, and the corner.
    pub(super) fn shown(&self, n: Flat, tangent: Flat, same: f64) -> [(f64, usize); 2] {
        let most = dot(self.corners[self.farthest(n)], n);
        let mut ends = [(f64::INFINITY, 0), (f64::NEG_INFINITY, 0)];
        for (place, &corner) in self.corners().iter().enumerate() {
            if dot(corner, n) >= most - same {
                let t = dot(corner, tangent);
                if t < ends[0].0 {
                    ends[0] = (t, place);
                }
                if t > ends[1].0 {
                    ends[1] = (t, place);
                }
            }
        }
        ends
    }
}
