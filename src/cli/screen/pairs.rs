//! The table of pairs on the screen. In: rows, names, the width of the terminal. Out: lines within that width. Names
//! are shortened first, then `closing`, the event and the lower end of the gap are dropped. A number is never cut.

use crate::wire::{EndCause, Event, PairRow, Verdict, pair_flags};

use super::lines::{Ink, RED, YELLOW};
use crate::cli::figures::{cut, number, number_within};
use crate::cli::monitor::Names;

/// Most columns of a body's name; longer names are cut.
pub(super) const NAME_WIDTH: usize = 24;
/// Least columns of a name before a column of the table is dropped.
pub(super) const NAME_LEAST: usize = 8;
const VERDICT_WIDTH: usize = 9;
/// Widths of an end of the gap and of the closing speed, columns: wide and narrow.
const GAP_WIDTHS: [usize; 2] = [12, 10];
const CLOSING_WIDTHS: [usize; 2] = [9, 8];
/// Width of the event, columns: for most full texts, and for single words.
const EVENT_WIDE: usize = 16;
const EVENT_LEAST: usize = 8;

/// The columns of the table, and their widths.
#[derive(Clone, Copy, Debug)]
pub(super) struct PairTable {
    name: usize,
    gap: usize,
    has_low: bool,
    /// 0: no such column; likewise for `event`.
    closing: usize,
    event: usize,
}

impl PairTable {
    /// Fits the table into `width` columns.
    ///
    /// * `longest` - columns of the longest name of a body.
    pub(super) fn fit(width: usize, longest: usize) -> Self {
        let wide = Self {
            name: NAME_WIDTH,
            gap: GAP_WIDTHS[0],
            has_low: true,
            closing: CLOSING_WIDTHS[0],
            event: EVENT_WIDE,
        };
        if wide.width() <= width {
            return wide.with_event_in(width);
        }
        let closing = CLOSING_WIDTHS[1];
        let longest = longest.clamp(1, NAME_WIDTH);
        let mut table = wide;
        for (has_low, closing, event) in [
            (true, closing, EVENT_LEAST),
            (true, 0, EVENT_LEAST),
            (true, 0, 0),
            (false, 0, 0),
        ] {
            table = Self {
                name: 0,
                gap: GAP_WIDTHS[1],
                has_low,
                closing,
                event,
            };
            let left = width.saturating_sub(table.width());
            table.name = longest.min(left / 2);
            if table.name >= longest.min(NAME_LEAST) {
                break;
            }
        }
        // A name with no characters left tells less than a line that is too long.
        table.name = table.name.max(longest.min(NAME_LEAST));
        table.with_event_in(width)
    }

    fn width(self) -> usize {
        let numbers = (self.gap + 1) * (1 + usize::from(self.has_low));
        let closing = if self.closing > 0 {
            self.closing + 1
        } else {
            0
        };
        let event = if self.event > 0 { self.event + 2 } else { 0 };
        2 * (self.name + 1) + VERDICT_WIDTH + numbers + closing + event
    }

    /// Gives the event the width that the other columns leave.
    fn with_event_in(mut self, width: usize) -> Self {
        if self.event > 0 {
            self.event += width.saturating_sub(self.width());
        }
        self
    }

    /// The head line above the rows.
    pub(super) fn head(self) -> String {
        let heads = if self.gap == GAP_WIDTHS[0] {
            ["gap from [m]", "to [m]"]
        } else if self.has_low {
            ["from [m]", "to [m]"]
        } else {
            ["", "gap to [m]"]
        };
        self.line(["a", "b", "verdict", heads[0], heads[1], "closing", "event"])
    }

    /// One row as a line.
    pub(super) fn row(self, row: &PairRow, names: &Names, ink: Ink) -> String {
        let verdict = Verdict::from_code(row.verdict);
        let colour = match verdict {
            Some(Verdict::Colliding) => RED,
            _ if row.flags & pair_flags::SWEPT_HIT != 0 => RED,
            Some(Verdict::Possible) => YELLOW,
            _ if row.flags & pair_flags::SWEPT_OPEN != 0 => YELLOW,
            _ => "",
        };
        let line = self.line([
            &cut(&names.of(row.body_a), self.name),
            &cut(&names.of(row.body_b), self.name),
            verdict.map_or("?", Verdict::word),
            &number_within(row.gap_min_m, 6, self.gap),
            &number_within(row.gap_max_m, 6, self.gap),
            &number_within(row.closing_mps, 3, self.closing),
            &told_within(&events(row), self.event),
        ]);
        ink.paint(colour, &line)
    }

