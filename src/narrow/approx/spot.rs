//! Where two boxes overlap: a place that contains everything the two share.
//!
//! In: a box, and slabs that bound it. Out: a smaller box along the same axes, as a sphere that can be cut along its
//! longest side.

use std::cmp::Ordering;

use crate::math::{Point, Vec3};
use crate::shape::{BoxId, Cone, Obb};

/// Added to sides, as a share of the boxes: axes rounded to f32 are only nearly unit and orthogonal.
const ROUNDED: f64 = 1e-6;
/// A slab whose normal has a smaller cosine with an axis does not bound that coordinate.
const LEVEL: f64 = 1e-3;
/// Rounds in which the bounds of one coordinate tighten the others: a third round gains less than a hundredth.
const ROUNDS: usize = 2;

/// A place where two shapes may touch.
#[derive(Clone, Copy, Debug)]
pub(in crate::narrow) struct Spot {
    /// Centre of a sphere that contains everything the two share here.
    pub(in crate::narrow) centre: Point,
    /// Its radius, metres.
    pub(in crate::narrow) radius_m: f64,
    /// Half of the longest side of the box inside it, and half the diagonal of the other sides, metres.
    pub(in crate::narrow) along: Vec3,
    pub(in crate::narrow) across_m: f64,
    /// Possible normals of a contact here, A to B.
    pub(in crate::narrow) cone: Cone,
    /// Depth of a contact found here, metres; NaN: none was found.
    pub(in crate::narrow) depth_m: f64,
    /// The two boxes it belongs to.
    pub(in crate::narrow) boxes: (BoxId, BoxId),
}

/// The points between two parallel planes: `low <= normal . (x - centre of the box) <= high`, metres.
#[derive(Clone, Copy, Debug)]
pub(in crate::narrow) struct Slab {
    pub(in crate::narrow) normal: Vec3,
    pub(in crate::narrow) low: f64,
    pub(in crate::narrow) high: f64,
}

impl Spot {
    /// The part of a box that lies in all slabs; `None`: there is none.
    ///
    /// Each slab bounds each coordinate, given the ranges of the others.
    ///
    /// * `size` - scale of the rounding errors, metres; `slop_m` is added to it.
    pub(in crate::narrow) fn of(of: &Obb, slabs: &[Slab], size: f64, slop_m: f64) -> Option<Self> {
        let pad = ROUNDED * size + slop_m;
        let mut high = of.half.map(|h| f64::from(h) + pad);
        let mut low = high.map(|h| -h);
        for round in 0..ROUNDS * slabs.len() {
            let slab = &slabs[round % slabs.len()];
            let on = of.axes.tr_mul(&slab.normal);
            let (mut least, mut most) = ([0.0; 3], [0.0; 3]);
            for k in 0..3 {
                let (x, y) = (on[k] * low[k], on[k] * high[k]);
                (least[k], most[k]) = (x.min(y), x.max(y));
            }
            // The slab's bounds on one coordinate when the others take their least and greatest values.
            let over = slab.high + pad - (least[0] + least[1] + least[2]);
            let under = slab.low - pad - (most[0] + most[1] + most[2]);
            if over < 0.0 || under > 0.0 {
                return None;
            }
            for k in 0..3 {
                if on[k].abs() < LEVEL {
                    continue;
                }
                let each = 1.0 / on[k];
                let (from, to) = ((under + most[k]) * each, (over + least[k]) * each);
                low[k] = low[k].max(from.min(to) - pad);
                high[k] = high[k].min(from.max(to) + pad);
                if low[k] > high[k] {
                    return None;
                }
            }
        }
        let middle = Vec3::from_fn(|k, _| 0.5 * (low[k] + high[k]));
        let half = Vec3::from_fn(|k, _| 0.5 * (high[k] - low[k]));
        let k = half.imax();
        let others = half.norm_squared() - half[k] * half[k];
        Some(Self {
            centre: of.centre + of.axes * middle,
            radius_m: half.norm() * (1.0 + ROUNDED) + pad,
            along: of.axes.column(k) * half[k],
            across_m: others.max(0.0).sqrt() * (1.0 + ROUNDED) + pad,
            cone: Cone::every(Vec3::zeros()),
            depth_m: f64::NAN,
            boxes: (BoxId::ROOT, BoxId::ROOT),
        })
    }

