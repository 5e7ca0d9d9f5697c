//! How steps predict those to come.

use super::*;
use crate::builtin::Random;

/// A box of side 1 somewhere.
fn at([x, y, z]: [f32; 3]) -> Down {
    Down::of([x, y, z, x + 1.0, y + 1.0, z + 1.0])
}

/// Three ticks of 16 bodies that step by 0.1 at most: either twice the same step, or in random directions.
fn run(course: &mut Course, random: &mut Random, alike: bool) {
    #[allow(clippy::cast_possible_truncation, reason = "any step will do")]
    let mut step = || [(); 3].map(|()| random.range(-0.1, 0.1) as f32);
    let add = |p: [f32; 3], by: [f32; 3]| std::array::from_fn(|k| p[k] + by[k]);
    let steps: [_; WIDTH] = std::array::from_fn(|_| {
        let first = step();
        [first, if alike { first } else { step() }]
    });
    let mut before = [at([5.0; 3]); WIDTH];
    let then = steps.map(|[first, _]| at(add([5.0; 3], first)));
    let mut now = steps.map(|[first, second]| at(add(add([5.0; 3], first), second)));
    // A body that just came has no place before, and an infinite one none at all.
    before[3] = Down::EMPTY;
    now[7].faces[1] = f32::NEG_INFINITY;
    course.clear();
    course.watch(u16::MAX, &before);
    assert!(course.asks());
    course.note(0, u16::MAX, &then, &now);
    course.close();
    assert!(!course.asks());
}

#[test]
fn steps_without_a_direction_widen_every_side_by_the_root_of_their_number() {
    let (mut course, mut random) = (Course::default(), Random::new(1));
    let (before, now) = (at([0.0; 3]), at([0.1, 0.0, 0.0]));
    // How far the box is swept ahead, and behind.
    let far = |course: &Course, ticks| {
        let swept = course.reach(ticks).sweep(&before, &now).corners();
        [swept[3] - 1.1, 0.1 - swept[0]]
    };
    run(&mut course, &mut random, true);
    let [ahead, behind] = far(&course, 8);
    assert!(!course.wanders && (ahead - 0.835).abs() < 1e-4 && (behind - PAD).abs() < 1e-4);
    run(&mut course, &mut random, false);
    let ([ahead, behind], [four, _]) = (far(&course, 16), far(&course, 4));
    assert!(course.wanders && (ahead - behind).abs() < 1e-4);
    assert!(((ahead - PAD) / (four - PAD) - 2.0).abs() < 1e-3);
    // Mean of its own step and those of all, which are shorter.
    assert!((0.2..0.4).contains(&(ahead / WANDER)), "{ahead}");
    run(&mut course, &mut random, true);
    assert!(!course.wanders);
}

#[test]
fn along_an_axis_that_parts_few_neighbours_boxes_are_swept_both_ways() {
    let mut course = Course::default();
    // Two blocks of neighbours far from each other in all axes except height; height alone separates every fourth of
    // them.
    for high in [0.5_f32, 1.5] {
        course.clear();
        let place = |block: f32, lane: usize| {
            let lift = if lane.is_multiple_of(4) {
                high * block
            } else {
                0.0
            };
            [7.0 * block, 7.0 * block, lift]
        };
        for block in [0.0, 1.0] {
            course.watch(
                u16::MAX,
                &std::array::from_fn(|lane| at(place(block, lane))),
            );
        }
        for (number, block) in [(0, 0.0), (SAMPLE, 1.0)] {
            let moved =
                |by: f32| std::array::from_fn(|lane| at(place(block, lane).map(|x| x + by)));
            course.note(number, u16::MAX, &moved(0.1), &moved(0.2));
        }
        course.close();
        let swept = course.reach(4).sweep(&at([0.0; 3]), &at([0.1, 0.1, 0.1]));
        let [x, y, z, ..] = swept.corners();
        assert!(!course.wanders && (x - y).abs() < 1e-6);
        assert!((x - (0.1 - PAD)).abs() < 1e-5, "{swept:?}");
        let back = if high < 1.0 {
            0.1 * (4.0 + SWERVE)
        } else {
            0.0
        };
        assert!((z - (0.1 - PAD - back)).abs() < 1e-5, "{swept:?}");
    }
}

#[test]
fn a_few_and_those_at_rest_tell_nothing() {
    let mut course = Course {
        wanders: true,
        ..Course::default()
    };
    let rests = [at([0.0; 3]); WIDTH];
    course.watch(u16::MAX, &rests);
    course.note(0, u16::MAX, &rests, &rests);
    course.close();
    // These keep their course, but seven are too few: the others were not watched, or another body has their lane; and
    // a block that was not watched has no data.
    course.watch(0xFF, &rests);
    course.forget(0, 3);
    let [then, now] = [1.0, 2.0].map(|x| [at([x; 3]); WIDTH]);
    course.note(0, u16::MAX, &then, &now);
    course.note(SAMPLE, u16::MAX, &then, &now);
    course.close();
    assert!(course.wanders);
    course.watch(0xFF, &rests);
    course.note(0, u16::MAX, &then, &now);
    course.close();
    assert!(!course.wanders);
}

#[test]
fn who_rests_is_not_padded_for_those_who_wander_and_who_hardly_moves_by_little() {
    let wanders = Course {
        wanders: true,
        step: 0.1,
        ..Course::default()
    };
    // A floor a thousand times as large as the bodies that vibrate on it.
    let floor = |x: f32| Down::of([x, 0.0, 0.0, x + 1000.0, 1000.0, 1000.0]);
    let padded = |x: f32| {
        let swept = wanders.reach(16).sweep(&floor(0.0), &floor(x)).corners();
        swept[4] - 1000.0 - 1000.0 * PAD
    };
    assert!(padded(0.0).abs() < 1e-3);
    let most = 0.1 * (1.0 + OTHERS_MAX) * WANDER * 2.0;
    assert!((0.0..1.1 * most).contains(&padded(0.1)));
}

#[test]
fn what_has_no_end_or_no_place_before_is_swept_to_no_number() {
    let endless = Down::of(std::array::from_fn(|k| {
        if k < 3 {
            f32::NEG_INFINITY
        } else {
            f32::INFINITY
        }
    }));
    let wanders = Course {
        wanders: true,
        ..Course::default()
    };
    for reach in [Reach::NEW, wanders.reach(9), Course::default().reach(9)] {
        let swept = reach.sweep(&endless, &endless).corners();
        assert_eq!(swept.map(f32::to_bits), endless.corners().map(f32::to_bits));
        let appeared = reach.sweep(&Down::EMPTY, &at([0.0; 3])).corners();
        assert!(appeared.iter().all(|face| face.is_finite()));
    }
}
