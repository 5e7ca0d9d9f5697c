//! Law 3.5: events.

use sweepd::scene::PairAction;
use sweepd::wire::{EndCause, Event, Verdict, pair_flags};
use sweepd::world::Edit;

use crate::rig::{ALL, FRAME_NS, NONE, Rig, ball, has, rule, scene};

/// Two balls, ids 1 and 2, with centres 2.5 m apart: neither the balls nor their boxes overlap.
fn two() -> Rig {
    Rig::new(&scene("", &[ball(1, 0.0, ""), ball(2, 2.5, "")]))
}

#[test]
fn law_3_5_a_collision_begins_persists_and_ends_in_its_ticks() {
    let mut rig = two();
    rig.send(ALL);
    assert!(rig.out.pairs.is_empty());
    rig.move_x(2, 1.9);
    rig.send(ALL);
    let row = rig.pair(1, 2).unwrap();
    assert!(has(row, Event::Begin) && !has(row, Event::Persist));
    assert_eq!((row.begin_first_tick, row.begin_last_tick), (2, 2));
    for x in [1.5, 1.9] {
        rig.move_x(2, x);
        rig.send(ALL);
        let row = rig.pair(1, 2).unwrap();
        assert!(has(row, Event::Persist) && !has(row, Event::Begin) && !has(row, Event::End));
    }
    rig.move_x(2, 2.5);
    rig.send(ALL);
    let row = rig.pair(1, 2).unwrap();
    assert!(has(row, Event::End) && !has(row, Event::Persist));
    assert_eq!(row.end_cause, EndCause::Separated.code());
    assert_eq!((row.end_first_tick, row.end_last_tick), (5, 5));
    rig.send(ALL);
    assert!(rig.out.pairs.is_empty());
}

#[test]
fn law_3_5_with_less_budget_a_begin_comes_later_with_the_range_it_may_have_happened_in() {
    let mut rig = two();
    rig.send(ALL);
    rig.move_x(2, 1.9);
    for _ in 2..5 {
        rig.send(NONE);
        let row = rig.pair(1, 2).unwrap();
        assert_eq!(rig.verdict(1, 2), Verdict::Possible);
        assert_eq!(row.events, 0, "nothing is certified");
        assert_eq!(row.certified_verdict, Verdict::Apart.code());
        assert_eq!(row.certified_tick, 1);
    }
    rig.send(ALL);
    let row = rig.pair(1, 2).unwrap();
    assert!(has(row, Event::Begin));
    assert_eq!((row.begin_first_tick, row.begin_last_tick), (2, 5));
}

#[test]
fn law_3_5_a_collision_that_only_possible_rows_saw_never_begins() {
    let mut rig = two();
    rig.send(ALL);
    rig.move_x(2, 1.9);
    rig.send(NONE);
    assert_eq!(rig.verdict(1, 2), Verdict::Possible);
    rig.move_x(2, 2.5);
    rig.send(ALL);
    assert!(rig.out.pairs.is_empty());
}

#[test]
fn law_3_5_an_end_by_cause_is_sent_at_once_also_from_possible() {
    let named = || "b2".to_owned();
    let disable = Edit::Enable {
        name: named(),
        enabled: false,
    };
    let causes = [
        (Edit::Remove { name: named() }, EndCause::Removed),
        (disable, EndCause::Disabled),
        (
            rule(PairAction::Ignore, "b1", "b2", None),
            EndCause::Filtered,
        ),
        (Edit::Reset { source: None }, EndCause::Reset),
    ];
    for (edit, cause) in causes {
        let mut rig = two();
        rig.move_x(2, 1.9);
        rig.send(ALL);
        assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
        // The balls are apart, but their boxes overlap and the budget is zero.
        rig.row(2).position = [1.5, 1.5, 0.0];
        rig.send(NONE);
        assert_eq!(rig.verdict(1, 2), Verdict::Possible, "{cause}");
        assert!(!has(rig.pair(1, 2).unwrap(), Event::End), "{cause}");
        rig.edit(vec![edit], NONE);
        let row = rig.pair(1, 2).unwrap();
        assert!(has(row, Event::End), "{cause}");
        assert_eq!(row.end_cause, cause.code(), "{cause}");
        assert_eq!((row.end_first_tick, row.end_last_tick), (2, 3), "{cause}");
        assert_ne!(row.flags & pair_flags::GONE, 0, "{cause}");
        rig.idle(FRAME_NS, NONE);
        assert!(rig.pair(1, 2).is_none_or(|row| row.events == 0), "{cause}");
    }
}

#[test]
fn law_3_5_a_body_taken_out_by_age_ends_its_pairs_as_source_lost() {
    let mut rig = Rig::new(&scene(
        "",
        &[ball(1, 0.0, "on_stale = \"remove\""), ball(2, 1.5, "")],
    ));
    rig.send(ALL);
    assert_eq!(rig.verdict(1, 2), Verdict::Colliding);
    rig.idle(600_000_000, ALL);
    let row = rig.pair(1, 2).unwrap();
    assert!(has(row, Event::End));
    assert_eq!(row.end_cause, EndCause::SourceLost.code());
}

#[test]
fn law_3_5_a_pair_that_was_ignored_is_not_said_to_have_been_apart() {
    let mut rig = two();
    rig.edit(vec![rule(PairAction::Ignore, "b1", "b2", None)], ALL);
    rig.move_x(2, 1.0);
    rig.send(ALL);
    assert!(rig.out.pairs.is_empty());
    let (a, b) = ("b1".to_owned(), "b2".to_owned());
    rig.edit(vec![Edit::DropRules { a, b }], NONE);
    let row = rig.pair(1, 2).unwrap();
    assert_eq!(rig.verdict(1, 2), Verdict::Possible);
    assert_eq!(row.certified_tick, 0, "it was never certified: {row:?}");
    rig.idle(FRAME_NS, ALL);
    let row = rig.pair(1, 2).unwrap();
    assert_eq!((row.begin_first_tick, row.begin_last_tick), (3, 4));
}

#[test]
fn law_3_5_a_collision_found_when_a_lost_body_is_back_may_have_begun_since_it_was_lost() {
    let mut rig = two();
    rig.send(ALL);
    let lost = 1 + rig.ticks();
    rig.idle(600_000_000, ALL);
    rig.idle(FRAME_NS, ALL);
    rig.move_x(2, 1.0);
    rig.send(ALL);
    let row = rig.pair(1, 2).unwrap();
    assert!(has(row, Event::Begin));
    assert_eq!(
        (row.begin_first_tick, row.begin_last_tick),
        (lost, rig.ticks())
    );
}
