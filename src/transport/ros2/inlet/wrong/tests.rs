//! Frames of senders that make mistakes: what each is told.

use super::*;
use crate::wire::NameRow;
const S: u64 = 1_000_000_000;

fn name_row(body: u64, name: &str, source: u32) -> NameRow {
    let mut row = NameRow {
        body,
        source,
        len: u32::try_from(name.len()).unwrap(),
        ..NameRow::default()
    };
    row.name[..name.len()].copy_from_slice(name.as_bytes());
    row
}

/// A scene of two sources; the second one moves the lid, none the wall.
fn local() -> (Local, Book) {
    let local = Local {
        frame_id: "world".to_owned(),
        sources: vec!["sim".to_owned(), "arm".to_owned()],
        boot_id: 77,
    };
    let rows = [name_row(4, "lid", 1), name_row(5, "wall", u32::MAX)];
    (local, Book::of(&rows))
}

fn receipt(now_ns: u64, ros_now_ns: u64) -> Receipt {
    Receipt {
        now_ns,
        waited: false,
        ros_now_ns,
        from: ros2_client::Gid::ZERO,
    }
}

fn body(name: &str, id: u64) -> BodyTransform {
    let mut body = BodyTransform {
        name: name.to_owned(),
        body: id,
        ..BodyTransform::default()
    };
    body.pose.orientation.w = 1.0;
    body
}

/// The first frame of the arm: the lid, as it should be.
fn good() -> BodyTransforms {
    BodyTransforms {
        source: "arm".to_owned(),
        session: 8,
        seq: 1,
        flags: frame_flags::FULL,
        transforms: vec![body("lid", 0)],
        ..BodyTransforms::default()
    }
}

/// What is told of frames that come one after another, each changed from a good one.
fn told(frames: &[&dyn Fn(&mut BodyTransforms)]) -> Vec<String> {
    let (local, book) = local();
    let mut wrongs = Wrongs::default();
    for change in frames {
        let mut message = good();
        change(&mut message);
        let own = local.refuse(&message).map(|(_, text)| text);
        let frame = (&message, own.as_deref());
        wrongs.note(&local, frame, receipt(5, 0), &book);
    }
    wrongs.words(&book, 5, S)
}

fn one(change: impl Fn(&mut BodyTransforms)) -> String {
    let told = told(&[&change]);
    assert!(told.len() <= 1, "{told:?}");
    told.into_iter().next().unwrap_or_default()
}

#[test]
fn bug_a_frame_that_is_refused_for_its_head_is_told_with_what_to_write() {
    assert_eq!(one(|_| ()), "");
    assert_eq!(
        one(|m| m.source = "nosuch".to_owned()),
        "frames of source \"nosuch\": the scene has no such source, it has sim, arm"
    );
    let refused = "frames of source arm are refused: ";
    assert_eq!(
        one(|m| m.session = 0),
        format!("{refused}session 0: draw a random number at start")
    );
    for flags in [0, 3, 8] {
        assert_eq!(
            one(|m| m.flags = flags),
            format!("{refused}flags {flags}: write FULL, PARTIAL or PAUSED")
        );
    }
    let paused = one(|m| m.flags = frame_flags::PAUSED);
    assert!(paused.contains("PAUSED with poses"), "{paused}");
    let speeds = one(|m| m.velocities = vec![Twist::default(); 2]);
    assert!(speeds.contains("one for each of the transforms"));
    let many = one(|m| m.transforms = vec![body("lid", 0); FRAME_ROWS_MAX + 1]);
    assert!(many.contains("send them in several"), "{many}");
    let foreign = one(|m| m.header.frame_id = "map".to_owned());
    assert!(
        foreign.contains("in \"map\", not in the scene's"),
        "{foreign}"
    );
}

#[test]
fn bug_frames_whose_number_is_not_raised_are_told() {
    let old = "frames of source arm are refused: not newer than the one before: raise seq with each frame, and epoch when the world resets";
    assert_eq!(told(&[&|_| (), &|_| ()]), [old]);
    assert_eq!(told(&[&|m| m.epoch = 1, &|m| m.seq = 9]), [old]);
    let fine: [&dyn Fn(&mut BodyTransforms); 4] = [
        &|_| (),
        &|m| m.seq = 2,
        &|m| (m.epoch, m.seq) = (1, 0),
        &|m| m.session = 9,
    ];
    assert_eq!(told(&fine), [""; 0], "another epoch or session begins anew");
}

