//! Goal: fat boxes hold what moves as it did, and are no wider than they must. Method: one body, tick by tick.

use super::*;
use crate::simd::boxes::Portable;

/// A unit cube at a place.
fn shifted(by: f32) -> Down {
    let top = -1.0 - by;
    Down {
        faces: [by, by, by, 0.0, top, top, top, 0.0],
    }
}

fn holds(outer: &Down, inner: &Down) -> bool {
    Portable.holds(outer, inner)
}

#[test]
fn a_body_that_flies_straight_stays_in_its_box_for_the_horizon() {
    let mut gait = Gait::NEW;
    let held = gait.renew(&shifted(0.0), 0, HORIZON, &Hold::EMPTY);
    let Hold { fat, core } = gait.renew(&shifted(0.02), 1, HORIZON, &held);
    let after = |ticks: f32| shifted(0.02 * (1.0 + HORIZON as f32 + ticks));
    assert!(holds(&fat, &after(-0.1)) && !holds(&fat, &after(1.0)));
    assert!(
        !holds(&fat, &shifted(0.0)),
        "it is not widened to where it came from"
    );
    assert!(
        holds(&after(-0.1), &core) && !holds(&after(1.0), &core),
        "what it leaves behind is not held for sure"
    );
}

#[test]
fn a_body_that_moves_now_and_then_stays_in_its_box_for_as_many_moves() {
    let (mut gait, mut held, mut renewals) = (Gait::NEW, Hold::EMPTY, 0);
    for step in 0..160_u32 {
        // All move in each hundredth tick, and this one in others of its own.
        let (beat, now) = (1000 + step / 100, shifted(0.02 * step as f32));
        if step % 100 != 0 {
            gait.note_move();
        }
        if step == 0 || !(holds(&held.fat, &now) && holds(&now, &held.core)) {
            held = gait.renew(&now, beat, HORIZON, &held);
            renewals += 1;
        }
    }
    assert!((5..=14).contains(&renewals), "{renewals}");
}

#[test]
fn a_body_that_trembles_learns_a_margin_that_holds_it() {
    let (mut gait, mut held, mut renewals) = (Gait::NEW, Hold::EMPTY, 0);
    for tick in 0..1000_u32 {
        let now = shifted(if tick % 2 == 0 { 0.004 } else { -0.004 });
        if tick == 0 || !(holds(&held.fat, &now) && holds(&now, &held.core)) {
            held = gait.renew(&now, tick, HORIZON, &held);
            renewals += 1;
            assert!(holds(&held.fat, &now) && holds(&now, &held.core));
        }
    }
    assert!(renewals < 12, "{renewals}");
}

#[test]
fn a_body_at_rest_keeps_to_the_places_that_it_has_been_at() {
    let (mut gait, mut held, mut late) = (Gait::NEW, Hold::EMPTY, 0);
    let mut state = 7_u32;
    for tick in 0..2000_u32 {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let now = shifted(((state >> 8) as f32 / 8_388_608.0 - 1.0) * 0.004);
        if tick == 0 || !(holds(&held.fat, &now) && holds(&now, &held.core)) {
            held = gait.renew(&now, tick, HORIZON, &held);
            late += u32::from(tick >= 100);
            assert!(holds(&held.fat, &now) && holds(&now, &held.core));
        }
    }
    // It spans 0.008; a margin on either side of a place would have to be as much.
    let span = held.core.faces[0] - held.fat.faces[0];
    assert!(late <= 2 && span < 0.014, "{late} {span}");
    assert!(!gait.leaves(Portable, &shifted(0.003), &held, 2016, HORIZON));
    // Off it goes: it is followed again.
    let mut renewals = 0;
    for tick in 2000..2100_u32 {
        let now = shifted(0.02 * (tick - 1999) as f32);
        if !(holds(&held.fat, &now) && holds(&now, &held.core)) {
            held = gait.renew(&now, tick, HORIZON, &held);
            renewals += 1;
        }
    }
    assert!(renewals < 30, "{renewals}");
}

#[test]
fn a_body_that_is_new_among_others_at_rest_hardly_has_to_learn() {
    let place = |tick: u32| {
        let mixed = tick.wrapping_mul(2_654_435_761).wrapping_add(977) >> 8;
        shifted((mixed as f32 / 8_388_608.0 - 1.0) * 0.004)
    };
    let run = |mut gait: Gait| {
        let (mut held, mut renewals) = (Hold::EMPTY, 0);
        for tick in 0..200 {
            let now = place(tick);
            if tick == 0 || !(holds(&held.fat, &now) && holds(&now, &held.core)) {
                held = gait.renew(&now, tick, HORIZON, &held);
                renewals += 1;
            }
        }
        (renewals, gait.span(&held))
    };
    let (learning, span) = run(Gait::NEW);
    let span = span.expect("it is at rest");
    assert!((0.008..0.016).contains(&span), "{span}");
    let (guessed, as_others) = run(Gait::at_rest(span));
    assert!(guessed * 2 <= learning, "{guessed} of {learning}");
    let as_others = as_others.expect("it is at rest, too");
    assert!(as_others < 2.0 * span, "{as_others}, {span}");
}

#[test]
fn a_wild_body_gets_its_own_box() {
    let (mut gait, mut held) = (Gait::NEW, Hold::EMPTY);
    for tick in 0..4 {
        held = gait.renew(&shifted(tick as f32 * 5.0), tick, HORIZON, &held);
    }
    let held = gait.renew(&shifted(77.0), 4, HORIZON, &held);
    assert_eq!(held.fat.corners(), shifted(77.0).corners());
}

#[test]
fn infinite_boxes_are_their_own() {
    let mut all = shifted(0.0);
    (all.faces[0], all.faces[4]) = (f32::NEG_INFINITY, f32::NEG_INFINITY);
    let mut gait = Gait::NEW;
    let held = gait.renew(&all, 0, HORIZON, &Hold::EMPTY);
    let held = gait.renew(&all, 3, HORIZON, &held);
    assert_eq!(held.fat.corners(), all.corners());
}
