//! Slivers between two planes: their distance is known up to the rounding of their corners.

use crate::builtin::Random;
use crate::math::{Pose, Quat, Vec3};
use crate::narrow::exact::{Warm, convex_gap};
use crate::shape::Convex;

/// One case: two slivers with one edge each, in two planes orthogonal to z, where the edges cross seen along z;
/// everything else of them is farther out.
struct Case {
    a: Convex,
    b: Convex,
    pos12: Pose,
    gap_m: f64,
}

/// Greatest extent of both and their distance, metres.
const SIZE_M: f64 = 4.0;

fn pose(random: &mut Random) -> Pose {
    let [x, y, z, w] = random.quaternion();
    let turn = Quat::new_normalize(nalgebra::Quaternion::new(w, x, y, z));
    Pose::from_parts((random.direction() * random.unit()).into(), turn)
}

/// A sliver with an edge in the plane at `z`, across the z axis; the rest is on the side of `out`, or in the plane too.
fn sliver(
    random: &mut Random,
    from: &Pose,
    (turn, z, out): (f64, f64, f64),
    solid: bool,
) -> Convex {
    let along = Vec3::new(turn.cos(), turn.sin(), 0.0) * random.range(0.2, 1.0);
    let thin = 10.0_f64.powf(random.range(-13.0, -2.0));
    let steep = [0.0, 1.0, 1e-3, 10.0][(random.bits() % 4) as usize];
    let mut corner = |part: f64, wide: f64, z: f64| {
        let across = Vec3::new(-along.y, along.x, 0.0) * (wide * random.unit());
        from.inverse_transform_point(&(along * part + across + Vec3::z() * z).into())
    };
    let beyond = z + out * thin * steep;
    let mut corners = vec![
        corner(-1.0, 0.0, z),
        corner(0.7, 0.0, z),
        corner(0.3, thin, beyond),
    ];
    if solid {
        corners.push(corner(-0.4, -thin, beyond));
        return Convex::hull_of_any(&corners).unwrap();
    }
    Convex::triangle([corners[0], corners[1], corners[2]])
}

fn case(random: &mut Random, turn: usize) -> Case {
    let (a, b) = (pose(random), pose(random));
    let gap_m = 10.0_f64.powf(random.range(-12.5, -7.0));
    let kind = turn % 3;
    let turns = random.range(0.0, 3.2);
    let beside = turns + 10.0_f64.powf(random.range(-13.0, 0.3));
    let first = if kind == 0 {
        // A box below the plane.
        let half = Vec3::new(0.6, 0.5, 0.4);
        (Convex::cuboid(half), Pose::translation(0.0, 0.0, -half.z))
    } else {
        (sliver(random, &a, (turns, 0.0, -1.0), kind == 1), a)
    };
    let second = sliver(random, &b, (beside, gap_m, 1.0), turn.is_multiple_of(2));
    Case {
        a: first.0,
        b: second,
        pos12: first.1.inverse() * b,
        gap_m,
    }
}

/// Of slivers with widths of 1e-13 to 1e-2 of their length, nearly parallel to each other, one in 17 was reported as
/// touching, and the intervals of one in six were wider than a hundredth of the gap. The rest would need more digits.
#[test]
fn bug_slivers_that_are_apart_were_told_as_touching() {
    let rounding = 64.0 * f64::EPSILON * SIZE_M;
    let mut random = Random::new(41);
    let (mut told, mut wide, mut touching) = (0, 0, 0);
    for turn in 0..20_000 {
        let case = case(&mut random, turn);
        let c = convex_gap(&case.a, &case.b, &case.pos12, &mut Warm::default());
        assert!(
            c.gap.min <= case.gap_m + rounding && case.gap_m - rounding <= c.gap.max,
            "turn {turn}: {} m apart: {c:?}",
            case.gap_m
        );
        // Gaps within the rounding of the relative pose are not counted.
        if case.gap_m > 8.0 * rounding {
            told += 1;
            touching += usize::from(c.collides());
            wide += usize::from(c.gap.max - c.gap.min > 0.01 * case.gap_m + 8.0 * rounding);
        }
    }
    let what = format!("of {told} apart {touching} touch, {wide} are wide");
    assert!(
        told > 15_000 && touching * 5000 < told && wide * 1000 < told,
        "{what}"
    );
}
