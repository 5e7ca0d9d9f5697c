//! Two bodies that both move and turn, of boxes, meshes and both together, compared with samples of the motion by exact
//! predicates on triangles.

use sweepd::math::{Point, Pose, Vec3};
use sweepd::wire::pair_flags;

use crate::oracle::meshes::{cuboid, trimesh};
use crate::oracle::rng::Rng;
use crate::oracle::{Placed, Truth, truth};
use crate::rig::{ALL, Rig, body, scene};
use crate::truth::Motion;

const CASES: usize = if cfg!(debug_assertions) { 60 } else { 600 };
const SAMPLES: u32 = 150;

/// The boxes of a body: half sides and position in the body.
type Parts = Vec<(Vec3, Vec3)>;

/// A body as text: a box, a mesh of it, or several shapes of both kinds.
fn shapes(rng: &mut Rng, kind: usize) -> (String, Parts) {
    let mut side = || {
        Vec3::new(
            rng.range(0.02, 0.3),
            rng.range(0.02, 0.3),
            rng.range(0.02, 0.3),
        )
    };
    // Centred at the origin, so that the centre of the geometry, which moves in a straight line, is the body's origin.
    let parts: Parts = match kind {
        0 | 1 => vec![(side(), Vec3::zeros())],
        _ => vec![
            (side(), Vec3::new(0.25, -0.05, 0.0)),
            (side(), Vec3::new(-0.25, 0.05, 0.0)),
        ],
    };
    let part = |(at, (half, place)): (usize, &(Vec3, Vec3))| {
        let placed = format!(
            "position = [{:?}, {:?}, {:?}] }}",
            place.x, place.y, place.z
        );
        if kind == 0 || kind == 2 && at == 0 {
            format!(
                "{{ type = \"box\", half_extents = [{:?}, {:?}, {:?}], {placed}",
                half.x, half.y, half.z
            )
        } else {
            let mesh = trimesh(&cuboid(*half), Some(true));
            format!("{}, {placed}", mesh.trim_end_matches(" }"))
        }
    };
    let all: Vec<_> = parts.iter().enumerate().map(part).collect();
    (format!("[{}]", all.join(", ")), parts)
}

/// The parts at a share of the motion, relative to a nearby point.
fn placed(parts: &Parts, motion: &Motion, s: f64, from: &Vec3) -> Vec<Placed> {
    let parts = parts.iter().map(|(half, place)| {
        let soup = cuboid(*half);
        let at = |p: &Point| Point::from(motion.place(&(p.coords + place), s) - from);
        let corners: Vec<_> = soup.vertices.iter().map(at).collect();
        Placed::new(
            &corners,
            &soup.faces,
            true,
            &Pose::identity(),
            &Vec3::zeros(),
        )
    });
    parts.collect()
}

/// The distance, or 0 if they overlap.
fn gap(a: &(Parts, Motion), b: &(Parts, Motion), s: f64) -> f64 {
    let from = a.1.from.translation.vector;
    let (one, other) = (placed(&a.0, &a.1, s, &from), placed(&b.0, &b.1, s, &from));
    let mut least = f64::INFINITY;
    for p in &one {
        for q in &other {
            least = least.min(match truth(p, q) {
                Truth::Apart(distance) => distance,
                Truth::Overlap(_) => 0.0,
            });
        }
    }
    least
}

#[test]
fn two_moving_bodies_of_any_kind_touch_when_samples_say_so_and_not_before() {
    let (mut hits, mut free, mut open) = (0, 0, 0);
    for case in 0..CASES {
        let mut rng = Rng::new(2000 + case as u64);
        let (text_a, parts_a) = shapes(&mut rng, case % 3);
        let (text_b, parts_b) = shapes(&mut rng, case / 3 % 3);
        let far = if case % 5 == 0 { 1e5 } else { 1.0 };
        let meet = rng.vector(far);
        let mut motion = |swing: f64| {
            let travel = rng.direction() * rng.range(1.0, 20.0);
            let from = meet + rng.vector(swing) - travel * rng.range(0.2, 0.8);
            Motion {
                from: rng.pose(from),
                travel,
                axis: rng.direction(),
                angle: rng.range(0.0, 3.1),
            }
        };
        let (a, b) = ((parts_a, motion(0.1)), (parts_b, motion(0.6)));
        let swept = "continuous = true";
        let mut rig = Rig::new(&scene(
            "",
            &[
                body(1, [0.0; 3], &text_a, swept),
                body(2, [0.0; 3], &text_b, swept),
            ],
        ));
        rig.place(1, &a.1.from);
        rig.place(2, &b.1.from);
        rig.send(ALL);
        if !rig.out.pairs.is_empty() {
            continue;
        }
        rig.place(1, &a.1.end());
        rig.place(2, &b.1.end());
        rig.send(ALL);
        let row = rig.pair(1, 2).copied();
        let slack = 1e-11 + 1e-14 * far;
        let told = row.map_or(0, |row| row.flags);
        let first = (0..=SAMPLES)
            .map(|k| f64::from(k) / f64::from(SAMPLES))
            .find(|&s| gap(&a, &b, s) == 0.0);
        if told & pair_flags::SWEPT_HIT != 0 {
            let row = row.unwrap();
            hits += 1;
            assert!(row.toi_max - row.toi_min <= 1e-6, "case {case}: {row:?}");
            assert!(
                gap(&a, &b, row.toi_max) <= slack,
                "case {case}: {} m apart {row:?}",
                gap(&a, &b, row.toi_max)
            );
            assert!(
                first.is_none_or(|first| row.toi_min <= first + 1e-12),
                "case {case}: {first:?} {row:?}"
            );
        } else if told & pair_flags::SWEPT_OPEN != 0 {
            open += 1;
            assert!(
                first.is_none_or(|first| row.unwrap().toi_min <= first),
                "case {case}: {first:?} {row:?}"
            );
        } else {
            free += 1;
            assert!(
                first.is_none(),
                "case {case}: missed, they overlap at {first:?}"
            );
        }
    }
    println!("{hits} hits, {free} free, {open} open");
    assert!(hits > CASES / 5 && free > CASES / 10, "{hits} {free}");
    assert!(open * 50 <= CASES, "{open} open");
}
