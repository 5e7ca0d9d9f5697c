//! Bounds of sectors compared with directions within them; whole gaps compared with any directions.

use super::*;
use crate::builtin::Random;
use crate::math::{Point, Pose, Quat};
use crate::narrow::exact::{Warm, convex_gap};
use crate::shape::Convex;

/// A round shape of size 1 and a smaller one, with their pose.
fn couple(random: &mut Random, small: f64) -> (Convex, Convex, Pose) {
    let mut size = |of: f64| of * 10.0_f64.powf(-random.unit());
    let sizes = [size(1.0), size(1.0), size(small), size(small), size(small)];
    let [radius, half, x, y, z] = sizes;
    let kinds = random.bits();
    let round = match kinds % 2 {
        0 => Convex::cylinder(radius, half),
        _ => Convex::cone(radius, half),
    };
    let other = match kinds / 2 % 6 {
        0 | 1 => Convex::cuboid(Vec3::new(x, y, z)),
        2 | 3 => {
            let mut corner = || {
                let d = random.direction();
                Point::new(x * d.x, y * d.y, z * d.z)
            };
            Convex::hull(&[(); 9].map(|()| corner())).unwrap()
        }
        4 => Convex::cylinder(x, y),
        _ => Convex::cone(x, y),
    };
    let lean = match kinds / 12 % 3 {
        0 => 0.0,
        1 => 10.0_f64.powf(random.range(-9.0, -1.0)),
        _ => 3.0,
    };
    let off = match kinds / 36 % 3 {
        0 => 0.0,
        1 => 0.3 * radius.min(half),
        _ => small * random.unit(),
    };
    let turn = Quat::from_scaled_axis(random.direction() * lean);
    let pose = Pose::from_parts((random.direction() * off).into(), turn);
    if (kinds / 108).is_multiple_of(2) {
        (round, other, pose)
    } else {
        (other, round, pose.inverse())
    }
}

#[test]
fn no_direction_of_a_sector_is_less_deep_than_its_bound() {
    let mut random = Random::new(41);
    let (mut asked, mut close) = (0, 0);
    for _ in 0..3000 {
        let small = 10.0_f64.powf(random.range(-3.0, 0.3));
        let (a, b, pose) = couple(&mut random, small);
        let pair = Pair::new(&a, &b, &pose);
        let around = Around::of(&pair).unwrap();
        let mut best = Best {
            value: f64::NEG_INFINITY,
            normal: Vec3::z(),
            refined: None,
            along: Vec3::x(),
            n: [0.0, 1.0],
        };
        around.offer(&mut best, &Vec3::x(), [0.0, 1.0]);
        let (from, width) = (random.range(-PI, PI), 2.0 * random.unit().powi(3));
        let chain = around.chain(&along(from + width / 2.0), &mut best);
        let ends = [from, from + width].map(along);
        let (least, _) = chain.bound(&along(from + width / 2.0), &ends, width);
        if least.depth <= 0.0 {
            continue;
        }
        let mut seen = f64::INFINITY;
        for k in 0..500 {
            let at = along(from + width * random.unit());
            let turn = match k % 2 {
                0 => PI * random.unit(),
                _ => least.n[0].atan2(least.n[1]) + 0.1 * random.range(-1.0, 1.0),
            };
            let (x, z) = turn.sin_cos();
            let normal = around.normal(&out(&at, [x.abs(), z]));
            let depth = -normal.dot(&pair.support(&normal).w);
            assert!(depth >= least.depth - pair.tiny(), "{a:?} {b:?} {pose:?}");
            seen = seen.min(depth);
        }
        asked += 1;
        close += u32::from(seen < least.depth * 1.01);
    }
    assert!(asked > 1500 && close > asked / 3, "{asked}, {close} close");
}

/// Polytopes of 2,000 faces ended at widths of up to 5e-3 of the size.
#[test]
fn bug_what_lies_near_the_axis_of_a_drum_was_known_to_a_thousandth() {
    let mut random = Random::new(43);
    let (mut asked, mut loose) = (0, 0);
    for k in 0..2000 {
        let small = 10.0_f64.powf(random.range(-5.0, -0.3));
        let (a, b, pose) = couple(&mut random, small);
        let found = convex_gap(&a, &b, &pose, &mut Warm::default());
        let pair = Pair::new(&a, &b, &pose);
        let what = (k, &a, &b, &pose, &found);
        assert!(found.gap.max < 0.0 || found.gap.min > -small, "{what:?}");
        if found.gap.max >= 0.0 {
            continue;
        }
        for _ in 0..200 {
            let normal = random.direction();
            let gap = normal.dot(&pair.support(&normal).w);
            assert!(gap <= found.gap.max, "{what:?}");
        }
        let aside = |random: &mut Random, off: f64| {
            let normal = (found.normal + random.direction() * off).normalize();
            normal.dot(&pair.support(&normal).w)
        };
        for off in [1e-1, 1e-2, 1e-4, 1e-6, 1e-8] {
            let gap = aside(&mut random, off).max(aside(&mut random, off));
            assert!(gap <= found.gap.max, "{what:?}");
        }
        // The closest points lie on the planes that touch both.
        let on_a = pair.support(&found.normal).a - found.point_a.coords;
        let on_b = pair.support(&found.normal).b - found.point_b.coords;
        let off = on_a.dot(&found.normal).abs() + on_b.dot(&found.normal).abs();
        assert!(off <= 1e-5 * pair.scale, "{off} {what:?}");
        asked += 1;
        loose += u32::from(found.gap.width() > 2e-7 * pair.scale);
    }
    assert!(asked > 1500, "{asked}");
    assert!(loose * 200 <= asked, "{loose} of {asked} are loose");
}

/// An upright prism with this many sides.
fn prism(sides: u32) -> Convex {
    let corners = (0..2 * sides).map(|k| {
        let at = along(f64::from(k % sides) * 2.0 * PI / f64::from(sides)) * 0.015;
        Point::new(at.x, at.y, if k < sides { -0.005 } else { 0.005 })
    });
    Convex::hull(&corners.collect::<Vec<_>>()).unwrap()
}

/// 512 sides took five thousand looks at a thousand points, twice, and proved nothing that a polytope does not.
#[test]
fn bug_prisms_of_many_sides_are_proved_or_left_alone() {
    let drum = Convex::cylinder(1.0, 1.0);
    let place = Pose::translation(1e-4, 2e-4, 0.0);
    for (sides, proved) in [(24, true), (96, true), (512, false), (2048, false)] {
        let prism = prism(sides);
        let pair = Pair::new(&drum, &prism, &place);
        let gap = narrow_gap(&pair, None);
        let tight = gap.is_some_and(|gap| gap.is_tight(&pair));
        assert_eq!(tight, proved, "{sides}: {gap:?}");
    }
}
