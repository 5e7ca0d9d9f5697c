//! Which contacts of a pair are kept when there are more than fit. In: all that were found. Out: the deepest, then
//! those farthest from the ones already kept, so that few points span the patches that many made.

use super::{Contact, KEPT_BEFORE, SAME_NORMAL};

/// Two points nearer than this share of the smaller body's radius, with normals within [`SAME_NORMAL`], are one contact
/// found by two triangles with a common edge.
const SAME_PLACE: f64 = 1e-3;

/// Moves the contacts that are kept to the front, deepest first; returns how many.
///
/// * `found` - deepest first.
/// * `most` - how many are kept at most.
/// * `radius` - of the smaller body, metres: two contacts with opposite normals are as far apart as two ends of it.
/// * `was_kept` - whether a contact was kept in the last tick.
///
/// Greedy: the contact farthest from its nearest kept neighbour comes next (Gonzalez 1985, Clustering to minimize the
/// maximum intercluster distance), never worse than half of the best spread.
///
/// Cost: O(`found` x `most`), no allocation.
pub(super) fn choose(
    found: &mut [Contact],
    most: usize,
    radius: f64,
    was_kept: impl Fn(&Contact) -> bool,
) -> usize {
    let found_len = merge(found, radius);
    let found = &mut found[..found_len];
    if found_len <= most {
        return found_len;
    }
    // The deepest stays at the front.
    for kept in 1..most {
        let score = |contact: &Contact| {
            let nearest = (found[..kept].iter())
                .map(|other| apart(contact, other, radius))
                .fold(f64::INFINITY, f64::min);
            let bonus = if was_kept(contact) { KEPT_BEFORE } else { 1.0 };
            nearest * bonus
        };
        let mut best = (kept, score(&found[kept]));
        for (at, contact) in found.iter().enumerate().skip(kept + 1) {
            let score = score(contact);
            // Of two equals the deeper wins: it comes first.
            if score > best.1 {
                best = (at, score);
            }
        }
        // The rest keeps its order.
        found[kept..=best.0].rotate_right(1);
    }
    let chosen = most.min(found_len);
    found[..chosen].sort_unstable_by(|x, y| {
        x.gap_m
            .total_cmp(&y.gap_m)
            .then_with(|| x.key().cmp(&y.key()))
    });
    chosen
}

/// Removes contacts that a deeper one represents; returns how many are left, at the front and in order.
fn merge(found: &mut [Contact], radius: f64) -> usize {
    let mut left = 0;
    for at in 0..found.len() {
        let contact = found[at];
        let same = |other: &Contact| {
            (other.shape_a, other.shape_b) == (contact.shape_a, contact.shape_b)
                && (other.point_a - contact.point_a).norm() <= SAME_PLACE * radius
                && other.normal.dot(&contact.normal) >= SAME_NORMAL
        };
        if !found[..left].iter().any(same) {
            found[left] = contact;
            left += 1;
        }
    }
    left
}

/// Squared distance of two contacts, square metres: of their points, plus the difference of their normals.
fn apart(one: &Contact, other: &Contact, radius: f64) -> f64 {
    let turn = (one.normal - other.normal).norm() * 0.5 * radius;
    (one.point_a - other.point_a).norm_squared() + turn * turn
}

#[cfg(test)]
mod tests {
    use super::super::at_place as contact;
    use super::*;
    use crate::math::Vec3;

    /// A grid of contacts over the unit square, a little deeper towards the middle.
    fn patch() -> Vec<Contact> {
        let mut all = Vec::new();
        for k in 0..81_u32 {
            let (x, y) = (f64::from(k % 9) / 8.0, f64::from(k / 9) / 8.0);
            let depth = 0.01 - 0.001 * ((x - 0.5).abs() + (y - 0.5).abs());
            all.push(contact(x, y, -depth, k));
        }
        all.sort_unstable_by(|x, y| x.gap_m.total_cmp(&y.gap_m));
        all
    }

    #[test]
    fn of_a_patch_the_deepest_and_its_corners_are_kept() {
        let mut all = patch();
        assert_eq!(choose(&mut all, 5, 1.0, |_| false), 5);
        let mut kept: Vec<_> = all[..5].iter().map(|c| c.triangle_a).collect();
        assert_eq!(kept[0], 40, "the deepest comes first");
        kept.sort_unstable();
        assert_eq!(kept, [0, 8, 40, 72, 80]);
    }

    #[test]
    fn a_patch_of_another_normal_is_kept_beside_a_larger_one() {
        let mut all = patch();
        let mut wall = contact(0.5, 0.5, -0.001, 99);
        wall.normal = Vec3::x();
        all.push(wall);
        let chosen = choose(&mut all, 4, 1.5, |_| false);
        assert!(all[..chosen].iter().any(|c| c.triangle_a == 99));
    }

    #[test]
    fn one_point_that_two_triangles_found_is_one_contact() {
        let mut all = vec![
            contact(0.0, 0.0, -0.02, 1),
            contact(1e-5, 0.0, -0.02, 2),
            contact(1.0, 0.0, -0.01, 3),
        ];
        assert_eq!(choose(&mut all, 4, 1.0, |_| false), 2);
        assert_eq!([all[0].triangle_a, all[1].triangle_a], [1, 3]);
    }

    #[test]
    fn of_two_equal_points_the_one_kept_before_stays() {
        let ends = [contact(0.0, 0.0, -0.02, 1), contact(1.0, 0.0, -0.01, 2)];
        let mut all = [ends[0], ends[1], contact(0.0, 1.0, -0.01, 3)];
        assert_eq!(choose(&mut all, 2, 1.0, |c| c.triangle_a == 3), 2);
        assert_eq!(all[1].triangle_a, 3);
        let mut all = [ends[0], ends[1], contact(0.0, 1.0, -0.01, 3)];
        assert_eq!(choose(&mut all, 2, 1.0, |_| false), 2);
        assert_eq!(all[1].triangle_a, 2);
    }
}
