//! The gap of two bodies of a running daemon, over the request service.

use sweepd::transport::client::Client;
use sweepd::wire::{Answer, Verdict};

use crate::live::{Desk, SECOND_NS, TWO_SPHERES, at, step};

fn ask(client: &mut Client, a: &str, b: &str) -> Answer {
    let json = format!(r#"{{"gap": {{"a": "{a}", "b": "{b}"}}}}"#);
    client.request(&json, &[], 30 * SECOND_NS).unwrap()
}

#[test]
fn a_gap_is_answered_with_the_tick_it_belongs_to_and_changes_nothing() {
    let desk = Desk::new();
    let _daemon = desk.run(TWO_SPHERES, &[]);
    let mut client = desk.source("sim");
    let unknown = ask(&mut client, "a", "b");
    assert!(!unknown.ok && unknown.error.unwrap().contains("not_received"));
    for x in [3.0, 0.5, 1.0] {
        step(&mut client, &[at(1, 0.0), at(2, x)]);
        let header = client.view().tick().header;
        let answer = ask(&mut client, "b", "a");
        assert!(answer.ok && answer.error.is_none(), "{answer:?}");
        assert_eq!(answer.scene_rev, header.scene_rev);
        let found = answer.gap.unwrap();
        assert_eq!(found.tick_header.boot_id, header.boot_id);
        assert!(found.tick_header.tick >= header.tick);
        let age_ns = found.age_ns.unwrap();
        assert!((1..60 * SECOND_NS).contains(&age_ns), "{age_ns}");
        let gap = x - 1.0;
        assert!(
            (found.known.gap_best_m.unwrap() - gap).abs() < 1e-12,
            "{found:?}"
        );
        assert!(found.known.gap_min_m.unwrap() <= gap && found.known.gap_max_m.unwrap() >= gap);
        let verdict = if gap > 0.0 {
            Verdict::Apart
        } else {
            Verdict::Colliding
        };
        assert_eq!(found.known.verdict, verdict.code(), "{found:?}");
        assert_eq!(found.known.touching, x == 1.0, "{found:?}");
        let normal = found.known.normal.unwrap();
        assert!((normal[0] + 1.0).abs() < 1e-9, "from B to A: {normal:?}");
    }
    for (a, b, word) in [
        ("a", "c", "\\\"c\\\""),
        ("a", "a", "itself"),
        ("", "a", "bytes"),
    ] {
        let answer = ask(&mut client, a, b);
        let why = answer.error.unwrap().replace('"', "\\\"");
        assert!(
            !answer.ok && answer.gap.is_none() && why.contains(word),
            "{why}"
        );
    }
}
