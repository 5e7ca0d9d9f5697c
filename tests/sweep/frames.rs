//! Several frames in one tick: bodies are at the poses of the frames at the times of these, whichever bodies a frame
//! contains. If no frame has the pose of one body while the other moves, nothing is certified.

use std::f64::consts::TAU;

use sweepd::math::{Pose, Vec3};
use sweepd::wire::{Event, PairRow, State, TransformRow, frame_flags, pair_flags};

use crate::cases::{SHOT, SWEPT, is_near};
use crate::rig::{ALL, FRAME_NS, Rig, body, has, row, scene};

const FULL: u32 = frame_flags::FULL;
const PARTIAL: u32 = frame_flags::PARTIAL;

/// Two bodies that cross at right angles at equal speed touch when each is this share of its 20 m along.
const MET: f64 = 0.5 - 0.02 / (20.0 * std::f64::consts::SQRT_2);

/// A frame: source, flags, and positions of bodies.
type Sent<'a> = (&'static str, u32, &'a [(u64, [f64; 2])]);

fn rows_of(places: &[(u64, [f64; 2])]) -> Vec<TransformRow> {
    let at = |&(id, [x, y]): &(u64, [f64; 2])| row(id, &Pose::translation(x, y, 0.0));
    places.iter().map(at).collect()
}

