//! The columns of the report's tables, the same on a terminal and on a page.

use super::Report;
use super::page::name;
use super::tally::Row;

/// A column.
#[derive(Clone, Copy)]
pub struct Column {
    /// Its head.
    pub name: &'static str,
    /// The unit of its values, or the second line of the head.
    pub unit: &'static str,
    /// Width on a terminal, characters.
    pub width: usize,
    /// Whether it is shown only if time is limited.
    pub timed: bool,
    /// Whether it is a count that is 0 if nothing is wrong.
    pub must_be_0: bool,
    /// The text of its cell in a row.
    pub cell: fn(&Row) -> String,
}

impl std::fmt::Debug for Column {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Column")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

const fn column(
    (name, unit): (&'static str, &'static str),
    width: usize,
    cell: fn(&Row) -> String,
) -> Column {
    Column {
        name,
        unit,
        width,
        timed: false,
        must_be_0: false,
        cell,
    }
}

const fn timed(of: Column) -> Column {
    Column { timed: true, ..of }
}

const fn must_be_0(of: Column) -> Column {
    Column {
        must_be_0: true,
        ..of
    }
}

/// All columns, in order.
const COLUMNS: [Column; 16] = [
    column(("budget", ""), 13, name),
    column(("undecided", "%"), 9, |row| {
        format!("{:.2}", 100.0 * row.undecided_share)
    }),
    column(("guessed", "wrong %"), 7, |row| {
        format!("{:.2}", 100.0 * row.guess_error_share)
    }),
    column(("width", "mean m"), 10, |row| metres(row.width_mean_m)),
    column(("width", "p99 m"), 10, |row| metres(row.width_p99_m)),
    column(("width", "endless"), 7, |row| row.width_endless.to_string()),
    column(("oldest", "ticks"), 7, |row| row.oldest_ticks.to_string()),
    column(("onset", "p50/p99"), 9, |row| {
        both(row.onset_p50_ticks, row.onset_p99_ticks)
    }),
    column(("never", "told"), 9, |row| {
        format!("{}/{}", row.onsets_never, row.onsets)
    }),
    timed(column(("time", "p50/p99 us"), 15, |row| {
        both(micro(row.time_p50_ns), micro(row.time_p99_ns))
    })),
    timed(column(("floor", "p50 us"), 8, |row| {
        or_none(micro(row.floor_p50_ns).map(|us| us.to_string()))
    })),
    timed(column(("over", "p50/p99 us"), 13, |row| {
        both(micro(row.over_p50_ns), micro(row.over_p99_ns))
    })),
    timed(column(("late", "%"), 6, |row| {
        or_none(row.late_share.map(|share| format!("{:.1}", 100.0 * share)))
    })),
    column(("units", "a tick"), 9, |row| {
        format!("{:.0}", row.units_mean)
    }),
    must_be_0(column(("wrong", ""), 6, |row| row.wrong.to_string())),
    must_be_0(column(("excluded", ""), 8, |row| row.excluded.to_string())),
];

/// The columns of a report, in order; those of times only if time is limited.
pub fn columns(report: &Report) -> impl Iterator<Item = &'static Column> {
    let timed = report.limited == "time";
    COLUMNS.iter().filter(move |column| timed || !column.timed)
}

fn metres(m: Option<f64>) -> String {
    or_none(m.map(|m| format!("{m:.2e}")))
}

fn both(a: Option<u64>, b: Option<u64>) -> String {
    or_none(a.zip(b).map(|(a, b)| format!("{a}/{b}")))
}

fn micro(ns: Option<u64>) -> Option<u64> {
    ns.map(|ns| (ns + 500) / 1_000)
}

fn or_none(text: Option<String>) -> String {
    text.unwrap_or_else(|| "-".to_owned())
}
