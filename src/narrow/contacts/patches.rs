//! The manifold of each patch: at most four of its points. In: all points found for a pair. Out: of each patch the
//! deepest point, and those that span the largest area with it.
//!
//! A patch is what touches with one normal: points of one shape pair that were found together, merged with other such
//! patches whose normals are within 8 degrees and whose boxes are next to each other (two regions of a mesh meet at a
//! ridge, and the points on the ridge are one patch). Two shelves of equal height are two patches: two surfaces, far
//! apart.

use super::{Contact, KEPT_BEFORE, SAME_NORMAL, SAME_POINT};
use crate::limits::MANIFOLD_POINTS_MAX;
use crate::math::{Aabb, Vec3};

/// Points of a patch whose distance from the segment or triangle of the others is below this share of the smaller
/// body's radius add no span.
const SPANS: f64 = 1e-3;
/// Points within this share of the radius of the greatest depth count as equally deep: for a body that lies flat, the
/// outermost comes first, regardless of rounding.
const AS_DEEP: f64 = 1e-9;

/// Reduces the points of each patch; returns how many are left, at the front.
///
/// * `found` - in any order; `patch` distinguishes those of one shape pair.
/// * `radius` - of the smaller body, metres.
/// * `was_kept` - whether a contact was kept in the last tick.
///
/// Cost: O(n log n) and O(patches^2) of each shape pair; no allocation.
pub(super) fn reduce(
    found: &mut [Contact],
    radius: f64,
    was_kept: impl Fn(&Contact) -> bool,
) -> usize {
    found.sort_unstable_by(order);
    for pair in found.chunk_by_mut(|x, y| (x.shape_a, x.shape_b) == (y.shape_a, y.shape_b)) {
        join(pair, radius);
    }
    let (mut left, mut at) = (0, 0);
    while at < found.len() {
        let key = |c: &Contact| (c.shape_a, c.shape_b, c.patch);
        let of = key(&found[at]);
        let end = at + found[at..].iter().take_while(|c| key(c) == of).count();
        let kept = select(&mut found[at..end], radius, &was_kept);
        found.copy_within(at..at + kept, left);
        left += kept;
        at = end;
    }
    left
}

fn order(x: &Contact, y: &Contact) -> std::cmp::Ordering {
    let place = |c: &Contact| (c.shape_a, c.shape_b, c.patch);
    (place(x).cmp(&place(y)))
        .then(x.gap_m.total_cmp(&y.gap_m))
        .then(x.feature.cmp(&y.feature))
        .then(x.key().cmp(&y.key()))
}

/// Gives the patches of one surface the same number; `found` is of one shape pair, in order.
fn join(found: &mut [Contact], radius: f64) {
    let near = SAME_POINT * radius;
    let mut start = 0;
    let mut changed = false;
    while start < found.len() {
        let patch = found[start].patch;
        let len = found[start..]
            .iter()
            .take_while(|c| c.patch == patch)
            .count();
        let (before, here) = found.split_at_mut(start);
        let here = &mut here[..len];
        let bounds = around(here, near);
        // The deepest point represents its patch.
        let normal = here[0].normal;
        let other = (before.chunk_by(|x, y| x.patch == y.patch))
            .find(|old| {
                old[0].normal.dot(&normal) >= SAME_NORMAL && meets(&around(old, 0.0), &bounds)
            })
            .map(|old| old[0].patch);
        if let Some(other) = other {
            here.iter_mut().for_each(|c| c.patch = other);
            changed = true;
        }
        start += len;
        if changed {
            // Merged patches are sorted together again.
            found[..start].sort_unstable_by(order);
            changed = false;
        }
    }
}

fn around(points: &[Contact], more: f64) -> Aabb {
    let mut bounds = Aabb::empty();
    for point in points {
        bounds.min = bounds.min.inf(&point.point_a);
        bounds.max = bounds.max.sup(&point.point_a);
    }
    bounds.widened(more)
}

fn meets(x: &Aabb, y: &Aabb) -> bool {
    (0..3).all(|k| x.min[k] <= y.max[k] && y.min[k] <= x.max[k])
}

/// Moves the points of a patch that are kept to the front; returns how many.
fn select(patch: &mut [Contact], radius: f64, was_kept: &impl Fn(&Contact) -> bool) -> usize {
    let len = once_each(patch);
    let patch = &mut patch[..len];
    if len <= 1 {
        return len;
    }
    let normal = patch[0].normal;
    let centre = patch.iter().map(|c| c.point_a.coords).sum::<Vec3>() / len as f64;
    let deepest = patch[0].gap_m + AS_DEEP * radius;
    let least = SPANS * radius;
    for kept in 0..MANIFOLD_POINTS_MAX.min(len) {
        let corners = [0, 1, 2].map(|k| patch[k.min(len - 1)].point_a.coords);
        let out = |c: &Contact| {
            let p = c.point_a.coords;
            match kept {
                0 if c.gap_m <= deepest => (p - centre).norm() + radius,
                0 => 0.0,
                1 => (p - corners[0]).norm(),
                2 => off_segment(&p, &corners[0], &corners[1]),
                _ => off_triangle(&p, &corners, &normal),
            }
        };
        let mut best = (kept, 0.0);
        for (k, contact) in patch.iter().enumerate().skip(kept) {
            let mut out = out(contact);
            // A point that adds no span gets no bonus for having been kept.
            if out > least && was_kept(contact) {
                out *= KEPT_BEFORE;
            }
            if out > best.1 {
                best = (k, out);
            }
        }
        if best.1 <= least {
            return kept.max(1);
        }
        patch[kept..=best.0].rotate_right(1);
    }
    MANIFOLD_POINTS_MAX.min(len)
}

/// Removes points with equal keys; the deepest, which come first, stay.
fn once_each(patch: &mut [Contact]) -> usize {
    let mut left = 0;
    for at in 0..patch.len() {
        let contact = patch[at];
        if !patch[..left].iter().any(|old| old.key() == contact.key()) {
            patch[left] = contact;
            left += 1;
        }
    }
    left
}

/// How far a point lies from a segment, metres.
fn off_segment(p: &Vec3, from: &Vec3, to: &Vec3) -> f64 {
    let (along, across) = (to - from, p - from);
    let square = along.norm_squared();
    let t = if square > 0.0 {
        (across.dot(&along) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (across - along * t).norm()
}

/// How far a point lies outside a triangle seen along `normal`, metres; zero inside.
fn off_triangle(p: &Vec3, corners: &[Vec3; 3], normal: &Vec3) -> f64 {
    let sides = [0, 1, 2].map(|k| (corners[k], corners[(k + 1) % 3]));
    let turns = sides.map(|(from, to)| normal.dot(&(to - from).cross(&(p - from))));
    if turns.iter().all(|t| *t > 0.0) || turns.iter().all(|t| *t < 0.0) {
        return 0.0;
    }
    (sides.iter().map(|(from, to)| off_segment(p, from, to))).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests;
