//! The motion of a body that loses its pose in the same tick, by a reset or an invalid pose, is swept like any other.

use sweepd::math::Pose;
use sweepd::wire::{
    BodyStatus, EndCause, Event, PairRow, Reason, State, Verdict, VertexFrame, VertexHeader,
    WIRE_VERSION, frame_flags, name_bytes, pair_flags, vertex_flags,
};
use sweepd::world::Edit;

use crate::cases::{PLATE, SHOT, SWEPT, is_near, plate};
use crate::rig::{ALL, FRAME_NS, Rig, body, has, row, scene};

fn at(z: f64) -> Pose {
    Pose::translation(0.0, 0.0, z)
}

fn hit(row: &PairRow) -> bool {
    row.flags & pair_flags::SWEPT_HIT != 0
}

#[test]
fn bug_a_touch_before_a_reset_in_the_same_tick_was_told_as_clear() {
    let mut rig = plate(SWEPT);
    let height = [-5.0, -6.0];
    let frame = |k: usize, rig: &mut Rig| {
        rig.epoch += k as u64;
        rig.place(2, &at(height[k]));
    };
    rig.send_several(2, frame, ALL);
    let row = rig.pair(1, 2).unwrap();
    // Two legs: the motion through the plate, and the step at the reset, which is not swept.
    is_near(row, (5.0 - 0.0105) / 10.0 / 2.0, 1e-9);
    assert!(has(row, Event::Passed) && row.flags & pair_flags::TELEPORTED == 0);
    assert_eq!(rig.state(), State::Colliding);
    rig.send(ALL);
    assert_eq!(rig.state(), State::Clear);
}

#[test]
fn a_reset_between_two_poses_of_one_tick_is_no_motion() {
    let mut rig = plate(SWEPT);
    let height = [5.0, -5.0];
    let frame = |k: usize, rig: &mut Rig| {
        rig.epoch += k as u64;
        rig.place(2, &at(height[k]));
    };
    rig.send_several(2, frame, ALL);
    assert_eq!(rig.state(), State::Clear);
    assert!(rig.pair(1, 2).is_none_or(|row| !hit(row)));
}

#[test]
fn what_stands_in_contact_and_is_reset_in_the_same_tick_is_no_news() {
    let mut rig = plate(SWEPT);
    rig.place(2, &at(0.005));
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
    let height = [0.005, 5.0];
    let frame = |k: usize, rig: &mut Rig| {
        rig.epoch += k as u64;
        rig.place(2, &at(height[k]));
    };
    rig.send_several(2, frame, ALL);
    assert_eq!(rig.state(), State::Clear);
    let row = rig.pair(1, 2).unwrap();
    assert!(has(row, Event::End) && !has(row, Event::Begin) && !hit(row));
}