#[test]
fn bug_a_body_that_the_scene_lacks_is_told_with_the_nearest_name() {
    assert_eq!(
        one(|m| m.transforms.push(body("lidd", 0))),
        "body \"lidd\" of source arm: the scene has no such body: did you mean \"lid\"?"
    );
    let far = one(|m| m.transforms.push(body("gripper", 0)));
    assert!(far.ends_with("its names are on ~/names"), "{far}");
    let by_id = one(|m| {
        m.boot_id = 77;
        m.transforms.push(body("", 40));
    });
    assert!(by_id.starts_with("body 40 of source arm: the scene has no body of this id"));
}

#[test]
fn a_body_that_another_source_moves_or_none_is_told_by_name() {
    for (name, id) in [("lid", 0), ("", 4)] {
        let by_sim = one(|m| {
            (m.source, m.boot_id) = ("sim".to_owned(), 77);
            m.transforms = vec![body(name, id)];
        });
        assert!(by_sim.contains("source sim sends it") && by_sim.contains("source arm"));
        let own = one(|m| {
            m.boot_id = 77;
            m.transforms = vec![body(name, id)];
        });
        assert_eq!(own, "");
    }
    let wall = one(|m| m.transforms.push(body("wall", 0)));
    assert!(wall.contains("has no source move it"), "{wall}");
}

#[test]
fn a_pose_that_is_none_is_told_by_name_with_what_to_write() {
    let nan = one(|m| m.transforms[0].pose.position.x = f64::NAN);
    assert_eq!(
        nan,
        "body lid: its pose from source arm is no pose: not_finite: write numbers that are neither NaN nor infinite"
    );
    let zeros = one(|m| m.transforms[0].pose.orientation.w = 0.0);
    assert!(zeros.contains("is no pose: bad_quaternion: write x, y, z, w of length 1"));
    let speed = one(|m| {
        let mut twist = Twist::default();
        twist.linear.z = f64::INFINITY;
        m.velocities = vec![twist];
    });
    assert!(speed.contains("its velocity from source arm is not_finite: write"));
}

#[test]
fn a_stamp_of_another_time_is_told_unless_it_is_of_another_clock() {
    let (local, book) = local();
    let mut message = good();
    let mut odd = |sec, clock_id| {
        (message.header.stamp.sec, message.clock_id) = (sec, clock_id);
        local.odd(&message, receipt(5, 100 * S), &book)
    };
    assert_eq!(odd(100, 0), None);
    let Some(Wrong::Said(text)) = odd(7, 0) else {
        panic!("a stamp of the past");
    };
    assert!(text.contains("source arm: its stamp lies 93.000 s in the past"));
    assert_eq!(odd(7, 3), None);
}

#[test]
fn bug_ids_of_another_run_of_the_daemon_are_refused_and_names_are_not() {
    let (local, _) = local();
    let by = |name: &str, boot_id| {
        local.refuse(&BodyTransforms {
            boot_id,
            transforms: vec![body(name, 4)],
            ..good()
        })
    };
    for boot_id in [0, 76] {
        let (reason, text) = by("", boot_id).unwrap();
        assert_eq!(reason, RejectReason::SessionOver);
        assert!(
            text.contains("source arm") && text.contains("is 77"),
            "{text}"
        );
        assert_eq!(by("lid", boot_id), None);
    }
    assert_eq!(by("", 77), None);
}

#[test]
fn what_is_wrong_with_one_source_hides_nothing_of_another_and_is_over_in_time() {
    let both: [&dyn Fn(&mut BodyTransforms); 3] =
        [&|m| m.session = 0, &|m| m.source = "sim".to_owned(), &|m| {
            m.source = "ghost".to_owned()
        }];
    assert_eq!(told(&both).len(), 3);
    let (local, book) = local();
    let mut wrongs = Wrongs::default();
    let message = BodyTransforms {
        session: 0,
        ..good()
    };
    wrongs.note(&local, (&message, None), receipt(5, 0), &book);
    assert_eq!(wrongs.words(&book, S, S).len(), 1);
    assert_eq!(wrongs.words(&book, 5 + S, S).len(), 0);
}

#[test]
fn bug_a_sender_with_the_clock_of_another_machine_is_told() {
    let (local, book) = local();
    let now_ns = 5000 * S;
    let told = |sent_ns| {
        let mut wrongs = Wrongs::default();
        let message = BodyTransforms { sent_ns, ..good() };
        wrongs.note(&local, (&message, None), receipt(now_ns, 0), &book);
        wrongs.words(&book, now_ns, S).concat()
    };
    let old = told(1400 * S);
    assert!(
        old.contains("source arm come, but their sent_ns is 3600.000 s old")
            && old.contains("writes 0"),
        "{old}"
    );
    let ahead = told(5003 * S);
    assert!(ahead.contains("3.000 s in the future"), "{ahead}");
    for fine_ns in [0, now_ns, now_ns - S, now_ns + S] {
        assert_eq!(told(fine_ns), "");
    }
}
