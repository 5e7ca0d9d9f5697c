//! Manifolds: up to four contact points that span what two shapes share, with ids that persist as long as the features.
//!
//! In: a pair and its exact answer. Out: points in A's frame, none deeper than the answer, up to rounding.
//!
//! Each core shows a feature along the normal: a polygon (box face, hull face, cap, base), a segment (side line,
//! capsule axis) or a point. One is clipped by planes along the normal through the edges of the other; gaps are
//! measured along the normal. The deepest point is always among the results.

mod clipped;
mod lathe;
mod plane;
mod shared;
mod triangles;

pub(in crate::narrow) use plane::points_on_plane;
pub(in crate::narrow) use shared::shared_points;
pub(in crate::narrow) use triangles::shared_by_triangles;

use clipped::Clipped;
use lathe::Surface;

use super::feature::{CORNERS_MAX, Feature};
use super::pair::Pair;
use super::{Closest, Convex};
use crate::limits::MANIFOLD_POINTS_MAX;
use crate::math::{Point, Pose, Vec3};
use crate::shape::Core;

/// Faces that lean further from the normal than this (cosine) share no patch worth clipping.
const FACING: f64 = 0.7;
/// How much closer (cosine) B's face must be to the normal than A's to become the reference face: for faces that lie
/// flat on one another rounding must not decide, because the names of the points depend on it.
const RATHER: f64 = 1e-9;
/// Points this far apart still count as contacts, as a share of the smaller one's radius: for a body at rest all
/// corners must, though rounding lifts some.
pub(in crate::narrow) const PREDICTION: f64 = 1e-6;
/// Points nearer than this share of the smaller one's radius, plus rounding, are merged.
const SAME: f64 = 1e-6;
/// Id of the closest points themselves, if no clipped point represents them.
const WITNESS: u32 = 0x7fff_ffff;

/// One contact point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ManifoldPoint {
    /// On the surface of A, A's frame.
    pub point_a: Point,
    /// On the surface of B, A's frame; `point_b - point_a = gap_m * normal`.
    pub point_b: Point,
    /// Along the answer's normal, metres.
    pub gap_m: f64,
    /// Which corners and edges meet here: equal from tick to tick while the contact persists.
    pub feature: u32,
}

/// Up to [`MANIFOLD_POINTS_MAX`] contact points, by feature id.
#[derive(Clone, Copy, Debug, Default)]
pub struct Manifold {
    points: [Option<ManifoldPoint>; MANIFOLD_POINTS_MAX],
}

impl Manifold {
    /// The points, by feature id.
    pub fn points(&self) -> impl Iterator<Item = &ManifoldPoint> {
        self.points.iter().flatten()
    }

    /// How many points there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.points().count()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Fills `out` with the contact points of a pair.
///
/// * `closest` - the answer of `convex_gap` for the same shapes and pose.
/// * `prediction_m` - points with a larger gap are left out.
///
/// Cost: below a microsecond; no allocation.
pub fn manifold(
    a: &Convex,
    b: &Convex,
    pos12: &Pose,
    closest: &Closest,
    prediction_m: f64,
    out: &mut Manifold,
) {
    *out = Manifold::default();
    let pair = Pair::new(a, b, pos12);
    if !(pair.scale.is_finite() && closest.best_m <= prediction_m) {
        return;
    }
    Found::of(&pair, closest, prediction_m).write(out);
}

/// Passes on all contact points of two shapes that touch, up to 16: the caller knows which were kept before, and
/// chooses four. Otherwise as [`manifold`]; points up to [`PREDICTION`] apart count.
pub(in crate::narrow) fn touching_points(
    a: &Convex,
    b: &Convex,
    pos12: &Pose,
    closest: &Closest,
    take: impl FnMut(&ManifoldPoint),
) {
    let pair = Pair::new(a, b, pos12);
    let prediction_m = (2.0 * pair.pad()).max(PREDICTION * a.radius().min(b.radius()));
    if pair.scale.is_finite() && closest.best_m <= prediction_m {
        let mut found = Found::of(&pair, closest, prediction_m);
        found.all().iter().for_each(take);
    }
}

/// The middle of what two cores share along `normal` once B has moved out by `-gap`: clipped features, only the deepest
/// points. `None` if they show no faces to clip.
pub(super) fn deepest_shared(pair: &Pair<'_>, normal: &Vec3, gap: f64) -> Option<(Vec3, Vec3)> {
    let of_a = Feature::of_a(pair, normal);
    let of_b = Feature::of_b(pair, normal);
    let (base, incident, base_is_b) = if of_a.facing(normal) >= of_b.facing(normal) {
        (&of_a, &of_b, false)
    } else {
        (&of_b, &of_a, true)
    };
    if base.facing(normal) < FACING {
        return None;
    }
    let clipped = Clipped::onto(base, incident, normal);
    let (mut sum, mut count) = (Vec3::zeros(), 0.0);
    let plane = base.used().first()?;
    for clip in &clipped.points[..clipped.count] {
        let over = normal.dot(&(clip.at - plane));
        let over = if base_is_b { -over } else { over };
        if over <= gap + 1e-9 * pair.scale {
            sum += clip.at;
            count += 1.0;
        }
    }
    if count == 0.0 {
        return None;
    }
    let at = sum / count;
    Some(if base_is_b {
        (at, at + normal * gap)
    } else {
        (at - normal * gap, at)
    })
}

/// Points found so far, on the shapes' surfaces.
struct Found {
    points: [ManifoldPoint; 2 * CORNERS_MAX],
    count: usize,
    normal: Vec3,
    /// Of A and of B.
    surfaces: [Surface; 2],
    prediction_m: f64,
    witness: ManifoldPoint,
    /// Points closer than this are merged, metres.
    same: f64,
    /// The answer's own point must be deeper than another by this to count as a separate point, metres.
    deeper: f64,
}

impl Found {
    #[inline]
    fn new(pair: &Pair<'_>, closest: &Closest, prediction_m: f64) -> Self {
        let same = SAME * pair.a.radius().min(pair.b.radius()) + pair.pad();
        let of_b = Surface::new(pair.b, pair.at, pair.rotation.column(2).into_owned());
        Self::with(closest, [Surface::own(pair.a), of_b], prediction_m, same)
    }

