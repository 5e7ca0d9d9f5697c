//! Goal: the cheaper mode is used, and trials of the other are rare. Method: counted work is fed tick by tick.

use super::*;

fn work(tests: u64, renewed: u64) -> Work {
    Work {
        tests,
        renewed,
        ..Work::default()
    }
}

/// Runs ticks in which all of 1,000 bodies move; returns how many worked without candidates.
fn run(gear: &mut Gear, on: &mut bool, ticks: u32, work: &Work) -> u32 {
    let mut scratch = 0;
    for _ in 0..ticks {
        *on = gear.choose(*on, 1000, 1000, (300, 0));
        if *on {
            scratch += 1;
        } else {
            gear.note(1000, 0, work);
        }
    }
    scratch
}

#[test]
fn motion_that_no_box_holds_is_worked_from_scratch_but_for_ever_rarer_trials() {
    let (mut gear, mut on) = (Gear::default(), false);
    let wild = work(10_000, 900);
    assert!(run(&mut gear, &mut on, 40, &wild) >= 1);
    assert_eq!(gear.cause, BroadCause::Spell);
    assert!(run(&mut gear, &mut on, 10_000, &wild) > 9_700);
    // It has calmed: a trial detects that, and candidates stay.
    let calm = work(500, 5);
    run(&mut gear, &mut on, SPELL_MAX + 1, &calm);
    assert_eq!(run(&mut gear, &mut on, 1000, &calm), 0);
}

/// Gives up candidates that renewed 900 boxes per tick of 1,000 bodies.
fn given_up() -> Gear {
    let (mut gear, wild) = (Gear::default(), work(10_000, 900));
    while !gear.choose(false, 1000, 1000, (300, 0)) {
        gear.note(1000, 0, &wild);
    }
    assert_eq!((gear.left, gear.probes()), (SPELL_LONG, Some(true)));
    gear
}

/// Runs ticks without candidates, at most `most` or until a trial, and feeds probe results. Returns how many probes
/// began, their ticks, and whether a trial came.
fn spell(gear: &mut Gear, most: u32, escapes: u64, crowd: u64) -> (u32, u32, bool) {
    let (mut begun, mut ticks) = (0, 0);
    for _ in 0..most {
        if let Some(begins) = gear.probes() {
            begun += u32::from(begins);
            ticks += 1;
            if ticks % PROBE_TICKS == 0 {
                gear.note_probe(Footing { escapes, crowd });
            }
        }
        if !gear.choose(true, 1000, 1000, (300, 0)) {
            assert_eq!(gear.cause, BroadCause::Trial);
            return (begun, ticks, true);
        }
    }
    (begun, ticks, false)
}

#[test]
fn candidates_are_not_tried_again_on_the_footing_that_they_were_given_up_on() {
    let mut gear = given_up();
    let two = (2, 2 * PROBE_TICKS, false);
    assert_eq!(spell(&mut gear, SPELL_LONG, 400, 2000), two);
    let ten = (10, 10 * PROBE_TICKS, false);
    assert_eq!(spell(&mut gear, 10 * SPELL_MIN, 350, 2500), ten);
    // Calmer, or another density.
    for (escapes, crowd) in [(290, 2000), (400, 1400), (400, 2700)] {
        let mut other = gear;
        assert!(
            spell(&mut other, SPELL_MIN, escapes, crowd).2,
            "{escapes} {crowd}"
        );
    }
    // They are not given up for ever.
    let rest = (VAIN_MAX - 11) * SPELL_MIN;
    assert!(!spell(&mut gear, rest, 400, 2000).2);
    assert!(spell(&mut gear, SPELL_MIN, 400, 2000).2);
}

#[test]
fn a_burst_that_has_calmed_before_the_first_probe_is_no_footing() {
    let mut gear = given_up();
    assert!(spell(&mut gear, SPELL_LONG, 50, 2000).2);
}

