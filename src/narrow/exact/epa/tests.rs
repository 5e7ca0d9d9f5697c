//! Polytopes: how many faces they take, and runs that begin with known features compared with runs from scratch.

use super::*;
use crate::builtin::Random;
use crate::math::{Pose, Quat};
use crate::narrow::exact::{Closest, Shell, Warm, convex_gap, convex_gap_along};
use crate::shape::Convex;

fn forget() {
    SCRATCH.with(|scratch| *scratch.borrow_mut() = Polytope::default());
}

/// Both intervals hold the true gap.
fn agree(one: &Closest, other: &Closest, what: &dyn std::fmt::Debug) {
    let (x, y) = (one.gap, other.gap);
    assert!(x.min <= y.max && y.min <= x.max, "{x:?} {y:?} of {what:?}");
}

fn faces_made() -> usize {
    SCRATCH.with(|scratch| scratch.borrow().faces.len())
}

/// They took up to 24,000 faces and 20 ms a query, and ended at a width of a thousandth.
#[test]
fn bug_solids_of_revolution_nearly_on_one_axis_took_milliseconds() {
    let shapes = [
        Convex::capsule(0.1, 0.4),
        Convex::cylinder(0.3, 0.5),
        Convex::cylinder(0.25, 0.2),
        Convex::cone(0.4, 0.5),
    ];
    let parts = [
        0.0, 1e-13, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.05, 0.1,
    ];
    let (mut asked, mut many, mut loose) = (0, 0, 0);
    for (a, b) in shapes
        .iter()
        .flat_map(|a| shapes.iter().map(move |b| (a, b)))
    {
        for (off, lean) in parts
            .iter()
            .flat_map(|x| parts.iter().map(move |y| (*x, *y)))
        {
            let mut warm = Warm::default();
            for lift in [0.13, 0.130_01] {
                let at = Vec3::new(0.6 * off, 0.8 * off, lift);
                let turn = Quat::from_axis_angle(&Vec3::x_axis(), lean);
                forget();
                let c = convex_gap(a, b, &Pose::from_parts(at.into(), turn), &mut warm);
                assert!(faces_made() <= FACES_MAX + 128, "{a:?} {b:?} {at:?} {lean}");
                asked += 1;
                many += usize::from(faces_made() > 512);
                loose += usize::from(!c.finished);
            }
        }
    }
    assert!(many * 50 <= asked, "{many} of {asked} grew large polytopes");
    assert!(loose * 1000 <= asked, "{loose} of {asked} are not finished");
}

/// Deep, shallow, apart and back again: a polytope begun where the last one ended agrees with a new one.
#[test]
fn a_polytope_begun_at_the_last_answer_says_what_one_begun_anew_does() {
    let mut corners = Vec::new();
    for k in 0..12 {
        let (turn, up) = (f64::from(k) * 2.4, f64::from(k) / 6.0 - 0.9);
        let across = (1.0_f64 - up * up).sqrt();
        corners.push(
            Vec3::new(
                0.4 * across * turn.cos(),
                0.5 * across * turn.sin(),
                0.3 * up,
            )
            .into(),
        );
    }
    let shapes = [
        Convex::cuboid(Vec3::new(0.3, 0.4, 0.5)),
        Convex::hull(&corners).unwrap(),
        Convex::capsule(0.1, 0.4),
        Convex::cylinder(0.3, 0.5),
        Convex::cone(0.4, 0.5),
    ];
    let (mut deep, mut apart, mut begun, mut kept) = (0, 0, 0, 0);
    for (a, b) in shapes
        .iter()
        .flat_map(|a| shapes.iter().map(move |b| (a, b)))
    {
        let (mut warm, mut followed) = (Warm::default(), Warm::default());
        let mut shell = Shell::default();
        for step in 0..200 {
            let at = f64::from(step);
            let out = 0.5 + 0.5 * (at * 0.05).sin();
            let to = Vec3::new(out, 0.2 * (at * 0.03).cos(), 0.1 * (at * 0.07).sin());
            let turn = Quat::from_scaled_axis(Vec3::new(0.01, 0.02, -0.015) * at);
            let pose = Pose::from_parts(to.into(), turn);
            begun += usize::from(warm.held.deep);
            kept += usize::from(!shell.is_empty());
            let (one, other) = (
                convex_gap(a, b, &pose, &mut warm),
                convex_gap(a, b, &pose, &mut Warm::default()),
            );
            let along = convex_gap_along(a, b, &pose, &mut followed, &mut shell);
            agree(&one, &other, &(step, a, b));
            agree(&along, &other, &(step, a, b));
            assert!(one.finished && other.finished && along.finished);
            deep += usize::from(one.gap.max < 0.0);
            apart += usize::from(one.gap.min > 0.0);
        }
    }
    assert!(
        deep > 1000 && apart > 1000 && begun > 500 && kept > 500,
        "{deep} {apart} {begun} {kept}"
    );
}

