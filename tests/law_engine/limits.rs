//! Law 3.9: truncation.

use sweepd::wire::{BodyStatus, Event, Reason, State, Verdict};

use crate::rig::{ALL, FRAME_NS, NONE, Rig, ball, body, has, scene};

/// `n` couples of balls, ids 2k and 2k + 1, with gap `gap(k)` in metres; 100 m from couple to couple.
fn couples(head: &str, n: u64, gap: impl Fn(u64) -> f64, more: &str) -> Rig {
    let mut bodies = Vec::new();
    for k in 1..=n {
        let x = 100.0 * k as f64;
        bodies.push(ball(2 * k, x, more));
        bodies.push(ball(2 * k + 1, x + 2.0 + gap(k), more));
    }
    Rig::new(&scene(head, &bodies))
}

fn ids(rig: &Rig) -> Vec<u64> {
    rig.out.pairs.iter().map(|row| row.body_a / 2).collect()
}

#[test]
fn law_3_9_events_that_do_not_fit_wait_with_their_range_and_deeper_pairs_go_first() {
    let head = "[limits]\npair_rows = 3";
    let mut rig = couples(head, 5, |k| -0.1 * k as f64, "");
    rig.send(ALL);
    assert_eq!(ids(&rig), [3, 4, 5], "the deepest");
    assert_eq!(rig.out.pairs_header.truncated, 2);
    assert_eq!(rig.state(), State::Colliding);
    assert!(rig.because(Reason::Truncated));
    rig.send(ALL);
    // The two delayed rows come first, with the tick of their begin, then the deepest pair.
    assert_eq!(ids(&rig), [1, 2, 5]);
    for row in &rig.out.pairs[..2] {
        assert!(has(row, Event::Begin));
        assert_eq!((row.begin_first_tick, row.begin_last_tick), (1, 1));
    }
    rig.send(ALL);
    assert_eq!(ids(&rig), [3, 4, 5]);
    assert!(rig.out.pairs.iter().all(|row| !has(row, Event::Begin)));
    assert_eq!(rig.out.tick.colliding, 5, "counts are of all pairs");
}

#[test]
fn law_3_9_rows_left_out_of_changes_are_those_of_pairs_and_their_events_wait_too() {
    let mut rig = couples("[limits]\npair_rows = 3", 5, |k| -0.1 * k as f64, "");
    rig.demand.pairs = false;
    for (want, begun) in [([3, 4, 5], 3), ([1, 2, 5], 2), ([3, 4, 5], 0)] {
        rig.send(ALL);
        let rows = &rig.out.changes;
        let couples: Vec<u64> = rows.iter().map(|row| row.body_a / 2).collect();
        assert_eq!(couples, want);
        let begins = rows.iter().filter(|row| has(row, Event::Begin)).count();
        assert_eq!(begins, begun);
        let header = rig.out.changes_header;
        assert_eq!((header.base_tick, header.listed), (0, 3), "the whole list");
        assert_eq!(header.message.truncated, 2);
        assert_eq!(rig.out.tick.header.truncated, 2);
        assert!(rig.because(Reason::Truncated));
    }
    for k in 2..=5 {
        rig.row(2 * k).position[1] = 50.0;
    }
    let mut ended = 0;
    while ended < 4 {
        rig.send(ALL);
        assert_eq!(rig.out.changes_header.base_tick, 0);
        let rows = rig.out.changes.iter();
        ended += rows.filter(|row| has(row, Event::End)).count();
    }
    // All rows fit again. The next message has only changes: the last ended pair has left the list.
    assert_eq!(rig.out.changes_header.message.truncated, 0);
    rig.send(ALL);
    let header = rig.out.changes_header;
    assert_eq!((header.base_tick, header.listed), (rig.ticks() - 1, 1));
    let [left] = rig.out.changes.as_slice() else {
        panic!("one has left")
    };
    assert!(left.has_left());
    rig.send(ALL);
    assert!(rig.out.changes.is_empty());
}

