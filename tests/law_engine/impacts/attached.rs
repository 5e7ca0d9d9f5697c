//! Attached bodies move with their root, and so does the closing speed of their gaps: circles and lines.

use std::f64::consts::FRAC_PI_2;

use sweepd::math::{Point, Pose, Vec3};
use sweepd::wire::{Verdict, VertexFrame, VertexHeader, WIRE_VERSION, name_bytes, vertex_flags};
use sweepd::world::Body;

use super::{ask, at, rig, warnings};
use crate::oracle::rng::Rng;
use crate::rig::{ALL, Rig, scene};

const HUB: &str = "name = \"hub\"\nid = 1\nshape = { type = \"sphere\", radius = 0.1 }\n";

/// A ball of radius 0.1 m at a position in the scene, or in the frame of the body that it is attached to.
fn small(name: &str, place: [f64; 3], more: &str) -> String {
    format!(
        "name = \"{name}\"\nposition = {place:?}\nshape = {{ type = \"sphere\", radius = 0.1 }}\n{more}\n"
    )
}

fn hanging(name: &str, on: &str, place: [f64; 3]) -> String {
    small(name, place, &format!("attached_to = \"{on}\""))
}

fn post(name: &str, place: [f64; 3]) -> String {
    small(name, place, "moves = false")
}

/// A hub, a hand attached 1 m from it, a tip attached 1 m from the hand, and posts.
fn arm(velocity: [f64; 6], posts: &[String]) -> Rig {
    let mut bodies = vec![
        HUB.to_owned(),
        hanging("hand", "hub", [1.0, 0.0, 0.0]),
        hanging("tip", "hand", [0.0, 1.0, 0.0]),
    ];
    bodies.extend_from_slice(posts);
    let mut rig = Rig::new(&scene("", &bodies));
    rig.velocities = vec![velocity];
    rig.send(ALL);
    rig
}