/// Needles, discs and everything in between, along ways of small and large steps: all intervals are some 1e-7 wide, so
/// warm-started results can be wrong by no more. Nor can those started from what another pair left, which may be a
/// shell of cores of the same kinds and very different sizes.
#[test]
fn answers_carried_along_a_way_agree_with_answers_anew_for_all_proportions() {
    let mut random = Random::new(23);
    let (mut deep, mut loose, mut asked, mut kept, mut strange) = (0, 0, 0, 0, 0);
    // The shell of the last pair of each combination of kinds.
    let mut left = vec![Shell::default(); 15];
    for turn in 0..2000 {
        let mut shape = |kind: u32| {
            let mut size = || 10.0_f64.powf(random.range(-2.0, 0.3));
            let (x, y, z) = (size(), size(), size());
            match kind % 5 {
                0 => Convex::cuboid(Vec3::new(x, y, z)),
                1 => Convex::capsule(x, y),
                2 => Convex::cone(x, y),
                3 => Convex::cylinder(x, y),
                _ => Convex::cylinder(x, 0.3 * x),
            }
        };
        // One of the two has a circle.
        let (a, b) = (shape(turn), shape(turn / 5 % 3 + 2));
        let size = 0.5 * (a.reach() + b.reach());
        let mut at = random.direction() * size * random.unit();
        // Faces on faces, too.
        let by = if random.unit() < 0.3 { 0.0 } else { 3.0 };
        let mut rotation = Quat::from_scaled_axis(random.direction() * by);
        let step = 10.0_f64.powf(random.range(-6.0, -0.5)) * random.unit();
        let way = random.direction() * size * step;
        let spin = Quat::from_scaled_axis(random.direction() * step);
        let (mut warm, mut followed) = (Warm::default(), Warm::default());
        let mut shell = Shell::default();
        for _ in 0..16 {
            at += way;
            rotation = Quat::new_normalize((spin * rotation).into_inner());
            let pose = Pose::from_parts(at.into(), rotation);
            let what = (&a, &b, &pose);
            let anew = convex_gap(&a, &b, &pose, &mut Warm::default());
            let mut other = left[turn as usize % left.len()].clone();
            let stranger = convex_gap_along(&a, &b, &pose, &mut warm.clone(), &mut other);
            let carried = convex_gap(&a, &b, &pose, &mut warm);
            let along = convex_gap_along(&a, &b, &pose, &mut followed, &mut shell);
            for one in [&carried, &along, &stranger] {
                agree(one, &anew, &what);
                loose += usize::from(!one.finished);
            }
            asked += 1;
            deep += usize::from(carried.gap.max < 0.0);
            kept += usize::from(!shell.is_empty());
            strange += usize::from(!other.is_empty());
        }
        left[turn as usize % 15] = shell;
    }
    assert!(deep * 2 > asked, "{deep} of {asked}");
    assert!(
        kept * 4 > asked && strange * 8 > asked,
        "{kept} and {strange} of {asked}"
    );
    assert!(loose * 1000 <= asked, "{loose} of {asked} are not finished");
}

