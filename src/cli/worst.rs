//! Selects the rows to show if not all are shown: the worst first. In: rows by ids. Out: the rows to show, in order.

use std::cmp::Ordering;

use crate::wire::{ContactRow, Event, PairRow, Verdict, pair_flags};

/// Pairs with an event first, then by verdict or result of the sweep, then the deepest first.
pub(super) fn pairs(rows: &[PairRow], most: usize) -> Vec<&PairRow> {
    worst(rows, most, |x, y| {
        (class(y).cmp(&class(x))).then(x.gap_min_m.total_cmp(&y.gap_min_m))
    })
}

/// The deepest contacts first.
pub(super) fn contacts(rows: &[ContactRow], most: usize) -> Vec<&ContactRow> {
    worst(rows, most, |x, y| x.gap_m.total_cmp(&y.gap_m))
}

fn class(row: &PairRow) -> (bool, u8) {
    let way = if row.flags & pair_flags::SWEPT_HIT != 0 {
        Verdict::Colliding.code()
    } else if row.flags & pair_flags::SWEPT_OPEN != 0 {
        Verdict::Possible.code()
    } else {
        0
    };
    let happened = row.events & !Event::Persist.bit() != 0;
    (happened, row.verdict.max(way))
}

fn worst<T>(rows: &[T], most: usize, by: impl Fn(&T, &T) -> Ordering) -> Vec<&T> {
    let mut all: Vec<&T> = rows.iter().collect();
    all.sort_by(|x, y| by(x, y));
    all.truncate(most);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_the_worst_rows_come_first_whatever_their_ids_are() {
        let pair = |body_b, verdict: Verdict, gap_min_m, events| PairRow {
            body_a: 1,
            body_b,
            verdict: verdict.code(),
            gap_min_m,
            events,
            ..PairRow::default()
        };
        let rows = [
            pair(2, Verdict::Near, 0.1, 0),
            pair(3, Verdict::Possible, -9.0, 0),
            pair(4, Verdict::Colliding, -1.0, Event::Persist.bit()),
            pair(5, Verdict::Colliding, -2.0, 0),
            pair(6, Verdict::Apart, 1.0, Event::End.bit()),
            PairRow {
                flags: pair_flags::SWEPT_HIT,
                ..pair(7, Verdict::Apart, 0.5, 0)
            },
        ];
        let ids = |most| -> Vec<u64> { pairs(&rows, most).iter().map(|row| row.body_b).collect() };
        assert_eq!(ids(9), [6, 5, 4, 7, 3, 2]);
        assert_eq!(ids(2), [6, 5]);
        let contact = |id, gap_m| ContactRow {
            id,
            gap_m,
            ..ContactRow::default()
        };
        let rows = [contact(1, 0.0), contact(2, -3.0), contact(3, -1.0)];
        let ids: Vec<u64> = contacts(&rows, 2).iter().map(|row| row.id).collect();
        assert_eq!(ids, [2, 3]);
    }
}