    /// Around at least one point: everything within `margin_m` of the points and between them.
    pub(in crate::narrow) fn round(points: &[Point], margin_m: f64) -> Self {
        let mut ends = (points[0], points[0], 0.0);
        for (k, p) in points.iter().enumerate() {
            for q in &points[k + 1..] {
                let square = (q - p).norm_squared();
                if square > ends.2 {
                    ends = (*p, *q, square);
                }
            }
        }
        let centre = nalgebra::center(&ends.0, &ends.1);
        let along = (ends.1 - ends.0) * 0.5;
        let (mut radius_m, mut across_m) = (0.0_f64, 0.0_f64);
        for p in points {
            let from = p - centre;
            radius_m = radius_m.max(from.norm());
            // No point lies beyond the two that are farthest apart.
            let share = from.dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE);
            across_m = across_m.max((from - along * share).norm());
        }
        Self {
            centre,
            radius_m: radius_m * (1.0 + ROUNDED) + margin_m,
            along,
            across_m: across_m * (1.0 + ROUNDED) + 2.0 * margin_m,
            cone: Cone::every(Vec3::zeros()),
            depth_m: f64::NAN,
            boxes: (BoxId::ROOT, BoxId::ROOT),
        }
    }

    /// What two boxes share, both in one frame; `None`: they are apart.
    pub(in crate::narrow) fn shared(p: &Obb, q: &Obb, slop_m: f64) -> Option<Self> {
        let size = |b: &Obb| b.half.iter().map(|h| f64::from(*h)).sum::<f64>();
        let (size_p, size_q) = (size(p), size(q));
        // The smaller one is cut, so that all slabs of the larger one matter.
        let (of, by) = if size_p <= size_q { (p, q) } else { (q, p) };
        let between = by.centre - of.centre;
        let slabs: [Slab; 3] = std::array::from_fn(|k| {
            let normal = by.axes.column(k).into_owned();
            let (at, half) = (normal.dot(&between), f64::from(by.half[k]));
            Slab {
                normal,
                low: at - half,
                high: at + half,
            }
        });
        // If they meet at all, their centres are within both sizes.
        Self::of(of, &slabs, size_p + size_q, slop_m)
    }

    /// A point that is certainly shared, or a pair of points, `normal` apart: a contact that was found.
    pub(in crate::narrow) fn found(a: &Point, b: &Point, normal: Vec3, depth_m: f64) -> Self {
        let along = (b - a) * 0.5;
        Self {
            centre: nalgebra::center(a, b),
            radius_m: along.norm() * (1.0 + ROUNDED),
            along,
            across_m: 0.0,
            cone: Cone::of(normal),
            depth_m,
            boxes: (BoxId::ROOT, BoxId::ROOT),
        }
    }

    /// The spot cut across its longest side; `None` if that removes next to nothing, and for a contact.
    pub(in crate::narrow) fn halves(&self) -> Option<[Self; 2]> {
        let along = self.along * 0.5;
        let square = along.norm_squared() + self.across_m * self.across_m;
        let radius_m = square.sqrt() * (1.0 + ROUNDED);
        let worth = self.depth_m.is_nan() && radius_m < 0.9 * self.radius_m;
        worth.then(|| {
            [along, -along].map(|to| Self {
                centre: self.centre + to,
                radius_m,
                along,
                ..*self
            })
        })
    }

    /// A sphere around both, with the normals of both.
    pub(in crate::narrow) fn with(&self, other: &Self) -> Self {
        let way = other.centre - self.centre;
        let apart = way.norm();
        let cone = Cone::around([self.cone, other.cone].into_iter());
        let depth_m = self.depth_m.max(other.depth_m);
        if apart + other.radius_m <= self.radius_m {
            return Self {
                cone,
                depth_m,
                ..*self
            };
        }
        if apart + self.radius_m <= other.radius_m {
            return Self {
                cone,
                depth_m,
                ..*other
            };
        }
        let radius_m = 0.5 * (apart + self.radius_m + other.radius_m);
        Self {
            centre: self.centre + way * ((radius_m - self.radius_m) / apart),
            radius_m: radius_m * (1.0 + ROUNDED),
            along: Vec3::zeros(),
            across_m: radius_m,
            cone,
            depth_m,
            ..*self
        }
    }
}

impl Ord for Spot {
    /// The largest compares greatest; ties by place, for equal replays.
    fn cmp(&self, other: &Self) -> Ordering {
        let place = |s: &Self| (s.boxes.0.0, s.boxes.1.0);
        (self.radius_m.total_cmp(&other.radius_m)).then_with(|| place(self).cmp(&place(other)))
    }
}

impl PartialOrd for Spot {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Spot {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Spot {}
