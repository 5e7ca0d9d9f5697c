//! The hit of a ray: against closed forms, with work cut off after any unit, and with unknown poses.

mod doubts;
mod grazes;
mod truth;

use std::collections::BTreeMap;

use sweepd::limits::RAY_BODIES_MAX;
use sweepd::math::{Point, Pose, Vec3};
use sweepd::query::RayQuestion;
use sweepd::scene::{Question, Request};
use sweepd::time::SystemClock;
use sweepd::wire::{MessageHeader, RayFound, Verdict};
use sweepd::world::World;

use crate::oracle::rng::Rng;
use crate::rig::{ALL, NONE, Rig, ball, body, scene};
use truth::{shape, truth};

fn question(world: &World, json: &str) -> Result<RayQuestion, String> {
    let json = format!("{{\"ray\": {json}}}");
    let Request::Ask(Question::Ray(ray)) = Request::parse(json.as_bytes(), &[])? else {
        panic!("a ray");
    };
    Ok(RayQuestion::new(world, MessageHeader::default(), &ray))
}

fn json(from: &Vec3, direction: &Vec3, more: &str) -> String {
    let [x, y, z] = [from.x, from.y, from.z];
    let [u, v, w] = [direction.x, direction.y, direction.z];
    format!("{{\"from\": [{x:?}, {y:?}, {z:?}], \"direction\": [{u:?}, {v:?}, {w:?}]{more}}}")
}

fn ask(world: &World, json: &str) -> RayFound {
    question(world, json).unwrap().answer(&SystemClock)
}

/// Two bodies of each kind at random poses, close enough together that most rays meet several.
fn crowd(rng: &mut Rng) -> (Rig, BTreeMap<String, (usize, Pose)>) {
    let kinds: Vec<usize> = (0..18).map(|id| id % 9).collect();
    let bodies: Vec<String> = (1..)
        .zip(&kinds)
        .map(|(id, kind)| body(id, [0.0; 3], &shape(*kind), ""))
        .collect();
    let mut rig = Rig::new(&scene("", &bodies));
    let mut placed = BTreeMap::new();
    for (id, kind) in (1..).zip(kinds) {
        let at = rng.vector(1.6);
        let pose = rng.pose(at);
        rig.place(id, &pose);
        placed.insert(format!("b{id}"), (kind, pose));
    }
    rig.send(ALL);
    (rig, placed)
}

