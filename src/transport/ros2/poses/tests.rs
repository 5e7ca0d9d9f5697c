//! Updates and faults for good and bad messages of common types.

#![allow(clippy::float_cmp, reason = "poses are handed on bit by bit")]

mod chains;
mod renewed;

use super::*;
use crate::config::RosSource;
use crate::transport::{BodyNote, ros2::RosSourceSpec};
use crate::wire::ros::{Header, TfMessage, Time, Transform, TransformStamped};

const MS: u64 = 1_000_000;

/// A source of this kind with one body.
fn source(kind: RosKind, max_skew_ns: u64, frame: &str) -> Source {
    let ros2 = RosSource {
        kind,
        topic: "/tf".to_owned(),
        static_topic: "/tf_static".to_owned(),
        max_skew_ns,
    };
    let scene = RosScene {
        frame_id: "world".to_owned(),
        sources: vec![RosSourceSpec {
            name: "s".to_owned(),
            timeout_ns: 500 * MS,
            ros2: Some(ros2),
        }],
        bodies: vec![BodyNote {
            id: 1,
            name: "a".to_owned(),
            source: Some(0),
            frame: frame.to_owned(),
            topic: "/a".to_owned(),
            ..BodyNote::default()
        }],
        ..RosScene::default()
    };
    Source::of(&scene).remove(0)
}

fn tf(frame: &str) -> Source {
    source(RosKind::Tf, 100 * MS, frame)
}

fn at(now_ns: u64) -> Receipt {
    Receipt {
        now_ns,
        waited: false,
        ros_now_ns: 0,
        from: Gid::ZERO,
    }
}

fn link(parent: &str, child: &str, stamp_ns: u64) -> TfMessage {
    let transform = Transform {
        translation: [1.0, 0.0, 0.0].into(),
        rotation: [0.0, 0.0, 0.0, 1.0].into(),
    };
    let header = Header {
        stamp: Time::from_ns(stamp_ns),
        frame_id: parent.to_owned(),
    };
    TfMessage {
        transforms: vec![TransformStamped {
            header,
            child_frame_id: child.to_owned(),
            transform,
        }],
    }
}

fn look(source: &mut Source, now_ns: u64) -> Vec<Update> {
    let mut updates = Vec::new();
    source.look(at(now_ns), &mut updates);
    updates
}

#[test]
fn a_body_is_said_when_a_link_of_its_chain_comes_and_not_again() {
    let mut one = tf("tool");
    assert!(look(&mut one, MS).is_empty());
    assert!(one.faults(9, 0)[0].contains("no link from frame \"tool\" towards \"world\""));
    one.take_links(&link("world", "base", MS), false, at(MS));
    one.take_links(&link("base", "tool", 2 * MS), false, at(2 * MS));
    let said = look(&mut one, 2 * MS);
    assert_eq!(said[0].result.unwrap().position, [2.0, 0.0, 0.0]);
    assert_eq!((said[0].stamp_ns, one.skew_ns), (MS, Some(MS)));
    assert!(one.faults(9, 0).is_empty() && look(&mut one, 3 * MS).is_empty());
}

#[test]
fn bug_a_body_whose_topic_nobody_sends_on_had_no_fault() {
    let mut one = source(RosKind::Pose, 0, "a");
    assert_eq!(one.faults(9, 1000 * MS), [""; 0], "it has just come");
    assert_eq!(one.faults(9, 1500 * MS), [""; 0]);
    let told = one.faults(9, 1501 * MS);
    assert!(told[0].starts_with("body a: no pose of it has come on /a"));
    // Where the senders' clock went back they have as long again.
    one.forget();
    assert_eq!(one.faults(9, 2000 * MS), [""; 0]);
    assert_eq!(one.faults(9, 2501 * MS), told);
}

#[test]
fn a_link_that_is_fixed_on_one_topic_and_moves_on_another_is_told() {
    let mut one = tf("tool");
    one.take_links(&link("world", "tool", 0), true, at(MS));
    assert_eq!(one.faults(9, MS), [""; 0]);
    one.take_links(&link("world", "tool", 0), true, at(2 * MS));
    assert_eq!(one.faults(9, 2 * MS), [""; 0], "said again");
    one.take_links(&link("world", "tool", 3 * MS), false, at(3 * MS));
    let told = one.faults(9, 3 * MS);
    assert!(
        told[0].contains("frame tool") && told[0].contains("leave one out"),
        "{told:?}"
    );
}