    #[inline]
    fn with(closest: &Closest, surfaces: [Surface; 2], prediction_m: f64, same: f64) -> Self {
        let witness = ManifoldPoint {
            point_a: closest.point_a,
            point_b: closest.point_b,
            gap_m: closest.best_m,
            feature: WITNESS,
        };
        Self {
            points: [witness; 2 * CORNERS_MAX],
            count: 0,
            normal: closest.normal,
            surfaces,
            prediction_m,
            witness,
            same,
            deeper: if closest.finished {
                // A curved answer is off by a share of the larger one.
                same.max(closest.gap.max - closest.gap.min)
            } else {
                same
            },
        }
    }

    /// All points that the features along the answer's normal share.
    fn of(pair: &Pair<'_>, closest: &Closest, prediction_m: f64) -> Self {
        let normal = closest.normal;
        let mut found = Self::new(pair, closest, prediction_m);
        if matches!(pair.a.core(), Core::Point) || matches!(pair.b.core(), Core::Point) {
            found.count = 1;
            return found;
        }
        let of_a = Feature::of_a(pair, &normal);
        let of_b = Feature::of_b(pair, &normal);
        let (side_a, side_b) = (of_a.facing(&normal), of_b.facing(&normal));
        if side_a >= FACING && side_a >= side_b - RATHER {
            clip_onto(&of_a, &of_b, &normal, false, &mut found);
        } else if side_b >= FACING {
            clip_onto(&of_b, &of_a, &normal, true, &mut found);
        } else if of_a.count == 2 && of_b.count == 2 {
            overlap_lines(&of_a, &of_b, &normal, &mut found);
        }
        found
    }

    /// Adds a pair of points of the cores, moved out to the surfaces; nothing if there is no surface along the normal.
    fn take(&mut self, a: &Vec3, b: &Vec3, feature: u32) {
        let [of_a, of_b] = &self.surfaces;
        let (Some(out_a), Some(out_b)) = (
            of_a.way_out(a, &self.normal),
            of_b.way_out(b, &-self.normal),
        ) else {
            return;
        };
        let gap_m = self.normal.dot(&(b - a)) - out_a - out_b;
        if gap_m > self.prediction_m || self.count == self.points.len() {
            return;
        }
        let point_a = Point::from(a + self.normal * out_a);
        let doubled = self.points[..self.count]
            .iter()
            .any(|p| (p.point_a - point_a).norm() <= self.same);
        if !doubled {
            self.points[self.count] = ManifoldPoint {
                point_a,
                point_b: Point::from(b - self.normal * out_b),
                gap_m,
                feature,
            };
            self.count += 1;
        }
    }

    /// All points found, plus the answer's own if none is as deep.
    fn all(&mut self) -> &[ManifoldPoint] {
        let deepest = self.points[..self.count]
            .iter()
            .map(|p| p.gap_m)
            .fold(f64::INFINITY, f64::min);
        if deepest > self.witness.gap_m + self.deeper && self.count < self.points.len() {
            self.points[self.count] = self.witness;
            self.count += 1;
        }
        &self.points[..self.count]
    }

