//! Times of impact that were wrong, too wide or missing.

use sweepd::math::Vec3;
use sweepd::wire::Verdict;

use super::{SHAPES, ask, at, rig};
use crate::oracle::rng::Rng;
use crate::rig::{ALL, Rig, body, scene};

/// The spin of a ball counted as motion of its surface.
#[test]
fn bug_a_ball_that_spins_touches_when_one_that_does_not_would() {
    for place in [[0.0; 3], [0.0, 0.3, -0.1]] {
        let ball = format!("{{ type = \"sphere\", radius = 0.13, position = {place:?} }}");
        let post = "{ type = \"cylinder\", radius = 0.2, half_height = 1 }";
        let rig = rig(&[
            body(1, [0.0; 3], &ball, ""),
            body(2, [place[0] + 0.34, place[1], place[2]], post, ""),
        ]);
        // Velocity of the origin such that the centre of the ball moves along x at 0.1 m/s, whatever its spin.
        let spin = Vec3::new(0.0, 125.87, 3.0);
        let [x, y, z]: [f64; 3] = (Vec3::x() * 0.1 - spin.cross(&Vec3::from(place))).into();
        let json = format!(
            r#"{{"a": "b1", "b": "b2", "linear_a": [{x:?}, {y:?}, {z:?}], "angular_a": [0, 125.87, 3]}}"#
        );
        at(&ask(rig.engine.world(), &json), 0.1);
    }
}

#[test]
fn bug_the_first_of_several_touches_was_left_open_up_to_a_later_one() {
    let bodies = [
        r#"name = "bar"
moves = false
position = [0.6368592544792979, 0.43577930203426707, 0.9176007212909796]
orientation = [0.42784693145087976, 0.7365849091786374, -0.21577395876454253, -0.47731674340781527]
shape = { type = "box", half_extents = [0.2015738836889722, 0.20299112438313482, 0.9278040127115219] }"#,
        r#"name = "roller"
moves = false
position = [1.2073054679859343, 0.3646137400052156, -1.591091367559807]
orientation = [0.7677919816758492, -0.31810038564200405, -0.4352122519302526, -0.3462627807005528]
shape = { type = "cylinder", radius = 0.2, half_height = 1 }"#,
    ];
    let rig = rig(&bodies.map(str::to_owned));
    let found = ask(
        rig.engine.world(),
        r#"{"a": "bar", "b": "roller", "within_s": 1,
            "angular_a": [5.007442712078114, 0.6021863086100283, -0.7317263361525143],
            "linear_b": [-1.5502916006967578, -0.09932682419061667, 3.6064579493990205],
            "angular_b": [52.465515803451204, 8.10818615314173, 9.584417041116245]}"#,
    );
    assert_eq!(found.verdict, Verdict::Colliding.code());
    let (low, high) = (found.t_min_s, found.t_max_s.unwrap());
    assert!(0.32 < low && high - low < 1e-6, "{found:?}");
}

/// Far from the origin the gap is known so inaccurately that its slope has no meaning.
#[test]
fn bug_what_goes_right_through_another_far_out_is_hit() {
    let bodies = [
        r#"name = "a"
moves = false
position = [32317.989288008353, 65020.8713232141, 21937.974492601374]
orientation = [-0.3810960213406204, -0.6135250711968664, 0.3289898365820283, 0.6083736491309922]
shape = { type = "box", half_extents = [0.8412680055272448, 0.5579724967206058, 0.8184758442832489] }"#,
        r#"name = "b"
moves = false
position = [32318.05416372216, 65019.300189348214, 21941.652444411448]
orientation = [0.16160683283154714, -0.2776781931373851, 0.6946104489993907, 0.6436570335038515]
shape = { type = "box", half_extents = [0.4552041465036235, 0.21622489485308055, 0.1612796005065167] }"#,
    ];
    let rig = rig(&bodies.map(str::to_owned));
    let found = ask(
        rig.engine.world(),
        r#"{"a": "a", "b": "b", "within_s": 1.5,
            "linear_a": [0.06487571380893808, -1.571133865889413, 3.6779518100721726]}"#,
    );
    assert_eq!(found.verdict, Verdict::Colliding.code(), "{found:?}");
    // All of these meet head-on.
    let (mut open, mut wide) = (0, 0.0_f64);
    for seed in 0..600 {
        let mut rng = Rng::new(seed);
        let far = [1e4, 1e5, 1e6][rng.below(3)];
        let (at, way) = (rng.vector(far), rng.direction());
        let bodies = [
            body(1, [0.0; 3], SHAPES[rng.below(4)], ""),
            body(2, [0.0; 3], SHAPES[rng.below(3)], ""),
        ];
        let mut rig = Rig::new(&scene("", &bodies));
        for (id, place) in [(1, at), (2, at + way * 4.0)] {
            let pose = rng.pose(place);
            rig.place(id, &pose);
        }
        rig.send(ALL);
        let [x, y, z] = (way * 4.0).into();
        let json = format!(
            r#"{{"a": "b1", "b": "b2", "linear_a": [{x:?}, {y:?}, {z:?}], "within_s": 1.5}}"#
        );
        let found = ask(rig.engine.world(), &json);
        match found.t_max_s {
            Some(until) => wide = wide.max((until - found.t_min_s) / far),
            None => open += 1,
        }
    }
    assert!(open == 0 && wide < 1e-12, "{open} {wide}");
}
