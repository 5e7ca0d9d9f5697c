//! Questions for the first contact of two bodies on a given motion: closed forms, samples of the motion, work cut off
//! after any unit.

mod attached;
mod bugs;

use sweepd::math::Vec3;
use sweepd::narrow::gap_between;
use sweepd::query::ImpactQuestion;
use sweepd::scene::{Question, Request};
use sweepd::time::{Meter, SystemClock};
use sweepd::wire::{ImpactFound, MessageHeader, Verdict};
use sweepd::world::{Body, World};

use crate::oracle::rng::Rng;
use crate::rig::{ALL, Rig, ball, body, scene};

const ROD: &str = "{ type = \"capsule\", radius = 0.1, half_height = 1.0, orientation = [0, 0.7071067811865476, 0, 0.7071067811865476] }";
const PYRAMID: &str = "{ type = \"trimesh\", vertices = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 1]], faces = [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]] }";
const SHAPES: [&str; 5] = [
    "{ type = \"sphere\", radius = 0.7 }",
    "{ type = \"box\", half_extents = [0.5, 0.8, 0.3] }",
    ROD,
    PYRAMID,
    "[{ type = \"sphere\", radius = 0.3, position = [-1, 0, 0] }, { type = \"cone\", radius = 0.4, half_height = 0.4, position = [1, 0, 0] }]",
];

fn question(world: &World, json: &str) -> Result<ImpactQuestion, String> {
    let json = format!("{{\"impact\": {json}}}");
    let Request::Ask(Question::Impact(asked)) = Request::parse(json.as_bytes(), &[])? else {
        panic!("an impact");
    };
    ImpactQuestion::new(world, MessageHeader::default(), &asked)
}

fn ask(world: &World, json: &str) -> ImpactFound {
    question(world, json).unwrap().answer(&SystemClock)
}

fn warnings(world: &World, json: &str) -> Vec<String> {
    question(world, json).unwrap().warnings
}

fn rig(bodies: &[String]) -> Rig {
    let mut rig = Rig::new(&scene("", bodies));
    rig.send(ALL);
    rig
}

fn at(found: &ImpactFound, seconds: f64) {
    assert_eq!(
        found.verdict,
        Verdict::Colliding.code(),
        "{seconds} {found:?}"
    );
    let (low, high) = (found.t_min_s, found.t_max_s.unwrap());
    assert!(
        low <= seconds + 1e-12 && seconds - 1e-12 <= high,
        "{seconds} {found:?}"
    );
    assert!(high - low < 1e-7, "{seconds} {found:?}");
}

