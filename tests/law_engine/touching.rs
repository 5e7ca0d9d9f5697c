//! The bodies that a body or a shape touches or would touch: by brute force over all bodies, by moving the body and
//! reading the tick, and with work cut off after any unit.

mod rules;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use sweepd::math::Pose;
use sweepd::narrow::gap_between;
use sweepd::query::TouchingQuestion;
use sweepd::scene::{Question, Request};
use sweepd::time::{Meter, SystemClock};
use sweepd::wire::{TouchingFound, Verdict};
use sweepd::world::{Body, Parts, PlacedShape, World};

use crate::oracle::rng::Rng;
use crate::rig::{ALL, Rig, body, scene};

const PYRAMID: &str = "{ type = \"trimesh\", vertices = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 1]], faces = [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]] }";
const SHAPES: [&str; 6] = [
    "{ type = \"sphere\", radius = 0.7 }",
    "{ type = \"box\", half_extents = [0.5, 0.8, 0.3] }",
    "{ type = \"capsule\", radius = 0.3, half_height = 0.6 }",
    "[{ type = \"sphere\", radius = 0.3, position = [-1, 0, 0] }, { type = \"cone\", radius = 0.4, half_height = 0.4, position = [1, 0, 0] }]",
    PYRAMID,
    "{ type = \"height_field\", heights = [[0, 0.3, 0], [0.2, 0, 0.1], [0, 0.4, 0.2]], size = [2, 2], base_m = 0.2 }",
];

/// A question with its shapes built, as the daemon's worker builds them.
fn question(world: &World, json: &str) -> Result<TouchingQuestion, String> {
    let json = format!("{{\"touching\": {json}}}");
    let Request::Ask(asked) = Request::parse(json.as_bytes(), &[])? else {
        panic!("a question");
    };
    let built = asked.shapes().iter().map(|spec| PlacedShape {
        shape: sweepd::shape::build(&spec.shape, Path::new("."))
            .unwrap()
            .shape,
        pose: spec.pose,
    });
    let parts: Parts = built.collect();
    let Question::Touching(asked) = &asked else {
        panic!("what touches");
    };
    TouchingQuestion::new(
        world,
        sweepd::wire::MessageHeader::default(),
        asked,
        Some(&parts),
    )
}

fn ask(world: &World, json: &str) -> TouchingFound {
    question(world, json).unwrap().answer(&SystemClock)
}

fn pose_json(pose: &Pose) -> String {
    let (t, q) = (&pose.translation.vector, pose.rotation.as_vector());
    format!(
        "\"position\": [{:?}, {:?}, {:?}], \"orientation\": [{:?}, {:?}, {:?}, {:?}]",
        t.x, t.y, t.z, q.x, q.y, q.z, q.w
    )
}

fn names(found: &TouchingFound) -> BTreeSet<String> {
    found.rows.iter().map(|row| row.b.clone()).collect()
}

fn named<'a>(world: &'a World, name: &str) -> &'a Body {
    world.body(world.slot_named(name).unwrap()).unwrap()
}

/// Bodies of every kind in a cube above a floor; some are in a group that collides only with itself.
fn crowd(rng: &mut Rng) -> Rig {
    let mut bodies = vec![
        "name = \"floor\"\nid = 99\nmoves = false\nshape = { type = \"half_space\", normal = [0, 0, 1], offset = -2.5 }\n".to_owned(),
    ];
    for id in 1..=24 {
        let more = match id % 8 {
            0 => "group = 2\nmask = 2\n",
            3 => "parent = \"b1\"\n",
            5 => "continuous = true\n",
            6 => "report_within_m = 0.5\n",
            _ => "",
        };
        bodies.push(body(id, [0.0; 3], SHAPES[rng.below(SHAPES.len())], more));
    }
    let mut rig = Rig::new(&scene("", &bodies));
    scatter(&mut rig, rng);
    rig.send(ALL);
    rig
}