/// The first body that a ray meets, with the distance.
fn first(
    placed: &BTreeMap<String, (usize, Pose)>,
    from: &Vec3,
    direction: &Vec3,
) -> Option<(f64, String)> {
    let met = placed.iter().filter_map(|(name, (kind, pose))| {
        let o = pose.inverse_transform_point(&Point::from(*from)).coords;
        let d = pose.rotation.inverse() * direction;
        Some((truth(*kind, &o, &d)?, name.clone()))
    });
    met.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Checks that the surface next to the hit is perpendicular to the normal, unless there is an edge.
fn check_normal(
    found: &RayFound,
    ((kind, pose), t): (&(usize, Pose), f64),
    (from, direction): (&Vec3, &Vec3),
    rng: &mut Rng,
) {
    let (point, normal) = (from + direction * t, Vec3::from(found.normal.unwrap()));
    let steep = normal.dot(direction);
    assert!(
        (normal.norm() - 1.0).abs() < 1e-9 && steep <= 1e-3,
        "{found:?}"
    );
    let across = normal.cross(&rng.direction()).normalize() * 1e-5;
    let beside = |step: Vec3| {
        let start = point - direction * 0.01 + step;
        let o = pose.inverse_transform_point(&Point::from(start)).coords;
        let t = truth(*kind, &o, &(pose.rotation.inverse() * direction))?;
        Some(start + direction * t)
    };
    let (Some(one), Some(other)) = (beside(across), beside(-across)) else {
        return;
    };
    if steep < -0.1 && (one - point).norm() < 1e-3 && (one - other).norm() > 0.0 {
        let tilt = (one - other).normalize().dot(&normal).abs();
        assert!(!(1e-3..=0.01).contains(&tilt), "{tilt} {found:?}");
    }
}

#[test]
fn the_first_hit_is_that_of_closed_forms() {
    let (mut hits, mut misses, mut inside) = (0, 0, 0);
    for seed in 0..10 {
        let mut rng = Rng::new(seed);
        let (rig, placed) = crowd(&mut rng);
        let world = rig.engine.world();
        for _ in 0..60 {
            let from = rng.vector(3.0);
            let direction = (rng.vector(1.8) - from).normalize();
            let found = ask(world, &json(&from, &(direction * 3.7), ""));
            let what = format!("seed {seed} from {from:?} along {direction:?}: {found:?}");
            assert!(found.complete, "{what}");
            let Some((t, name)) = first(&placed, &from, &direction) else {
                assert_eq!(found.verdict, Verdict::Apart.code(), "{what}");
                assert!(found.body.is_none() && found.t_max_m.is_none(), "{what}");
                misses += 1;
                continue;
            };
            hits += 1;
            inside += usize::from(found.inside);
            assert_eq!(
                found.verdict,
                Verdict::Colliding.code(),
                "{t} {name} {what}"
            );
            let (low, high) = (found.t_min_m, found.t_max_m.unwrap());
            assert!(low <= t + 1e-12 && t - 1e-12 <= high, "{t} {what}");
            // The depth in a round shape is proved to about 1e-8 of its size, which limits the accuracy where the ray
            // begins.
            assert!(high - low < 1e-5, "{t} {what}");
            assert!((found.t_best_m.unwrap() - t).abs() < 1e-9, "{t} {what}");
            // A ray may begin inside several bodies.
            let told = found.body.clone().unwrap();
            let alone = BTreeMap::from([(told.clone(), placed[&told])]);
            let own = first(&alone, &from, &direction).map(|(own, _)| own);
            assert!(
                told == name || (t <= 0.0 && own == Some(0.0)),
                "{name} {what}"
            );
            assert_eq!(found.inside, t <= 0.0, "{what}");
            let point = Vec3::from(found.point.unwrap());
            assert!((point - (from + direction * t)).norm() < 1e-8, "{what}");
            if found.inside {
                continue;
            }
            check_normal(&found, (&placed[&name], t), (&from, &direction), &mut rng);
        }
    }
    assert!(
        hits > 200 && misses > 50 && inside > 10,
        "{hits} {misses} {inside}"
    );
}

#[test]
fn cut_off_after_any_unit_a_ray_is_free_as_far_as_it_says() {
    let mut rng = Rng::new(77);
    let (rig, placed) = crowd(&mut rng);
    let mut open = 0;
    for _ in 0..40 {
        let from = rng.vector(3.0);
        let direction = (rng.vector(1.8) - from).normalize();
        let truth = first(&placed, &from, &direction);
        let asked = question(rig.engine.world(), &json(&from, &direction, "")).unwrap();
        for units in [0, 1, 2, 4, 8, 16, 40] {
            let found = asked.answer_within(&SystemClock, Some(units));
            let what = format!("{truth:?} after {units}: {found:?}");
            let Some((t, _)) = &truth else {
                assert_ne!(found.verdict, Verdict::Colliding.code(), "{what}");
                continue;
            };
            assert_ne!(found.verdict, Verdict::Apart.code(), "{what}");
            assert!(found.t_min_m <= t + 1e-12, "{what}");
            assert!(found.t_max_m.is_none_or(|high| high >= t - 1e-12), "{what}");
            open += usize::from(!found.complete);
            assert!(
                found.complete != (found.verdict == Verdict::Possible.code())
                    || found.body.is_some(),
                "{what}"
            );
        }
    }
    assert!(open > 40, "{open}");
}

#[test]
fn planes_height_fields_and_rays_along_axes_are_met_where_they_are() {
    let field = "{ type = \"height_field\", heights = [[0, 0, 0], [0, 1, 0], [0, 0, 0]], size = [4, 4], base_m = 1 }";
    let floor = "name = \"floor\"\nid = 9\nmoves = false\nshape = { type = \"half_space\", normal = [0, 0, 1], offset = -5.0 }\n";
    let bodies = [
        floor.to_owned(),
        body(1, [0.0; 3], field, ""),
        body(
            2,
            [1e6, 0.0, 0.0],
            "{ type = \"box\", half_extents = [1, 1, 1] }",
            "group = 4\n",
        ),
    ];
    let mut rig = Rig::new(&scene("", &bodies));
    rig.send(ALL);
    let world = rig.engine.world();
    let of = |from: [f64; 3], direction: [f64; 3], more: &str| {
        ask(
            world,
            &json(&Vec3::from(from), &Vec3::from(direction), more),
        )
    };
    let at = |found: &RayFound, name: &str, t: f64, normal: [f64; 3]| {
        assert_eq!(found.body.as_deref(), Some(name), "{found:?}");
        let slack = 1e-9 * t.max(1.0);
        assert!((found.t_best_m.unwrap() - t).abs() < slack, "{t} {found:?}");
        assert!(
            (Vec3::from(found.normal.unwrap()) - Vec3::from(normal)).norm() < 1e-4,
            "{found:?}"
        );
    };
    at(
        &of([9.0, 0.0, 3.0], [0.0, 0.0, -1.0], ""),
        "floor",
        8.0,
        [0.0, 0.0, 1.0],
    );
    at(
        &of([9.0, 0.0, 3.0], [1.0, 0.0, -1.0], ""),
        "floor",
        8.0 * 2.0_f64.sqrt(),
        [0.0, 0.0, 1.0],
    );
    let apart = of([9.0, 0.0, 3.0], [0.0, 0.0, 1.0], ", \"max_m\": 100");
    assert_eq!(
        (apart.verdict, apart.t_min_m, apart.complete),
        (Verdict::Apart.code(), 100.0, true)
    );
    let sunk = of([9.0, 0.0, -6.0], [0.0, 0.0, 1.0], "");
    assert!(
        sunk.inside && sunk.t_max_m == Some(0.0) && sunk.normal.is_none(),
        "{sunk:?}"
    );
    // From above onto the slope of the tip; from the side onto the wall.
    let slope = of([0.5, 0.1, 3.0], [0.0, 0.0, -1.0], "");
    assert_eq!((slope.body.as_deref(), slope.shape), (Some("b1"), Some(0)));
    assert!(slope.triangle.is_some() && slope.t_min_m > 2.0 && slope.t_min_m < 3.0);
    at(
        &of([5.0, 0.3, -0.5], [-1.0, 0.0, 0.0], ""),
        "b1",
        3.0,
        [1.0, 0.0, 0.0],
    );
    // Far away, and selected by groups.
    at(
        &of([-10.0, 0.0, 10.0], [1e6 + 9.0, 0.0, -10.0], ", \"mask\": 4"),
        "b2",
        1e6 + 9.0,
        [-1.0, 0.0, 0.0],
    );
    let masked = of([9.0, 0.0, 3.0], [0.0, 0.0, -1.0], ", \"mask\": 4");
    assert!(
        masked.body.is_none() && masked.ignored == 1 && masked.complete,
        "{masked:?}"
    );
}

#[test]
fn bodies_that_may_be_in_the_way_are_named_and_too_many_are_told() {
    let count = RAY_BODIES_MAX as u64 + 9;
    let mut bodies: Vec<String> = (1..=count)
        .map(|id| ball(id, id as f64 * 0.01, ""))
        .collect();
    bodies.push(ball(9001, 900.0, "max_speed_mps = 1.0"));
    let mut rig = Rig::new(&scene("", &bodies));
    rig.checked = false;
    rig.demand = sweepd::wire::Demand::default();
    let along = json(&Vec3::new(-9.0, 0.0, 0.0), &Vec3::x(), "");
    let lost = ask(rig.engine.world(), &along);
    assert!(
        !lost.complete && lost.body.is_none() && !lost.unknown.is_empty(),
        "{lost:?}"
    );
    assert_eq!(lost.verdict, Verdict::Possible.code(), "{lost:?}");
    rig.send(NONE);
    let found = ask(rig.engine.world(), &along);
    // The pairs that did not fit begin behind the hit.
    assert!(found.complete && found.left_out == 0, "{found:?}");
    assert_eq!(found.body.as_deref(), Some("b1"));
    assert!((found.t_best_m.unwrap() - 8.01).abs() < 1e-9, "{found:?}");
    let beside = json(&Vec3::new(-9.0, 0.9, 0.9), &Vec3::x(), "");
    let open = ask(rig.engine.world(), &beside);
    assert_eq!((open.left_out, open.complete), (10, false), "{open:?}");
    assert_eq!(open.verdict, Verdict::Possible.code());
    rig.row(1).position[0] = f64::NAN;
    rig.send(NONE);
    let found = ask(rig.engine.world(), &along);
    assert_eq!((found.body.as_deref(), found.complete), (Some("b2"), false));
    assert_eq!(
        (
            found.unknown[0].body.as_str(),
            found.unknown[0].status.as_str()
        ),
        ("b1", "rejected")
    );
    for (bad, wanted) in [
        (r#"{"from": [0, 0, 0]}"#, "`direction` is missing"),
        (r#"{"from": [0, 0, 0], "direction": [0, 0, 0]}"#, "all 0"),
        (r#"{"from": [0, 0], "direction": [0, 0, 1]}"#, "write 3"),
        (
            r#"{"from": [0, 0, 1e13], "direction": [0, 0, 1]}"#,
            "stay within",
        ),
        (
            r#"{"from": [0, 0, 0], "direction": [0, 0, 1], "max_m": -1}"#,
            "from 0 to",
        ),
        (
            r#"{"from": [0, 0, 0], "direction": [0, 0, 1], "mask": -1}"#,
            "mask",
        ),
    ] {
        let error = question(rig.engine.world(), bad).unwrap_err();
        assert!(error.contains(wanted), "{bad}: {error}");
    }
}

/// An angle computed from a cosine loses its digits there; a piece of the ray then lay beside the ray.
#[test]
fn bug_a_ray_near_the_z_axis_is_asked_along_its_own_direction() {
    let wall = "{ type = \"half_space\", normal = [-1, 0, 0], offset = -7e-6 }";
    let rig = Rig::new(&scene(
        "",
        &[body(1, [0.0; 3], wall, "").replace("moves = true", "moves = false")],
    ));
    for tilt in [7.1e-9, 1e-8, 1.4e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3] {
        for up in [1.0, -1.0] {
            let direction = Vec3::new(tilt, 0.0, up);
            let found = ask(
                rig.engine.world(),
                &json(&Vec3::zeros(), &direction, ", \"max_m\": 1000"),
            );
            let truth = 7e-6 / tilt * direction.norm();
            assert_eq!(
                found.verdict,
                Verdict::Colliding.code(),
                "{tilt}: {found:?}"
            );
            let (least, most) = (found.t_min_m, found.t_max_m.unwrap());
            assert!(least <= truth && truth <= most, "{tilt}: {found:?}");
            let off = (found.t_best_m.unwrap() - truth).abs();
            assert!(off <= 1e-9 / tilt, "{tilt}: {found:?}");
        }
    }
}

/// A cube of side 2 m as a solid mesh.
const CUBE: &str = "{ type = \"trimesh\", solid = true, vertices = [[-1, -1, -1], [1, -1, -1], [-1, 1, -1], [1, 1, -1], [-1, -1, 1], [1, -1, 1], [-1, 1, 1], [1, 1, 1]], faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]] }";

/// The ray is free until it enters the box of the cube, which is its surface: all later pieces of the ray begin there.
#[test]
fn bug_a_solid_mesh_along_the_axes_is_hit_where_it_is() {
    let mut rig = Rig::new(&scene("", &[body(1, [0.0; 3], CUBE, "")]));
    rig.send(ALL);
    let hit = |from: [f64; 3], direction: [f64; 3]| {
        ask(
            rig.engine.world(),
            &json(&Vec3::from(from), &Vec3::from(direction), ""),
        )
    };
    let third = 1.0 / 3.0;
    for (at, far) in [
        // Onto a face, its diagonal, an edge, a corner, at an angle; and along a face, in its plane.
        ([0.3, 0.2, 1.0], [0.0, 0.0, 1.0]),
        ([0.25, 0.25, -1.0], [0.0, 0.0, -2.0]),
        ([0.3, 1.0, third], [0.5, 2.0, 0.1]),
        ([1.0, 1.0, 0.25], [1.0, 1.0, 0.0]),
        ([1.0, 1.0, 1.0], [1.0, 2.0, 3.0]),
        ([-1.0, 0.5, 1.0], [-1.0, 0.25, 1.0]),
        ([1.0, 0.5, 1.0], [2.0, 0.0, 0.0]),
    ] {
        let (at, far) = (Vec3::from(at), Vec3::from(far));
        let found = hit((at + far).into(), (-far).into());
        let (least, most) = (found.t_min_m, found.t_max_m.unwrap());
        assert!(least <= far.norm() + 1e-12, "{at} {found:?}");
        let in_plane = far.y == 0.0 && at.z == 1.0 && far.z == 0.0;
        assert!(most >= far.norm() - 1e-12, "{at} {found:?}");
        // A ray in the plane of a face need not count as a hit; its upper end is at most the end of the face.
        let wide = if in_plane { 2.0 } else { 1e-9 };
        assert!(most - least <= wide + 1e-12, "{at} {found:?}");
        let off = (found.t_best_m.unwrap() - far.norm()).abs();
        assert!(off <= 1e-9, "{at} {found:?}");
    }
}

#[test]
fn bug_the_normal_of_a_surface_that_a_ray_begins_on_is_against_the_ray() {
    let triangle = "{ type = \"triangle\", vertices = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]] }";
    let field =
        "{ type = \"height_field\", heights = [[0, 0], [0, 0]], size = [2, 2], base_m = 1 }";
    let cube = "{ type = \"box\", half_extents = [1, 1, 1] }";
    for (shape, heights) in [
        (CUBE, [1.0, -1.0]),
        (cube, [1.0, -1.0]),
        (field, [0.0, -1.0]),
        (triangle, [0.0, 0.0]),
    ] {
        let mut rig = Rig::new(&scene("", &[body(1, [0.0; 3], shape, "")]));
        rig.send(ALL);
        for (height, down) in heights.into_iter().zip([-1.0, 1.0]) {
            let from = Vec3::new(0.3, 0.2, height);
            let found = ask(rig.engine.world(), &json(&from, &(Vec3::z() * down), ""));
            assert_eq!(found.t_max_m, Some(0.0), "{shape} {found:?}");
            let normal = Vec3::from(found.normal.unwrap());
            assert!((normal.z + down).abs() < 1e-9, "{shape} {found:?}");
        }
    }
}
