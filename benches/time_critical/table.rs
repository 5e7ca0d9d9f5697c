//! One row of the table: a cell for each column, empty if the case has no such value; and the limits of the rows.

use std::fmt::{self, Display, Formatter};

use sweepd::time::{Clock, Meter};

/// Columns after those of the origin and the method; new columns are appended.
///
/// Shares: `unresolved`, `unconfirmed` and `guess_error` of all pairs, `false_alarm` of the pairs that are apart.
/// `width`: of the distance interval, all pairs, with an overlap counted as 0; `region`: radius of the largest sphere
/// in which an open pair may touch, open pairs only; both as a share of the diameter. `onsets`: contacts that began,
/// and the number of them never reported, which the delays exclude.
pub const COLUMNS: [&str; 27] = [
    "case",
    "motion_percent",
    "budget",
    "ticks",
    "pairs",
    "spent_p50_us",
    "spent_p99_us",
    "spent_cpu_p50_us",
    "motion_pass_p50_us",
    "units_p50",
    "unresolved_percent",
    "unconfirmed_percent",
    "guess_error_percent",
    "oldest_ticks",
    "wrong",
    "onset_p50_ticks",
    "onset_p99_ticks",
    "overshoot_wall_p99_us",
    "overshoot_cpu_p99_us",
    "area",
    "false_alarm_percent",
    "width_mean_percent",
    "width_p50_percent",
    "region_mean_percent",
    "region_p50_percent",
    "onsets",
    "onsets_unreported",
];

/// The cells of a row.
pub struct Row(Vec<String>);

impl Row {
    pub fn new(case: &str) -> Self {
        Self(vec![String::new(); COLUMNS.len()]).put("case", case)
    }

    /// Returns the row with one more cell.
    pub fn put(mut self, column: &str, cell: impl Display) -> Self {
        let at = COLUMNS.iter().position(|known| *known == column);
        self.0[at.unwrap()] = cell.to_string();
        self
    }

    pub fn line(&self) -> String {
        self.0.join(",")
    }
}

/// Limit of a tick: none, microseconds, or work units (which other load on the machine does not affect).
#[derive(Clone, Copy)]
pub enum Limit {
    None,
    Us(u64),
    Units(u64),
}

impl Limit {
    pub fn ns(self) -> Option<u64> {
        match self {
            Self::Us(us) => Some(us * 1_000),
            Self::None | Self::Units(_) => None,
        }
    }

    /// A meter that starts at `from_ns`, monotonic clock.
    pub fn meter(self, clock: &dyn Clock, from_ns: u64) -> Meter<'_> {
        let units = match self {
            Self::Units(units) => Some(units),
            Self::None | Self::Us(_) => None,
        };
        Meter::new(clock, self.ns().map(|ns| from_ns + ns), units)
    }
}

impl Display for Limit {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::Us(us) => write!(f, "{us}us"),
            Self::Units(units) => write!(f, "{units}units"),
        }
    }
}

pub fn us(ns: u64) -> f64 {
    ns as f64 / 1e3
}

/// Nanoseconds as text, microseconds.
pub fn tenths(ns: u64) -> String {
    format!("{:.1}", us(ns))
}

/// A share as text, percent.
pub fn percent_of(part: u64, whole: u64) -> String {
    format!("{:.2}", 100.0 * part as f64 / whole.max(1) as f64)
}
