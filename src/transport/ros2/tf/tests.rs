//! Chains and their faults, and the removal of frames that no body needs.

#![allow(clippy::float_cmp, reason = "numbers are handed on bit by bit")]

use super::room::FRAMES_MAX;
use super::*;
use crate::wire::ros::{Header, Time, Transform};

const BACK_NS: u64 = 500;

fn link(parent: &str, child: &str, x: f64, stamp_ns: u64) -> TransformStamped {
    let rotation = [0.0, 0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt()].into();
    TransformStamped {
        header: Header {
            stamp: Time::from_ns(stamp_ns),
            frame_id: parent.to_owned(),
        },
        child_frame_id: child.to_owned(),
        transform: Transform {
            translation: [x, 0.0, 0.0].into(),
            rotation,
        },
    }
}

fn find(tree: &mut Tree, frame: &str) -> Result<Found, Missing> {
    let (frame, root) = (tree.pin(frame), tree.pin("world"));
    tree.find(frame, root)
}

#[test]
fn a_chain_is_composed_and_its_stamps_are_compared() {
    let mut tree = Tree::default();
    tree.take(&link("/world", "base", 1.0, 100), false, 7, BACK_NS);
    tree.take(&link("base", "tool", 2.0, 130), false, 8, BACK_NS);
    tree.take(&link("tool", "tip", 0.0, 0), true, 9, BACK_NS);
    let found = find(&mut tree, "tip").unwrap();
    // A quarter turn at the base moves the tool to +y; with three quarter turns the tip points along -y.
    let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
    assert!(
        near(found.position[0], 1.0) && near(found.position[1], 2.0),
        "{found:?}"
    );
    assert_eq!((found.stamp_ns, found.skew_ns), (100, 30));
    assert_eq!(found.received_ns, Some((8, 7)));
}

#[test]
fn a_single_link_is_handed_on_bit_by_bit() {
    let mut tree = Tree::default();
    let mut sent = link("world", "b", 0.1, 5);
    sent.transform.rotation = [0.0, 0.0, 0.0, 1.000_001].into();
    tree.take(&sent, false, 1, BACK_NS);
    assert_eq!(
        find(&mut tree, "b").unwrap().orientation,
        [0.0, 0.0, 0.0, 1.000_001]
    );
}

#[test]
fn loops_gaps_and_bad_numbers_are_told_apart() {
    let mut tree = Tree::default();
    tree.take(&link("a", "b", 0.0, 1), false, 1, BACK_NS);
    assert_eq!(find(&mut tree, "b"), Err(Missing::Frame("a".to_owned())));
    tree.take(&link("b", "a", 0.0, 1), false, 1, BACK_NS);
    assert!(matches!(find(&mut tree, "b"), Err(Missing::Loop(_))));
    let mut zero = link("world", "a", 0.0, 2);
    zero.transform.rotation = [0.0; 4].into();
    tree.take(&zero, false, 1, BACK_NS);
    let bad = Missing::Bad("a".to_owned(), RejectReason::BadQuaternion);
    assert_eq!(find(&mut tree, "b"), Err(bad));
    for (parent, child) in [("a", "a"), ("/a", "a"), ("", "x"), ("x", "")] {
        let taken = tree.take(&link(parent, child, 0.0, 1), false, 1, BACK_NS);
        assert!(matches!(taken, Taken::Refused(_)), "{parent} {child}");
    }
}

#[test]
fn an_older_link_is_passed_over_and_a_clock_that_began_anew_ends_all_links() {
    let mut tree = Tree::default();
    tree.take(&link("world", "a", 1.0, 2000), false, 1, BACK_NS);
    tree.take(&link("world", "b", 1.0, 2000), false, 1, BACK_NS);
    assert_eq!(
        tree.take(&link("world", "a", 2.0, 1900), false, 2, BACK_NS),
        Taken::Older(100)
    );
    assert_eq!(find(&mut tree, "a").unwrap().position[0], 1.0);
    let mut late = |n: u64| tree.take(&link("world", "a", 3.0, 100 + n), false, 3 + n, BACK_NS);
    assert_eq!(late(0), Taken::Older(1900), "bug: a late one is no pose");
    assert_eq!(late(150), Taken::Older(1750));
    assert_eq!(late(300), Taken::WentBack);
    assert_eq!(find(&mut tree, "a").unwrap().position[0], 3.0);
    assert_eq!(find(&mut tree, "b"), Err(Missing::Frame("b".to_owned())));
}

