//! One polygon clipped by the edges of another, along the normal; each corner is named by the lines that meet there.

use crate::math::Vec3;
use crate::narrow::exact::feature::{CORNERS_MAX, Feature};

/// Flag of the lines along which a polygon is cut: the other's edges, not its own. Names of corners have fewer bits.
pub(super) const CUT: u32 = 0x4000;
/// The bits of a corner's name that identify the corner.
const NAME: u32 = 0x3fff;

/// Name of a new corner: the pair of lines that meet there, which is unique.
///
/// * `line` - of the polygon that is cut: [`NAME`] of the corner where its edge begins, or one of the cutting edges.
/// * `edge` - the cutting edge, from 0 on.
pub(super) const fn met(line: u32, edge: u32) -> u32 {
    line | ((edge & NAME) + 1) << 15
}

/// A point of one feature that lies over the other, with its origin.
#[derive(Clone, Copy, Default)]
pub(super) struct Clip {
    /// On the core of the clipped feature, A's frame.
    pub(super) at: Vec3,
    pub(super) feature: u32,
    /// The line along which the ring continues from here.
    line: u32,
}

/// A polygon being clipped.
pub(super) struct Clipped {
    pub(super) points: [Clip; 2 * CORNERS_MAX],
    pub(super) count: usize,
}

impl Clipped {
    /// `incident`, cut by the planes along the normal through the edges of `base`.
    pub(super) fn onto(base: &Feature, incident: &Feature, normal: &Vec3) -> Self {
        let mut clipped = Self::of(incident);
        let corners = base.used();
        let centre: Vec3 = corners.iter().sum::<Vec3>() / corners.len() as f64;
        for (k, corner) in corners.iter().enumerate() {
            let next = corners[(k + 1) % corners.len()];
            let mut outward = (next - corner).cross(normal);
            if outward.dot(&(corner - centre)) < 0.0 {
                outward = -outward;
            }
            clipped.cut(corner, &outward, base.id(k));
        }
        clipped
    }

    fn of(feature: &Feature) -> Self {
        let mut points = [Clip::default(); 2 * CORNERS_MAX];
        for (k, corner) in feature.used().iter().enumerate() {
            points[k] = Clip {
                at: *corner,
                feature: feature.id(k) & NAME,
                line: feature.id(k) & NAME,
            };
        }
        Self {
            points,
            count: feature.count,
        }
    }

    /// Cuts off the part beyond the plane. Source: Sutherland and Hodgman 1974, Reentrant polygon clipping.
    fn cut(&mut self, on: &Vec3, outward: &Vec3, edge: u32) {
        let count = self.count;
        let mut over = [0.0; 2 * CORNERS_MAX];
        for (over, clip) in over.iter_mut().zip(&self.points[..count]) {
            *over = outward.dot(&(clip.at - on));
        }
        if over[..count].iter().all(|over| *over <= 0.0) {
            return;
        }
        let (old, mut kept) = (self.points, 0);
        let mut put = |clip: Clip| {
            if kept < self.points.len() {
                self.points[kept] = clip;
                kept += 1;
            }
        };
        for k in 0..count {
            let next = if k + 1 < count { k + 1 } else { 0 };
            let (here, there) = (over[k], over[next]);
            // Where the ring leaves, it continues along the cut.
            let on = if there > 0.0 {
                CUT | edge & NAME
            } else {
                old[k].line
            };
            if here <= 0.0 {
                let line = if here == 0.0 { on } else { old[k].line };
                put(Clip { line, ..old[k] });
            }
            // A segment is not a ring: the way back adds nothing.
            let crosses = (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0);
            if crosses && !(count == 2 && k == 1) && count > 1 {
                let t = here / (here - there);
                put(Clip {
                    at: old[k].at + (old[next].at - old[k].at) * t,
                    feature: met(old[k].line, edge),
                    line: on,
                });
            }
        }
        self.count = kept;
    }
}
