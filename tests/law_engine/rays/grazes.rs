//! Rays that are hard to decide: those that graze a shape, and those of unlimited length.

use sweepd::math::{Point, Pose, Vec3, pose_from};
use sweepd::wire::{RayFound, Verdict};

use super::{ask, json};
use crate::oracle::rng::Rng;
use crate::rig::{ALL, Rig, body, scene};

const BALL: &str = "{ type = \"sphere\", radius = 1 }";

#[test]
fn bug_what_is_farther_than_a_shape_may_be_large_is_hit_too() {
    let corner = [1e12, 1e12, 1e12];
    for (from, at) in [
        ([0.0; 3], [1.1e9, 0.0, 0.0]),
        ([1.0, 2.0, 3.0], [-3e10, 4e10, 1.0]),
        ([-1e12, -1e12, -1e12], corner),
    ] {
        let mut rig = Rig::new(&scene("", &[body(1, at, BALL, "")]));
        rig.send(ALL);
        let way = Vec3::from(at) - Vec3::from(from);
        let found = ask(rig.engine.world(), &json(&Vec3::from(from), &way, ""));
        let (truth, slack) = (way.norm() - 1.0, 1e-13 * way.norm());
        assert_ne!(found.verdict, Verdict::Apart.code(), "{found:?}");
        assert!(found.t_min_m <= truth + slack, "{truth} {found:?}");
        if slack < 1e-2 {
            assert_eq!(found.verdict, Verdict::Colliding.code(), "{found:?}");
            let off = (found.t_best_m.unwrap() - truth).abs();
            assert!(off <= slack, "{off} {found:?}");
        }
    }
    // A half-space that is tested first against the whole ray.
    let floor = "name = \"floor\"\nid = 9\nmoves = false\nshape = { type = \"half_space\", normal = [0, 0, 1], offset = -5.0 }\n";
    let rig = Rig::new(&scene("", &[floor.to_owned()]));
    let found = ask(
        rig.engine.world(),
        &json(&Vec3::new(9.0, 0.0, 3.0), &-Vec3::z(), ""),
    );
    assert!((found.t_best_m.unwrap() - 8.0).abs() <= 1e-12, "{found:?}");
    let point = Point::from(found.point.unwrap());
    assert!((point.z + 5.0).abs() <= 1e-12, "{found:?}");
}

/// The rounding error at the end of a ray grows with its length, and far out it exceeds the ray's height above a floor.
#[test]
fn bug_a_ray_along_a_half_space_hit_it_at_the_end_of_the_world() {
    let floor = "name = \"floor\"\nid = 9\nmoves = false\nshape = { type = \"half_space\", normal = [0, 0, 1], offset = 0.0 }\n";
    let rig = Rig::new(&scene("", &[floor.to_owned()]));
    for height in [1e-9, 1e-6, 1e-3, 0.01, 0.1, 1.0] {
        for (more, may_doubt) in [("", true), (", \"max_m\": 100000", height < 1e-8)] {
            let from = Vec3::new(0.0, 0.0, height);
            let found = ask(rig.engine.world(), &json(&from, &Vec3::x(), more));
            assert_ne!(
                found.verdict,
                Verdict::Colliding.code(),
                "{height} {found:?}"
            );
            let apart = found.verdict == Verdict::Apart.code();
            assert!(apart || may_doubt, "{height} {found:?}");
        }
    }
}

/// The hit of a ray on one body at a pose.
fn cast(shape: &str, pose: &Pose, from: &Vec3, direction: &Vec3) -> RayFound {
    let mut rig = Rig::new(&scene("", &[body(1, [0.0; 3], shape, "")]));
    rig.place(1, pose);
    rig.send(ALL);
    ask(rig.engine.world(), &json(from, direction, ""))
}

/// Coarse pieces of a ray have larger errors than fine ones; a contact within these errors was not examined further.
#[test]
fn bug_a_ray_that_grazes_a_cone_is_not_hit_before_it_is_there() {
    let shape =
        "{ type = \"cone\", radius = 1.1548372989396636, half_height = 0.0003891368532240094 }";
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let pose = pose_from([0.584_812_885_142_032_7, 0.0, 0.0], [0.0, 0.0, half, half]).unwrap();
    let from = Vec3::new(
        0.252_924_867_433_011_07,
        7.369_394_377_155_151e-17,
        0.823_114_750_457_348_2,
    );
    let direction = Vec3::new(
        -0.706_868_552_881_267_8,
        1.569_563_485_584_497_4e-16,
        -0.707_344_929_258_379_8,
    );
    let found = cast(shape, &pose, &from, &direction);
    let truth = 1.164_218_266_431_880_8;
    assert!(found.t_min_m <= truth + 1e-15, "{found:?}");
    assert!(
        found.t_max_m.is_none_or(|until| until >= truth - 2e-11),
        "{found:?}"
    );
}