fn scatter(rig: &mut Rig, rng: &mut Rng) {
    for id in 1..=24 {
        let at = rng.vector(2.6);
        let pose = rng.pose(at);
        rig.place(id, &pose);
    }
}

/// Verdict and lower end of the gap of every body, without the use of boxes.
fn by_force(world: &World, asked: &Body, but: &str, filters: bool) -> BTreeMap<String, (f64, f64)> {
    let own = world.slot_named(but);
    let others = world.bodies().filter(|(slot, _)| Some(*slot) != own);
    let checked = others.filter(|(slot, other)| match own {
        Some(own) => !filters || world.filters().allows(own, *slot),
        None => !(asked.only_half_spaces && other.only_half_spaces),
    });
    let gap = |other: &Body| {
        let mut meter = Meter::unlimited(&SystemClock);
        let asked = gap_between(asked, other, 0.0, &mut meter);
        (asked.gap.min, asked.gap.max)
    };
    checked
        .map(|(_, other)| (other.name.clone(), gap(other)))
        .collect()
}

#[test]
fn rows_are_those_of_brute_force_and_of_the_body_that_was_moved_there() {
    let mut collisions = 0;
    for seed in 0..12 {
        let mut rng = Rng::new(seed);
        let mut rig = crowd(&mut rng);
        for _ in 0..6 {
            let (id, at) = (1 + rng.below(24) as u64, rng.vector(2.6));
            let (pose, within) = (rng.pose(at), [0.0, 0.2, 1.5][rng.below(3)]);
            let filters = rng.below(4) > 0;
            let name = format!("b{id}");
            let world = rig.engine.world();
            let json = format!(
                "{{\"body\": \"{name}\", {}, \"within_m\": {within}, \"filters\": {filters}}}",
                pose_json(&pose)
            );
            let found = ask(world, &json);
            let what = format!("seed {seed}: {json}: {found:?}");
            assert!(found.complete && found.asked == [name.clone()], "{what}");
            let truth = by_force(world, &named(world, &name).at(&pose), &name, filters);
            let near = truth.iter().filter(|(_, gap)| gap.0 <= within);
            let near: BTreeSet<String> = near.map(|(name, _)| name.clone()).collect();
            assert_eq!(names(&found), near, "{what}");
            for row in &found.rows {
                let (low, high) = truth[&row.b];
                assert!(
                    row.known.gap_min_m.unwrap() <= high && row.known.gap_max_m.unwrap() >= low,
                    "{what}"
                );
            }
            // The engine's own result with the body at that pose.
            let was = named(world, &name).pose;
            rig.place(id, &pose);
            rig.send(ALL);
            let other = |row: &sweepd::wire::PairRow| match (row.body_a == id, row.body_b == id) {
                (true, _) => Some(row.body_b),
                (_, true) => Some(row.body_a),
                _ => None,
            };
            let colliding = Verdict::Colliding.code();
            let touched: BTreeSet<String> = (rig.out.pairs.iter())
                .filter(|row| row.verdict == colliding)
                .filter_map(other)
                .map(|id| {
                    if id == 99 {
                        "floor".to_owned()
                    } else {
                        format!("b{id}")
                    }
                })
                .collect();
            let told = found
                .rows
                .iter()
                .filter(|row| row.known.verdict == colliding);
            let told: BTreeSet<String> = told.map(|row| row.b.clone()).collect();
            if filters {
                assert_eq!(told, touched, "{what}");
                collisions += told.len();
            } else {
                assert!(told.is_superset(&touched), "{what}");
            }
            // A question without a pose uses the current pose.
            let here = ask(rig.engine.world(), &format!("{{\"body\": \"{name}\"}}"));
            assert_eq!(names(&here), touched, "{what} {here:?}");
            rig.place(id, &was);
            rig.send(ALL);
        }
    }
    assert!(collisions > 50, "{collisions}");
}