    /// At most four: the deepest, the farthest from it, and the two that span the largest area.
    fn write(&mut self, out: &mut Manifold) {
        let normal = self.normal;
        let points = self.all();
        let mut chosen = [0; MANIFOLD_POINTS_MAX];
        let count = if points.len() <= MANIFOLD_POINTS_MAX {
            chosen = [0, 1, 2, 3];
            points.len()
        } else {
            spread(points, &normal, &mut chosen);
            MANIFOLD_POINTS_MAX
        };
        let mut picked = chosen.map(|k| points.get(k).copied());
        picked[count..].fill(None);
        picked.sort_by_key(|p| p.map_or(u32::MAX, |p| p.feature));
        out.points = picked;
    }
}

fn spread(points: &[ManifoldPoint], normal: &Vec3, chosen: &mut [usize; MANIFOLD_POINTS_MAX]) {
    let best = |score: &dyn Fn(usize) -> f64| {
        let mut best = (0, f64::NEG_INFINITY);
        for k in 0..points.len() {
            let value = score(k);
            if value > best.1 {
                best = (k, value);
            }
        }
        best.0
    };
    let at = |k: usize| points[k].point_a.coords;
    chosen[0] = best(&|k| -points[k].gap_m);
    let first = at(chosen[0]);
    chosen[1] = best(&|k| (at(k) - first).norm_squared());
    let along = at(chosen[1]) - first;
    let side = normal.cross(&along);
    chosen[2] = best(&|k| side.dot(&(at(k) - first)));
    chosen[3] = best(&|k| -side.dot(&(at(k) - first)));
    // All collinear: duplicates are replaced by any remaining point.
    for k in 2..MANIFOLD_POINTS_MAX {
        if chosen[..k].contains(&chosen[k]) {
            let free = (0..points.len()).find(|j| !chosen[..k].contains(j));
            chosen[k] = free.unwrap_or(chosen[k]);
        }
    }
}

/// Clips `incident` by the planes along the normal through `base`'s edges, and projects the rest onto `base`'s plane.
fn clip_onto(
    base: &Feature,
    incident: &Feature,
    normal: &Vec3,
    base_is_b: bool,
    found: &mut Found,
) {
    let base = base.spread();
    let clipped = Clipped::onto(&base, incident, normal);
    let corners = base.used();
    let steep = base.normal.dot(normal);
    let side = if base_is_b { 1 << 31 } else { 0 };
    for clip in &clipped.points[..clipped.count] {
        // Along the normal onto the base's plane.
        let lift = base.normal.dot(&(clip.at - corners[0])) / steep;
        let cast = clip.at - normal * lift;
        if base_is_b {
            found.take(&clip.at, &cast, side | clip.feature);
        } else {
            found.take(&cast, &clip.at, side | clip.feature);
        }
    }
}

/// Two nearly parallel lines: the ends of their common range.
fn overlap_lines(of_a: &Feature, of_b: &Feature, normal: &Vec3, found: &mut Found) {
    let (a, b) = (of_a.used(), of_b.used());
    let along = a[1] - a[0];
    let other = b[1] - b[0];
    let flat = |v: Vec3| v - normal * v.dot(normal);
    let (along_flat, other_flat) = (flat(along), flat(other));
    let (square, size) = (along_flat.norm_squared(), other_flat.norm());
    // Lines that cross at a real angle meet in one point, which is the witness.
    if along_flat.cross(&other_flat).norm() > 0.1 * square.sqrt() * size
        || square == 0.0
        || size == 0.0
    {
        return;
    }
    let mut place = [0.0; 2];
    for (t, p) in place.iter_mut().zip(b) {
        *t = flat(p - a[0]).dot(&along_flat) / square;
    }
    let span = place[1] - place[0];
    for (k, s) in [0.0_f64, 1.0].into_iter().enumerate() {
        // Ends of A over B, ends of B over A.
        let on_b = (s - place[0]) / span;
        #[allow(clippy::cast_possible_truncation, reason = "0 or 1")]
        let k32 = k as u32;
        // The far point is placed opposite, and moved back onto its side: the lines may be slightly skew.
        if (0.0..=1.0).contains(&on_b) {
            let end = a[0] + along * s;
            let far = end + normal * normal.dot(&(b[0] + other * on_b - end));
            if let Some(back) = found.surfaces[1].way_back(&far, &-normal) {
                found.take(&end, &(far - normal * back), 0x100 | k32);
            }
        }
        if (0.0..=1.0).contains(&place[k]) {
            let far = b[k] - normal * normal.dot(&(b[k] - a[0] - along * place[k]));
            if let Some(back) = found.surfaces[0].way_back(&far, normal) {
                found.take(&(far + normal * back), &b[k], 0x200 | k32);
            }
        }
    }
}