#[test]
fn bug_frames_without_end_leave_room_for_those_of_bodies() {
    let mut tree = Tree::default();
    tree.pin("world");
    let tool = tree.pin("tool");
    tree.take(&link("world", "plate", 1.0, 0), true, 1, BACK_NS);
    for n in 0..2 * FRAMES_MAX {
        let taken = tree.take(
            &link("camera", &format!("seen_{n}"), 0.0, 1),
            false,
            1,
            BACK_NS,
        );
        assert_eq!(taken, Taken::Newer, "{n}");
    }
    // Links of a body's chain and fixed links have stayed or find room, and no index is used by two frames.
    tree.take(&link("plate", "arm", 1.0, 5), false, 1, BACK_NS);
    tree.take(&link("arm", "tool", 1.0, 5), false, 1, BACK_NS);
    assert!(find(&mut tree, "tool").is_ok());
    assert_eq!(tree.pin("tool"), tool);
    let late = find(&mut tree, "late");
    assert_eq!(late, Err(Missing::Frame("late".to_owned())));
    assert_eq!(tree.take_let_go(), 0);
}

#[test]
fn bug_every_body_of_a_large_scene_has_a_frame_of_its_own() {
    let mut tree = Tree::default();
    let ids: Vec<usize> = (0..FRAMES_MAX + 9)
        .map(|n| tree.pin(&format!("f{n}")))
        .collect();
    assert!(ids.windows(2).all(|two| two[0] < two[1]));
    let taken = tree.take(&link("f1", "other", 0.0, 1), false, 1, BACK_NS);
    assert_eq!(taken, Taken::Newer);
}

#[test]
fn links_that_never_change_go_only_where_they_alone_are_too_many_and_that_is_counted() {
    let mut tree = Tree::default();
    tree.take(&link("world", "tool", 1.0, 0), true, 1, BACK_NS);
    tree.pin("tool");
    for n in 0..FRAMES_MAX + 9 {
        tree.take(&link("map", &format!("tag_{n}"), 0.0, 0), true, 1, BACK_NS);
    }
    assert!(tree.take_let_go() > 0);
    assert!(find(&mut tree, "tool").is_ok());
}

#[test]
fn frames_that_all_hang_on_one_body_are_refused_when_they_are_too_many() {
    let mut tree = Tree::default();
    tree.pin("up_0");
    for n in 0..=FRAMES_MAX {
        let (child, parent) = (format!("up_{n}"), format!("up_{}", n + 1));
        let taken = tree.take(&link(&parent, &child, 0.0, 1), false, 1, BACK_NS);
        let wanted = if n < FRAMES_MAX {
            Taken::Newer
        } else {
            Taken::Full
        };
        assert_eq!(taken, wanted, "{n}");
    }
}

#[test]
fn a_frame_that_no_body_has_any_more_makes_room() {
    let mut tree = Tree::default();
    for n in 0..2 * FRAMES_MAX {
        let frame = tree.pin(&format!("f{n}"));
        tree.unpin(frame);
    }
    tree.take(&link("world", "a", 0.0, 1), false, 1, BACK_NS);
    assert!(find(&mut tree, "a").is_ok());
}

#[test]
fn bug_a_frame_whose_name_is_too_long_is_refused_and_not_kept() {
    let mut tree = Tree::default();
    let (longest, over) = ("x".repeat(FRAME_NAME_BYTES_MAX), "x".repeat(300));
    for (parent, child) in [("camera", over.as_str()), (over.as_str(), "camera")] {
        let taken = tree.take(&link(parent, child, 1.0, 100), false, 7, BACK_NS);
        assert!(matches!(taken, Taken::Refused(_)) && tree.ids.is_empty());
    }
    // A leading slash is not part of a name.
    let taken = tree.take(
        &link("camera", &format!("/{longest}"), 1.0, 100),
        false,
        7,
        BACK_NS,
    );
    assert_eq!((taken, tree.ids.len()), (Taken::Newer, 2));
}

/// A tree with `odom` as the scene's frame, which is a child of `map`.
fn odom() -> (Tree, usize) {
    let (mut tree, root) = Tree::rooted("odom");
    tree.take(&link("map", "odom", 1.0, 100), false, 7, BACK_NS);
    (tree, root)
}

#[test]
fn bug_a_body_beside_the_scenes_frame_had_no_pose_though_a_frame_above_both_joins_them() {
    let (mut tree, root) = odom();
    tree.take(&link("map", "obstacle", 3.0, 140), false, 9, BACK_NS);
    let obstacle = tree.pin("obstacle");
    let found = tree.find(obstacle, root).unwrap();
    // `odom` is turned by a quarter in `map`, so the obstacle 2 m ahead in `map` is 2 m to the right; the turns cancel.
    let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
    let [x, y, z] = found.position;
    assert!(near(x, 0.0) && near(y, -2.0) && near(z, 0.0), "{found:?}");
    assert!(near(found.orientation[3].abs(), 1.0), "{found:?}");
    assert_eq!((found.stamp_ns, found.skew_ns), (100, 40));
    assert_eq!(found.received_ns, Some((9, 7)));
    // The ancestor is itself the frame of a body.
    let map = tree.pin("map");
    let [x, y, _] = tree.find(map, root).unwrap().position;
    assert!(near(x, 0.0) && near(y, 1.0), "{x} {y}");
    // A frame below the scene's frame needs nothing above it.
    tree.take(&link("odom", "base", 5.0, 5), false, 3, BACK_NS);
    let base = tree.pin("base");
    let found = tree.find(base, root).unwrap();
    assert_eq!((found.position, found.stamp_ns), ([5.0, 0.0, 0.0], 5));
}

