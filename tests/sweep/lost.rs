//! What a body went before its place was lost in the same tick, by a reset or a pose that is refused, is asked for as
//! any other way.

use sweepd::math::Pose;
use sweepd::wire::{Event, PairRow, State, Verdict, pair_flags};

use crate::cases::{SWEPT, is_near, plate};
use crate::rig::{ALL, Rig, has};

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
    // Two legs: the way through the plate, and the step over the reset, of which nothing is asked.
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
    // Through it, and through it and back.
    for heights in [&[-5.0, f64::NAN][..], &[-5.0, 5.0, f64::NAN]] {
        let mut rig = plate(SWEPT);
        let frame = |k: usize, rig: &mut Rig| rig.place(2, &at(heights[k]));
        rig.send_several(heights.len(), frame, ALL);
        let row = rig.pair(1, 2).unwrap();
        // It has begun, and where it is now is not known: whether it has ended is not certain.
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
