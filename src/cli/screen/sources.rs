//! The table of sources on the screen. In: a tick, the width of the terminal. Out: lines within that width. Names are
//! shortened first, then whole columns are dropped. A number is never cut.

use crate::wire::{SourceRow, TickRow, name_str};

use super::lines::{GREEN, Ink, RED, YELLOW};
use super::pairs::{NAME_LEAST, NAME_WIDTH};
use crate::cli::figures::{cut, time};

const HEADS: [&str; 5] = ["state", "age", "frame", "skipped", "refused"];
/// Least widths of the columns: wide and narrow.
const LEAST_WIDTHS: [[usize; 5]; 2] = [[11, 10, 12, 10, 10], [11, 9, 9, 8, 8]];
/// Indices of the columns that are dropped, in this order.
const GO_FIRST: [usize; 3] = [3, 2, 4];

/// The columns of the table, and their widths.
struct SourceTable {
    name: usize,
    /// 0: the column is dropped.
    widths: [usize; 5],
}

/// The sources of a tick, one line each, below a head line; empty if the tick has none.
pub(super) fn table(tick: &TickRow, width: usize, ink: Ink) -> Vec<String> {
    let sources = tick.sources.iter().take(usize::from(tick.sources_len));
    let name = |source: &SourceRow| name_str(&source.name).unwrap_or("?").to_owned();
    let rows: Vec<_> = sources
        .map(|source| (name(source), cells(source)))
        .collect();
    if rows.is_empty() {
        return Vec::new();
    }
    let table = SourceTable::fit(width, &rows);
    let head = table.line("source", &HEADS.map(str::to_owned), "", ink);
    let rows = rows.iter();
    let rows = rows.map(|(name, (colour, cells))| table.line(name, cells, colour, ink));
    std::iter::once(head).chain(rows).collect()
}

/// The colour of the state, and the texts of the columns.
type Cells = (&'static str, [String; 5]);

fn cells(source: &SourceRow) -> Cells {
    let (colour, word) = match (source.alive, source.paused, source.age_ns) {
        (_, _, u64::MAX) => (YELLOW, "nothing yet"),
        (1, 1, _) => ("", "paused"),
        (1, _, _) => (GREEN, "alive"),
        _ => (RED, "silent"),
    };
    let age = match source.age_ns {
        u64::MAX => "-".to_owned(),
        age_ns => time(age_ns),
    };
    let [seq, skipped, refused] =
        [source.seq, source.skipped, source.refused].map(|count| count.to_string());
    (colour, [word.to_owned(), age, seq, skipped, refused])
}

impl SourceTable {
    fn fit(width: usize, rows: &[(String, Cells)]) -> Self {
        let wide = Self::new(NAME_WIDTH, LEAST_WIDTHS[0], rows);
        if wide.width() <= width {
            return wide;
        }
        let names = rows.iter().map(|(name, _)| name.chars().count());
        let longest = names
            .max()
            .unwrap_or_default()
            .clamp("source".len(), NAME_WIDTH);
        let mut table = Self::new(0, LEAST_WIDTHS[1], rows);
        for column in GO_FIRST {
            if table.width() + longest.min(NAME_LEAST) <= width {
                break;
            }
            table.widths[column] = 0;
        }
        let left = width.saturating_sub(table.width());
        table.name = left.clamp(longest.min(NAME_LEAST), longest);
        table
    }

    fn new(name: usize, least_widths: [usize; 5], rows: &[(String, Cells)]) -> Self {
        let mut widths = least_widths;
        for (_, (_, cells)) in rows {
            for (width, cell) in widths.iter_mut().zip(cells) {
                *width = (*width).max(cell.len());
            }
        }
        Self { name, widths }
    }

    fn width(&self) -> usize {
        let others = self.widths.iter().filter(|width| **width > 0);
        self.name + others.map(|width| width + 1).sum::<usize>()
    }

    fn line(&self, name: &str, cells: &[String; 5], colour: &str, ink: Ink) -> String {
        let mut line = format!("{:<width$}", cut(name, self.name), width = self.name);
        for (column, (cell, width)) in cells.iter().zip(self.widths).enumerate() {
            if column == 0 {
                line += &format!(" {}", ink.paint(colour, &format!("{cell:<width$}")));
            } else if width > 0 {
                line += &format!(" {cell:>width$}");
            }
        }
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::screen::lines::columns;
    use crate::wire::name_bytes;

    #[test]
    fn bug_lines_of_sources_were_cut_on_terminals_of_80_columns() {
        let mut tick = TickRow {
            sources_len: 2,
            ..TickRow::default()
        };
        for (source, name) in tick
            .sources
            .iter_mut()
            .zip(["simulator_of_the_north", "tf"])
        {
            source.name = name_bytes(name);
            source.alive = 1;
            source.age_ns = 999_990_000;
            source.seq = 12_345_678_901;
            source.refused = 31;
        }
        for width in 59..140 {
            let lines = table(&tick, width, Ink { colours: true });
            assert_eq!(lines.len(), 3);
            for line in &lines {
                assert!(columns(line) <= width, "{width}: {line}");
            }
            assert!(
                lines[1].contains("alive") && lines[1].contains(" 999.99 ms"),
                "{}",
                lines[1]
            );
            assert!(lines[1].ends_with(" 31"), "{width}: {}", lines[1]);
            assert!(
                width < 79 || lines[1].contains(" 12345678901 "),
                "{width}: {}",
                lines[1]
            );
        }
        assert!(table(&tick, 79, Ink { colours: false })[1].starts_with("simulator_of_the_north "));
        assert!(table(&TickRow::default(), 80, Ink { colours: false }).is_empty());
    }
}