/// Polytopes of cylinders, some of them with a step that failed.
#[test]
fn a_shell_is_the_surface_it_was_left_by_or_nothing() {
    let mut random = Random::new(31);
    let (mut same, mut broken) = (0, 0);
    for turn in 0..400 {
        let (a, b) = (Convex::cylinder(0.3, 0.5), Convex::cylinder(0.4, 0.3));
        let at = random.direction() * 0.3 * random.unit();
        let rotation = Quat::from_scaled_axis(random.direction() * 3.0);
        let pose = Pose::from_parts(at.into(), rotation);
        let pair = Pair::new(&a, &b, &pose);
        let mut polytope = Polytope::default();
        let axes = [Vec3::x(), Vec3::y(), Vec3::z()];
        polytope.start(&pair, &Simplex::default(), &axes).unwrap();
        for _ in 0..turn % 16 {
            let nearest = polytope.nearest().unwrap();
            let new = pair.support(&-polytope.faces[nearest].normal);
            assert!(polytope.grow(nearest, new, pair.tiny()));
        }
        // A step that fails leaves a hole.
        let whole = turn % 3 != 0;
        if !whole {
            let last = polytope.faces.len() - 1;
            polytope.faces[last].alive = false;
        }
        let mut shell = Shell::default();
        polytope.leave(&pair, &mut shell);
        let mut again = Polytope::default();
        let begun = again.start_with(&pair, &shell, |_| None);
        assert_eq!(shell.is_empty(), !whole, "{} {begun}", polytope.faces.len());
        if !whole {
            broken += 1;
            assert!(!begun);
            continue;
        }
        let distances = |polytope: &Polytope| -> Vec<f64> {
            let alive = polytope.faces.iter().filter(|face| face.alive);
            alive.map(|face| face.distance).collect()
        };
        let (one, other) = (distances(&polytope), distances(&again));
        assert_eq!(one.len(), other.len());
        for (x, y) in one.iter().zip(&other) {
            // Positions on circles are kept as f32, which tilts thin faces.
            assert!((x - y).abs() < 1e-4, "{x} {y}");
        }
        same += 1;
    }
    assert!(same > 100 && broken > 50, "{same} {broken}");
}

/// Their estimate was the depth of a polytope with a capped number of faces, which is off by 1e-4.
#[test]
fn bug_a_post_within_the_edge_of_a_box_had_a_poor_estimate() {
    let half = Vec3::new(1.0, 1.0, 1.0);
    let post = Convex::cylinder(0.5, 2.0);
    for lean in [0.0, 1e-9, 1e-6] {
        let turn = Quat::from_axis_angle(&Vec3::x_axis(), lean);
        let at = Pose::from_parts(Vec3::new(1.0, 1.0, 0.0).into(), turn);
        let c = convex_gap(&Convex::cuboid(half), &post, &at, &mut Warm::default());
        // Every direction between the two faces is equally good: the radius.
        assert!((c.best_m + 0.5).abs() <= 2.0 * lean + 1e-9, "{lean}: {c:?}");
        assert!(c.gap.contains(c.best_m), "{lean}: {c:?}");
        let along = c.normal.dot(&(c.point_b - c.point_a));
        assert!((along - c.best_m).abs() <= 1e-12, "{lean}: {c:?}");
    }
}

/// A run from scratch has no points yet: it reported coplanar cores that are apart as touching.
#[test]
fn bug_a_flat_difference_asked_from_nothing_told_of_points_that_are_none() {
    let flat =
        Convex::triangle([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[x, y]| [x, y, 0.0].into()));
    let apart = Pose::translation(3.0, 0.0, 0.0);
    let pair = Pair::new(&flat, &flat, &apart);
    let upright = [Vec3::x(), Vec3::y(), Vec3::z()];
    let gap = Polytope::default().run(&pair, &Simplex::default(), &upright, None);
    assert!(gap.lower <= 2.0 && gap.upper >= 2.0, "{gap:?}");
}