#[test]
fn law_3_9_an_event_waits_after_its_pair_is_gone_and_begin_and_end_unsent_cancel() {
    let head = "[limits]\npair_rows = 1";
    let mut rig = couples(head, 3, |k| -0.1 * k as f64, "");
    rig.send(ALL);
    assert_eq!(ids(&rig), [3]);
    for k in 1..=3 {
        rig.row(2 * k).position[1] = 50.0;
    }
    rig.send(ALL);
    // The begins of 1 and 2 were never sent, and now these pairs have ended.
    assert_eq!(rig.out.tick.cancelled_events, 2);
    assert_eq!(ids(&rig), [3]);
    assert!(has(&rig.out.pairs[0], Event::End));
    // A delayed end: 3 collides and is published, then all three end at once.
    let mut rig = couples(head, 3, |k| -0.1 * k as f64, "");
    for _ in 0..4 {
        rig.send(ALL);
    }
    for k in 1..=3 {
        rig.row(2 * k).position[1] = 50.0;
    }
    let end = rig.ticks() + 1;
    let mut ended = Vec::new();
    for _ in 0..3 {
        rig.send(ALL);
        assert!(rig.state() != State::Clear || rig.out.pairs_header.truncated == 0);
        let [row] = rig.out.pairs.as_slice() else {
            panic!("one row a tick")
        };
        assert_eq!((row.end_first_tick, row.end_last_tick), (end, end));
        ended.push(row.body_a / 2);
    }
    ended.sort_unstable();
    assert_eq!(ended, [1, 2, 3]);
    rig.send(ALL);
    assert!(rig.out.pairs.is_empty());
    assert_eq!(rig.state(), State::Clear);
}

#[test]
fn law_3_9_bug_an_event_that_waits_has_its_turn_before_deeper_ones_that_are_new() {
    let mut rig = couples("[limits]\npair_rows = 1", 2, |_| -0.1, "");
    rig.send(ALL);
    assert_eq!(ids(&rig), [1]);
    rig.send(ALL);
    assert_eq!(ids(&rig), [2]);
    // Both end; then the first pair begins and ends repeatedly, deeper than the second ever was.
    rig.row(4).position[1] = 50.0;
    let mut told = Vec::new();
    for tick in 0..8 {
        rig.row(2).position[1] = if tick % 2 == 0 { 50.0 } else { 0.0 };
        rig.send(ALL);
        told.extend(ids(&rig));
    }
    assert!(told[..2].contains(&2), "{told:?}");
}

#[test]
fn law_3_9_rows_keep_their_rank_colliding_before_possible_before_near() {
    let near = "report_within_m = 0.5";
    for (rows, want) in [(1, vec![1]), (2, vec![1, 2]), (3, vec![1, 2, 3])] {
        let mut rig = couples(
            &format!("[limits]\npair_rows = {rows}"),
            3,
            |k| [0.0, -0.5, 0.3, 0.3][usize::try_from(k).unwrap()],
            near,
        );
        rig.send(ALL);
        rig.send(ALL);
        // The second couple moves, and the budget is zero: its verdict is possible.
        rig.row(4).position[2] = 0.4;
        rig.send(NONE);
        assert_eq!(rig.verdict(2, 3), Verdict::Colliding);
        assert_eq!(ids(&rig), want);
        assert_eq!(rig.out.pairs_header.truncated, 3 - rows);
    }
}

#[test]
fn law_3_9_the_state_is_never_clear_nor_near_when_something_was_left_out() {
    let mut rig = couples(
        "[limits]\npair_rows = 1",
        3,
        |_| 0.3,
        "report_within_m = 0.5",
    );
    rig.send(ALL);
    assert_eq!(rig.state(), State::Unknown);
    assert_eq!(rig.out.tick.header.truncated, 2);
}

