//! The bodies that a body of a running daemon touches or would touch, over the request service.

use sweepd::transport::client::Client;
use sweepd::wire::{Answer, TouchingFound, Verdict};

use crate::live::{Desk, SECOND_NS, TWO_SPHERES, at, step};

fn ask(client: &mut Client, question: &str) -> Answer {
    let json = format!("{{\"touching\": {question}}}");
    client.request(&json, &[], 30 * SECOND_NS).unwrap()
}

fn found(client: &mut Client, question: &str) -> TouchingFound {
    let answer = ask(client, question);
    assert!(answer.ok && answer.error.is_none(), "{answer:?}");
    let found = answer.touching.unwrap();
    assert_eq!(answer.scene_rev, found.tick_header.scene_rev);
    found
}

#[test]
fn a_pose_is_tried_and_nothing_changes() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    let lost = ask(&mut client, r#"{"body": "a"}"#);
    assert!(!lost.ok && lost.error.unwrap().contains("not_received"));
    let tried = found(&mut client, r#"{"body": "a", "position": [0, 0, 0]}"#);
    assert!(!tried.complete && tried.unknown[0].body == "b", "{tried:?}");
    step(&mut client, &[at(1, 0.0), at(2, 3.0)]);
    let header = client.view().tick().header;
    let here = found(&mut client, r#"{"body": "a"}"#);
    assert!(here.complete && here.rows.is_empty(), "{here:?}");
    assert_eq!(here.tick_header.boot_id, header.boot_id);
    assert!(here.tick_header.tick >= header.tick);
    let there = found(&mut client, r#"{"body": "a", "position": [2.5, 0, 0]}"#);
    let [row] = &there.rows[..] else {
        panic!("{there:?}");
    };
    assert_eq!((row.a.as_deref(), row.b.as_str()), (Some("a"), "b"));
    assert_eq!(row.known.verdict, Verdict::Colliding.code());
    assert!(
        (row.known.gap_best_m.unwrap() + 0.5).abs() < 1e-12,
        "{row:?}"
    );
    assert!((row.known.normal.unwrap()[0] - 1.0).abs() < 1e-9, "{row:?}");
    assert!((1..60 * SECOND_NS).contains(&row.age_ns.unwrap()));
    assert_eq!(found(&mut client, r#"{"body": "a"}"#).rows, []);
    step(&mut client, &[at(1, 0.0), at(2, 3.0)]);
    assert!(client.view().tick().colliding == 0);
}

#[test]
fn a_region_is_asked_for_by_its_shape_and_a_bad_one_is_refused() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    step(&mut client, &[at(1, 0.0), at(2, 3.0)]);
    let region = r#"{"type": "box", "half_extents": [1, 1, 1]}"#;
    let inside = found(
        &mut client,
        &format!("{{\"shape\": {region}, \"position\": [4.4, 0, 0], \"within_m\": 0.1}}"),
    );
    let [row] = &inside.rows[..] else {
        panic!("{inside:?}");
    };
    assert_eq!((&row.a, row.b.as_str()), (&None, "b"));
    for (question, word) in [
        (r#"{"body": "c"}"#, "\"c\""),
        (
            r#"{"shape": {"type": "box", "half_extents": [1, 1]}}"#,
            "write 3",
        ),
        (
            r#"{"shape": {"type": "trimesh", "file": "none.stl"}}"#,
            "none.stl",
        ),
        (r#"{}"#, "name a body"),
    ] {
        let answer = ask(&mut client, question);
        let why = answer.error.unwrap();
        assert!(
            !answer.ok && answer.touching.is_none() && why.contains(word),
            "{why}"
        );
    }
}
