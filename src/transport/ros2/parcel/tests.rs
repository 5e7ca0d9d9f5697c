//! Which rows of a tick are published, and which ticks are dropped.

use super::*;

const CAPS: Caps = Caps {
    pairs: 3,
    contacts: 2,
};

fn outbox(tick: u64) -> Outbox {
    let pair = |id, verdict: Verdict, gap_min_m, events| PairRow {
        body_a: id,
        verdict: verdict.code(),
        gap_min_m,
        events,
        ..PairRow::default()
    };
    let contact = |id, gap_m| ContactRow {
        id,
        gap_m,
        ..ContactRow::default()
    };
    let mut outbox = Outbox {
        pairs: vec![
            pair(1, Verdict::Near, 0.1, 0),
            pair(2, Verdict::Colliding, -0.1, Event::Persist.bit()),
            pair(3, Verdict::Possible, -9.0, 0),
            pair(4, Verdict::Apart, 1.0, Event::End.bit()),
            pair(5, Verdict::Colliding, -0.2, Event::Persist.bit()),
        ],
        contacts: vec![contact(1, -0.1), contact(2, -0.3), contact(3, -0.2)],
        ..Outbox::default()
    };
    outbox.tick.header.tick = tick;
    outbox.contacts_header.truncated = 5;
    outbox
}

fn next(parcels: &Parcels) -> Parcel {
    match parcels.next(Duration::ZERO) {
        Next::Parcel(parcel, _) => *parcel,
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_rows_of_best_rank_are_kept_in_their_order_and_the_rest_is_counted() {
    let parcels = Parcels::default();
    parcels.put(&outbox(1), Demand::ALL, CAPS);
    let parcel = next(&parcels);
    let pairs: Vec<_> = parcel.pairs.iter().map(|row| row.body_a).collect();
    assert_eq!((pairs, parcel.pairs_header.truncated), (vec![2, 4, 5], 2));
    let contacts: Vec<_> = parcel.contacts.iter().map(|row| row.id).collect();
    assert_eq!(
        (contacts, parcel.contacts_header.truncated),
        (vec![2, 3], 6)
    );
}

#[test]
fn no_event_is_left_out_and_what_is_cut_is_told_in_the_tick() {
    let parcels = Parcels::default();
    let mut all = outbox(1);
    all.pairs
        .iter_mut()
        .take(4)
        .for_each(|row| row.events = Event::End.bit());
    all.tick.header.truncated = 5;
    parcels.put(&all, Demand::ALL, CAPS);
    let parcel = next(&parcels);
    let pairs: Vec<_> = parcel.pairs.iter().map(|row| row.body_a).collect();
    assert_eq!(
        (pairs, parcel.pairs_header.truncated),
        (vec![1, 2, 3, 4], 1)
    );
    assert_eq!(parcel.tick.header.truncated, 5 + 1 + 1);
    assert_eq!(parcel.tick.reasons, Reason::Truncated.bit());
}

#[test]
fn law_3_6_bug_a_tick_cut_for_ros_was_unknown_only_where_it_had_been_clear() {
    let parcels = Parcels::default();
    let wide = Caps {
        pairs: 9,
        contacts: 9,
    };
    for caps in [
        CAPS,
        Caps { pairs: 3, ..wide },
        Caps {
            contacts: 2,
            ..wide
        },
        wide,
    ] {
        for state in [State::Clear, State::Near, State::Possible, State::Colliding] {
            let mut all = outbox(1);
            for header in [
                &mut all.tick.header,
                &mut all.pairs_header,
                &mut all.contacts_header,
            ] {
                header.state = state.code();
            }
            parcels.put(&all, Demand::ALL, caps);
            let parcel = next(&parcels);
            let wanted = if caps == wide || state == State::Colliding {
                state
            } else {
                State::Unknown
            };
            let told = [
                parcel.tick.header,
                parcel.pairs_header,
                parcel.contacts_header,
            ];
            assert_eq!(
                told.map(|header| header.state),
                [wanted.code(); 3],
                "{state}"
            );
            parcels.give_back(parcel);
        }
    }
}

#[test]
fn a_cap_of_zero_keeps_nothing_and_says_so() {
    let parcels = Parcels::default();
    let caps = Caps {
        pairs: 0,
        contacts: 0,
    };
    let mut clear = outbox(1);
    clear.tick.header.state = State::Clear.code();
    parcels.put(&clear, Demand::ALL, caps);
    let parcel = next(&parcels);
    assert_eq!((parcel.pairs.len(), parcel.pairs_header.truncated), (0, 5));
    assert_eq!(parcel.tick.header.state, State::Unknown.code());
}

#[test]
fn the_newest_ticks_win_and_names_are_not_lost_with_the_old() {
    let parcels = Parcels::default();
    let mut named = outbox(1);
    named.names_changed = true;
    named.names = vec![NameRow::default()];
    parcels.put(&named, Demand::default(), CAPS);
    for tick in 2..=4 {
        parcels.put(&outbox(tick), Demand::default(), CAPS);
    }
    assert_eq!(parcels.dropped(), 2);
    let Next::Parcel(parcel, names) = parcels.next(Duration::ZERO) else {
        panic!("a parcel waits");
    };
    assert_eq!(
        (parcel.tick.header.tick, names.map(|n| n.1.len())),
        (3, Some(1))
    );
    assert!(parcel.pairs.is_empty());
    parcels.stop();
    assert!(matches!(parcels.next(Duration::MAX), Next::Stop));
}

#[test]
fn bug_ticks_alone_pushed_out_the_rows_and_events_of_the_tick_before() {
    let parcels = Parcels::default();
    parcels.put(&outbox(1), Demand::ALL, CAPS);
    let gone: u64 = (2..=5)
        .map(|tick| parcels.put_tick(&outbox(tick).tick))
        .sum();
    assert_eq!((gone, parcels.dropped()), (3, 3));
    let first = next(&parcels);
    assert_eq!((first.tick.header.tick, first.pairs.len()), (1, 3));
    let second = next(&parcels);
    assert_eq!((second.tick.header.tick, second.done), (5, false));
    // If both waiting parcels have rows, the tick without rows is dropped; parcels with rows drop the oldest of them.
    parcels.put(&outbox(6), Demand::ALL, CAPS);
    parcels.put(&outbox(7), Demand::ALL, CAPS);
    assert_eq!(parcels.put_tick(&outbox(8).tick), 1);
    assert_eq!(parcels.put(&outbox(9), Demand::ALL, CAPS), 1);
    let ticks = [next(&parcels), next(&parcels)].map(|parcel| parcel.tick.header.tick);
    assert_eq!(ticks, [7, 9]);
}

#[test]
fn a_tick_that_is_not_done_says_so_in_memory_that_was_used_before() {
    let parcels = Parcels::default();
    parcels.put(&outbox(1), Demand::default(), CAPS);
    let parcel = next(&parcels);
    assert!(parcel.done);
    parcels.give_back(parcel);
    parcels.put_tick(&outbox(2).tick);
    assert!(!next(&parcels).done);
}