#[test]
fn bug_a_link_without_a_name_or_to_itself_was_passed_over_in_silence() {
    let mut one = tf("tool");
    one.take_links(&link("world", "tool", MS), false, at(MS));
    assert_eq!(one.faults(9, MS), [""; 0]);
    for (parent, child, words) in [
        (
            "world",
            "",
            "frame ``: its link is refused, because it has no name",
        ),
        (
            "",
            "tool",
            "frame `tool`: its link is refused, because its parent has no name",
        ),
        ("/tool", "tool", "linked to itself"),
        (&"x".repeat(256), "tool", "more than 255 bytes"),
    ] {
        let refused = one.refused;
        one.take_links(&link(parent, child, 2 * MS), false, at(2 * MS));
        let told = one.faults(9, 2 * MS);
        assert!(told.iter().any(|text| text.contains(words)), "{told:?}");
        assert_eq!(one.refused, refused + 1);
    }
}

#[test]
fn stamps_too_far_apart_make_the_body_unknown_and_say_so() {
    let mut one = source(RosKind::Tf, 50 * MS, "tool");
    one.take_links(&link("world", "base", 10 * MS), false, at(MS));
    one.take_links(&link("base", "tool", 90 * MS), false, at(MS));
    assert_eq!(look(&mut one, MS)[0].result, Err(RejectReason::BadChain));
    assert!(
        one.faults(9, 0)[0].contains("0.080 s apart"),
        "{:?}",
        one.faults(9, 0)
    );
    one.take_links(&link("world", "base", 90 * MS), false, at(2 * MS));
    assert!(look(&mut one, 2 * MS)[0].result.is_ok());
}

#[test]
fn bug_a_link_without_stamps_that_falls_silent_is_noticed_by_its_receipt() {
    let mut one = tf("tool");
    one.take_links(&link("world", "base", 0), false, at(MS));
    one.take_links(&link("base", "tool", 0), false, at(MS));
    assert!(look(&mut one, MS)[0].result.is_ok());
    one.take_links(&link("base", "tool", 0), false, at(900 * MS));
    assert_eq!(
        look(&mut one, 900 * MS)[0].result,
        Err(RejectReason::BadChain)
    );
}

#[test]
fn a_loop_and_a_zero_quaternion_refuse_the_body_with_the_reason() {
    let mut one = tf("a");
    one.take_links(&link("b", "a", MS), false, at(MS));
    one.take_links(&link("a", "b", MS), false, at(MS));
    assert_eq!(look(&mut one, MS)[0].result, Err(RejectReason::BadChain));
    assert!(one.faults(9, 0)[0].contains("loop"));
    let mut zero = link("world", "a", 2 * MS);
    zero.transforms[0].transform.rotation = [0.0; 4].into();
    one.take_links(&zero, false, at(2 * MS));
    assert_eq!(
        look(&mut one, 2 * MS)[0].result,
        Err(RejectReason::BadQuaternion)
    );
}

#[test]
fn a_chain_that_never_changes_is_vouched_for_again_and_again() {
    let mut one = tf("a");
    one.take_links(&link("world", "a", 5 * MS), true, at(MS));
    assert_eq!(look(&mut one, MS).len(), 1);
    assert!(look(&mut one, 100 * MS).is_empty());
    assert_eq!(look(&mut one, 200 * MS).len(), 1);
}