/// Runs one tick with these frames.
fn tick(rig: &mut Rig, frames: &[Sent<'_>]) {
    let set = |at: usize, rig: &mut Rig| {
        let (source, flags, places) = frames[at];
        (rig.source, rig.flags, rig.rows) = (source, flags, rows_of(places));
        rig.session = if source == "feed" { 11 } else { 12 };
    };
    rig.send_several(frames.len(), set, ALL);
}

/// Two bullets, 10 m before a crossing; the second with another source, or the same.
fn crossing(other: &str) -> Rig {
    let head = "[[source]]\nname = \"gun\"\ntimeout_ms = 500\n";
    let of = |source: &str| format!("{SWEPT}\nsource = \"{source}\"");
    let bodies = [(1, "feed"), (2, other), (3, "feed")];
    let bodies = bodies.map(|(id, source)| body(id, [90.0, 0.0, 0.0], SHOT, &of(source)));
    Rig::new(&scene(head, &bodies))
}

/// As [`crossing`], with both poses known.
fn before_the_crossing(other: &'static str) -> Rig {
    let mut rig = crossing(other);
    let (one, two) = ((1, [-10.0, 0.0]), (2, [0.0, -10.0]));
    if other == "feed" {
        tick(&mut rig, &[("feed", FULL, &[one, two, (3, [90.0, 0.0])])]);
    } else {
        let feed: &[_] = &[one, (3, [90.0, 0.0])];
        tick(&mut rig, &[("feed", FULL, feed), (other, FULL, &[two])]);
    }
    assert_eq!(rig.state(), State::Clear);
    rig
}

fn flags(rig: &Rig) -> u8 {
    rig.pair(1, 2).map_or(0, |row| row.flags)
}

fn is_hit(rig: &Rig) -> bool {
    flags(rig) & pair_flags::SWEPT_HIT != 0
}

fn is_open(rig: &Rig) -> bool {
    flags(rig) & pair_flags::SWEPT_OPEN != 0
}

fn met(rig: &Rig) -> &PairRow {
    rig.pair(1, 2)
        .unwrap_or_else(|| panic!("missed: {:?}", rig.state()))
}

#[test]
fn bug_a_crossing_was_missed_where_a_later_frame_had_one_of_the_two_alone() {
    let over: &[_] = &[(1, [10.0, 0.0]), (2, [0.0, 10.0])];
    for (flags, more) in [(PARTIAL, 10.1), (FULL, 10.1), (PARTIAL, 10.0)] {
        let mut rig = before_the_crossing("feed");
        tick(
            &mut rig,
            &[("feed", FULL, over), ("feed", flags, &[(1, [more, 0.0])])],
        );
        is_near(met(&rig), MET / 2.0, 1e-9);
        assert!(has(met(&rig), Event::Passed));
        assert_eq!(rig.state(), State::Colliding);
    }
    // A frame without either of the two divides the tick too, and is no reason for doubt.
    let mut rig = before_the_crossing("feed");
    let third: &[_] = &[(3, [80.0, 0.0])];
    tick(
        &mut rig,
        &[
            ("feed", PARTIAL, third),
            ("feed", FULL, over),
            ("feed", PARTIAL, third),
        ],
    );
    is_near(met(&rig), (1.0 + MET) / 3.0, 1e-9);
}

#[test]
fn bug_a_crossing_was_missed_where_the_row_of_one_was_refused_in_a_later_frame() {
    let mut rig = before_the_crossing("feed");
    tick(
        &mut rig,
        &[
            ("feed", FULL, &[(1, [10.0, 0.0]), (2, [0.0, 10.0])]),
            ("feed", FULL, &[(1, [10.1, 0.0]), (2, [f64::NAN, 10.0])]),
        ],
    );
    is_near(met(&rig), MET / 2.0, 1e-9);
    assert_eq!(rig.state(), State::Colliding);
}

/// For the frames after the one with the invalid pose, the body counted as being at its last pose.
#[test]
fn bug_a_body_whose_pose_was_refused_was_certainly_touched_where_it_was_before() {
    let mut rig = before_the_crossing("feed");
    tick(
        &mut rig,
        &[
            ("feed", FULL, &[(1, [-9.0, 0.0]), (2, [0.0, -9.0])]),
            ("feed", FULL, &[(1, [0.0, -20.0]), (2, [f64::NAN, 0.0])]),
            ("feed", FULL, &[(1, [0.0, 20.0])]),
        ],
    );
    assert!(!is_hit(&rig) && is_open(&rig), "{:?}", met(&rig));
    assert_ne!(rig.state(), State::Colliding);
}

#[test]
fn bug_a_crossing_was_missed_where_one_came_in_with_the_first_of_several_frames() {
    let mut rig = crossing("feed");
    tick(&mut rig, &[("feed", FULL, &[(1, [-30.0, 0.0])])]);
    tick(
        &mut rig,
        &[
            ("feed", FULL, &[(1, [-10.0, 0.0]), (2, [0.0, -10.0])]),
            ("feed", FULL, &[(1, [10.0, 0.0]), (2, [0.0, 10.0])]),
        ],
    );
    is_near(met(&rig), (1.0 + MET) / 2.0, 1e-9);
    // The first pose is not a motion: the earlier motion of the other body cannot touch it.
    let mut rig = crossing("feed");
    tick(&mut rig, &[("feed", FULL, &[(1, [-10.0, 0.0])])]);
    tick(
        &mut rig,
        &[
            ("feed", FULL, &[(1, [10.0, 0.0]), (2, [0.0, -10.0])]),
            ("feed", FULL, &[(1, [30.0, 0.0]), (2, [0.0, 10.0])]),
        ],
    );
    assert!(!is_hit(&rig) && !is_open(&rig), "{:?}", rig.pair(1, 2));
}

#[test]
fn bug_two_that_went_one_after_the_other_were_certified_to_meet() {
    let mut rig = before_the_crossing("feed");
    tick(
        &mut rig,
        &[
            ("feed", PARTIAL, &[(1, [10.0, 0.0])]),
            ("feed", PARTIAL, &[(2, [0.0, 10.0])]),
        ],
    );
    // No frame has the pose of the second body while the first moves: it is neither a hit nor clear.
    assert!(!is_hit(&rig) && is_open(&rig), "{:?}", rig.pair(1, 2));
    assert_eq!(rig.state(), State::Possible);
    assert!(!has(met(&rig), Event::Begin));
}

#[test]
fn what_goes_alone_is_certified_whatever_the_others_frames_are() {
    for other in ["feed", "gun"] {
        let mut rig = before_the_crossing(other);
        tick(&mut rig, &[(other, PARTIAL, &[(2, [0.0, 0.0])])]);
        assert_eq!(rig.state(), State::Clear, "{other}");
        // The second body is in the way of the first, with or without repeated poses.
        let stands: Sent<'_> = (other, PARTIAL, &[(2, [0.0, 0.0])]);
        let goes: Sent<'_> = ("feed", PARTIAL, &[(1, [10.0, 0.0])]);
        tick(&mut rig, &[stands, goes, stands, stands]);
        assert!(is_hit(&rig), "{other}: {:?}", rig.pair(1, 2));
        assert_eq!(rig.state(), State::Colliding, "{other}");
    }
}

#[test]
fn of_two_sources_the_ways_between_one_frame_each_are_in_step() {
    let mut rig = before_the_crossing("gun");
    let (one, two): (&[_], &[_]) = (&[(1, [10.0, 0.0])], &[(2, [0.0, 10.0])]);
    tick(&mut rig, &[("feed", FULL, one), ("gun", FULL, two)]);
    is_near(met(&rig), MET, 1e-9);
}

#[test]
fn bug_of_two_sources_with_several_frames_a_meeting_was_certified_or_ruled_out_at_will() {
    // Two frames of one source, and one or two of the other: nothing relates their times.
    for frames in [1, 2] {
        for mid in [-9.0, 0.0, 9.0] {
            let mut rig = before_the_crossing("gun");
            let all: [Sent<'_>; 4] = [
                ("feed", FULL, &[(1, [mid, 0.0])]),
                ("feed", FULL, &[(1, [10.0, 0.0])]),
                ("gun", FULL, &[(2, [0.0, 10.0])]),
                ("gun", FULL, &[(2, [0.0, 10.1])]),
            ];
            tick(&mut rig, &all[..2 + frames]);
            assert!(
                !is_hit(&rig) && is_open(&rig),
                "{mid}: {:?}",
                rig.pair(1, 2)
            );
            assert_eq!(rig.state(), State::Possible);
        }
    }
    // Bodies with separate paths are clear in any order of frames: with parallel paths, or far apart.
    for aside in [[10.0, 9.9], [-10.0, -10.0]] {
        let mut rig = before_the_crossing("gun");
        tick(
            &mut rig,
            &[
                ("feed", FULL, &[(1, [-10.0, 4.0])]),
                ("feed", FULL, &[(1, [-10.0, 9.9])]),
                ("gun", FULL, &[(2, aside)]),
            ],
        );
        assert_eq!(rig.state(), State::Clear, "{aside:?}");
    }
}

/// A pause means that the pose is still valid; its duration counted as time in which the body turned.
#[test]
fn bug_a_body_was_certified_to_turn_through_another_while_it_was_paused() {
    const PAUSES: u64 = 49;
    let rod = "{ type = \"capsule\", radius = 0.001, half_height = 1.0 }";
    for unstamped in [false, true] {
        let mut rig = Rig::new(&scene(
            "",
            &[
                body(1, [0.0, -0.9, 0.0], SHOT, ""),
                body(2, [0.0; 3], rod, SWEPT),
            ],
        ));
        // One turn in 25 frames.
        let spin = TAU / (25.0 * FRAME_NS as f64 * 1e-9);
        let still = [0.0; 6];
        rig.velocities = vec![still, [0.0, 0.0, 0.0, spin, 0.0, 0.0]];
        rig.send(ALL);
        let (rows, velocities) = (rig.rows.clone(), rig.velocities.clone());
        rig.rows.clear();
        rig.velocities.clear();
        (rig.flags, rig.unstamped) = (frame_flags::PAUSED, unstamped);
        for _ in 0..PAUSES {
            rig.send(ALL);
            assert_eq!(rig.state(), State::Clear);
        }
        (rig.rows, rig.velocities) = (rows, velocities);
        (rig.flags, rig.unstamped) = (FULL, false);
        rig.send(ALL);
        assert_eq!(rig.state(), State::Clear, "{:?}", rig.pair(1, 2));
        // From here on it turns again: a whole turn in 25 frames, past the ball.
        rig.seq += 24;
        rig.send(ALL);
        assert!(is_hit(&rig), "{:?}", rig.pair(1, 2));
        // Again after a pause with a timestamp: a whole turn since the pause.
        if !unstamped {
            let (rows, velocities) = (rig.rows.clone(), rig.velocities.clone());
            rig.rows.clear();
            rig.velocities.clear();
            rig.flags = frame_flags::PAUSED;
            rig.send(ALL);
            (rig.rows, rig.velocities, rig.flags) = (rows, velocities, FULL);
            rig.place(2, &Pose::rotation(Vec3::x() * 1e-9));
            rig.seq += 24;
            rig.send(ALL);
            assert!(is_hit(&rig), "{:?}", rig.pair(1, 2));
        }
    }
}