#[test]
fn what_a_reset_puts_into_a_wall_was_not_hit_on_its_way() {
    let mut rig = plate(SWEPT);
    let height = [6.0, 0.0];
    let frame = |k: usize, rig: &mut Rig| {
        rig.epoch += k as u64;
        rig.place(2, &at(height[k]));
    };
    rig.send_several(2, frame, ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
    let row = rig.pair(1, 2).unwrap();
    assert!(has(row, Event::Begin) && !hit(row), "{row:?}");
}

#[test]
fn bug_a_touch_before_a_refused_pose_in_the_same_tick_was_never_told() {
    // Through the plate, and through it and back.
    for heights in [&[-5.0, f64::NAN][..], &[-5.0, 5.0, f64::NAN]] {
        let mut rig = plate(SWEPT);
        let frame = |k: usize, rig: &mut Rig| rig.place(2, &at(heights[k]));
        rig.send_several(heights.len(), frame, ALL);
        let row = rig.pair(1, 2).unwrap();
        // The contact has begun; the current pose is unknown, so that its end is uncertain.
        assert!(hit(row) && has(row, Event::Begin) && !has(row, Event::End));
        assert_eq!(rig.verdict(1, 2), Verdict::Possible);
        rig.send(ALL);
        assert_eq!(rig.verdict(1, 2), Verdict::Possible);
        rig.place(2, &at(-5.0));
        rig.send(ALL);
        assert!(has(rig.pair(1, 2).unwrap(), Event::End));
        rig.send(ALL);
        assert_eq!(rig.state(), State::Clear);
        assert_eq!(rig.verdict(1, 2), Verdict::Apart);
    }
}

/// A plate, a body that ignores it, and an attached continuous ball that does not.
fn carrier(more: &str) -> Rig {
    let ball = "name = \"b3\"\nid = 3\nattached_to = \"b2\"\nposition = [0.0, 0.2, 0.0]\ncontinuous = true\n\
                shape = { type = \"sphere\", radius = 0.05 }";
    Rig::new(&scene(
        "",
        &[
            body(1, [0.0; 3], PLATE, ""),
            body(2, [0.0; 3], SHOT, &format!("mask = 0\n{more}")),
            ball.to_owned(),
        ],
    ))
}

#[test]
fn bug_what_hangs_on_a_body_was_not_followed_from_its_first_pose_of_a_tick() {
    for more in [
        "",
        SWEPT,
        "enabled = false",
        "enabled = false\ncontinuous = true",
    ] {
        for first in [None, Some(5.0), Some(-5.0)] {
            for heights in [&[5.0, -5.0][..], &[7.0, 5.0, -5.0], &[5.0, 4.0, -5.0, -6.0]] {
                let mut rig = carrier(more);
                if let Some(first) = first {
                    rig.place(2, &at(first));
                    rig.send(ALL);
                    rig.epoch += 1;
                }
                let frame = |k: usize, rig: &mut Rig| rig.place(2, &at(heights[k]));
                rig.send_several(heights.len(), frame, ALL);
                let what = format!("`{more}`, {first:?}, {heights:?}");
                let row = rig.pair(1, 3).unwrap_or_else(|| panic!("{what}: no row"));
                assert!(hit(row) && has(row, Event::Passed), "{what}: {row:?}");
                assert_eq!(rig.state(), State::Colliding);
                rig.send(ALL);
                assert_eq!(rig.state(), State::Clear, "{what}");
            }
        }
    }
    // A jump of the parent at a reset is not a motion of either body.
    let mut rig = carrier(SWEPT);
    rig.place(2, &at(5.0));
    rig.send(ALL);
    rig.epoch += 1;
    rig.place(2, &at(-5.0));
    rig.send(ALL);
    assert_eq!(rig.state(), State::Clear);
}

#[test]
fn bug_what_hangs_on_a_body_that_is_found_and_lost_in_one_tick_was_never_asked() {
    for more in ["", SWEPT] {
        let mut rig = carrier(more);
        rig.place(2, &at(5.0));
        rig.send(ALL);
        rig.place(2, &at(f64::NAN));
        rig.send(ALL);
        assert!(rig.pair(1, 3).is_none());
        let heights = [-5.0, f64::NAN];
        let frame = |k: usize, rig: &mut Rig| rig.place(2, &at(heights[k]));
        rig.send_several(2, frame, ALL);
        assert!(hit(rig.pair(1, 3).unwrap()), "{more}");
        assert_eq!(rig.state(), State::Colliding);
    }
}

#[test]
fn bug_what_went_on_its_way_in_a_frame_that_is_too_old_by_now_was_never_asked() {
    let late_ns = 600_000_000;
    for lost in [f64::NAN, 5.0] {
        let wall = body(1, [0.0; 3], PLATE, "").replace("moves = true", "moves = false");
        let mut rig = Rig::new(&scene("", &[wall, body(2, [0.0; 3], SHOT, SWEPT)]));
        rig.place(2, &at(5.0));
        rig.send(ALL);
        rig.place(2, &at(lost));
        rig.send(ALL);
        rig.idle(late_ns, ALL);
        assert!(rig.pair(1, 2).is_none());
        rig.waited_ns = late_ns;
        rig.place(2, &at(-5.0));
        rig.send(ALL);
        let row = rig.pair(1, 2).unwrap();
        assert!(hit(row), "{row:?}");
        assert!(rig.because(Reason::Swept));
        assert_eq!(rig.state(), State::Colliding);
        // Its box makes no more pairs than before.
        rig.waited_ns = 0;
        rig.send(ALL);
        assert_eq!(rig.state(), State::Clear);
    }
}

/// After a stall two frames arrive together, and the first is too old.
#[test]
fn bug_a_frame_too_old_took_a_body_out_of_the_tick_whose_younger_one_it_is() {
    let wall = body(1, [0.0; 3], PLATE, "").replace("moves = true", "moves = false");
    let removed = format!("{SWEPT}\non_stale = \"remove\"");
    let mut rig = Rig::new(&scene("", &[wall, body(2, [0.0; 3], SHOT, &removed)]));
    rig.place(2, &at(5.0));
    rig.send(ALL);
    let frame = |k: usize, rig: &mut Rig| {
        rig.waited_ns = [600_000_000, 0][k];
        rig.place(2, &at([-5.0, -6.0][k]));
    };
    rig.send_several(2, frame, ALL);
    let row = rig.pair(1, 2).unwrap();
    assert!(hit(row) && has(row, Event::Passed), "{row:?}");
    assert_eq!(rig.state(), State::Colliding);
    rig.send(ALL);
    assert_eq!(rig.state(), State::Clear);

    // A body in contact stays in contact meanwhile.
    rig.place(2, &at(0.005));
    rig.send(ALL);
    let frame = |k: usize, rig: &mut Rig| {
        rig.waited_ns = [600_000_000, 0][k];
        rig.place(2, &at([0.004, 0.005][k]));
    };
    rig.send_several(2, frame, ALL);
    let row = rig.pair(1, 2).unwrap();
    assert!(!has(row, Event::End) && !has(row, Event::Begin), "{row:?}");
}

#[test]
fn bug_the_way_on_which_a_body_was_removed_by_its_age_was_never_asked() {
    let wall = body(1, [0.0; 3], PLATE, "").replace("moves = true", "moves = false");
    let removed = format!("{SWEPT}\non_stale = \"remove\"");
    let child = body(
        3,
        [0.0, 0.0, 0.0],
        SHOT,
        &format!("{SWEPT}\nattached_to = \"b2\""),
    );
    let mut rig = Rig::new(&scene(
        "",
        &[wall, body(2, [0.0; 3], SHOT, &removed), child],
    ));
    rig.place(2, &at(5.0));
    rig.send(ALL);
    rig.waited_ns = 600_000_000;
    rig.place(2, &at(-5.0));
    rig.send(ALL);
    for id in [2, 3] {
        let row = rig.pair(1, id).unwrap();
        assert!(hit(row), "{id} {row:?}");
    }
    assert!(rig.because(Reason::RemovedByAge));
    assert_eq!(rig.state(), State::Colliding);
    rig.idle(FRAME_NS, ALL);
    assert!(rig.pair(1, 2).is_none_or(|row| !hit(row)));
    assert_eq!(rig.state(), State::Unknown);
    rig.waited_ns = 0;
    rig.send(ALL);
    assert_eq!(rig.state(), State::Clear);
}

/// A fixed wall, a moving body, a body attached to it, and another body of the same source.
fn reset_on_its_way(more: &str) -> Rig {
    let still = |text: String| text.replace("moves = true", "moves = false");
    let hangs = format!("{SWEPT}\nattached_to = \"b2\"");
    let cloth = "{ type = \"trimesh\", solid = false, vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces = [[0, 1, 2]] }";
    let mut rig = Rig::new(&scene(
        "",
        &[
            still(body(1, [0.0; 3], PLATE, "")),
            body(2, [0.0; 3], SHOT, &format!("{SWEPT}\n{more}")),
            body(3, [0.0, 0.1, 0.0], SHOT, &hangs),
            body(4, [50.0, 0.0, 0.0], cloth, "deforms = true"),
        ],
    ));
    rig.vertices = vec![cloth_of(1, 1)];
    rig.place(2, &at(5.0));
    rig.send(ALL);
    assert_eq!(rig.state(), State::Clear);
    rig
}

/// The vertices of body 4.
fn cloth_of(epoch: u64, version: u64) -> VertexFrame {
    VertexFrame {
        header: VertexHeader {
            session: 11,
            epoch,
            body: 4,
            version,
            source: name_bytes("feed"),
            count: 3,
            total: 3,
            flags: vertex_flags::FULL,
            schema: WIRE_VERSION,
            ..VertexHeader::default()
        },
        rows: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        ..VertexFrame::default()
    }
}

/// Asserts the tick in which body 2 went through the wall and was reset, the next one, and the first with all poses
/// known.
fn its_way_was_asked(rig: &mut Rig, cause: EndCause) {
    for id in [2, 3] {
        let row = rig.pair(1, id).unwrap_or_else(|| panic!("no row of {id}"));
        assert!(hit(row) && has(row, Event::Begin), "{row:?}");
        assert!(!has(row, Event::End), "{row:?}");
        assert_eq!(rig.verdict(1, id), Verdict::Possible);
    }
    assert_eq!(rig.state(), State::Colliding);
    rig.idle(FRAME_NS, ALL);
    for id in [2, 3] {
        let row = rig.pair(1, id).unwrap_or_else(|| panic!("no end of {id}"));
        assert!(!hit(row) && has(row, Event::End), "{row:?}");
        assert_eq!(row.end_cause, cause.code());
    }
    assert_eq!(rig.state(), State::Unknown);
    rig.idle(FRAME_NS, ALL);
    assert!(rig.pair(1, 2).is_none() && rig.pair(1, 3).is_none());
    rig.epoch += 1;
    (rig.scene_rev, rig.flags, rig.waited_ns) = (0, frame_flags::FULL, 0);
    rig.vertices = vec![cloth_of(rig.epoch, 1)];
    rig.place(2, &at(-5.0));
    rig.send(ALL);
    assert_eq!(rig.state(), State::Clear);
}

#[test]
fn bug_the_way_before_an_epoch_that_waits_was_never_asked() {
    let mut rig = reset_on_its_way("");
    let frame = |k: usize, rig: &mut Rig| {
        (rig.epoch, rig.scene_rev) = (1 + k as u64, 99 * k as u64);
        rig.place(2, &at([-5.0, -6.0][k]));
    };
    rig.send_several(2, frame, ALL);
    assert!(rig.because(Reason::NotReceived));
    let told = rig.out.bodies.iter().find(|row| row.body == 2).unwrap();
    assert_eq!(told.status, BodyStatus::NotReceived.code());
    its_way_was_asked(&mut rig, EndCause::Reset);
}

#[test]
fn bug_the_way_before_an_epoch_that_begins_with_other_bodies_was_never_asked() {
    let mut rig = reset_on_its_way("");
    let frame = |k: usize, rig: &mut Rig| {
        rig.epoch = 1 + k as u64;
        rig.place(2, &at(-5.0));
        if k == 1 {
            rig.flags = frame_flags::PARTIAL;
            rig.rows.retain(|row| row.body == 4);
        }
    };
    rig.send_several(2, frame, ALL);
    rig.rows.push(row(2, &at(0.0)));
    its_way_was_asked(&mut rig, EndCause::Reset);
}

#[test]
fn bug_the_way_before_an_epoch_whose_vertices_come_first_was_never_asked() {
    let mut rig = reset_on_its_way("");
    rig.vertices = vec![cloth_of(2, 1)];
    rig.place(2, &at(-5.0));
    rig.send(ALL);
    rig.epoch = 2;
    its_way_was_asked(&mut rig, EndCause::Reset);
}

#[test]
fn bug_the_way_before_an_epoch_whose_first_pose_is_refused_was_never_asked() {
    let mut rig = reset_on_its_way("");
    let frame = |k: usize, rig: &mut Rig| {
        rig.epoch = 1 + k as u64;
        rig.place(2, &at([-5.0, f64::NAN][k]));
    };
    rig.send_several(2, frame, ALL);
    its_way_was_asked(&mut rig, EndCause::Reset);
}

/// A body with a stale pose takes no part, and its next pose is not a motion.
#[test]
fn bug_the_way_before_an_epoch_whose_poses_are_too_old_was_never_asked() {
    for late in [1, 2] {
        let mut rig = reset_on_its_way("on_stale = \"remove\"");
        let heights = [-5.0, 5.0, -5.0];
        let frame = |k: usize, rig: &mut Rig| {
            (rig.epoch, rig.waited_ns) = (1 + u64::from(k > 0), 600_000_000 * u64::from(k == late));
            rig.place(2, &at(heights[k]));
        };
        rig.send_several(1 + late, frame, ALL);
        assert!(rig.because(Reason::RemovedByAge));
        let row = *rig.pair(1, 2).unwrap();
        // One leg of two or three.
        let share = (5.0 - 0.0105) / 10.0 / (1 + late) as f64;
        is_near(&row, share, 1e-9);
        its_way_was_asked(&mut rig, EndCause::SourceLost);
    }
}

#[test]
fn what_a_reset_leaves_without_a_pose_is_asked_for_no_way_that_it_did_not_go() {
    let mut rig = reset_on_its_way("");
    // It is above the wall, and the frame of the new epoch, with a pose below the wall, waits.
    let frame = |k: usize, rig: &mut Rig| {
        (rig.epoch, rig.scene_rev) = (1 + k as u64, 99 * k as u64);
        rig.place(2, &at([5.0, -5.0][k]));
    };
    rig.send_several(2, frame, ALL);
    assert!(rig.pair(1, 2).is_none() && rig.pair(1, 3).is_none());
    assert_eq!(rig.state(), State::Unknown);
    // A contact ends with the reset, at once.
    let mut rig = reset_on_its_way("");
    rig.place(2, &at(0.005));
    rig.send(ALL);
    let frame = |k: usize, rig: &mut Rig| {
        (rig.epoch, rig.scene_rev) = (1 + k as u64, 99 * k as u64);
    };
    rig.send_several(2, frame, ALL);
    let row = rig.pair(1, 2).unwrap();
    assert!(has(row, Event::End) && !has(row, Event::Begin), "{row:?}");
    assert_eq!(row.end_cause, EndCause::Reset.code());
}

#[test]
fn a_wall_that_is_lost_in_the_tick_in_which_something_passes_it_was_there_before() {
    let mut rig = plate(SWEPT);
    assert_eq!(rig.state(), State::Clear);
    rig.place(1, &at(f64::NAN));
    rig.place(2, &at(-5.0));
    rig.send(ALL);
    let row = rig.pair(1, 2).unwrap();
    assert_eq!(row.flags & pair_flags::SWEPT_OPEN, pair_flags::SWEPT_OPEN);
    assert_eq!(rig.verdict(1, 2), Verdict::Possible);
    // Afterwards its old pose has no meaning.
    let mut rig = plate(SWEPT);
    rig.place(1, &at(f64::NAN));
    rig.send(ALL);
    rig.place(2, &at(-5.0));
    rig.send(ALL);
    assert!(rig.pair(1, 2).is_none());
}

/// It was swept with the rotation of its velocity since the stamp of its former parent, past the body that it touches.
#[test]
fn bug_the_first_way_of_a_body_let_go_was_turned_by_a_stamp_of_another() {
    let sphere = |radius: f64| format!("{{ type = \"sphere\", radius = {radius} }}");
    let rod = "{ type = \"box\", half_extents = [0.5, 0.01, 0.01] }";
    let pin = body(3, [0.45, -0.5, 0.0], &sphere(0.01), "");
    let bodies = [
        body(1, [0.0, 3.0, 0.0], &sphere(0.1), ""),
        body(
            2,
            [0.0, -4.0, 0.0],
            rod,
            "continuous = true\nattached_to = \"b1\"",
        ),
        pin.replace("moves = true", "moves = false"),
    ];
    let mut rig = Rig::new(&scene("", &bodies));
    rig.send(ALL);
    let let_go = Edit::Attach {
        name: "b2".to_owned(),
        to: None,
        pose: None,
    };
    rig.edit(vec![let_go], ALL);
    rig.rows.push(row(2, &Pose::translation(0.0, 1.0, 0.0)));
    // One turn per frame.
    let spin = std::f64::consts::TAU / (FRAME_NS as f64 * 1e-9);
    rig.velocities = vec![[0.0; 6], [0.0, 0.0, 0.0, 0.0, 0.0, spin]];
    rig.send(ALL);
    let row = rig.pair(2, 3).unwrap();
    assert!(hit(row), "{row:?}");
    is_near(row, 0.24, 1e-9);
    // From now on its own stamps determine the rotation.
    rig.place(2, &Pose::translation(0.0, -1.0, 0.0));
    rig.send(ALL);
    assert!(rig.pair(2, 3).is_none_or(|row| !hit(row)));
}