#[test]
fn rows_that_are_left_where_they_stood_among_others_that_do_not_fit_are_those_of_a_list_that_fits()
{
    let near = "report_within_m = 0.5";
    let gap = |k: u64| 0.04 * k as f64 - 0.5;
    let mut whole = couples("", 20, gap, near);
    let mut cut = couples("[limits]\npair_rows = 7", 20, gap, near);
    // Couples that change their gap in a tick; never more than seven rows matter.
    let stirs: [&[u64]; 9] = [&[], &[], &[3], &[20, 19], &[], &[1, 2, 3], &[8], &[], &[7]];
    let mut kept = 0;
    for (tick, stirred) in (0..90).zip(stirs.iter().cycle()) {
        for k in *stirred {
            let y = 0.3 * ((tick * 7 + k) % 5) as f64;
            whole.row(2 * k).position[1] = y;
            cut.row(2 * k).position[1] = y;
        }
        let before: Vec<u64> = ids(&cut);
        whole.send(ALL);
        cut.send(ALL);
        assert_eq!(cut.out.pairs.len(), 7);
        kept += ids(&cut).iter().filter(|id| before.contains(id)).count();
        for row in &cut.out.pairs {
            let twin = |other: &&sweepd::wire::PairRow| other.body_a == row.body_a;
            let twin = whole.out.pairs.iter().find(twin).unwrap();
            // Rows with delayed events are skipped: the twin has published these earlier.
            if row.events & !Event::Persist.bit() == 0 && twin.events == row.events {
                // Compared as text, so that NaN equals NaN.
                assert_eq!(format!("{row:?}"), format!("{twin:?}"), "tick {tick}");
            }
        }
    }
    assert!(kept > 90 * 4, "{kept}");
}

#[test]
fn law_3_9_contact_rows_that_do_not_fit_are_the_shallowest() {
    let mut rig = couples("[limits]\ncontact_rows = 2", 4, |k| -0.1 * k as f64, "");
    rig.send(ALL);
    let kept: Vec<u64> = rig.out.contacts.iter().map(|row| row.body_a / 2).collect();
    assert_eq!(kept, [3, 4]);
    assert_eq!(rig.out.contacts_header.truncated, 2);
    assert_eq!(rig.out.pairs.len(), 4);
    assert!(rig.because(Reason::Truncated));
}

#[test]
fn law_3_9_contacts_of_the_deepest_pair_fit_whatever_the_limit_is() {
    let cube = "{ type = \"box\", half_extents = [1.0, 1.0, 1.0] }";
    let bodies: Vec<String> = (1..=2)
        .flat_map(|k| [(2 * k, 0.0), (2 * k + 1, 2.0 - 0.1 * k as f64)])
        .map(|(id, x)| body(id, [100.0 * (id / 2) as f64 + x, 0.0, 0.0], cube, ""))
        .collect();
    let mut rig = Rig::new(&scene("[limits]\ncontact_rows = 3", &bodies));
    rig.send(ALL);
    let told: Vec<u64> = rig.out.contacts.iter().map(|row| row.body_a / 2).collect();
    assert_eq!(told, [2; 4]);
    assert_eq!(rig.out.contacts_header.truncated, 4);
}

#[test]
fn law_3_9_regions_that_do_not_fit_are_those_of_whole_pairs_the_shallowest() {
    let mut rig = couples("[limits]\nregion_rows = 8", 4, |k| -0.1 * k as f64, "");
    rig.send(ALL);
    let kept: Vec<u64> = rig.out.regions.iter().map(|row| row.body_a / 2).collect();
    assert_eq!(kept, [4], "one contact, one region");
    assert_eq!(rig.out.regions_header.truncated, 3);
    assert_eq!(rig.out.pairs.len(), 4);
    assert!(rig.because(Reason::Truncated));
}