#[test]
fn chains_that_do_not_meet_are_told_with_both_ends() {
    let (mut tree, root) = odom();
    tree.take(&link("base", "tool", 1.0, 1), false, 1, BACK_NS);
    let tool = tree.pin("tool");
    let apart = Missing::Apart("base".to_owned(), "map".to_owned());
    assert_eq!(tree.find(tool, root), Err(apart));
    // A loop above the scene's frame joins no chains, and an invalid link that no chain needs is no refusal.
    tree.take(&link("odom", "map", 1.0, 1), false, 1, BACK_NS);
    assert!(matches!(
        tree.find(tool, root),
        Err(Missing::Apart(..) | Missing::Frame(_))
    ));
    let mut zero = link("earth", "map", 1.0, 1);
    zero.transform.rotation = [0.0; 4].into();
    tree.take(&zero, false, 1, BACK_NS);
    assert!(matches!(tree.find(tool, root), Err(Missing::Apart(..))));
    tree.take(&link("earth", "base", 1.0, 1), false, 1, BACK_NS);
    let bad = Missing::Bad("map".to_owned(), RejectReason::BadQuaternion);
    assert_eq!(tree.find(tool, root), Err(bad));
}

#[test]
fn bug_a_bad_link_above_the_frame_that_joins_two_chains_refused_bodies_that_do_not_need_it() {
    let (mut tree, root) = odom();
    tree.take(&link("map", "obstacle", 3.0, 140), false, 9, BACK_NS);
    let mut zero = link("earth", "map", 1.0, 1);
    zero.transform.rotation = [0.0; 4].into();
    tree.take(&zero, false, 1, BACK_NS);
    let obstacle = tree.pin("obstacle");
    assert!(tree.find(obstacle, root).is_ok());
}

/// Sends three stamps of a restarted clock; returns the result of the last.
fn restart(tree: &mut Tree, parent: &str, child: &str) -> Taken {
    tree.take(&link(parent, child, 1.0, 2000), false, 1, BACK_NS);
    let late = [0, 150, 300].map(|n| {
        let link = link(parent, child, 2.0, 100 + n);
        tree.take(&link, false, 3 + n, BACK_NS)
    });
    assert!(matches!(late[..2], [Taken::Older(_), Taken::Older(_)]));
    late[2]
}

#[test]
fn bug_a_link_that_no_body_hangs_on_began_the_whole_source_anew() {
    let (mut tree, root) = odom();
    tree.take(&link("odom", "base", 1.0, 2000), false, 1, BACK_NS);
    let base = tree.pin("base");
    for (parent, child) in [("camera", "tag"), ("base", "camera"), ("map", "odom")] {
        assert_eq!(restart(&mut tree, parent, child), Taken::Newer, "{child}");
        let on = link(parent, child, 3.0, 450);
        assert_eq!(tree.take(&on, false, 400, BACK_NS), Taken::Newer);
    }
    assert!(tree.find(base, root).is_ok());
    // Now a body depends on each of these two links: one directly, one because it is joined above the scene's frame.
    tree.pin("tag");
    assert_eq!(restart(&mut tree, "camera", "tag"), Taken::WentBack);
    assert!(tree.find(base, root).is_err());
    assert_eq!(restart(&mut tree, "map", "odom"), Taken::WentBack);
}

#[test]
fn bug_a_stamp_of_0_in_a_chain_made_its_stamps_lie_56_years_apart() {
    let mut tree = Tree::default();
    tree.take(&link("world", "base", 1.0, 0), false, 7, BACK_NS);
    let found = find(&mut tree, "base").unwrap();
    assert_eq!((found.stamp_ns, found.skew_ns), (0, 0));
    assert_eq!(
        found.received_ns,
        Some((7, 7)),
        "it has an age all the same"
    );
    tree.take(&link("base", "tool", 2.0, 1 << 60), false, 9, BACK_NS);
    let found = find(&mut tree, "tool").unwrap();
    assert_eq!((found.stamp_ns, found.skew_ns), (1 << 60, 0));
    assert_eq!(found.received_ns, Some((9, 7)));
}
