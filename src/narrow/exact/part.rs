//! Polytopes that seem to touch because of rounding, separated by planes along their edges.
//!
//! In: a pair, and a gap that is wider than rounding. Out: that gap, tightened by what planes and edges prove.
//!
//! The face of a sliver has a normal of few digits, and methods that go from normal to normal end at its rounding: with
//! sound but very wide intervals. But every direction proves a gap, and two polytopes that are apart are separated
//! across a corner, along an edge of each, or along a face. So these directions are tried, for the corners behind the
//! answer and for those that the best direction so far shows.

use super::pair::{CoreGap, Pair, Vertex, frame, unit};
use crate::math::Vec3;

/// Corners of each core whose edges are tried.
const CORNERS_MAX: usize = 5;
/// How often the corners shown by the best direction are tried too.
const ROUNDS_MAX: usize = 4;
/// Widths caused by rounding alone, in units of [`Pair::tiny`].
const ROUNDING: f64 = 64.0;

/// Some corners of a core, A's frame.
#[derive(Default)]
struct Corners {
    points: [Vec3; CORNERS_MAX],
    count: usize,
}

impl Corners {
    fn all(&self) -> &[Vec3] {
        &self.points[..self.count]
    }

    /// Adds a point. Returns whether it is new, and there was room.
    fn put(&mut self, point: Vec3) -> bool {
        let new = self.count < CORNERS_MAX && !self.all().contains(&point);
        if new {
            self.points[self.count] = point;
            self.count += 1;
        }
        new
    }

    /// Every two of them; a single one is an edge of zero length.
    fn edges(&self) -> impl Iterator<Item = (Vec3, Vec3)> + '_ {
        let all = self.all();
        let alone = all.first().filter(|_| all.len() == 1);
        let two = all
            .iter()
            .enumerate()
            .flat_map(move |(at, one)| all[at + 1..].iter().map(move |other| (*one, *other)));
        alone.map(|one| (*one, *one)).into_iter().chain(two)
    }
}

/// Tightens a gap that rounding left open, as far as planes and edges can; returns any other as it is.
pub(super) fn part(pair: &Pair<'_>, gap: CoreGap) -> CoreGap {
    let is_open = gap.upper >= 0.0 && gap.upper - gap.lower > ROUNDING * pair.tiny();
    if !(pair.polytopes && is_open) {
        return gap;
    }
    let (mut a, mut b) = (Corners::default(), Corners::default());
    let show = |vertex: &Vertex, a: &mut Corners, b: &mut Corners| {
        let new = [a.put(vertex.a), b.put(vertex.b)];
        new.contains(&true)
    };
    for vertex in pair.recall(&gap.held, &gap.normal) {
        show(&vertex, &mut a, &mut b);
    }
    // The corners of slivers, however wrong the normal.
    let (one, other) = frame(&gap.normal);
    for dir in [one, other].into_iter().flat_map(|dir| [dir, -dir]) {
        show(&pair.support(&dir), &mut a, &mut b);
    }
    let mut best = gap;
    for _ in 0..ROUNDS_MAX {
        for normal in normals(&a, &b) {
            let value = normal.dot(&pair.support(&normal).w);
            if value > best.lower {
                (best.lower, best.normal) = (value, normal);
            }
        }
        if !show(&pair.support(&best.normal), &mut a, &mut b) {
            break;
        }
    }
    for (point_a, point_b) in a
        .edges()
        .flat_map(|one| b.edges().map(move |other| nearest(one, other)))
    {
        let apart_m = (point_b - point_a).norm();
        if apart_m < best.upper {
            best = CoreGap {
                upper: apart_m,
                point_a,
                point_b,
                ..best
            };
        }
    }
    best.upper = best.upper.max(best.lower);
    best
}

/// Unit directions across faces and pairs of edges, and from corners to the nearest place of an edge; each in both
/// senses, because slivers do not show which way is out.
fn normals<'a>(a: &'a Corners, b: &'a Corners) -> impl Iterator<Item = Vec3> + 'a {
    let along = |(from, to): (Vec3, Vec3)| to - from;
    let crossing = a.edges().flat_map(move |one| {
        let one = along(one);
        b.edges().map(move |other| across(one, along(other)))
    });
    let faces = [a, b].into_iter().flat_map(move |of| {
        let all = of.all();
        all.iter().flat_map(move |corner| {
            of.edges()
                .map(move |edge| across(along(edge), edge.0 - corner))
        })
    });
    let straight = a.edges().flat_map(move |one| {
        b.edges().flat_map(move |other| {
            let (point_a, point_b) = nearest(one, other);
            let between = point_b - point_a;
            [one, other].map(|edge| beside(&between, &along(edge)))
        })
    });
    crossing
        .chain(faces)
        .chain(straight)
        .filter_map(|normal| unit(&normal))
        .flat_map(|normal| [normal, -normal])
}

/// Orthogonal to two directions, exactly so to the longer one: for nearly parallel ones the cross product alone has few
/// digits, and its error must not lie along the long one.
fn across(one: Vec3, other: Vec3) -> Vec3 {
    let (long, short) = if one.norm_squared() < other.norm_squared() {
        (other, one)
    } else {
        (one, other)
    };
    long.cross(&beside(&short, &long))
}

/// The part of a direction orthogonal to an edge; all of it if the edge has no length.
fn beside(dir: &Vec3, edge: &Vec3) -> Vec3 {
    let share = edge.dot(dir) / edge.norm_squared();
    if share.is_finite() {
        dir - edge * share
    } else {
        *dir
    }
}

/// The points of two edges that are nearest to each other, or nearly: any two of their points are sound.
///
/// Computed orthogonally to the first edge alone, so near-parallel edges lose no digits.
fn nearest((p, q): (Vec3, Vec3), (r, s): (Vec3, Vec3)) -> (Vec3, Vec3) {
    let (one, other, from) = (q - p, s - r, p - r);
    // A division by zero gives NaN: then any point of the edge is equally near.
    let share = |of: f64, by: f64| {
        let t = (of / by).clamp(0.0, 1.0);
        if t.is_nan() { 0.0 } else { t }
    };
    let across = beside(&other, &one);
    let second = share(across.dot(&beside(&from, &one)), across.norm_squared());
    let first = share(one.dot(&(other * second - from)), one.norm_squared());
    let second = share(other.dot(&(one * first + from)), other.norm_squared());
    (p + one * first, r + other * second)
}

#[cfg(test)]
mod tests;
