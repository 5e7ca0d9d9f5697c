//! Separating axes of two boxes: their exact depth, or a direction that separates them.
//!
//! In: a pair. Out: the gap if they overlap, else a first direction for GJK; nothing for other cores. The depth of two
//! polytopes is least along a face normal or along the cross product of two edges: 15 axes for boxes.
//!
//! Source: Gottschalk, Lin, Manocha 1996, OBBTree.

use super::manifold::deepest_shared;
use super::pair::{CoreGap, Held, Pair};
use crate::math::Vec3;
use crate::shape::Core;

/// Edges closer to parallel than this (sine) get no cross axis: leaving it out costs at most the sine times the size,
/// keeping it costs roundoff divided by the sine times the size. Both are equal here.
const PARALLEL: f64 = 1e-8;
/// If rounding leaves the overlap of nearly aligned boxes open by more than this, in units of what cannot be told from
/// 0, a polytope decides. That takes longer, but such boxes are few: their edges are tilted by 1e-12 to 1e-3, and an
/// axis of two edges overlaps about as little as the least.
const OPEN: f64 = 1024.0;
/// A box shows a corner, not an edge, if every component of the normal in its frame exceeds this.
const CORNER: f64 = 1e-6;
/// How far beyond its end an edge may be met, as a share of the size: roundoff of the intersection of two lines.
const SAME: f64 = 1e-9;

/// Result of the axis tests of two boxes.
pub(super) enum Axes {
    /// They overlap or touch.
    Overlap(CoreGap),
    /// They are apart; the direction separates them most among the axes.
    Apart(Vec3),
}

/// The axis of least overlap, and which features it belongs to.
#[derive(Clone, Copy)]
struct Least {
    overlap_m: f64,
    /// Unit, A to B, A's frame.
    normal: Vec3,
    kind: Kind,
    /// No axis overlaps less, whatever rounding has done to each.
    floor_m: f64,
}

#[derive(Clone, Copy)]
enum Kind {
    /// A face of A.
    FaceA,
    /// A face of B.
    FaceB,
    /// An edge of A along its axis `.0` and one of B along `.1`.
    Edges(usize, usize),
}

impl Least {
    /// Takes an axis that overlaps less.
    #[inline]
    fn offer(&mut self, overlap_m: f64, kind: Kind, normal: impl FnOnce() -> Vec3) {
        if overlap_m < self.overlap_m {
            *self = Self {
                overlap_m,
                normal: normal(),
                kind,
                ..*self
            };
        }
    }
}

/// Tries the axes of two boxes; `None` for other cores, and for boxes whose axes leave the depth open.
pub(super) fn boxes(pair: &Pair<'_>) -> Option<Axes> {
    let (Core::Cuboid { half: ha }, Core::Cuboid { half: hb }) = (pair.a.core(), pair.b.core())
    else {
        return None;
    };
    let least = least_overlap(pair, ha, hb);
    if least.overlap_m < 0.0 {
        return Some(Axes::Apart(least.normal));
    }
    let normal = least.normal;
    let lower = normal.dot(&pair.support(&normal).w);
    let upper = (-least.floor_m).max(lower);
    if upper - lower > OPEN * pair.tiny() {
        return None;
    }
    let (point_a, point_b) = witnesses(pair, &least, lower)?;
    Some(Axes::Overlap(CoreGap {
        lower,
        upper,
        normal,
        point_a,
        point_b,
        held: Held::default(),
    }))
}

/// Overlap along an axis: the half extents of both, minus the distance of the centres.
fn least_overlap(pair: &Pair<'_>, ha: &Vec3, hb: &Vec3) -> Least {
    let rotation = &pair.rotation;
    let absolute = rotation.abs();
    let (reach_b, reach_a) = (absolute * hb, absolute.tr_mul(ha));
    let at_b = pair.to_b(&pair.at);
    let mut least = Least {
        overlap_m: f64::INFINITY,
        normal: Vec3::z(),
        kind: Kind::FaceA,
        floor_m: f64::INFINITY,
    };
    let sign = |v: f64| 1.0_f64.copysign(v);
    for k in 0..3 {
        let overlap = ha[k] + reach_b[k] - pair.at[k].abs();
        least.offer(overlap, Kind::FaceA, || Vec3::ith(k, sign(pair.at[k])));
        let overlap = hb[k] + reach_a[k] - at_b[k].abs();
        least.offer(overlap, Kind::FaceB, || rotation.column(k) * sign(at_b[k]));
    }
    let of_faces = least.overlap_m;
    least.floor_m = of_faces;
    for i in 0..3 {
        let (i1, i2) = ((i + 1) % 3, (i + 2) % 3);
        for j in 0..3 {
            let (j1, j2) = ((j + 1) % 3, (j + 2) % 3);
            // e_i x column j, its length, and the extents along it, all from entries of the rotation matrix.
            let (p, q) = (rotation[(i2, j)], rotation[(i1, j)]);
            let sine = (p * p + q * q).sqrt();
            // Seen along edges that are nearly one, two boxes are rectangles, and a face overlaps no more.
            let by_faces = of_faces - sine * pair.scale;
            if sine < PARALLEL {
                least.floor_m = least.floor_m.min(by_faces);
                continue;
            }
            let reach = ha[i1] * absolute[(i2, j)]
                + ha[i2] * absolute[(i1, j)]
                + hb[j1] * absolute[(i, j2)]
                + hb[j2] * absolute[(i, j1)];
            let between = pair.at[i2] * q - pair.at[i1] * p;
            let overlap = (reach - between.abs()) / sine;
            least.offer(overlap, Kind::Edges(i, j), || {
                let mut axis = Vec3::zeros();
                axis[i1] = -p * sign(between) / sine;
                axis[i2] = q * sign(between) / sine;
                axis
            });
            let rounded = 4.0 * f64::EPSILON / sine * pair.scale;
            least.floor_m = least.floor_m.min((overlap - rounded).max(by_faces));
        }
    }
    least
}

/// Points of the features that touch once B has moved out.
fn witnesses(pair: &Pair<'_>, least: &Least, gap: f64) -> Option<(Vec3, Vec3)> {
    let n = &least.normal;
    let vertex = pair.support(n);
    let corner = |dir: Vec3| dir.abs().min() > CORNER;
    match least.kind {
        Kind::FaceA if corner(pair.to_b(n)) => Some((vertex.b - n * gap, vertex.b)),
        Kind::FaceB if corner(*n) => Some((vertex.a, vertex.a + n * gap)),
        Kind::Edges(i, j) => {
            let (along, other) = (Vec3::ith(i, 1.0), pair.rotation.column(j).into_owned());
            // Lines through the two supports, moved together: where they cross.
            let between = vertex.b - n * gap - vertex.a;
            let cosine = along.dot(&other);
            let square = 1.0 - cosine * cosine;
            if square < 1e-6 {
                return deepest_shared(pair, n, gap);
            }
            let (s, t) = (between.dot(&along), between.dot(&other));
            let a = vertex.a + along * ((s - cosine * t) / square);
            let b = a + n * gap;
            // The axis of two edges may be that of a face as well, and then the edges need not cross.
            let half = |core: &Core, k: usize| match core {
                Core::Cuboid { half } => half[k] + SAME * pair.scale,
                _ => f64::INFINITY,
            };
            let crossing = a[i].abs() <= half(pair.a.core(), i)
                && other.dot(&(b - pair.at)).abs() <= half(pair.b.core(), j);
            if crossing {
                Some((a, b))
            } else {
                deepest_shared(pair, n, gap)
            }
        }
        _ => deepest_shared(pair, n, gap),
    }
}
