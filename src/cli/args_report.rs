//! Flags and arguments of `sweepd report`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::args::CourseArgs;
use super::values::{Limit, count, duration, ticks_of_report, units};

#[derive(Debug, Subcommand)]
pub(super) enum Report {
    /// Measure error against run time of a scene, over a sweep of budgets.
    ///
    /// Runs the daemon's engine offline with the built-in motion of `feed`, once for each budget, and compares each
    /// answer with that of a twin without a budget at the same poses. Exits with code 1 if a verdict is wrong or an
    /// interval excludes the truth.
    Error(ErrorArgs),
    /// Check stiff and extreme cases against known truths.
    ///
    /// Exits with code 1 if an interval excludes the truth or a verdict is wrong.
    Stability(StabilityArgs),
}

#[derive(Debug, Args)]
pub(super) struct ErrorArgs {
    /// Scene file (TOML).
    #[arg(value_name = "SCENE")]
    pub(super) scene: PathBuf,
    /// Time budgets per tick, such as `50us,200us,1ms,none`.
    ///
    /// By default nine, from the floor of the scene to twice the 90th percentile of ticks without a budget, but at
    /// least to four floors and to 200us.
    #[arg(long, value_name = "TIME,..", value_delimiter = ',', value_parser = duration, allow_hyphen_values = true)]
    pub(super) budgets: Vec<Limit>,
    /// Use budgets of work units instead of time; values need the `=`, as in `--units=0,1000,none`.
    ///
    /// No clock takes part, so each run of the report gives the same bits. Without values there are eleven budgets: 0,
    /// nine steps, and no limit.
    #[arg(long, value_name = "UNITS,..", value_delimiter = ',', num_args = 0..=1, require_equals = true, value_parser = units, conflicts_with = "budgets")]
    pub(super) units: Option<Vec<Limit>>,
    /// Ticks at each budget, after a sixth as many (at least 4) to warm up.
    #[arg(long, value_name = "N", default_value_t = 120, allow_negative_numbers = true, value_parser = ticks_of_report)]
    pub(super) ticks: u64,
    #[command(flatten)]
    pub(super) course: CourseArgs,
    /// Number of bodies of each source to move, while the others rest at their start (default: all).
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = count)]
    pub(super) count: Option<usize>,
    /// Print one JSON document instead of the table: metres, seconds, shares of 1; fields that end in `_ns` are
    /// nanoseconds.
    #[arg(long)]
    pub(super) json: bool,
    /// Also write a self-contained HTML page with plots to this file.
    #[arg(long, value_name = "FILE")]
    pub(super) html: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct StabilityArgs {
    /// Run only this family of cases; may be repeated.
    #[arg(long, value_name = "NAME")]
    pub(super) family: Vec<String>,
    /// List the families of cases.
    #[arg(long)]
    pub(super) list: bool,
    /// Print one JSON document with all points instead of the table.
    #[arg(long)]
    pub(super) json: bool,
    /// Also write a self-contained HTML page with plots to this file.
    #[arg(long, value_name = "FILE")]
    pub(super) html: Option<PathBuf>,
}
