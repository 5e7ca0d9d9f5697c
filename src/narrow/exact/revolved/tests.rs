//! Bounds between planes, compared with the planes in between.

use super::*;
use crate::math::{Point, Pose, Quat};
use crate::narrow::exact::{Warm, convex_gap};
use crate::shape::Convex;

/// Quasi-random numbers, 0 to 1.
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
            // The pair's own `f` along any direction of the plane is not above it either.
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

/// Pseudorandom numbers, 0 to 1, of all step sizes. Source: Steele et al. 2014, Fast splittable pseudorandom numbers.
fn hashed(k: u64) -> f64 {
    let z = (k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ z >> 31) >> 11) as f64 / 9_007_199_254_740_992.0
}

/// How far a point lies outside a shape, metres; negative inside.
fn outside(shape: &Convex, point: Point) -> f64 {
    let at = Pose::from_parts(point.coords.into(), Quat::identity());
    convex_gap(shape, &Convex::sphere(0.0), &at, &mut Warm::default()).best_m
}

#[test]
fn bug_closest_points_of_shapes_on_nearly_one_axis_were_off_them() {
    let mut asked = 0;
    for k in 0..20_000 {
        let at = |step: u64| hashed(64 * k + step);
        let shape = |which: f64, size: f64, long: f64| {
            if which < 0.5 {
                Convex::cylinder(0.1 + size, 0.1 + long)
            } else {
                Convex::cone(0.1 + size, 0.1 + long)
            }
        };
        let [a, b] = [0, 3].map(|from| shape(at(from), at(from + 1), at(from + 2)));
        let lean = 0.3 * 10.0_f64.powf(-9.0 * at(6));
        let over = if k % 2 == 0 { 0.0 } else { PI };
        let turn = Quat::from_axis_angle(&Vec3::z_axis(), 6.0 * at(7))
            * Quat::from_axis_angle(&Vec3::x_axis(), lean + over)
            * Quat::from_axis_angle(&Vec3::z_axis(), 6.0 * at(8));
        let (off, aside) = (0.3 * 10.0_f64.powf(-9.0 * at(9)), 6.3 * at(10));
        let place = Vec3::new(off * aside.cos(), off * aside.sin(), at(11) - 0.5);
        let pose = Pose::from_parts(place.into(), turn);
        let found = convex_gap(&a, &b, &pose, &mut Warm::default());
        if found.gap.max >= 0.0 {
            continue;
        }
        asked += 1;
        let on_b = pose.inverse() * found.point_b;
        let off = outside(&a, found.point_a)
            .abs()
            .max(outside(&b, on_b).abs());
        let size = a.reach() + b.reach() + place.norm();
        assert!(
            off <= 1e-5 * size,
            "{k}: {off:e} {a:?} {b:?} {pose:?} {found:?}"
        );
    }
    assert!(asked > 10_000, "{asked} asked");
}
