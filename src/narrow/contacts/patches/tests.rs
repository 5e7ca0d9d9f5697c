//! The manifold of a patch: which points of squares and lines are kept, and which patches are one.

use super::super::at_place as contact;
use super::*;

fn names(found: &mut [Contact]) -> Vec<u64> {
    let left = reduce(found, 1.0, |_| false);
    let mut names: Vec<u64> = found[..left].iter().map(|c| c.feature).collect();
    names.sort_unstable();
    names
}

#[test]
fn of_a_flat_square_the_corners_are_kept_whatever_rounding_says() {
    let mut found = Vec::new();
    for k in 0..81_u32 {
        let (x, y) = (f64::from(k % 9) / 8.0, f64::from(k / 9) / 8.0);
        let rounding = 1e-15 * f64::from(k * 37 % 11);
        found.push(contact(x, y, -0.01 - rounding, k));
    }
    assert_eq!(names(&mut found), [0, 8, 72, 80]);
}

#[test]
fn the_deepest_is_kept_and_a_line_has_two_ends() {
    let mut found: Vec<_> = (0..9_u32)
        .map(|k| {
            let depth = if k == 3 { 0.02 } else { 0.01 };
            contact(f64::from(k), 0.0, -depth, k)
        })
        .collect();
    assert_eq!(names(&mut found), [0, 3, 8]);
    let mut found: Vec<_> = (0..9_u32)
        .map(|k| contact(f64::from(k), 0.0, -0.01, k))
        .collect();
    assert_eq!(names(&mut found), [0, 8]);
}

#[test]
fn patches_that_meet_with_one_normal_are_one_and_those_far_apart_are_two() {
    let square = |x: f64, patch: u32| {
        (0..4_u32).map(move |k| {
            let mut corner = contact(x + f64::from(k % 2), f64::from(k / 2), -0.01, 0);
            corner.feature = u64::from(10 * patch + k);
            corner.patch = patch;
            corner
        })
    };
    let mut found: Vec<_> = square(0.0, 0).chain(square(1.0, 1)).collect();
    assert_eq!(names(&mut found), [0, 2, 11, 13]);
    let mut found: Vec<_> = square(0.0, 0).chain(square(3.0, 1)).collect();
    assert_eq!(names(&mut found).len(), 8);
    let mut found: Vec<_> = square(0.0, 0).chain(square(1.0, 1)).collect();
    found[4..].iter_mut().for_each(|c| c.normal = Vec3::x());
    assert_eq!(names(&mut found).len(), 8);
}