#[test]
fn candidates_that_take_twice_as_much_are_given_up_early() {
    let (mut gear, mut on) = (Gear::default(), false);
    let wild = work(10_000, 900);
    assert_eq!(run(&mut gear, &mut on, 12, &wild), 0);
    assert_eq!(run(&mut gear, &mut on, 1, &wild), 1);
    assert_eq!(gear.cause, BroadCause::Cost);
    let left = SPELL_LONG - 1;
    assert_eq!(run(&mut gear, &mut on, left, &wild), left);
    assert_eq!(gear.cause, BroadCause::Spell);
    assert_eq!(run(&mut gear, &mut on, 1, &wild), 0);
    assert_eq!(gear.cause, BroadCause::Trial);
}

#[test]
fn a_world_that_comes_to_rest_is_left_to_candidates_at_once() {
    let (mut gear, mut on) = (Gear::default(), false);
    run(&mut gear, &mut on, 40, &work(10_000, 900));
    assert!(on);
    for _ in 0..CALM_TICKS {
        on = gear.choose(on, 10, 1000, (300, 0));
    }
    assert_eq!((on, gear.cause), (false, BroadCause::Calm));
    gear.forced = Some(true);
    assert!(gear.choose(on, 10, 1000, (300, 0)));
    assert_eq!(gear.cause, BroadCause::Forced);
}

#[test]
fn bug_what_a_world_without_bodies_cost_is_no_measure_for_those_that_come() {
    for cost in [0, 20_000] {
        let (mut gear, mut on) = (Gear::default(), false);
        run(&mut gear, &mut on, 40, &work(10_000, 900));
        for _ in 0..CALM_TICKS {
            assert!(on);
            gear.note_scratch(0, cost);
            on = gear.choose(on, 0, 0, (0, 0));
        }
        // Vibrating bodies get candidates, and those that no fat box holds do not.
        let mut wild = gear;
        assert_eq!(run(&mut gear, &mut on, 500, &work(500, 5)), 0, "{cost}");
        assert!(
            run(&mut wild, &mut on, 40, &work(10_000, 900)) > 0,
            "{cost}"
        );
    }
}

#[test]
fn motion_that_boxes_hold_is_never_worked_from_scratch() {
    let (mut gear, mut on) = (Gear::default(), false);
    assert_eq!(run(&mut gear, &mut on, 5_000, &work(500, 5)), 0);
}

/// Ticks of many bodies that all move, from the first; probes report `escapes` of 1,024. Returns the first tick with
/// candidates, or `ticks`.
fn begin(ticks: u32, escapes: u64) -> u32 {
    let (mut gear, mut on, mut looks) = (Gear::default(), false, 0);
    let bodies = FAR + 1;
    for tick in 0..ticks {
        // Bodies that came are not listed as moved.
        let moved = if tick == 0 { 0 } else { bodies };
        on = gear.choose(on, moved, bodies, (0, 0));
        if !on {
            return tick;
        }
        if gear.probes().is_some() {
            looks += 1;
            if gear.asks_probe(looks) {
                gear.note_probe(Footing {
                    escapes,
                    crowd: 4096,
                });
            }
        }
    }
    ticks
}

#[test]
fn many_bodies_begin_without_candidates_and_get_them_where_few_escape() {
    assert_eq!(begin(SPELL_MIN, FIRST_ESCAPES + 1), SPELL_MIN);
    assert_eq!(begin(SPELL_MIN, FIRST_ESCAPES), FIRST_TICKS);
    // If bodies stand still they get candidates at once, and few bodies begin with them.
    let mut gear = Gear::default();
    assert!(gear.choose(false, 0, FAR + 1, (0, 0)));
    assert!(!gear.choose(true, 0, FAR + 1, (0, 0)));
    assert!(!gear.choose(false, FAR, FAR + 1, (0, 0)));
    assert!(!Gear::default().choose(false, 0, FAR, (0, 0)));
}