    fn line(self, [a, b, verdict, low, high, closing, event]: [&str; 7]) -> String {
        let (name, gap) = (self.name, self.gap);
        let mut line = format!("{a:<name$} {b:<name$} {verdict:<VERDICT_WIDTH$}");
        if self.has_low {
            line += &format!(" {low:>gap$}");
        }
        line += &format!(" {high:>gap$}");
        if self.closing > 0 {
            line += &format!(" {closing:>width$}", width = self.closing);
        }
        if self.event > 0 {
            line += &format!("  {event}");
        }
        line.truncate(line.trim_end().len());
        line
    }
}

/// The events of a pair: each in full, and as one word.
fn events(row: &PairRow) -> Vec<(String, &'static str)> {
    let mut events = Vec::new();
    for event in row.told_events() {
        match event {
            Event::End => {
                let cause = EndCause::from_code(row.end_cause).map_or("?", EndCause::word);
                events.push((format!("end ({cause})"), "end"));
            }
            Event::Begin => events.push(("begin".to_owned(), "begin")),
            Event::Passed => events.push(("passed on the way".to_owned(), "passed")),
            Event::Persist => {}
        }
    }
    let of_the_way = |share| format!("{} of the way", number(share, 6));
    if row.flags & pair_flags::SWEPT_HIT != 0 {
        events.push((format!("touched at {}", of_the_way(row.toi_max)), "touched"));
    } else if row.flags & pair_flags::SWEPT_OPEN != 0 {
        events.push((format!("open from {}", of_the_way(row.toi_min)), "open"));
    }
    if row.flags & pair_flags::TELEPORTED != 0 {
        events.push(("teleported".to_owned(), "teleport"));
    }
    events
}

/// Events in at most `width` columns: in full, else as words, else as many words as fit and a `+` for the others.
fn told_within(events: &[(String, &'static str)], width: usize) -> String {
    let full: Vec<&str> = events.iter().map(|(full, _)| full.as_str()).collect();
    let words: Vec<&str> = events.iter().map(|(_, word)| *word).collect();
    for told in [full.join(", "), words.join(", ")] {
        if told.len() <= width {
            return told;
        }
    }
    let shorter = (0..words.len())
        .rev()
        .map(|most| words[..most].join(", ") + "+");
    shorter
        .into_iter()
        .find(|told| told.len() <= width)
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::screen::lines::columns;

    /// A row whose numbers have no more digits than the table of 60 columns shows.
    fn row(flags: u8) -> PairRow {
        PairRow {
            body_a: 1,
            body_b: 2,
            verdict: Verdict::Colliding.code(),
            gap_min_m: -12.345_678,
            gap_max_m: 9.876_543,
            closing_mps: -1.234,
            events: Event::End.bit() | Event::Begin.bit(),
            end_cause: EndCause::SourceLost.code(),
            flags,
            ..PairRow::default()
        }
    }

    #[test]
    fn bug_lines_of_60_columns_and_more_had_cut_numbers_and_no_event() {
        let names = Names::default();
        let ink = Ink { colours: true };
        for width in 59..200 {
            for longest in [1, 8, 13, 24, 200] {
                let table = PairTable::fit(width, longest);
                for flags in [0, pair_flags::SWEPT_HIT | pair_flags::TELEPORTED] {
                    let line = table.row(&row(flags), &names, ink);
                    assert!(columns(&line) <= width, "{width}, {longest}: {line}");
                    for whole in ["colliding ", " -12.345678 ", " 9.876543 ", "  end"] {
                        assert!(line.contains(whole), "{width}, {longest}: {line}");
                    }
                    let has_closing = width >= 79 || longest < 4;
                    assert!(
                        !has_closing || line.contains(" -1.234 "),
                        "{width}, {longest}: {line}"
                    );
                }
                assert!(columns(&table.head()) <= width);
                assert!(table.head().ends_with("event"), "{}", table.head());
            }
        }
        // On a terminal narrower than the smallest screen the gap's upper end stays.
        for width in 0..59 {
            let line = PairTable::fit(width, 24).row(&row(0), &names, ink);
            assert!(line.contains(" 9.876543"), "{width}: {line}");
            assert!(width < 40 || columns(&line) <= width, "{width}: {line}");
        }
    }

    #[test]
    fn with_room_for_all_names_and_events_are_told_in_full() {
        let table = PairTable::fit(usize::MAX, 3);
        let line = table.row(&row(0), &Names::default(), Ink { colours: false });
        let begin = format!(
            "{:<24} {:<24} colliding   -12.345678     9.876543    -1.234  ",
            "#1", "#2"
        );
        assert_eq!(line, format!("{begin}end (source lost), begin"));
    }

    #[test]
    fn events_that_do_not_fit_are_told_as_words_and_then_by_how_many_fit() {
        let events = [
            ("end (removed)".to_owned(), "end"),
            ("begin".to_owned(), "begin"),
        ];
        for (width, told) in [
            (20, "end (removed), begin"),
            (19, "end, begin"),
            (9, "end+"),
            (3, "+"),
            (0, ""),
        ] {
            assert_eq!(told_within(&events, width), told);
        }
    }
}
