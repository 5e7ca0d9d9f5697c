//! Goal: events that were never sent are one entry per pair, with all that is still true. Method: events happen, and
//! are merged.

use super::*;

fn ticks(first: u64, last: u64) -> Ticks {
    Ticks { first, last }
}

#[test]
fn law_3_9_a_begin_and_its_end_that_were_never_sent_cancel_and_are_counted() {
    let ids = (BodyId(1), BodyId(2));
    let mut events = Events::default();
    events.push(ids, None, Some(ticks(3, 4)));
    events.push(ids, Some((ticks(5, 5), EndCause::Separated)), None);
    events.merge();
    assert!(events.waiting().is_empty());
    assert_eq!(events.cancelled, 1);
}

#[test]
fn law_3_5_an_end_and_a_begin_of_one_pair_share_a_row_in_that_order() {
    let ids = (BodyId(1), BodyId(2));
    let mut events = Events::default();
    events.push(ids, Some((ticks(5, 5), EndCause::Removed)), None);
    events.push(ids, None, Some(ticks(6, 7)));
    events.merge();
    let [event] = events.waiting() else {
        panic!("one row")
    };
    assert_eq!(event.end, Some((ticks(5, 5), EndCause::Removed)));
    assert_eq!(event.begin, Some(ticks(6, 7)));
    assert_eq!(events.cancelled, 0);
}

#[test]
fn bug_an_end_by_cause_was_told_as_the_separated_end_of_a_pass() {
    let ids = (BodyId(1), BodyId(2));
    for cause in [EndCause::Reset, EndCause::Separated] {
        let mut events = Events::default();
        events.push(ids, Some((ticks(5, 5), cause)), None);
        events.push_pass(ids, ticks(5, 5));
        events.merge();
        let [event] = events.waiting() else {
            panic!("one row")
        };
        let by_cause = cause == EndCause::Reset;
        assert_eq!(event.end, Some((ticks(5, 5), cause)));
        assert_eq!(
            (event.pass.is_none(), events.cancelled),
            (by_cause, u64::from(by_cause))
        );
    }
}

#[test]
fn law_3_9_a_pass_that_was_never_sent_cancels_when_more_happens_and_waits_while_nothing_does() {
    let ids = (BodyId(1), BodyId(2));
    let mut events = Events::default();
    events.push(ids, Some((ticks(2, 2), EndCause::Separated)), None);
    events.push_pass(ids, ticks(3, 3));
    events.merge();
    events.merge();
    assert_eq!(events.waiting()[0].pass, Some(ticks(3, 3)));
    events.push(ids, None, Some(ticks(5, 5)));
    events.merge();
    let [event] = events.waiting() else {
        panic!("one row")
    };
    assert_eq!((event.pass, event.begin), (None, Some(ticks(5, 5))));
    assert_eq!(event.end, Some((ticks(2, 2), EndCause::Separated)));
    assert_eq!(events.cancelled, 1);
}

#[test]
fn law_3_9_an_unsent_end_survives_a_begin_that_is_cancelled_later() {
    let ids = (BodyId(1), BodyId(2));
    let mut events = Events::default();
    events.push(ids, Some((ticks(5, 5), EndCause::Separated)), None);
    events.push(ids, None, Some(ticks(6, 6)));
    events.push(ids, Some((ticks(7, 7), EndCause::Removed)), None);
    events.merge();
    let [event] = events.waiting() else {
        panic!("one row")
    };
    assert_eq!(event.end, Some((ticks(5, 5), EndCause::Separated)));
    assert_eq!(event.begin, None);
}