#[test]
fn time_that_goes_back_is_told_once_and_small_disorder_is_passed_over() {
    let mut one = source(RosKind::Pose, 0, "");
    let mut updates = Vec::new();
    let mut pose = PoseStamped::default();
    pose.header.frame_id = "/world".to_owned();
    pose.pose.orientation.w = 1.0;
    let mut send = |stamp_ns, now_ns, updates: &mut Vec<Update>| {
        pose.header.stamp = Time::from_ns(stamp_ns);
        let back = one.take_pose(0, &pose, at(now_ns), updates);
        (back, one.refused)
    };
    assert_eq!(send(2000 * MS, MS, &mut updates), (false, 0));
    assert_eq!(send(1900 * MS, MS, &mut updates), (false, 1));
    // A restarted clock; its first messages might also be late ones of the old clock.
    assert_eq!(send(10 * MS, MS, &mut updates), (false, 2));
    assert_eq!(send(20 * MS, 150 * MS, &mut updates), (false, 3));
    assert_eq!(updates.len(), 1);
    assert_eq!(send(30 * MS, 300 * MS, &mut updates), (true, 3));
    assert_eq!(updates.len(), 2);
    assert_eq!(send(40 * MS, 310 * MS, &mut updates), (false, 3));
    assert_eq!(updates.len(), 3);
}

#[test]
fn bug_a_late_pose_never_becomes_the_newest() {
    let mut one = source(RosKind::Pose, 0, "");
    let mut updates = Vec::new();
    let mut pose = PoseStamped::default();
    pose.header.frame_id = "world".to_owned();
    pose.pose.orientation.w = 1.0;
    for n in 0..100 {
        for late_ns in [0, 800 * MS, 5000 * MS] {
            let now_ns = 10_000 * MS + n * 20 * MS;
            pose.header.stamp = Time::from_ns(now_ns - late_ns);
            assert!(!one.take_pose(0, &pose, at(now_ns), &mut updates));
        }
    }
    assert_eq!((updates.len(), one.refused), (100, 200));
    assert!(updates.is_sorted_by_key(|update| update.stamp_ns));
    let told = one.faults(9, 12_000 * MS);
    assert!(
        told[0].contains("does the network bring it late"),
        "{told:?}"
    );
}

#[test]
fn a_pose_in_another_frame_makes_its_body_unknown() {
    let mut one = source(RosKind::Pose, 0, "");
    let mut updates = Vec::new();
    let mut pose = PoseStamped::default();
    pose.header.frame_id = "map".to_owned();
    one.take_pose(0, &pose, at(MS), &mut updates);
    assert_eq!(updates[0].result, Err(RejectReason::BadChain));
    assert!(one.faults(9, 0)[0].contains("frame \"map\""));
}