/// It was treated as being at rest, and proved apart from the body it was about to hit.
#[test]
fn bug_what_hangs_on_a_body_that_moves_goes_with_it() {
    let posts = [
        post("post", [3.0, 0.0, 0.0]),
        post("above", [1.0, 4.0, 0.0]),
    ];
    let ahead = arm([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], &posts);
    let world = ahead.engine.world();
    for json in [
        r#"{"a": "hand", "b": "post", "within_s": 5}"#,
        r#"{"a": "post", "b": "hand", "within_s": 5}"#,
    ] {
        assert_eq!(warnings(world, json), [""; 0]);
        at(&ask(world, json), 1.8);
    }
    let found = ask(world, r#"{"a": "hand", "b": "post", "within_s": 5}"#);
    assert_eq!(found.linear_a, [1.0, 0.0, 0.0]);
    let up = arm([0.0, 2.0, 0.0, 0.0, 0.0, 0.0], &posts);
    at(
        &ask(
            up.engine.world(),
            r#"{"a": "tip", "b": "above", "within_s": 5}"#,
        ),
        1.4,
    );
}

#[test]
fn bug_what_hangs_on_a_body_that_turns_goes_on_an_arc() {
    let posts = [
        post("post", [0.0, 1.0, 0.0]),
        post("beside", [1.0, 1.5, 0.0]),
        post("far", [-2.0_f64.sqrt(), 0.0, 0.0]),
    ];
    let turning = arm([0.0, 0.0, 0.0, 0.0, 0.0, FRAC_PI_2], &posts);
    let world = turning.engine.world();
    let hand = ask(world, r#"{"a": "hand", "b": "post", "within_s": 3}"#);
    at(&hand, 1.0 - 2.0 * 0.1_f64.asin() / FRAC_PI_2);
    assert!((hand.linear_a[1] - FRAC_PI_2).abs() < 1e-12, "{hand:?}");
    assert_eq!(hand.angular_a, [0.0, 0.0, FRAC_PI_2]);
    // The hand passes it on its circle at 0.6 m; a straight motion would hit it.
    let past = ask(world, r#"{"a": "hand", "b": "beside", "within_s": 3}"#);
    assert_eq!(past.verdict, Verdict::Apart.code(), "{past:?}");
    // Three eighths of a turn away, over a chain of two attachments.
    let two = 2.0 * (0.1 / 2.0_f64.sqrt()).asin();
    at(
        &ask(world, r#"{"a": "tip", "b": "far", "within_s": 3}"#),
        (1.5 * FRAC_PI_2 - two) / FRAC_PI_2,
    );
    // A root whose centre is not its origin moves in a straight line with its centre, and turns about it.
    let hub = "name = \"hub\"\nid = 1\nshape = { type = \"sphere\", radius = 0.1, position = [0, 1, 0] }\n";
    let mut rig = Rig::new(&scene(
        "",
        &[
            hub.to_owned(),
            hanging("hand", "hub", [1.0, 1.0, 0.0]),
            post("post", [0.0, 2.0, 0.0]),
        ],
    ));
    // The centre of the hub does not move.
    rig.velocities = vec![[FRAC_PI_2, 0.0, 0.0, 0.0, 0.0, FRAC_PI_2]];
    rig.send(ALL);
    at(
        &ask(
            rig.engine.world(),
            r#"{"a": "hand", "b": "post", "within_s": 3}"#,
        ),
        1.0 - 2.0 * 0.1_f64.asin() / FRAC_PI_2,
    );
}

#[test]
fn what_a_question_says_of_a_body_moves_it_and_what_hangs_on_it() {
    let posts = [post("post", [3.0, 0.0, 0.0])];
    let still = arm([0.0; 6], &posts);
    let world = still.engine.world();
    // A velocity of its own moves its own centre in a straight line.
    let own = r#"{"a": "hand", "b": "post", "linear_a": [1, 0, 0], "angular_a": [0, 0, 5], "within_s": 5}"#;
    at(&ask(world, own), 1.8);
    // A body attached to the other moves with it, also over chains; the other does not move with its attached body.
    for json in [
        r#"{"a": "hub", "b": "tip", "linear_a": [1, 2, 0], "angular_a": [0, 50, 5], "within_s": 50}"#,
        r#"{"a": "tip", "b": "hub", "linear_b": [1, 2, 0], "angular_b": [0, 50, 5], "within_s": 50}"#,
    ] {
        let found = ask(world, json);
        assert_eq!(found.verdict, Verdict::Apart.code(), "{found:?}");
        assert_eq!(warnings(world, json), [""; 0]);
    }
    let found = ask(
        world,
        r#"{"a": "hub", "b": "tip", "linear_a": [1, 2, 0], "angular_a": [0, 0, 5], "within_s": 50}"#,
    );
    assert_eq!(found.linear_b, [-4.0, 7.0, 0.0]);
    at(
        &ask(
            world,
            r#"{"a": "hand", "b": "hub", "linear_a": [-1, 0, 0], "within_s": 5}"#,
        ),
        0.8,
    );
    // Two bodies attached to the same root are at rest relative to each other, whatever the root does.
    let spins = arm([9.0, 0.0, 1.0, 30.0, 40.0, 50.0], &posts);
    let json = r#"{"a": "hand", "b": "tip", "within_s": 1000}"#;
    let found = ask(spins.engine.world(), json);
    assert_eq!(found.verdict, Verdict::Apart.code(), "{found:?}");
    assert_eq!(warnings(spins.engine.world(), json), [""; 0]);
}

#[test]
fn who_sends_no_velocity_is_named() {
    let mut silent = rig(&[
        HUB.to_owned(),
        hanging("hand", "hub", [1.0, 0.0, 0.0]),
        post("post", [3.0, 0.0, 0.0]),
    ]);
    let json = r#"{"a": "hand", "b": "post", "within_s": 5}"#;
    let told = warnings(silent.engine.world(), json);
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(
        told[0].contains("\"hand\"") && told[0].contains("source of \"hub\""),
        "{told:?}"
    );
    // A velocity sent with the same pose applies at once.
    silent.velocities = vec![[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]];
    silent.send(ALL);
    assert_eq!(warnings(silent.engine.world(), json), [""; 0]);
    at(&ask(silent.engine.world(), json), 1.8);
    silent.velocities.clear();
    silent.send(ALL);
    assert_eq!(warnings(silent.engine.world(), json).len(), 1);
}

/// Only the age of the pose was reported.
#[test]
fn bug_how_old_a_velocity_is_and_that_vertices_stay_is_told() {
    let sheet = "name = \"sheet\"\nposition = [0, 0, 9]\ndeforms = true\nshape = { type = \"trimesh\", solid = false, \
        vertices = [[-1, -1, 0], [1, -1, 0], [1, 1, 0]], faces = [[0, 1, 2]] }\n";
    let mut held = Rig::new(&scene(
        "",
        &[
            format!("{HUB}on_stale = \"hold\"\n"),
            hanging("hand", "hub", [1.0, 0.0, 0.0]),
            post("post", [3.0, 0.0, 0.0]),
            sheet.to_owned(),
        ],
    ));
    let mut vertices = VertexFrame {
        rows: vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0]],
        ..VertexFrame::default()
    };
    let sheet = held.engine.world().slot_named("sheet").unwrap();
    vertices.header = VertexHeader {
        session: 11,
        epoch: 1,
        body: held.engine.world().body(sheet).unwrap().id.0,
        version: 1,
        source: name_bytes("feed"),
        count: 3,
        total: 3,
        flags: vertex_flags::FULL,
        schema: WIRE_VERSION,
        ..VertexHeader::default()
    };
    held.vertices = vec![vertices];
    held.velocities = vec![[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 6]];
    held.send(ALL);
    let of_sheet = r#"{"a": "post", "b": "sheet"}"#;
    let told = warnings(held.engine.world(), of_sheet);
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(
        told[0].contains("vertices are taken as they are"),
        "{told:?}"
    );
    held.idle(700_000_000, ALL);
    let world = held.engine.world();
    for name in ["hub", "hand"] {
        let told = warnings(
            world,
            &format!(r#"{{"a": "{name}", "b": "post", "within_s": 5}}"#),
        );
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(told[0].contains("is held"), "{told:?}");
        assert!(
            told[1].contains("that velocity was 0.700 s old"),
            "{told:?}"
        );
    }
    // A velocity given in the question replaces the stale one, so only one warning remains.
    let told = warnings(world, r#"{"a": "hub", "b": "post", "linear_a": [1, 0, 0]}"#);
    assert_eq!(told.len(), 1, "{told:?}");
}

/// Position and velocity of a body's origin, from the velocity of the root, over a chain of poses.
fn middle(root: &Pose, chain: &[Pose], velocity: &[f64; 6]) -> (Point, Vec3) {
    let at = chain.iter().fold(*root, |at, local| at * local);
    let point = at * Point::origin();
    let [x, y, z, rx, ry, rz] = *velocity;
    let arm = point.coords - root.translation.vector;
    (
        point,
        Vec3::new(x, y, z) + Vec3::new(rx, ry, rz).cross(&arm),
    )
}

/// The speed was missing for every pair with an attached body.
#[test]
fn bug_how_fast_a_gap_shrinks_is_told_of_attached_bodies_too() {
    let near = "report_within_m = 100.0";
    for seed in 0..20 {
        let mut rng = Rng::new(seed);
        let places = [rng.vector(2.0), rng.vector(2.0)];
        let list = |v: &Vec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
        let ball = |id: u64, more: &str| {
            format!(
                "name = \"b{id}\"\nid = {id}\nshape = {{ type = \"sphere\", radius = 0.01 }}\n{near}\n{more}\n"
            )
        };
        let turned = rng.pose(Vec3::zeros()).rotation;
        let q = turned.as_vector();
        let bodies = [
            ball(1, ""),
            ball(
                2,
                &format!(
                    "attached_to = \"b1\"\nposition = {}\norientation = [{:?}, {:?}, {:?}, {:?}]",
                    list(&places[0]),
                    q.x,
                    q.y,
                    q.z,
                    q.w
                ),
            ),
            ball(
                3,
                &format!("attached_to = \"b2\"\nposition = {}", list(&places[1])),
            ),
            ball(4, ""),
            ball(5, "moves = false\nposition = [5, 5, 5]"),
        ];
        let locals = [
            Pose::from_parts(places[0].into(), turned),
            Pose::from_parts(places[1].into(), Pose::identity().rotation),
        ];
        let mut rig = Rig::new(&scene("", &bodies));
        for step in 0..3 {
            let (one, other) = (
                rng.pose(rng_at(seed, step)),
                rng.pose(rng_at(seed, step + 9)),
            );
            // In the last step only the velocities change.
            if step < 2 {
                rig.place(1, &one);
                rig.place(4, &other);
            }
            let mut twist = || {
                let (v, w) = (rng.vector(2.0), rng.vector(3.0));
                [v.x, v.y, v.z, w.x, w.y, w.z]
            };
            rig.velocities = vec![twist(), twist()];
            rig.send(ALL);
            let world = rig.engine.world();
            let pose = |name: &str| body(world, name).pose;
            let root = pose("b1");
            let of = |id: u64| match id {
                1 => middle(&root, &[], &rig.velocities[0]),
                2 => middle(&root, &locals[..1], &rig.velocities[0]),
                3 => middle(&root, &locals, &rig.velocities[0]),
                4 => middle(&pose("b4"), &[], &rig.velocities[1]),
                _ => (Point::new(5.0, 5.0, 5.0), Vec3::zeros()),
            };
            for (a, b) in [(1, 4), (2, 4), (3, 4), (1, 5), (2, 5), (3, 5), (4, 5)] {
                let ((at_a, v_a), (at_b, v_b)) = (of(a), of(b));
                let truth = -(v_b - v_a).dot(&(at_b - at_a).normalize());
                let told = rig.pair(a, b).unwrap().closing_mps;
                assert!(
                    (told - truth).abs() < 1e-9,
                    "seed {seed} {a} {b}: {told} {truth}"
                );
            }
        }
        // Without velocities neither the body nor those attached to it have one.
        rig.velocities.clear();
        rig.send(ALL);
        for a in [1, 2, 3] {
            assert!(rig.pair(a, 5).unwrap().closing_mps.is_nan(), "{a}");
        }
    }
}

fn rng_at(seed: u64, step: u64) -> Vec3 {
    Rng::new(seed * 100 + step).vector(4.0)
}

fn body<'w>(world: &'w sweepd::world::World, name: &str) -> &'w Body {
    world.body(world.slot_named(name).unwrap()).unwrap()
}
