//! Newton's step compared with the whole system, and the bounds of the elements compared with all directions.

use super::set::Rim;
use super::*;
use crate::builtin::Random;
use crate::math::{Pose, Quat};
use crate::narrow::exact::polytope::Polytope;
use crate::narrow::exact::{Warm, convex_gap};
use crate::shape::Convex;
use nalgebra::{DMatrix, DVector};

/// The full system of one step: two coordinates, then the change of each weight except the first.
fn whole(set: &Set) -> Option<Vec<f64>> {
    let size = set.count + 1;
    let (mut m, mut right) = (DMatrix::zeros(size, size), DVector::zeros(size));
    let first = set.actives[0];
    for x in &set.actives[..set.count] {
        let [xx, xy, yy] = x.bend();
        let bend = [[xx, xy], [xy, yy]];
        for row in 0..2 {
            for column in 0..2 {
                m[(row, column)] -= x.weight * bend[row][column];
            }
            m[(row, row)] -= x.weight * x.value;
            right[row] -= x.weight * x.slope[row];
        }
    }
    for (j, x) in set.actives[1..set.count].iter().enumerate() {
        for k in 0..2 {
            m[(k, 2 + j)] = x.slope[k] - first.slope[k];
            m[(2 + j, k)] = m[(k, 2 + j)];
        }
        right[2 + j] = first.value - x.value;
    }
    Some(m.lu().solve(&right)?.iter().copied().collect())
}

#[test]
fn a_step_solves_the_whole_system() {
    let mut random = Random::new(7);
    for turn in 0..3000 {
        let mut set = Set {
            count: turn % 3 + 1,
            ..Set::default()
        };
        for x in &mut set.actives {
            x.weight = random.unit();
            x.value = random.range(-1.0, 1.0);
            x.slope = [random.range(-1.0, 1.0), random.range(-1.0, 1.0)];
            let (p, q) = (random.range(-1.0, 1.0), random.range(-1.0, 1.0));
            x.rims[0] = Rim {
                lean: 1.0,
                bend_m: 1.0,
                along: [p, q],
            };
        }
        let Some(known) = whole(&set) else { continue };
        let (x, y, change) = step(&set).unwrap();
        let size = known.iter().fold(1.0_f64, |most, v| most.max(v.abs()));
        for (found, known) in [x, y, change[1], change[2]].iter().zip(&known) {
            assert!(
                (found - known).abs() < 1e-9 * size * size,
                "{set:?}: {found} {known}"
            );
        }
        assert!(change.iter().sum::<f64>().abs() < 1e-9 * size);
    }
}

