//! Questions about bodies whose poses are unknown, which are attached to others, of which there are too many, or which
//! cannot be asked for.

use std::collections::BTreeSet;

use sweepd::limits::{TOUCHING_ROWS_MAX, UNKNOWN_ROWS_MAX};
use sweepd::math::Vec3;
use sweepd::wire::TouchingFound;

use super::{SHAPES, ask, names, question};
use crate::rig::{ALL, Rig, ball, body, scene};

#[test]
fn a_body_whose_place_is_not_known_is_named_and_never_missing() {
    let bodies = [
        ball(1, 0.0, ""),
        ball(2, 1.5, ""),
        ball(3, 50.0, ""),
        ball(4, 1.6, "on_stale = \"hold\""),
        ball(5, 1.7, "max_speed_mps = 1.0"),
        ball(6, 40.0, "max_speed_mps = 1.0"),
        ball(7, 1.8, "group = 2\nmask = 2"),
        ball(8, 1.9, "on_stale = \"remove\""),
        ball(9, 60.0, "on_stale = \"hold\""),
    ];
    let mut rig = Rig::new(&scene("", &bodies));
    // Before the first pose, all bodies that the filters allow are unknown.
    let error = question(rig.engine.world(), r#"{"body": "b1"}"#).unwrap_err();
    assert!(error.contains("not_received"), "{error}");
    let there = r#"{"body": "b1", "position": [0, 0, 0]}"#;
    let found = ask(rig.engine.world(), there);
    let unknown = |found: &TouchingFound| -> Vec<(String, String)> {
        let each = found.unknown.iter();
        each.map(|it| (it.body.clone(), it.status.clone()))
            .collect()
    };
    let status = |names: &[&str], status: &str| -> Vec<(String, String)> {
        names
            .iter()
            .map(|name| ((*name).to_owned(), status.to_owned()))
            .collect()
    };
    let others = ["b2", "b3", "b4", "b5", "b6", "b8", "b9"];
    assert_eq!(unknown(&found), status(&others, "not_received"));
    assert!(
        !found.complete && found.rows.is_empty() && found.ignored == 1,
        "{found:?}"
    );
    rig.send(ALL);
    let found = ask(rig.engine.world(), there);
    assert!(found.complete && found.unknown.is_empty(), "{found:?}");
    assert_eq!(names(&found).len(), 4, "{found:?}");
    // Its pose is rejected, far away: the body may be anywhere.
    rig.row(3).position[0] = f64::NAN;
    rig.send(ALL);
    let found = ask(rig.engine.world(), there);
    assert_eq!(unknown(&found), status(&["b3"], "rejected"));
    // All poses are stale. A stale body may have come near. A held body is reported at its pose, but may be elsewhere,
    // and a body held far away may be here. A slow body far away is no doubt.
    rig.row(3).position[0] = 50.0;
    rig.send(ALL);
    rig.idle(600_000_000, ALL);
    let found = ask(rig.engine.world(), there);
    let mut stale = status(&["b2", "b3", "b5"], "stale");
    stale.extend(status(&["b4", "b9"], "held"));
    stale.extend(status(&["b8"], "removed_by_age"));
    stale.sort();
    assert_eq!(unknown(&found), stale, "{found:?}");
    assert!(
        !found.complete && names(&found) == BTreeSet::from(["b4".to_owned()]),
        "{found:?}"
    );
}

#[test]
fn what_hangs_on_a_body_goes_with_it_and_is_asked_for_too() {
    let bodies = [
        ball(1, 0.0, ""),
        body(2, [0.0, 3.0, 0.0], SHAPES[0], "attached_to = \"b1\"\n"),
        body(3, [0.0, 3.0, 0.0], SHAPES[0], "attached_to = \"b2\"\n"),
        ball(4, 10.0, ""),
        body(5, [10.0, 6.0, 0.0], SHAPES[0], ""),
        body(6, [10.0, 6.1, 0.0], SHAPES[0], "group = 2\nmask = 2\n"),
    ];
    let mut rig = Rig::new(&scene("", &bodies));
    rig.send(ALL);
    let pairs = |found: &TouchingFound| -> Vec<(String, String)> {
        let rows = found.rows.iter();
        let mut pairs: Vec<_> = rows
            .map(|row| (row.a.clone().unwrap(), row.b.clone()))
            .collect();
        pairs.sort();
        pairs
    };
    let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
    let found = ask(
        rig.engine.world(),
        r#"{"body": "b1", "position": [10, 0, 0]}"#,
    );
    assert_eq!(found.asked, ["b1", "b2", "b3"]);
    assert_eq!(
        pairs(&found),
        [pair("b1", "b4"), pair("b3", "b5")],
        "{found:?}"
    );
    assert_eq!(found.ignored, 1, "{found:?}");
    let all = ask(
        rig.engine.world(),
        r#"{"body": "b1", "position": [10, 0, 0], "filters": false}"#,
    );
    assert_eq!(
        pairs(&all),
        [pair("b1", "b4"), pair("b3", "b5"), pair("b3", "b6")]
    );
    // A body from the middle of the chain: its parent stays where it is, and is met.
    let found = ask(
        rig.engine.world(),
        r#"{"body": "b2", "position": [0, 0.2, 0], "filters": false}"#,
    );
    assert_eq!(found.asked, ["b2", "b3"]);
    assert_eq!(pairs(&found), [pair("b2", "b1")], "{found:?}");
    assert_eq!(
        rig.engine
            .world()
            .body(rig.engine.world().slot_named("b3").unwrap())
            .unwrap()
            .pose
            .translation
            .vector,
        Vec3::new(0.0, 6.0, 0.0)
    );
}

#[test]
fn what_there_is_no_room_for_is_counted_and_nothing_is_complete() {
    let count = TOUCHING_ROWS_MAX as u64 + 50;
    let bodies: Vec<String> = (1..=count)
        .map(|id| ball(id, id as f64 * 0.0005, ""))
        .collect();
    let mut rig = Rig::new(&scene("", &bodies));
    rig.checked = false;
    let sphere = r#"{"shape": {"type": "sphere", "radius": 2.0}}"#;
    let found = ask(rig.engine.world(), sphere);
    assert_eq!(found.unknown.len(), UNKNOWN_ROWS_MAX);
    assert_eq!(found.unknown_left_out, count - UNKNOWN_ROWS_MAX as u64);
    rig.demand = sweepd::wire::Demand::default();
    rig.send(crate::rig::NONE);
    let found = ask(rig.engine.world(), sphere);
    assert_eq!((found.rows.len(), found.left_out), (TOUCHING_ROWS_MAX, 50));
    assert!(!found.complete && found.unknown.is_empty());
    let deepest = found.rows.iter().map(|row| row.known.gap_min_m.unwrap());
    assert!(deepest.is_sorted(), "worst first");
    // Bodies outside a half-space have no row, so that the limit of rows does not matter.
    let above = ask(
        rig.engine.world(),
        r#"{"shape": {"type": "half_space", "normal": [0, 0, 1], "offset": -1.5}}"#,
    );
    assert!(above.complete && above.rows.is_empty(), "{above:?}");
}

#[test]
fn what_cannot_be_asked_is_answered_with_what_to_change() {
    let mut rig = Rig::new(&scene(
        "",
        &[ball(1, 0.0, ""), ball(2, 1.0, "enabled = false")],
    ));
    rig.send(ALL);
    for (json, wanted) in [
        (r#"{"body": "b3"}"#, "no body \"b3\""),
        (r#"{"body": "b2"}"#, "enable it"),
        (
            r#"{"body": "b2", "position": [0, 0, 0]}"#,
            "ask for its `shape`",
        ),
        (
            r#"{"body": "b1", "orientation": [0, 0, 0, 1]}"#,
            "without `position`",
        ),
        (r#"{"body": "b1", "position": [0, 0, 1e999]}"#, "not JSON"),
        (
            r#"{"body": "b1", "position": [0, 0, 0], "orientation": [1, 1, 0, 0]}"#,
            "unit quaternion",
        ),
        (r#"{"body": "b1", "mask": 1}"#, "for a `shape`"),
        (
            r#"{"body": "b1", "shape": {"type": "sphere", "radius": 1}}"#,
            "keep one",
        ),
        (r#"{"within_m": 1}"#, "name a body, or write a shape"),
        (r#"{"body": "b1", "within_m": -1}"#, "from 0 to"),
        (r#"{"shape": []}"#, "empty list"),
        (
            r#"{"shape": {"type": "spher", "radius": 1}}"#,
            "did you mean \"sphere\"?",
        ),
        (
            r#"{"body": "b1", "withn_m": 1}"#,
            "did you mean `within_m`?",
        ),
    ] {
        let error = question(rig.engine.world(), json).unwrap_err();
        assert!(error.contains(wanted), "{json}: {error}");
    }
    // A disabled body does not exist for others.
    let found = ask(rig.engine.world(), r#"{"body": "b1", "filters": false}"#);
    assert!(
        found.rows.is_empty() && found.complete && found.ignored == 1,
        "{found:?}"
    );
}

/// The half-space, not only the body in question, may be nearer than at its last pose.
#[test]
fn bug_a_half_space_that_is_stale_is_named_where_it_may_reach() {
    let gate = "{ type = \"half_space\", normal = [0, 0, 1], offset = 0.0 }";
    let mut rig = Rig::new(&scene(
        "",
        &[body(1, [0.0; 3], gate, "max_speed_mps = 0.5")],
    ));
    rig.send(ALL);
    rig.idle(1_600_000_000, ALL);
    let at = |z: f64| {
        let shape = "{\"type\": \"sphere\", \"radius\": 0.1}";
        format!(
            "{{\"shape\": {shape}, \"position\": [0, 0, {z:?}], \"orientation\": [0, 0, 0, 1]}}"
        )
    };
    let found = ask(rig.engine.world(), &at(0.5));
    assert!(!found.complete && found.unknown.len() == 1, "{found:?}");
    let found = ask(rig.engine.world(), &at(1.0));
    assert!(found.complete && found.unknown.is_empty(), "{found:?}");
}
