//! Flags and arguments of `sweepd report`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::args::{CourseArgs, Limit, duration, units};

#[derive(Debug, Subcommand)]
pub(super) enum Report {
    /// Error against run time of a scene, over a sweep of budgets.
    ///
    /// Drives the engine of the daemon offline, with the built-in motion of `feed`, once for each budget; each answer
    /// is held against a twin without a budget at the same poses. Ends with code 1 when a verdict is wrong or an
    /// interval excludes the truth.
    Error(ErrorArgs),
    /// Stiff and extreme cases, each against a truth that is known.
    ///
    /// Ends with code 1 when an interval excludes the truth or a verdict is wrong.
    Stability(StabilityArgs),
}

#[derive(Debug, Args)]
pub(super) struct ErrorArgs {
    /// The scene file (TOML).
    #[arg(value_name = "SCENE")]
    pub(super) scene: PathBuf,
    /// Budgets of time a tick, such as `50us,200us,1ms,none`; by default nine, from the scene's floor to what its
    /// slowest ticks take without a budget.
    #[arg(long, value_name = "TIME,..", value_delimiter = ',', value_parser = duration, allow_hyphen_values = true)]
    pub(super) budgets: Vec<Limit>,
    /// Budgets of work units in place of time: no clock takes part, and a report is the same to the last bit whenever
    /// it is made. With numbers, such as `--units=0,1000,none`, those; by default nine.
    #[arg(long, value_name = "UNITS,..", value_delimiter = ',', num_args = 0..=1, require_equals = true, value_parser = units, conflicts_with = "budgets")]
    pub(super) units: Option<Vec<Limit>>,
    /// Ticks at each budget, after a sixth as many to warm up.
    #[arg(long, value_name = "N", default_value_t = 120, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub(super) ticks: u64,
    #[command(flatten)]
    pub(super) course: CourseArgs,
    /// Bodies of each source that move, the others rest at their start (default: all).
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) count: Option<usize>,
    /// One JSON document instead of the table: metres, seconds, shares of 1.
    #[arg(long)]
    pub(super) json: bool,
    /// Also write a page with plots to this file; it needs nothing but itself.
    #[arg(long, value_name = "FILE")]
    pub(super) html: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct StabilityArgs {
    /// Only this family; may be given more than once.
    #[arg(long, value_name = "NAME")]
    pub(super) family: Vec<String>,
    /// List the families.
    #[arg(long)]
    pub(super) list: bool,
    /// One JSON document with all points instead of the table.
    #[arg(long)]
    pub(super) json: bool,
    /// Also write a page with plots to this file; it needs nothing but itself.
    #[arg(long, value_name = "FILE")]
    pub(super) html: Option<PathBuf>,
}