/// Solids with faces, edges and rims, in all pairs, at random poses: Newton's results for their overlap.
fn overlaps(mut each: impl FnMut(&Pair<'_>, &Refined, &mut Random)) {
    let mut random = Random::new(19);
    let shapes = [
        Convex::cuboid(Vec3::new(0.3, 0.4, 0.5)),
        Convex::capsule(0.1, 0.4),
        Convex::cylinder(0.3, 0.5),
        Convex::cylinder(0.4, 0.1),
        Convex::cone(0.4, 0.5),
    ];
    for (a, b) in shapes
        .iter()
        .flat_map(|a| shapes.iter().map(move |b| (a, b)))
    {
        for turn in 0..120 {
            let spread = random.range(0.05, 0.5);
            let at = random.direction() * spread;
            // Every fourth is upright or lies flat: faces on faces, rims on faces.
            let upright = turn % 4 == 0;
            let axis = random.direction();
            let by = if upright { 0.0 } else { random.range(0.0, 3.0) };
            let rotation = Quat::from_scaled_axis(axis * by);
            let pose = Pose::from_parts(at.into(), rotation);
            let mut warm = Warm::default();
            let _ = convex_gap(a, b, &pose, &mut warm);
            let pair = Pair::new(a, b, &pose);
            if let Some(found) = resume(&pair, &warm.held, &warm.normal) {
                each(&pair, &found, &mut random);
            }
        }
    }
}

#[test]
fn no_direction_within_a_cap_is_better() {
    let (mut caps, mut wide) = ([0; 4], 0);
    overlaps(|pair, found, random| {
        let Some(cap) = found.cap.filter(|cap| cap.loss_m < 1e-9) else {
            return;
        };
        caps[usize::from(found.held.count)] += 1;
        let angle = 2.0 * cap.half().atan();
        wide += u32::from(angle > 0.2);
        let (one, other) = frame(&found.normal);
        for _ in 0..100 {
            let (turn, by) = (random.range(0.0, 6.3), random.unit() * angle);
            let aside = one * turn.cos() + other * turn.sin();
            let n = found.normal * by.cos() + aside * by.sin();
            let value = n.dot(&pair.support(&n).w);
            assert!(
                value <= found.value + cap.loss_m + pair.pad(),
                "{value} {found:?} {by} of {cap:?}"
            );
        }
    });
    assert!(caps[1..].iter().all(|&count| count > 50), "{caps:?}");
    assert!(wide * 2 > caps.iter().sum::<u32>(), "{wide} of {caps:?}");
}

/// What the features lose by rounding is taken off the answer, too.
#[test]
fn an_answer_under_a_cap_is_no_tighter_than_the_cap() {
    let mut under = 0;
    overlaps(|pair, found, _| {
        let loss_m = pair.tolerance() / 4.0;
        let Some(mut cap) = found.cap.filter(|cap| cap.loss_m < loss_m) else {
            return;
        };
        cap.loss_m = loss_m;
        let lossy = Refined {
            cap: Some(cap),
            ..*found
        };
        let Some(gap) = Polytope::default().depth_under(pair, &lossy, None) else {
            return;
        };
        under += 1;
        assert!(gap.upper >= found.value + loss_m, "{gap:?} {lossy:?}");
        // Nor is there an answer if nothing is left of the depth.
        let shallow = Refined {
            value: -loss_m / 2.0,
            ..lossy
        };
        assert!(
            Polytope::default()
                .depth_under(pair, &shallow, None)
                .is_none()
        );
    });
    assert!(under > 500, "{under}");
}

/// Otherwise a cap would hide better directions than its own.
#[test]
fn what_stands_for_a_cap_is_not_reached_outside_of_it() {
    for half in [0.026, 0.05, 0.15, 0.25, 0.42] {
        let cap = Cap::of_face(1.0, half, 0.0).unwrap();
        let angle = 2.0 * cap.half().atan();
        assert!(cap.lift() < 1.0);
        for step in 0..=1000 {
            let by = angle + (std::f64::consts::PI - angle) * f64::from(step) / 1000.0;
            let most = by.cos() + cap.rise() * by.sin();
            assert!(most <= cap.lift() + 1e-15, "{angle} {by}: {most}");
        }
    }
}

#[test]
fn a_disc_is_met_face_on_where_the_other_touches_inside_its_rim() {
    let (mut met, mut aside) = (0, 0);
    let mut random = Random::new(5);
    let (cone, flat) = (Convex::cone(0.2, 0.3), Convex::cylinder(0.4, 0.1));
    for _ in 0..400 {
        // Its tip points down into the disc.
        let lean = Quat::from_scaled_axis(Vec3::new(3.0, random.range(-0.3, 0.3), 0.0));
        let at = Vec3::new(random.range(-0.6, 0.6), random.range(-0.6, 0.6), 0.35);
        let pose = Pose::from_parts(at.into(), lean);
        let tip = pose * crate::math::Point::new(0.0, 0.0, 0.3);
        let pair = Pair::new(&flat, &cone, &pose);
        let mut set = Set::default();
        set.add(pair.support(&Vec3::z()).of_a, 0, 1.0);
        let found = disc::face_on(&pair, &set, &Vec3::new(0.05, 0.0, 1.0).normalize());
        let inside = tip.x.hypot(tip.y) < 0.4;
        assert_eq!(found.is_some(), inside, "{tip}");
        let Some(found) = found else {
            aside += 1;
            continue;
        };
        met += 1;
        assert!(
            (found.value - (tip.z - 0.1)).abs() < 1e-14,
            "{}",
            found.value
        );
        assert!((found.point_a - Vec3::new(tip.x, tip.y, 0.1)).norm() < 1e-14);
        // The result is the same seen from the other side.
        let turned = Pair::new(&cone, &flat, &pose.inverse());
        let n = -pair.to_b(&Vec3::z());
        let mut set = Set::default();
        set.add(0, pair.support(&Vec3::z()).of_a, 1.0);
        let other = disc::face_on(&turned, &set, &n).unwrap();
        assert!((other.value - found.value).abs() < 1e-14);
        assert!((other.point_b - pair.to_b(&(found.point_a - pair.at))).norm() < 1e-14);
    }
    assert!(met > 50 && aside > 50, "{met} {aside}");
}
