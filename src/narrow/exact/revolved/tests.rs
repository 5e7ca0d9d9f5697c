//! Bounds between planes, against the planes in between.

use super::*;
use crate::math::{Pose, Quat};
use crate::shape::Convex;

/// Numbers without a pattern, 0 to 1.
fn spread(k: u32) -> f64 {
    (f64::from(k) * 0.618_033_988_749_894_9).fract()
}

#[test]
fn a_segment_without_length_is_a_point() {
    let (a, b) = (Convex::cylinder(0.3, 0.5), Convex::capsule(0.1, 0.0));
    let pose = Pose::from_parts(Vec3::new(0.05, 0.0, 0.1).into(), Quat::identity());
    let found = gap(&Pair::new(&a, &b, &pose), None).map(|g| (g.lower, g.upper));
    assert!(found.is_some_and(|(low, high)| (low + 0.25).abs() < 1e-14 && high - low < 1e-14));
}

#[test]
fn no_plane_between_two_shows_a_greater_gap_than_their_bound() {
    let shapes = [
        Convex::capsule(0.1, 0.4),
        Convex::cylinder(0.3, 0.5),
        Convex::cylinder(0.9, 0.05),
        Convex::cone(0.4, 0.5),
        Convex::cone(0.1, 0.9),
    ];
    let (mut asked, mut close) = (0, 0);
    for k in 0..4000 {
        let [a, b] = [3, 5].map(|step| &shapes[(k as usize * step + 1) / 3 % shapes.len()]);
        let lean = 0.3 * spread(k).powi(3);
        let turn = Quat::from_axis_angle(&Vec3::z_axis(), 6.0 * spread(3 * k))
            * Quat::from_axis_angle(&Vec3::x_axis(), lean + PI * f64::from(k % 2));
        let at = Vec3::new(0.3 * spread(7 * k).powi(2), 0.0, 0.6 * spread(11 * k) - 0.3);
        let pose = Pose::from_parts(at.into(), turn);
        let pair = Pair::new(a, b, &pose);
        let Some(planes) = Planes::of(&pair) else {
            continue;
        };
        let mut best = Best::from(None);
        let (from, width) = (2.0 * spread(13 * k), spread(17 * k).powi(4));
        let [start, end] = [from, from + width].map(|angle| planes.slice(angle, &mut best));
        let bound = planes.bound(&start, &end);
        for step in 0..=64 {
            let mut between = Best::from(None);
            planes.slice(from + width * f64::from(step) / 64.0, &mut between);
            assert!(between.shown <= bound + pair.tiny(), "{a:?} {b:?} {pose:?}");
            // What the pair itself says along any direction of the plane is not above it either.
            assert!(between.value <= bound + pair.tiny(), "{a:?} {b:?} {pose:?}");
        }
        asked += 1;
        close += u32::from(bound < best.shown + 1e-3);
    }
    assert!(
        asked > 3000 && close > asked / 3,
        "{asked} asked, {close} close"
    );
}