#[test]
fn odometry_brings_its_velocity_into_the_scenes_frame() {
    let mut one = source(RosKind::Odometry, 0, "");
    let text = serde_json::json!({
        "header": {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": "world"},
        "child_frame_id": "a",
        "pose": {"pose": {"position": {"x": 0.0, "y": 0.0, "z": 0.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": 0.5_f64.sqrt(), "w": 0.5_f64.sqrt()}},
            "covariance": vec![0.0; 36]},
        "twist": {"twist": {"linear": {"x": 2.0, "y": 0.0, "z": 0.0},
            "angular": {"x": 0.0, "y": 0.0, "z": 1.0}}, "covariance": vec![0.0; 36]},
    });
    let message: Odometry = serde_json::from_value(text).unwrap();
    let mut updates = Vec::new();
    one.take_odometry(0, &message, at(MS), &mut updates);
    let velocity = updates[0].velocity.unwrap();
    assert!(
        (velocity[1] - 2.0).abs() < 1e-12 && velocity[0].abs() < 1e-12,
        "{velocity:?}"
    );
    assert!((velocity[5] - 1.0).abs() < 1e-12);
}

#[test]
fn law_3_8_a_chain_is_as_old_as_its_oldest_link() {
    let mut one = tf("tool");
    one.take_links(&link("world", "base", 0), false, at(MS));
    one.take_links(&link("base", "tool", 0), false, at(400 * MS));
    let said = look(&mut one, 400 * MS);
    assert!(said[0].result.is_ok());
    assert_eq!((said[0].since_ns, said[0].received_ns), (MS, 400 * MS));
    // A chain older than the time-out has no pose, which is reported at once.
    one.take_links(&link("base", "tool", 0), false, at(900 * MS));
    let said = look(&mut one, 900 * MS);
    assert!(said[0].result.is_err());
    assert_eq!(said[0].since_ns, 900 * MS);
}

#[test]
fn a_frame_that_two_publishers_link_is_told_and_bug_so_was_a_sender_that_starts_anew() {
    let mut one = tf("tool");
    let from = |number, now_ns| Receipt {
        from: Gid::from([number; 16]),
        ..at(now_ns)
    };
    let told = |one: &mut Source, now_ns| {
        one.faults(9, now_ns)
            .iter()
            .any(|f| f.contains("two publishers"))
    };
    one.take_links(&link("world", "tool", MS), false, from(1, MS));
    one.take_links(&link("world", "base", MS), false, from(2, MS));
    assert!(!told(&mut one, 2 * MS), "each its own frame");
    one.take_links(&link("world", "tool", 2 * MS), true, from(2, 2 * MS));
    assert!(!told(&mut one, 2 * MS), "a link that never changes");
    for now_ns in [300 * MS, 400 * MS] {
        one.take_links(&link("world", "tool", now_ns), false, from(2, now_ns));
        assert!(!told(&mut one, now_ns), "it may have started anew");
    }
    one.take_links(&link("world", "tool", 500 * MS), false, from(1, 500 * MS));
    assert!(told(&mut one, 500 * MS));
    one.take_links(&link("world", "tool", 5000 * MS), false, from(2, 5000 * MS));
    assert!(!told(&mut one, 5000 * MS), "the other has stopped");
    // Five publishers in turn.
    for (number, now_ns) in [(1, 5010), (3, 5020), (4, 5030), (5, 5040), (2, 5050)] {
        let receipt = from(number, now_ns * MS);
        one.take_links(&link("world", "tool", receipt.now_ns), false, receipt);
    }
    assert!(told(&mut one, 5050 * MS));
}

#[test]
fn bug_of_several_frames_that_are_wrong_at_once_one_alone_was_told() {
    let mut one = tf("tool");
    let now = |now_ns: u64| Receipt {
        ros_now_ns: now_ns,
        ..at(now_ns)
    };
    let now_ns = 100_000 * MS;
    for round in 0..5 {
        let now_ns = now_ns + round * MS;
        one.take_links(
            &link("world", "late", now_ns - 5000 * MS),
            false,
            now(now_ns),
        );
        one.take_links(
            &link("world", "early", now_ns + 7000 * MS),
            false,
            now(now_ns),
        );
        one.take_links(&link("self", "self", now_ns), false, now(now_ns));
    }
    let told = one.faults(9, now_ns + 5 * MS);
    assert_eq!(told.len(), 3, "each once: {told:?}");
    for frame in ["late", "early", "self"] {
        assert!(told.iter().any(|text| text.contains(frame)), "{told:?}");
    }
    // At most 8 faults, and none after their reporting time.
    for frame in 0..50 {
        let frame = format!("frame{frame}");
        one.take_links(&link(&frame, &frame, now_ns), false, now(now_ns));
    }
    assert_eq!(one.faults(99, now_ns).len(), 8);
    assert!(one.faults(99, now_ns + 4000 * MS).is_empty());
}

#[test]
fn bug_a_body_of_which_nothing_comes_any_more_was_named_nowhere() {
    let silent = |one: &mut Source, now_ns| {
        let told = one.faults(9, now_ns);
        told.iter()
            .any(|text| text.contains("body a: nothing has come of it"))
    };
    let mut one = tf("tool");
    one.take_links(&link("world", "tool", MS), false, at(MS));
    look(&mut one, MS);
    assert!(!silent(&mut one, 500 * MS) && silent(&mut one, 502 * MS));
    one.take_links(&link("world", "tool", 600 * MS), false, at(600 * MS));
    look(&mut one, 600 * MS);
    assert!(!silent(&mut one, 700 * MS));
    // Fixed links are sent only once.
    let mut one = tf("tool");
    one.take_links(&link("world", "tool", MS), true, at(MS));
    look(&mut one, MS);
    assert!(!silent(&mut one, 9000 * MS));
    let mut one = source(RosKind::Pose, 0, "tool");
    let mut message = PoseStamped::default();
    message.header.frame_id = "world".to_owned();
    message.pose.orientation = [0.0, 0.0, 0.0, 1.0].into();
    one.take_pose(0, &message, at(MS), &mut Vec::new());
    assert!(!silent(&mut one, 500 * MS) && silent(&mut one, 502 * MS));
}