#[test]
fn bug_the_point_where_a_ray_passes_the_rim_of_a_sheet_is_on_it() {
    let shape = "{ type = \"trimesh\", solid = false, vertices = [[-1, -1, 0], [-1, 0, 0], [-1, 1, 0], [0, -1, 0], [0, 0, 0], [0, 1, 0], [1, -1, 0], [1, 0, 0], [1, 1, 0]], faces = [[0, 3, 1], [1, 3, 4], [1, 4, 2], [2, 4, 5], [3, 6, 4], [4, 6, 7], [4, 7, 5], [5, 7, 8]] }";
    let turn = [
        -0.279_073_697_839_378_3,
        -0.741_128_474_000_061,
        -0.328_258_215_513_421_05,
        0.514_871_828_855_047,
    ];
    let pose = pose_from([0.0; 3], turn).unwrap();
    let from = Vec3::new(
        -0.351_483_555_659_378_3,
        3.097_771_870_390_983,
        1.497_978_470_000_918_9,
    );
    let direction = Vec3::new(
        0.367_721_432_932_689_8,
        -0.823_014_346_715_525_6,
        -0.432_929_939_900_61,
    );
    let found = cast(shape, &pose, &from, &direction);
    assert!((found.t_min_m - 3.0).abs() <= 1e-11, "{found:?}");
    if let Some(point) = found.point {
        let seen = pose.inverse_transform_point(&Point::from(point)).coords;
        let over = seen.map(|x| (x.abs() - 1.0).max(0.0));
        let off = Vec3::new(over.x, over.y, seen.z).norm();
        assert!(off <= 1e-11, "{off} {found:?}");
    }
}

/// For a ball, a capsule or a box: the shape, its distance function, a point of its surface, and a direction that
/// grazes it there.
fn grazed(kind: usize, rng: &mut Rng) -> (String, fn(&Vec3) -> f64, Vec3, Vec3) {
    match kind {
        0 => {
            let at = rng.direction();
            let way = at.cross(&rng.direction()).normalize();
            (BALL.to_owned(), |p| (p.norm() - 1.0).max(0.0), at, way)
        }
        1 => {
            let angle = rng.range(0.0, std::f64::consts::TAU);
            let at = Vec3::new(angle.cos(), angle.sin(), rng.range(-0.01, 0.01));
            let way = Vec3::new(-angle.sin(), angle.cos(), 0.0);
            let shape = "{ type = \"capsule\", radius = 1, half_height = 0.01 }";
            let off = |p: &Vec3| {
                let core = p.z.clamp(-0.01, 0.01);
                ((p - Vec3::z() * core).norm() - 1.0).max(0.0)
            };
            (shape.to_owned(), off, at, way)
        }
        _ => {
            let at = Vec3::new(1.0, rng.range(-0.4, 0.4), 0.001);
            let off = |p: &Vec3| {
                let over = |k: usize, half: f64| (p[k].abs() - half).max(0.0);
                Vec3::new(over(0, 1.0), over(1, 0.4), over(2, 0.001)).norm()
            };
            let shape = "{ type = \"box\", half_extents = [1, 0.4, 0.001] }";
            (shape.to_owned(), off, at, rng.direction())
        }
    }
}

#[test]
fn rays_that_graze_are_told_on_the_surface_or_not_at_all() {
    let (mut hits, mut misses, mut worst) = (0, 0, 0.0_f64);
    for seed in 0..900 {
        let mut rng = Rng::new(seed);
        let kind = rng.below(3);
        let (shape, off, at, way) = grazed(kind, &mut rng);
        let beyond = [0.0, 1e-15, -1e-14, 1e-13, -1e-12, 1e-11, -1e-10, 1e-9][rng.below(8)];
        let far = [0.1, 1.0, 3.0, 10.0][rng.below(4)];
        let place = rng.vector(1.0);
        let pose = rng.pose(place);
        let from = pose * Point::from(at * (1.0 + beyond) - way * far);
        let direction = pose.rotation * way;
        let found = cast(&shape, &pose, &from.coords, &direction);
        let what = format!("seed {seed} {shape} {beyond} {far}: {found:?}");
        let away = |t: f64| off(&pose.inverse_transform_point(&(from + direction * t)).coords);
        if beyond <= 0.0 {
            assert!(found.t_min_m <= far + 1e-12, "{what}");
        }
        let Some(until) = found.t_max_m else {
            misses += 1;
            assert!(
                beyond > -1e-13 || found.verdict != Verdict::Apart.code(),
                "{what}"
            );
            continue;
        };
        hits += 1;
        // The shapes are convex, so the closest approach up to the hit is at the end of the interval or at the grazed
        // point.
        let last = away(until).min(away(until.min(far)));
        let best = away(found.t_best_m.unwrap());
        worst = worst.max(best).max(last);
        assert!(best <= 1e-9 && last <= 1e-9, "{best} {last} {what}");
    }
    assert!(hits > 300 && misses > 100, "{hits} {misses}");
    assert!(worst <= 1e-10, "{worst}");
}