#[test]
fn a_shape_that_is_no_body_is_met_by_what_its_mask_lets() {
    for seed in 20..26 {
        let mut rng = Rng::new(seed);
        let rig = crowd(&mut rng);
        let world = rig.engine.world();
        for shape in [
            r#"{"type": "box", "half_extents": [1.0, 0.2, 2.0]}"#,
            r#"[{"type": "sphere", "radius": 0.4}, {"type": "sphere", "radius": 0.4, "position": [0, 0, 1]}]"#,
            r#"{"type": "half_space", "normal": [1, 2, 3], "offset": -1.0}"#,
        ] {
            let at = rng.vector(1.0);
            let pose = pose_json(&rng.pose(at));
            for mask in [u32::MAX, 2] {
                let json = format!(
                    "{{\"shape\": {shape}, {pose}, \"within_m\": 0.1, \"group\": 3, \"mask\": {mask}}}"
                );
                let asked = question(world, &json).unwrap();
                let found = asked.answer(&SystemClock);
                assert!(found.complete && found.asked.is_empty(), "{found:?}");
                let truth = by_force(world, &probe(&json), "", true);
                let near = truth.iter().filter(|(name, gap)| {
                    let of_group_2 = ["b8", "b16", "b24"].contains(&name.as_str());
                    gap.0 <= 0.1 && (mask == u32::MAX || of_group_2)
                });
                let near: BTreeSet<String> = near.map(|(name, _)| name.clone()).collect();
                assert_eq!(names(&found), near, "seed {seed}: {json}: {found:?}");
            }
        }
    }
}

/// The shapes of a question as a body.
fn probe(json: &str) -> Body {
    let json = format!("{{\"touching\": {json}}}");
    let Ok(Request::Ask(Question::Touching(asked))) = Request::parse(json.as_bytes(), &[]) else {
        panic!("a question");
    };
    let sweepd::scene::Subject::Shapes { shapes, .. } = asked.subject else {
        panic!("shapes");
    };
    let built = shapes.iter().map(|spec| PlacedShape {
        shape: sweepd::shape::build(&spec.shape, Path::new("."))
            .unwrap()
            .shape,
        pose: spec.pose,
    });
    Body::of_shapes(built.collect(), &asked.pose.unwrap())
}

#[test]
fn cut_off_after_any_unit_nothing_that_is_near_is_missing() {
    let (mut cut, mut rng) = (0, Rng::new(5));
    let rig = crowd(&mut rng);
    let world = rig.engine.world();
    for id in 1..=24 {
        let json = format!("{{\"body\": \"b{id}\", \"within_m\": 0.3}}");
        let asked = question(world, &json).unwrap();
        let truth = by_force(
            world,
            named(world, &format!("b{id}")),
            &format!("b{id}"),
            true,
        );
        for units in [0, 1, 2, 3, 5, 8, 20, 100] {
            let found = asked.answer_within(&SystemClock, Some(units));
            let what = format!("{json} after {units}: {found:?}");
            for (name, (low, high)) in &truth {
                let row = found.rows.iter().find(|row| row.b == *name);
                assert!(row.is_some() || *high > 0.3, "{name}: {what}");
                let Some(row) = row else { continue };
                assert!(
                    row.known.gap_min_m.is_none_or(|min| min <= *high),
                    "{name}: {what}"
                );
                assert!(
                    row.known.gap_max_m.is_none_or(|max| max >= *low),
                    "{name}: {what}"
                );
                let wrong = if *low > 0.0 {
                    Verdict::Colliding
                } else {
                    Verdict::Near
                };
                assert!(
                    row.known.verdict != wrong.code() || *high > 0.0 && *low <= 0.0,
                    "{what}"
                );
                cut += usize::from(row.known.verdict == Verdict::Possible.code());
            }
        }
    }
    assert!(cut > 50, "{cut}");
}
