//! Chains that do not start below the scene's frame, and links that do not concern a body.

use super::*;

#[test]
fn a_chain_that_joins_nothing_is_told_with_both_ends() {
    let mut one = tf("tool");
    one.take_links(&link("map", "world", MS), false, at(MS));
    one.take_links(&link("base", "tool", MS), false, at(MS));
    assert!(look(&mut one, MS).is_empty(), "nobody has said where");
    let told = one.faults(9, MS);
    assert!(
        told[0].contains("no chain of links joins frame \"base\" and \"world\"")
            && told[0].contains("ends at \"map\""),
        "{told:?}"
    );
    one.take_links(&link("map", "base", 2 * MS), false, at(2 * MS));
    let said = look(&mut one, 2 * MS);
    assert_eq!(said[0].result.unwrap().position, [1.0, 0.0, 0.0]);
    assert!(one.faults(9, 2 * MS).is_empty());
}

#[test]
fn bug_a_camera_that_was_started_again_began_bodies_anew_that_hang_on_none() {
    let mut one = tf("tool");
    one.take_links(&link("world", "tool", 9000 * MS), false, at(MS));
    assert_eq!(look(&mut one, MS).len(), 1);
    one.take_links(&link("camera", "tag", 9000 * MS), false, at(MS));
    for now_ms in [10, 200, 400] {
        let tag = link("camera", "tag", now_ms * MS);
        assert!(!one.take_links(&tag, false, at(now_ms * MS)));
        assert!(look(&mut one, now_ms * MS).is_empty());
    }
    // A restarted clock of the body's own link restarts the source.
    for (now_ms, back) in [(410, false), (600, false), (800, true)] {
        let tool = link("world", "tool", now_ms * MS);
        assert_eq!(one.take_links(&tool, false, at(now_ms * MS)), back);
    }
}

#[test]
fn bug_two_publishers_of_a_fixed_link_that_differ_were_told_nowhere() {
    let mut one = tf("tool");
    let from = |number, now_ns| Receipt {
        from: Gid::from([number; 16]),
        ..at(now_ns)
    };
    let told = |one: &mut Source, now_ns| {
        let told = one.faults(9, now_ns);
        told.iter()
            .any(|f| f.contains("frame tool: another publisher"))
    };
    one.take_links(&link("world", "tool", 0), true, from(1, MS));
    one.take_links(&link("world", "tool", MS), true, from(2, MS));
    assert!(!told(&mut one, MS), "it is the same link");
    let mut other = link("world", "tool", 0);
    other.transforms[0].transform.translation.x = 7.0;
    one.take_links(&other, true, from(2, 2 * MS));
    assert!(!told(&mut one, 2 * MS), "its sender changed it");
    one.take_links(&link("world", "tool", 0), true, from(1, 3 * MS));
    assert!(told(&mut one, 3 * MS));
}

#[test]
fn bug_a_body_that_is_put_after_frames_without_end_is_not_at_the_scenes_origin() {
    let mut one = tf("tool");
    for n in 0..70_000 {
        let seen = link("camera", &format!("seen_{n}"), MS);
        one.take_links(&seen, false, at(MS));
    }
    let late = BodyNote {
        id: 2,
        name: "late".to_owned(),
        source: Some(0),
        frame: "late".to_owned(),
        ..BodyNote::default()
    };
    one.put_body(&late);
    assert!(look(&mut one, 2 * MS).is_empty(), "nobody has said where");
    let told = one.faults(9, 2 * MS);
    assert!(told[1].contains("no link from frame \"late\""), "{told:?}");
    one.take_links(&link("world", "late", 3 * MS), false, at(3 * MS));
    let said = look(&mut one, 3 * MS);
    assert_eq!(said[0].result.unwrap().position, [1.0, 0.0, 0.0]);
}
