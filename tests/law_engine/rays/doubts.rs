//! Rays and bodies that may be elsewhere, are in no group, or were not tested; and the choice between two bodies met at
//! once.

use sweepd::math::Vec3;
use sweepd::time::SystemClock;
use sweepd::wire::Verdict;

use super::{ask, json, question};
use crate::rig::{ALL, Rig, ball, body, scene};

/// A ray along z through a position on the x axis.
fn through(x: f64, more: &str) -> String {
    json(&Vec3::new(x, 0.0, -9.0), &Vec3::z(), more)
}

#[test]
fn bug_a_body_that_is_held_off_the_way_was_no_doubt() {
    let mut rig = Rig::new(&scene(
        "",
        &[
            ball(1, 0.0, "on_stale = \"hold\""),
            ball(2, 20.0, "max_speed_mps = 1.0"),
        ],
    ));
    rig.send(ALL);
    let found = ask(rig.engine.world(), &through(5.0, ""));
    assert!(found.complete && found.verdict == Verdict::Apart.code());
    rig.idle(600_000_000, ALL);
    let found = ask(rig.engine.world(), &through(5.0, ""));
    assert!(
        !found.complete && found.verdict == Verdict::Possible.code(),
        "{found:?}"
    );
    let named: Vec<_> = found
        .unknown
        .iter()
        .map(|it| (&*it.body, &*it.status))
        .collect();
    assert_eq!(named, [("b1", "held")]);
    // A held body is hit at its pose, and also listed as uncertain.
    let found = ask(rig.engine.world(), &through(0.0, ""));
    assert_eq!(found.body.as_deref(), Some("b1"));
    assert!(!found.complete && found.unknown.len() == 1, "{found:?}");
}

#[test]
fn bug_a_body_of_no_group_is_met_by_a_ray_that_meets_all() {
    let mut rig = Rig::new(&scene("", &[ball(1, 0.0, "group = 0")]));
    rig.send(ALL);
    let found = ask(rig.engine.world(), &through(0.0, ""));
    assert_eq!(found.body.as_deref(), Some("b1"), "{found:?}");
    let found = ask(rig.engine.world(), &through(0.0, ", \"mask\": 4294967294"));
    assert_eq!((found.verdict, found.ignored), (Verdict::Apart.code(), 1));
}

#[test]
fn bug_a_ray_of_no_length_was_free_where_nothing_was_looked_at() {
    let mesh = "{ type = \"trimesh\", solid = true, vertices = [[-1, -1, -1], [1, -1, -1], [0, 1, -1], [0, 0, 1]], faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]] }";
    let mut rig = Rig::new(&scene("", &[body(1, [0.0; 3], mesh, "")]));
    rig.send(ALL);
    let at = |from: Vec3| {
        question(
            rig.engine.world(),
            &json(&from, &Vec3::x(), ", \"max_m\": 0"),
        )
        .unwrap()
    };
    let inside = at(Vec3::zeros());
    let found = inside.answer_within(&SystemClock, Some(0));
    assert!(
        !found.complete && found.verdict == Verdict::Possible.code(),
        "{found:?}"
    );
    assert_eq!(
        inside.answer(&SystemClock).verdict,
        Verdict::Colliding.code()
    );
    let outside = at(Vec3::new(0.9, 0.9, 0.9)).answer(&SystemClock);
    assert!(
        outside.complete && outside.verdict == Verdict::Apart.code(),
        "{outside:?}"
    );
}

#[test]
fn bug_of_two_bodies_that_a_ray_begins_in_the_one_of_the_lower_slot_was_told() {
    let mut rig = Rig::new(&scene("", &[ball(5, 0.0, ""), ball(3, 0.1, "")]));
    rig.send(ALL);
    let found = ask(rig.engine.world(), &json(&Vec3::zeros(), &Vec3::z(), ""));
    assert!(found.inside && found.t_max_m == Some(0.0), "{found:?}");
    assert_eq!(found.body.as_deref(), Some("b3"));
}
