//! What messages say, and how large they become.

use super::*;
use crate::wire::BODY_NAME_LEN;

fn named(body: u64, text: &str) -> NameRow {
    let mut row = NameRow {
        body,
        len: u32::try_from(text.len()).unwrap(),
        ..NameRow::default()
    };
    row.name[..text.len()].copy_from_slice(text.as_bytes());
    row
}

#[test]
fn rows_are_cut_into_messages_that_fit_and_none_is_lost() {
    let rows: Vec<u64> = (0..1000).collect();
    let chunks: Vec<_> = cut(&rows, |_| 400).map(|(run, ..)| run).collect();
    assert!(chunks.len() > 3 && chunks.iter().all(|c| c.len() * 400 <= MESSAGE_BYTES_MAX));
    assert_eq!(chunks.concat(), rows);
    assert_eq!(cut::<u64>(&[], |_| 400).count(), 1);
    assert_eq!(cut(&rows[..2], |_| MESSAGE_BYTES_MAX * 2).count(), 2);
}

#[test]
fn the_largest_message_stays_below_128_kilobytes_on_the_wire() {
    let long = "x".repeat(BODY_NAME_LEN);
    let rows: Vec<NameRow> = (1..=3000).map(|id| named(id, &long)).collect();
    let all = Speaker {
        frame_id: "world".to_owned(),
        book: Book::of(&rows),
        stamp: None,
    };
    let contact = |body_b| ContactRow {
        body_a: 1,
        body_b,
        ..ContactRow::default()
    };
    let pair = |body_b| PairRow {
        body_a: 1,
        body_b,
        ..PairRow::default()
    };
    let contacts: Vec<_> = (2..2002).map(contact).collect();
    let pairs: Vec<_> = (2..2002).map(pair).collect();
    let header = MessageHeader::default();
    let names = all.names(Time::default(), 1, 1);
    for (topic, bytes) in [
        ("contacts", largest(&all.contacts(&header, &contacts))),
        ("pairs", largest(&all.pairs(&header, &pairs))),
        ("names", largest(&names)),
    ] {
        assert!((60_000..=128 * 1024).contains(&bytes), "{topic}: {bytes}");
    }
}

/// Bytes on the wire of the largest one.
fn largest<M: serde::Serialize>(messages: &[M]) -> usize {
    let sizes = messages.iter().map(|message| {
        cdr_encoding::to_vec::<_, byteorder::LittleEndian>(message)
            .unwrap()
            .len()
    });
    sizes.max().unwrap()
}

#[test]
fn a_state_says_its_reasons_in_words_and_its_worst_pair_by_name() {
    let mut speaker = Speaker {
        frame_id: "cell".to_owned(),
        book: Book::of(&[named(7, "arm")]),
        stamp: None,
    };
    let mut row = TickRow {
        worst_a: 7,
        worst_b: 9,
        ..TickRow::default()
    };
    row.reasons = Reason::Stale.bit() | Reason::NoInput.bit();
    row.header.state = wire::State::Unknown.code();
    row.header.oldest_stamp_ns = 3_000_000_001;
    let state = speaker.state(&row);
    assert_eq!(
        (state.word.as_str(), state.reason_words),
        ("unknown", vec!["stale".to_owned(), "no_input".to_owned()])
    );
    assert_eq!(
        (state.worst_name_a.as_str(), state.worst_name_b.as_str()),
        ("arm", "")
    );
    assert_eq!(
        (
            state.header.stamp.sec,
            state.header.stamp.nanosec,
            state.header.frame_id.as_str()
        ),
        (3, 1, "cell")
    );
    speaker.stamp = Some(Time::from_ns(5_000_000_000));
    assert_eq!(speaker.state(&row).header.stamp.sec, 5);
}

#[test]
fn the_name_of_a_body_that_has_left_is_kept_for_rows_that_end_its_pairs() {
    let first = Book::of(&[named(1, "arm"), named(2, "crate")]);
    let second = first.next(&[named(1, "arm")]);
    assert_eq!((second.name(2), second.name(1)), ("crate", "arm"));
    // It is no body of the scene any more: neither listed nor found by its name.
    assert_eq!((second.id("crate"), second.holds(2)), (None, false));
    assert_eq!(second.rows().count(), 1);
    let back = second.next(&[named(1, "arm"), named(2, "crate")]);
    assert_eq!((back.id("crate"), back.gone.len()), (Some(2), 0));
    // Those that left last are kept.
    let many: Vec<NameRow> = (3..3 + 2 * GONE_MAX as u64)
        .map(|id| named(id, "x"))
        .collect();
    let late = second.next(&many).next(&[]);
    assert_eq!((late.gone.len(), late.name(2)), (GONE_MAX, ""));
    assert_eq!(late.name(2 + 2 * GONE_MAX as u64), "x");
}
