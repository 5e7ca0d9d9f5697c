//! The front of two bodies of several shapes compared with its reference: every pair of shapes queried separately.

use std::path::Path;

use super::*;
use crate::builtin::Random;
use crate::daemon::build_shapes;
use crate::math::{Quat, Vec3};
use crate::narrow::Counters;
use crate::narrow::ask::{Bench, gap_between};
use crate::narrow::contacts::Contact;
use crate::narrow::cursor::{Cursor, Room, Turn};
use crate::narrow::shelves::Shelves;
use crate::scene::Scene;
use crate::shape::Geometry;
use crate::time::{ManualClock, Meter};
use crate::wire::Verdict;
use crate::world::{PlacedShape, World};

/// Bodies with these counts of shapes: mixed, some of them meshes; with a half-space as the last of B's, or alone.
fn bodies(random: &mut Random, counts: [usize; 2], planes: Planes) -> [Body; 2] {
    let mut text = String::new();
    for (body, count) in counts.into_iter().enumerate() {
        text += &format!(
            "[[body]]\nname = \"b{body}\"\nid = {}\nmoves = false\n",
            body + 1
        );
        if body == 1 && planes == Planes::Only {
            text += "[[body.shape]]\ntype = \"half_space\"\nnormal = [0.1, 0.2, 0.9]\n";
            continue;
        }
        for _ in 0..count {
            let mut some = |low: f64, high: f64| random.range(low, high);
            let kind = some(0.0, 5.0);
            let shape = if kind < 1.0 {
                format!("type = \"sphere\"\nradius = {}", some(0.05, 0.2))
            } else if kind < 2.0 {
                let (radius, half) = (some(0.02, 0.1), some(0.1, 0.4));
                format!("type = \"capsule\"\nradius = {radius}\nhalf_height = {half}")
            } else if kind < 4.0 {
                let half = [some(0.02, 0.3), some(0.02, 0.1), some(0.02, 0.2)];
                format!("type = \"box\"\nhalf_extents = {half:?}")
            } else {
                let solid = "faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]";
                let v = some(0.1, 0.3);
                format!(
                    "type = \"trimesh\"\nsolid = true\nvertices = [[0.0, 0.0, 0.0], [{v}, 0.0, 0.0], [0.0, {v}, 0.0], [0.0, 0.0, {v}]]\n{solid}"
                )
            };
            let at = [some(-1.0, 1.0), some(-1.0, 1.0), some(-1.0, 1.0)];
            let turn = [some(-1.0, 1.0), some(-1.0, 1.0), some(-1.0, 1.0), 1.0];
            let length = turn.iter().map(|x| x * x).sum::<f64>().sqrt();
            let turn = turn.map(|x| x / length);
            text +=
                &format!("[[body.shape]]\n{shape}\nposition = {at:?}\norientation = {turn:?}\n");
        }
        if body == 1 && planes == Planes::Beside {
            text += "[[body.shape]]\ntype = \"half_space\"\nnormal = [0.0, 0.6, 0.8]\nposition = [0.0, 0.0, -1.2]\n";
        }
    }
    let scene = Scene::parse(&text, "test", Path::new(".")).unwrap();
    let world = World::new(&scene, build_shapes(&scene).unwrap().bodies, 0).unwrap();
    let mut all = world.bodies().map(|(_, body)| body.clone());
    [all.next().unwrap(), all.next().unwrap()]
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Planes {
    None,
    Beside,
    Only,
}

/// The reference: every pair of shapes queried separately to the end: the gap of the bodies, and which shapes collide.
fn twin((a, b): (&Body, &Body), rel: &Pose) -> (Interval, Vec<(u32, u32)>) {
    let clock = ManualClock::new(0);
    let mut meter = Meter::new(&clock, None, None);
    let mut shelves = Shelves::default();
    let mut gap = Interval::new(f64::INFINITY, f64::INFINITY);
    let mut colliding = Vec::new();
    for (i, one) in (0..).zip(a.shapes.iter()) {
        for (j, other) in (0..).zip(b.shapes.iter()) {
            let is_plane =
                |placed: &PlacedShape| matches!(placed.shape.geometry, Geometry::HalfSpace { .. });
            if is_plane(one) && is_plane(other) {
                continue;
            }
            let mut cursor = Cursor::default();
            cursor.start((i, j), (*rel, Bent::default()), 0.0, 0, Goal::Gap);
            let mut room = Room {
                fronts: &mut shelves.store,
                contacts: &mut shelves.contacts,
                search: Search::Carried,
            };
            let counters = &mut Counters::default();
            while cursor.turn(
                &mut room,
                (one, other),
                (0.0, u64::MAX),
                &mut meter,
                counters,
            ) == Turn::Open
            {}
            gap = gap.least(cursor.gap);
            if cursor.gap.max <= 0.0 {
                colliding.push((i, j));
            }
            cursor.release(&mut shelves.store, &mut shelves.contacts);
        }
    }
    (gap, colliding)
}

/// Every pair of shapes that entries cover, sorted.
fn covered(front: &CompoundFront, shelves: &Shelves, (a, b): (&Body, &Body)) -> Vec<(u32, u32)> {
    let (a, b) = (Side::of(a), Side::of(b));
    let mut all = Vec::new();
    let whole = front.cover.visit_all(&shelves.store.entries, |of_a, of_b| {
        for &i in &shapes_below(&a, of_a) {
            all.extend(shapes_below(&b, of_b).iter().map(|&j| (i, j)));
        }
    });
    assert!(whole, "nothing is lumped together");
    all.sort_unstable();
    all
}

fn shapes_below(side: &Side<'_>, id: BoxId) -> Vec<u32> {
    let (mut stack, mut all) = (vec![id], Vec::new());
    while let Some(id) = stack.pop() {
        match side.held(id) {
            Held::Triangle(place) => all.push(place),
            Held::Pack(pack) => {
                let mask = side.pack(pack).unwrap().mask;
                stack.extend(crate::narrow::cover::lanes(mask).map(|lane| BoxId::new(pack, lane)));
            }
        }
    }
    all
}

fn turned(random: &mut Random, angle: f64) -> Quat {
    let axis = Vec3::new(
        random.range(-1.0, 1.0),
        random.range(-1.0, 1.0),
        random.range(-1.0, 1.0),
    );
    Quat::from_scaled_axis(axis * angle)
}

/// The next pose: usually a small step, sometimes none, another direction, or a leap.
fn step_on(random: &mut Random, rel: &mut Pose, way: &mut Vec3) {
    match random.range(0.0, 30.0) {
        x if x < 1.0 => {
            let at = turned(random, 3.0) * Vec3::new(0.0, 0.0, random.range(0.5, 2.5));
            *rel = Pose::from_parts(at.into(), turned(random, 3.0));
        }
        x if x < 3.0 => {
            let back = -rel.translation.vector * 0.01 * random.range(0.0, 2.0);
            *way = turned(random, 0.5) * back;
        }
        x if x < 12.0 => {}
        _ => {
            rel.translation.vector += *way;
            rel.rotation = turned(random, 0.01) * rel.rotation;
        }
    }
}

/// One moving pair, cut off at random, each step compared with its reference.
fn drive(random: &mut Random, counts: [usize; 2], planes: Planes, steps: usize) -> [usize; 3] {
    let [a, b] = &bodies(random, counts, planes);
    let clock = ManualClock::new(0);
    let mut bench = Bench::default();
    let mut front = CompoundFront::default();
    let mut rel = Pose::from_parts(Vec3::new(0.0, 0.0, 1.5).into(), turned(random, 3.0));
    let mut way = Vec3::new(0.0, 0.0, -0.01);
    let (mut seen, mut decided) = ([0; 3], 0);
    for step in 0..steps {
        step_on(random, &mut rel, &mut way);
        let (gap, colliding) = twin((a, b), &rel);
        let mut tools = bench.tools();
        front.move_to(&mut tools, (a, b), &rel);
        for turn in 0..3 {
            let goal = [Goal::Verdict, Goal::Gap, Goal::Contacts][turn];
            let units =
                [Some(0), Some(1), Some(13), None][usize::try_from(random.bits() % 4).unwrap()];
            let mut meter = Meter::new(&clock, None, units);
            let report_m = [0.0, 0.1][step % 2];
            let done = front.advance(&mut tools, (a, b), (goal, report_m), u64::MAX, &mut meter);
            assert!(done || units.is_some(), "no end without a limit");
            let known = front.interval();
            let slack = 1e-9;
            assert!(
                known.min <= gap.max + slack && known.max >= gap.min - slack,
                "step {step}, {goal:?}: {known:?} does not hold {gap:?}"
            );
            if !done {
                break;
            }
            decided += 1;
            if goal == Goal::Verdict {
                assert!(known.max <= 0.0 || known.min > 0.0 || gap.contains(0.0));
            } else if gap.min > 0.0 {
                assert!(known.width() <= gap.width() + slack, "{known:?} {gap:?}");
            }
            if goal == Goal::Contacts {
                let contacts = front.contacts(&tools.shelves.contacts);
                for &(i, j) in &colliding {
                    let is_there = |c: &Contact| (c.shape_a, c.shape_b) == (i, j);
                    assert!(contacts.iter().any(is_there), "step {step}: {i} and {j}");
                }
            }
        }
        seen[if gap.max <= 0.0 { 0 } else { 1 }] += 1;
        seen[2] += decided;
        let [of_a, of_b] = [a, b].map(|body| u32::try_from(body.shapes.len()).unwrap());
        let pairs = (0..of_a).flat_map(|i| (0..of_b).map(move |j| (i, j)));
        let all: Vec<_> = pairs.collect();
        assert_eq!(covered(&front, &bench.shelves, (a, b)), all, "step {step}");
    }
    front.release(&mut bench.shelves);
    seen
}

#[test]
fn whatever_is_cut_off_the_front_holds_what_every_pair_of_shapes_says() {
    let mut random = Random::new(11);
    let mut seen = [0; 3];
    for round in 0..60 {
        let counts = [[1, 7], [6, 1], [2, 3], [20, 9], [70, 2]][round % 5];
        let planes = [Planes::None, Planes::Beside, Planes::None, Planes::Only][round % 4];
        let of = drive(&mut random, counts, planes, 60);
        seen = [seen[0] + of[0], seen[1] + of[1], seen[2] + of[2]];
    }
    let [collide, apart, decided] = seen;
    assert!(collide > 500 && apart > 500 && decided > 1000, "{seen:?}");
}

#[test]
fn two_bodies_of_many_shapes_ask_a_few_pairs_and_fewer_on_their_way() {
    let mut random = Random::new(3);
    let [a, b] = &bodies(&mut random, [400, 400], Planes::None);
    let clock = ManualClock::new(0);
    let mut bench = Bench::default();
    let mut front = CompoundFront::default();
    let mut units = Vec::new();
    for step in 0..40 {
        let at = Vec3::new(0.0, 0.0, 2.6 - 0.0005 * f64::from(step));
        let rel = Pose::from_parts(at.into(), Quat::identity());
        let mut tools = bench.tools();
        let mut meter = Meter::new(&clock, None, None);
        front.move_to(&mut tools, (a, b), &rel);
        let asked = (Goal::Verdict, 0.0);
        assert!(front.advance(&mut tools, (a, b), asked, u64::MAX, &mut meter));
        units.push(meter.spent());
    }
    let carried = units[1..].iter().sum::<u64>() / (units.len() as u64 - 1);
    assert!(units[0] < 2_000, "of 160,000 pairs: {units:?}");
    assert!(carried * 5 < units[0].max(5), "{units:?}");
}

#[test]
fn a_walk_over_pairs_of_shapes_leaves_out_none_that_may_touch() {
    let mut random = Random::new(5);
    for planes in [Planes::None, Planes::Beside, Planes::Only] {
        let [a, b] = &bodies(&mut random, [40, 30], planes);
        let mut waiting = Waiting::default();
        for step in 0..20 {
            let at = Vec3::new(0.0, 0.1 * f64::from(step), 1.0);
            let rel = Pose::from_parts(at.into(), turned(&mut random, 3.0));
            let mut walk = PairWalk::new((a, b), &rel, &mut waiting);
            let mut near = Vec::new();
            while let Some(pair) = walk.next(|| true, |low| low <= 0.0) {
                near.push(pair);
            }
            let (_, colliding) = twin((a, b), &rel);
            for pair in &colliding {
                assert!(near.contains(pair));
            }
            let every = a.shapes.len() * b.shapes.len();
            assert!(planes == Planes::Only || near.len() * 2 < every);
        }
    }
}

#[test]
fn bug_two_bodies_that_both_have_a_half_space_came_to_no_end_at_another_pose() {
    let mut random = Random::new(7);
    let [_, a] = bodies(&mut random, [1, 3], Planes::Beside);
    let [_, mut b] = bodies(&mut random, [1, 4], Planes::Beside);
    let clock = ManualClock::new(0);
    for step in 0..6 {
        b.pose = Pose::translation(0.0, 0.0, 3.0 + 0.001 * f64::from(step));
        // Their half-spaces have no gap; their other shapes have one, and one with the other's half-space.
        let mut meter = Meter::new(&clock, None, None);
        let asked = gap_between(&a, &b, 0.0, &mut meter);
        let (truth, colliding) = twin((&a, &b), &b.pose);
        assert!(asked.finished && asked.gap.min <= truth.max && truth.min <= asked.gap.max);
        assert_eq!(asked.verdict == Verdict::Colliding, !colliding.is_empty());
    }
}