#[test]
fn straight_ways_and_turns_end_where_formulas_say() {
    let balls = rig(&[ball(1, 0.0, ""), ball(2, 5.0, "")]);
    let world = balls.engine.world();
    let found = ask(
        world,
        r#"{"a": "b1", "b": "b2", "linear_a": [1, 0, 0], "linear_b": [-0.5, 0, 0], "within_s": 3}"#,
    );
    at(&found, 2.0);
    assert_eq!(
        (found.linear_a, found.linear_b),
        ([1.0, 0.0, 0.0], [-0.5, 0.0, 0.0])
    );
    let late = ask(
        world,
        r#"{"a": "b1", "b": "b2", "linear_a": [1, 0, 0], "within_s": 2.9}"#,
    );
    assert_eq!(
        (late.verdict, late.t_min_s, late.t_max_s),
        (Verdict::Apart.code(), 2.9, None)
    );
    // First past each other by more than both radii, then by less, off-centre.
    let past = ask(
        world,
        r#"{"a": "b1", "b": "b2", "linear_a": [1, 0.5, 0], "within_s": 99}"#,
    );
    assert_eq!(past.verdict, Verdict::Apart.code(), "{past:?}");
    let askew = ask(
        world,
        r#"{"a": "b1", "b": "b2", "linear_a": [1, 0.3, 0], "within_s": 99}"#,
    );
    let (speed2, along) = (1.09, 5.0);
    at(&askew, (along - (25.0_f64 - speed2 * 21.0).sqrt()) / speed2);
    // A rod that turns into a ball next to its middle.
    let turning = rig(&[
        body(1, [0.0; 3], ROD, ""),
        body(
            2,
            [0.0, 0.8, 0.0],
            "{ type = \"sphere\", radius = 0.2 }",
            "",
        ),
    ]);
    let found = ask(
        turning.engine.world(),
        r#"{"a": "b1", "b": "b2", "angular_a": [0, 0, 2], "within_s": 3}"#,
    );
    at(
        &found,
        (std::f64::consts::FRAC_PI_2 - (0.3_f64 / 0.8).asin()) / 2.0,
    );
    // The body turns about a joint; its centre moves in a straight line.
    let arm = "{ type = \"sphere\", radius = 0.5, position = [1, 0, 0] }";
    let joint = rig(&[
        body(1, [0.0; 3], arm, ""),
        body(
            2,
            [1.0, 3.0, 0.0],
            "{ type = \"sphere\", radius = 0.5 }",
            "",
        ),
    ]);
    at(
        &ask(
            joint.engine.world(),
            r#"{"a": "b1", "b": "b2", "angular_a": [0, 0, 1], "within_s": 5}"#,
        ),
        2.0,
    );
    // A ball falls to a floor; two balls that already touch have time 0.
    let floor = "name = \"floor\"\nid = 9\nmoves = false\nshape = { type = \"half_space\", normal = [0, 0, 1], offset = -5 }\n";
    let falling = rig(&[floor.to_owned(), ball(1, 0.0, ""), ball(2, 1.5, "")]);
    let world = falling.engine.world();
    at(
        &ask(
            world,
            r#"{"a": "floor", "b": "b1", "linear_b": [3, 0, -2], "angular_b": [1, 2, 3], "within_s": 9}"#,
        ),
        2.0,
    );
    at(&ask(world, r#"{"a": "b1", "b": "b2"}"#), 0.0);
}

/// A wheel turning next to a plate only got the verdict `possible`: its rotation counted as motion of its surface.
#[test]
fn bug_what_spins_about_its_own_axis_goes_nowhere() {
    let shapes = [
        "{ type = \"cylinder\", radius = 1, half_height = 0.1 }",
        "[{ type = \"cone\", radius = 1, half_height = 0.5 }, { type = \"sphere\", radius = 0.2, position = [0, 0, 0.5] }]",
    ];
    let plate = |gap: f64| {
        let plate = "{ type = \"box\", half_extents = [1, 1, 0.1] }";
        body(2, [2.0 + gap, 0.0, 0.0], plate, "")
    };
    for shape in shapes {
        let near = rig(&[body(1, [0.0; 3], shape, ""), plate(1e-4)]);
        let found = ask(
            near.engine.world(),
            r#"{"a": "b1", "b": "b2", "angular_a": [0, 0, 50], "within_s": 10}"#,
        );
        assert_eq!(found.verdict, Verdict::Apart.code(), "{found:?}");
    }
    let far = rig(&[body(1, [0.0; 3], shapes[0], ""), plate(1.0)]);
    let found = ask(
        far.engine.world(),
        r#"{"a": "b1", "b": "b2", "linear_a": [0.5, 0, 0], "angular_a": [0, 0, 50], "within_s": 10}"#,
    );
    at(&found, 2.0);
    // Rotation about any other axis does move the surface.
    let above = "{ type = \"box\", half_extents = [1, 1, 0.1] }";
    let above = body(2, [0.0, 0.0, 0.5], above, "");
    let near = rig(&[body(1, [0.0; 3], shapes[0], ""), above]);
    let found = ask(
        near.engine.world(),
        r#"{"a": "b1", "b": "b2", "angular_a": [0, 1, 0], "within_s": 1}"#,
    );
    assert_eq!(found.verdict, Verdict::Colliding.code(), "{found:?}");
}

#[test]
fn velocities_are_those_that_were_sent_where_none_are_said() {
    let mut rig = rig(&[ball(1, 0.0, ""), ball(2, 5.0, "")]);
    let json = r#"{"a": "b1", "b": "b2", "within_s": 9}"#;
    let still = question(rig.engine.world(), json).unwrap();
    assert_eq!(still.warnings.len(), 2, "{:?}", still.warnings);
    assert!(
        still.warnings[0].contains("sends no velocity"),
        "{:?}",
        still.warnings
    );
    assert_eq!(still.answer(&SystemClock).verdict, Verdict::Apart.code());
    rig.velocities = vec![[1.0, 0.0, 0.0, 0.0, 0.0, 9.0], [0.0; 6]];
    rig.send(ALL);
    let sent = question(rig.engine.world(), json).unwrap();
    assert!(sent.warnings.is_empty(), "{:?}", sent.warnings);
    let found = sent.answer(&SystemClock);
    at(&found, 3.0);
    assert_eq!(found.angular_a, [0.0, 0.0, 9.0]);
    let other = ask(
        rig.engine.world(),
        r#"{"a": "b1", "b": "b2", "linear_a": [3, 0, 0], "within_s": 9}"#,
    );
    at(&other, 1.0);
    assert_eq!(other.angular_a, [0.0; 3]);
}

/// Lower and upper end of the gap at a share of the motion.
fn gap_at((a, b): (&Body, &Body), share: f64) -> (f64, f64) {
    let there = |body: &Body| {
        let path = body.path.as_deref().unwrap();
        body.at(&path.legs()[0].at(share, path.pivot()))
    };
    let mut meter = Meter::unlimited(&SystemClock);
    let gap = gap_between(&there(a), &there(b), 0.0, &mut meter).gap;
    (gap.min, gap.max)
}

#[test]
fn samples_of_the_way_agree_and_so_does_any_part_of_the_work() {
    let (mut touched, mut free, mut open) = (0, 0, 0);
    for seed in 0..120 {
        let mut rng = Rng::new(seed);
        let shapes = [SHAPES[rng.below(5)], SHAPES[rng.below(5)]];
        let mut rig = Rig::new(&scene(
            "",
            &[
                body(1, [0.0; 3], shapes[0], ""),
                body(2, [0.0; 3], shapes[1], ""),
            ],
        ));
        let places = [rng.vector(0.5), rng.direction() * 4.0];
        for (id, at) in (1..).zip(places) {
            let pose = rng.pose(at);
            rig.place(id, &pose);
        }
        rig.send(ALL);
        let mut velocity = |aim: Vec3| (aim + rng.vector(0.7), rng.vector(4.0));
        let (of_a, of_b) = (velocity(Vec3::zeros()), velocity(places[1] * -0.4));
        let list = |v: &Vec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
        let json = format!(
            "{{\"a\": \"b1\", \"b\": \"b2\", \"linear_a\": {}, \"angular_a\": {}, \"linear_b\": {}, \"angular_b\": {}, \"within_s\": 3}}",
            list(&of_a.0),
            list(&of_a.1),
            list(&of_b.0),
            list(&of_b.1)
        );
        let world = rig.engine.world();
        let named = |name: &str| world.body(world.slot_named(name).unwrap()).unwrap();
        let a = named("b1").on_way(of_a.0, of_a.1, 3.0);
        let b = named("b2").on_way(of_b.0, of_b.1, 3.0);
        let asked = question(world, &json).unwrap();
        for units in [0, 1, 3, 10, 30, 100, u64::MAX] {
            let found = asked.answer_within(&SystemClock, Some(units));
            let what = format!("seed {seed} {shapes:?} {json} after {units}: {found:?}");
            for k in 0..=300 {
                let share = f64::from(k) / 300.0;
                if share * 3.0 < found.t_min_s {
                    let (_, most) = gap_at((&a, &b), share);
                    assert!(most > -1e-9, "{share}: {most} {what}");
                }
            }
            if let Some(end_s) = found.t_max_s {
                assert!(found.t_min_s <= end_s && end_s <= 3.0, "{what}");
                let (least, _) = gap_at((&a, &b), end_s / 3.0);
                assert!(least <= 1e-7, "{least} {what}");
            }
            match Verdict::from_code(found.verdict) {
                Some(Verdict::Possible) => open += 1,
                Some(Verdict::Apart) if units == u64::MAX => free += 1,
                Some(Verdict::Colliding) if units == u64::MAX => touched += 1,
                _ => {}
            }
        }
    }
    assert!(
        touched > 30 && free > 20 && open > 100,
        "{touched} {free} {open}"
    );
}

#[test]
fn what_cannot_be_followed_is_answered_with_what_to_change() {
    let floor = "name = \"floor\"\nid = 9\nmoves = false\nshape = { type = \"half_space\", normal = [0, 0, 1], offset = -5 }\n";
    let rod = body(3, [0.0, 9.0, 0.0], ROD, "");
    let rig = rig(&[floor.to_owned(), ball(1, 0.0, ""), ball(2, 5.0, ""), rod]);
    for (json, wanted) in [
        (r#"{"a": "b1", "b": "b1"}"#, "itself"),
        (r#"{"a": "b1", "b": "b7"}"#, "no body \"b7\""),
        (r#"{"a": "b1"}"#, "`b` is missing"),
        (
            r#"{"a": "b1", "b": "floor", "linear_b": [0, 0, 1]}"#,
            "let the other body move",
        ),
        (
            r#"{"a": "b3", "b": "b2", "angular_a": [0, 0, 1000], "within_s": 1000}"#,
            "shorter time",
        ),
        (
            r#"{"a": "b1", "b": "b2", "linear_a": [0, 0, 1e9]}"#,
            "stay within",
        ),
        (r#"{"a": "b1", "b": "b2", "within_s": 0}"#, "from"),
        (
            r#"{"a": "b1", "b": "b2", "linear": [0, 0, 1]}"#,
            "did you mean",
        ),
    ] {
        let error = question(rig.engine.world(), json).unwrap_err();
        assert!(error.contains(wanted), "{json}: {error}");
    }
}

/// A thousand kilometres from the origin a motion is known to a few nanometres, which correspond to milliseconds at
/// this speed.
#[test]
fn bug_a_touch_that_rounding_alone_tells_is_no_time_of_impact() {
    let shape = "{ type = \"sphere\", radius = 0.5 }";
    let far = 1_000_001.000_001;
    let bodies = |far: f64| {
        [
            body(1, [1e6, 0.0, 0.0], shape, ""),
            body(2, [far, 0.0, 0.0], shape, ""),
        ]
    };
    for (speed, within_s) in [(1e-6, 10.0), (1e-3, 10.0), (1.0, 3.0), (1e-6, 1.001)] {
        let rig = rig(&bodies(far));
        let json = format!(
            "{{\"a\": \"b1\", \"b\": \"b2\", \"linear_a\": [{speed:?}, 0, 0], \"within_s\": {within_s:?}}}"
        );
        let found = ask(rig.engine.world(), &json);
        let truth = (far - 1e6 - 1.0) / speed;
        assert!(found.t_min_s <= truth, "{truth} {found:?}");
        if let Some(until) = found.t_max_s {
            assert_eq!(found.verdict, Verdict::Colliding.code());
            assert!(
                truth <= until && until - found.t_min_s <= 2e-8 / speed,
                "{truth} {found:?}"
            );
        } else {
            assert_eq!(found.verdict, Verdict::Possible.code(), "{found:?}");
            assert!(within_s < 1.01, "{found:?}");
        }
    }
    // The bodies approach to within rounding errors and never touch.
    let rig = rig(&bodies(far));
    let json = r#"{"a": "b1", "b": "b2", "linear_a": [9.99e-7, 0, 0], "within_s": 1}"#;
    let found = ask(rig.engine.world(), json);
    assert_ne!(found.verdict, Verdict::Colliding.code(), "{found:?}");
}

#[test]
fn what_touches_to_the_last_digit_where_it_is_touches_at_once() {
    let rig = rig(&[ball(1, 0.0, ""), ball(2, 2.0, "")]);
    for json in [
        r#"{"a": "b1", "b": "b2"}"#,
        r#"{"a": "b1", "b": "b2", "linear_a": [1, 0, 0]}"#,
        r#"{"a": "b1", "b": "b2", "linear_a": [-1, 0, 0], "within_s": 3}"#,
        r#"{"a": "b1", "b": "b2", "linear_a": [0, 1, 0], "within_s": 3}"#,
    ] {
        at(&ask(rig.engine.world(), json), 0.0);
    }
}