#[test]
fn law_3_9_beyond_the_pair_set_the_state_is_unknown_and_so_is_each_body_concerned() {
    let mut rig = couples("[limits]\npairs = 2", 4, |_| 0.1, "report_within_m = 0.05");
    for k in 1..=4 {
        // The boxes overlap, the balls do not.
        rig.row(2 * k + 1).position = [100.0 * k as f64 + 1.5, 1.5, 1.5];
    }
    rig.send(ALL);
    assert_eq!(rig.state(), State::Unknown);
    assert!(rig.because(Reason::Truncated));
    assert_eq!(rig.out.tick.candidates, 2);
    let unknown = rig
        .out
        .bodies
        .iter()
        .filter(|row| row.status == BodyStatus::Truncated.code());
    assert_eq!(unknown.count(), 4);
    assert_eq!(rig.out.tick.unknown, 4);
    let verdicts = &rig.out.body_verdicts;
    assert_eq!(
        verdicts
            .iter()
            .filter(|&&v| v == Verdict::Possible.code())
            .count(),
        4
    );
    // Two couples separate: the other two fit in the pair set, and the state is clear after the next tick.
    for k in 1..=2 {
        rig.row(2 * k).position[1] = -50.0;
    }
    rig.send(ALL);
    rig.idle(FRAME_NS, ALL);
    assert_eq!(rig.state(), State::Clear);
    assert_eq!(rig.out.tick.unknown, 0);
}

#[test]
fn law_3_9_a_pair_that_did_not_fit_is_not_said_to_have_been_apart_before() {
    let mut rig = couples("[limits]\npairs = 1", 2, |_| -0.5, "");
    rig.send(ALL);
    rig.send(ALL);
    assert_eq!(rig.out.pairs.len(), 1);
    let (seen, missed) = if ids(&rig) == [1] { (1, 2) } else { (2, 1) };
    rig.row(2 * seen).position[1] = 50.0;
    rig.send(ALL);
    rig.idle(FRAME_NS, ALL);
    let row = rig.pair(2 * missed, 2 * missed + 1).unwrap();
    assert_eq!(rig.verdict(2 * missed, 2 * missed + 1), Verdict::Colliding);
    assert!(row.certified_tick >= 3);
    assert_eq!(rig.out.tick.colliding, 1);
}

#[test]
fn law_3_9_one_byte_a_body_is_never_truncated() {
    let mut rig = couples(
        "[limits]\npair_rows = 1\ncontact_rows = 1",
        20,
        |k| if k % 2 == 0 { -0.2 } else { 0.4 },
        "",
    );
    rig.send(ALL);
    let want: Vec<u8> = (1..=20_u64)
        .flat_map(|k| if k % 2 == 0 { [4, 4] } else { [1, 1] })
        .collect();
    assert_eq!(rig.out.body_verdicts, want);
    assert_eq!(rig.out.bodies.len(), 40);
    for (row, verdict) in rig.out.bodies.iter().zip(&rig.out.body_verdicts) {
        assert_eq!(row.verdict, *verdict);
    }
}

#[test]
fn bug_an_end_that_waited_carries_the_interval_of_this_tick_not_of_its_last_test() {
    let mut rig = couples("[limits]\npair_rows = 1", 2, |_| -0.1, "");
    for _ in 0..3 {
        rig.send(ALL);
    }
    // Apart along a diagonal, where the boxes overlap: both couples stay candidates, with certificates of 0.26 m.
    let place = |rig: &mut Rig, d: f64| {
        for k in 1..=2 {
            let x = 100.0 * k as f64;
            rig.row(2 * k + 1).position = [x + d, d, 0.0];
        }
        rig.send(ALL);
        let row = rig.out.pairs[0];
        let gap_m = d.hypot(d) - 2.0;
        assert!(has(&row, Event::End), "{row:?}");
        assert!(
            row.gap_min_m <= gap_m && gap_m <= row.gap_max_m,
            "{gap_m}: {row:?}"
        );
    };
    place(&mut rig, 1.6);
    assert_eq!(ids(&rig), [1]);
    // They move by less than the certificate: there are no queries, and the delayed row is sent.
    place(&mut rig, 1.55);
    assert_eq!(ids(&rig), [2]);
    assert_eq!(rig.engine.counters().queries, 0);
}
