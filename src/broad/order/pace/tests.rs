//! Goal: lists last as long as costs least, and are dropped where they do not pay. Method: counted work is fed tick by
//! tick.

use super::*;

const BODIES: usize = 1000;

/// Lists in sequence; a search costs `tests`, and a tick has `entries` for each tick that boxes are swept for. Returns
/// how long the last ones were in use, and whether lists go on.
fn run(pace: &mut Pace, tests: u64, entries: u64, lists: u32) -> (u32, bool) {
    pace.note_list(tests);
    for _ in 0..lists {
        let most = usize::try_from(entries * u64::from(pace.ticks)).unwrap();
        while pace.phase() == Phase::Lasts {
            pace.note_tick(most, 0, BODIES);
        }
        if !pace.pays() {
            return (pace.ticks, false);
        }
        pace.open();
        while pace.phase() == Phase::Makes {
            pace.note_tick(most, 0, BODIES);
        }
        assert_eq!(pace.phase(), Phase::Ends);
        pace.note_list(tests);
        pace.note_tick(most, 0, BODIES);
    }
    (pace.ticks, true)
}

#[test]
fn a_list_is_in_use_for_as_many_ticks_as_cost_least() {
    // A search of 12,000 over n ticks, and 480 n in each: minimal at five.
    let mut pace = Pace::default();
    pace.begin(4000 * MEET);
    let (ticks, on) = run(&mut pace, 1000, 120, 40);
    assert!((4..=8).contains(&ticks) && on, "{ticks}");
    // With cheaper entries it is longer.
    let (ticks, on) = run(&mut pace, 1000, 10, 40);
    assert!((12..=TICKS_MAX).contains(&ticks) && on, "{ticks}");
}

#[test]
fn the_next_list_is_made_in_the_last_ticks_of_the_one_in_use() {
    let mut pace = Pace::default();
    pace.begin(1000 * MEET);
    assert_eq!(pace.span(true), TICKS);
    pace.note_list(1000);
    pace.note_tick(10, 0, BODIES);
    let mut seen = Vec::new();
    loop {
        let phase = pace.phase();
        if phase == Phase::Opens {
            assert!(pace.pays());
            assert_eq!(pace.open(), pace.left);
        }
        seen.push((phase, pace.span(false)));
        if phase == Phase::Ends {
            break;
        }
        pace.note_tick(10, 0, BODIES);
    }
    let (lasts, makes) = seen.split_at(3);
    assert_eq!(
        pace.ticks,
        TICKS - 2,
        "one way is as good as the other at first"
    );
    let spans: Vec<u32> = lasts.iter().map(|(_, span)| *span).collect();
    assert!(lasts.iter().all(|(phase, _)| *phase == Phase::Lasts));
    assert_eq!(spans, [7, 6, 5]);
    let made = [9, 8, 7].map(|span| (Phase::Makes, span));
    assert_eq!(makes[0], (Phase::Opens, 10));
    assert_eq!(makes[1..4], made);
    assert_eq!(makes[4..], [(Phase::Ends, 6)]);
    // Its boxes last to the end of the list that takes over now.
    pace.note_list(1000);
    pace.note_tick(10, 0, BODIES);
    assert_eq!((pace.phase(), pace.span(false)), (Phase::Lasts, 5));
}

#[test]
fn lists_that_do_not_pay_are_tried_ever_more_seldom() {
    let mut pace = Pace::default();
    let mut rests = Vec::new();
    for _ in 0..4 {
        pace.begin(1000 * MEET);
        let (_, on) = run(&mut pace, 8000, 300, 40);
        assert!(!on);
        rests.push(1 + (0..).take_while(|_| !pace.begins(0, 1000 * MEET)).count());
    }
    assert_eq!(rests, [64, 256, 1024, 2048]);
    // After a list that pays, rests start from the beginning.
    pace.begin(4000 * MEET);
    assert!(run(&mut pace, 1000, 10, 4).1);
    let mut broken = pace;
    pace.fail();
    assert_eq!(pace.rest, REST_MIN);
    // One that was broken off is tried again sooner, if it had paid.
    broken.break_off();
    assert_eq!(broken.rest, REST_BROKEN);
    broken.begin(4000 * MEET);
    broken.break_off();
    assert_eq!(broken.rest, 4 * REST_MIN);
}

#[test]
fn a_crowd_of_overlaps_is_not_listed() {
    let mut pace = Pace::default();
    assert!(!pace.begins(2000, 1000 * MEET) && pace.nears());
    assert!(!pace.begins(10_000, 1000 * MEET) && pace.begins(2000, 1000 * MEET));
    // A list that turns out too large is dropped in the next tick.
    pace.begin(1000 * MEET);
    pace.note_list(1000);
    pace.note_tick(100_000, 0, BODIES);
    assert!(pace.phase() == Phase::Opens && !pace.pays());
}

#[test]
fn what_flies_far_beside_its_size_is_not_listed_to_begin_with() {
    let mut pace = Pace::default();
    assert!(pace.promises(1000, 2.5, 1000 * MEET));
    assert!(!pace.promises(1000, 4.0, 1000 * MEET));
    assert!((0..REST_MIN - 1).all(|_| !pace.begins(0, 1000 * MEET)) && pace.begins(0, 1000 * MEET));
}

#[test]
fn where_many_stray_the_next_list_is_begun() {
    let mut pace = Pace::default();
    pace.begin(1000 * MEET);
    pace.note_list(1000);
    pace.note_tick(100, BODIES / 100, BODIES);
    assert_eq!(pace.phase(), Phase::Lasts);
    pace.note_tick(100, BODIES / 10, BODIES);
    assert_eq!(pace.phase(), Phase::Opens);
}

#[test]
fn searches_that_have_cost_as_much_as_laying_anew_are_wear() {
    let mut pace = Pace::default();
    pace.note_list(1000);
    for _ in 0..12 {
        assert!(!pace.is_worn(BODIES));
        pace.note_list(2000);
    }
    assert!(pace.is_worn(BODIES));
    pace.note_laid();
    assert!(!pace.is_worn(BODIES));
}
