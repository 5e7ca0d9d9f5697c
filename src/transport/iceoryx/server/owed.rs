//! The rows of `pairs` for readers that did not get the last message.

use std::iter::from_fn;

use crate::wire::PairRow;

/// Replaces rows of `pairs` by owed rows of the same pairs, and inserts the others.
///
/// * `pairs`, `owed` - by ids. An owed row which says that its pair has left removes that pair's row.
pub(super) fn mended<'a>(
    pairs: &'a [PairRow],
    owed: &'a [PairRow],
) -> impl Iterator<Item = PairRow> + 'a {
    let ids = |row: &PairRow| (row.body_a, row.body_b);
    let (mut pairs, mut owed) = (pairs.iter().peekable(), owed.iter().peekable());
    let rows = from_fn(move || match (pairs.peek(), owed.peek()) {
        (Some(row), Some(other)) if ids(row) < ids(other) => pairs.next(),
        (row, Some(other)) => {
            if row.is_some_and(|row| ids(row) == ids(other)) {
                pairs.next();
            }
            owed.next()
        }
        (_, None) => pairs.next(),
    });
    rows.filter(|row| !row.has_left()).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{Event, Verdict};

    #[test]
    fn what_is_owed_stands_among_the_rows_in_their_places_or_takes_them_away() {
        let row = |body_b: u64, verdict: Verdict, events: u8| PairRow {
            body_a: 1,
            body_b,
            verdict: verdict.code(),
            events,
            ..PairRow::default()
        };
        let (begin, end) = (Event::Begin.bit(), Event::End.bit());
        let pairs = [
            row(3, Verdict::Near, 0),
            row(4, Verdict::Colliding, Event::Persist.bit()),
            row(6, Verdict::Apart, end),
            row(8, Verdict::Near, 0),
        ];
        let owed = [
            row(2, Verdict::None, end),
            row(4, Verdict::Colliding, begin),
            row(6, Verdict::Apart, 0),
            row(9, Verdict::None, end),
        ];
        let told = |owed| -> Vec<_> {
            let rows = mended(&pairs, owed);
            rows.map(|row| (row.body_b, row.events)).collect()
        };
        assert_eq!(
            told(&owed),
            [(2, end), (3, 0), (4, begin), (8, 0), (9, end)]
        );
        let all = [(3, 0), (4, Event::Persist.bit()), (6, end), (8, 0)];
        assert_eq!(told(&[]), all);
        assert_eq!(mended(&[], &owed).count(), 3);
    }
}
