//! Flags and arguments.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use super::args_query::QueryArgs;
use super::args_report::Report;
use super::args_tools::{CompletionsArgs, DoctorArgs, ListArgs, ManArgs, RecordArgs};
use super::manual::after_help;
use super::values::{Limit, count, duration, from_0, from_1, mode, nanoseconds, span, units};
use crate::builtin::Pattern;
use crate::error::Error;

/// A collision server: body poses in over shared memory, colliding pairs and contacts out, within a time budget per
/// tick.
#[derive(Debug, Parser)]
#[command(name = "sweepd", version, max_term_width = 100, after_help = after_help())]
pub(super) struct Cli {
    /// Log more to stderr; twice: everything.
    #[arg(short, long, global = true, action = clap::ArgAction::Count, display_order = 1000)]
    pub(super) verbose: u8,
    /// Log errors only.
    #[arg(short, long, global = true, display_order = 1000)]
    pub(super) quiet: bool,
    #[command(subcommand)]
    pub(super) command: Command,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Run the daemon for a scene until SIGINT or SIGTERM (or SIGHUP, unless under `nohup`).
    Run(RunArgs),
    /// Read and validate a scene; print the plan, ignored pairs and warnings.
    Check(CheckArgs),
    /// Move the bodies of a scene with a built-in motion: a source for demos and load tests.
    Feed(FeedArgs),
    /// Watch a running daemon: state, pairs by name, gaps, budget, sources, rejects.
    ///
    /// Press `q` or Ctrl-C to end it. On a terminal narrower than about 110 columns (at least 60 are needed) names are
    /// shortened, `closing` is left out if there is no room, and each event is one word.
    Monitor(MonitorArgs),
    /// Ask a running daemon about gaps, touches, rays and times of impact; or query pairs of shapes offline.
    Query(Box<QueryArgs>),
    /// List running instances with their sources and readers.
    List(ListArgs),
    /// Find out what is wrong: shared memory, permissions, leftovers, daemons, limits; one line per finding.
    ///
    /// Each line says ok, warning or wrong, what was found, and what to do. Nothing is changed without --clean. The
    /// exit code is 1 if something is wrong; warnings alone do not count.
    Doctor(DoctorArgs),
    /// Record what a running daemon publishes to an MCAP file for Foxglove or `ros2 bag`.
    ///
    /// The file does not contain what the daemon received: to replay its engine, start the daemon itself with
    /// `run --record FILE`. If the daemon restarts, recording goes on.
    Record(RecordArgs),
    /// Run the engine again on a recording of `run --record`, and report the first tick that differs.
    Replay(ReplayArgs),
    /// Measure error against run time, or numerical stability.
    Report(ReportArgs),
    /// Print shell completions for commands and flags.
    Completions(CompletionsArgs),
    /// Print the manual, or write it as man pages into a directory.
    Man(ManArgs),
}

/// Which report.
#[derive(Debug, Args)]
pub(super) struct ReportArgs {
    #[command(subcommand)]
    pub(super) report: Report,
}

/// Which daemon.
#[derive(Clone, Debug, Args)]
pub(super) struct Which {
    /// Name of the daemon: up to 32 of a-z, 0-9 and _.
    #[arg(long, default_value = "default", value_name = "NAME")]
    pub(super) instance: String,
}

#[derive(Debug, Args)]
pub(super) struct RunArgs {
    /// Scene file (TOML); `launch-free-scripts/example_scene.toml` shows every key.
    #[arg(value_name = "SCENE")]
    pub(super) scene: PathBuf,
    #[command(flatten)]
    pub(super) which: Which,
    /// Time limit of a tick, such as `2ms`, `500us` or `none`; by default the scene's value.
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub(super) budget: Option<Limit>,
    /// Limit of work units per tick, or `none`; by default the scene's value. Such runs replay bit for bit.
    #[arg(long, value_name = "UNITS", value_parser = units, allow_hyphen_values = true)]
    pub(super) budget_units: Option<Limit>,
    /// What triggers a tick: `on_all`, `on_frame=SOURCE` or `rate=HZ`; by default the scene's value.
    #[arg(long, value_name = "MODE", value_parser = mode)]
    pub(super) mode: Option<crate::config::Mode>,
    /// How long to poll for the next frame before sleeping, such as `100us` or `0us`: less latency for more CPU time.
    /// The default is 50us if there is more than one core.
    #[arg(long, value_name = "TIME", value_parser = nanoseconds, allow_hyphen_values = true)]
    pub(super) spin: Option<u64>,
    /// Never sleep: saves microseconds of latency and takes a whole core.
    #[arg(long, conflicts_with = "spin")]
    pub(super) busy_poll: bool,
    /// Exit with code 5 if the tick thread makes no progress for this long, such as `10s`, or `none`.
    ///
    /// At least the heartbeat plus one second. The default is 10s, or the heartbeat plus one second if that is longer.
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub(super) watchdog: Option<Limit>,
    /// Stop after N ticks; by default at a signal.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = from_1)]
    pub(super) ticks: Option<u64>,
    /// Also run as a ROS 2 node; on this host only, unless `ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET`.
    ///
    /// `--ros-args ... [--]` does so too, with the arguments of every ROS 2 node: -r FROM:=TO, -p NAME:=VALUE,
    /// --params-file FILE, --log-level LEVEL, --disable-rosout-logs.
    #[arg(long)]
    pub(super) ros2: bool,
    /// DDS domain, 0 to 232; by default `ROS_DOMAIN_ID`.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) ros_domain_id: Option<i64>,
    /// Record all input and output of the engine to this file (MCAP), for `sweepd replay` and for viewers.
    ///
    /// Recording listens to pairs and contacts, and to bodies ten times per second, so these are computed.
    #[arg(long, value_name = "FILE.mcap")]
    pub(super) record: Option<PathBuf>,
    /// Overwrite the recording if it exists.
    #[arg(long, requires = "record")]
    pub(super) force: bool,
}

#[derive(Debug, Args)]
#[cfg_attr(
    not(feature = "mcap"),
    allow(dead_code, reason = "this build refuses to replay")
)]
pub(super) struct ReplayArgs {
    /// Recording written by `sweepd run SCENE --record FILE`.
    #[arg(value_name = "FILE.mcap")]
    pub(super) file: PathBuf,
    /// Print one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
    /// First tick to compare; those before it are only run.
    #[arg(long, value_name = "TICK", allow_negative_numbers = true, value_parser = from_0)]
    pub(super) from: Option<u64>,
    /// Last tick to run and compare, counted from 1.
    #[arg(long, value_name = "TICK", allow_negative_numbers = true, value_parser = from_1)]
    pub(super) until: Option<u64>,
}

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    /// Scene file (TOML): metres, seconds, quaternions x, y, z, w.
    #[arg(value_name = "SCENE")]
    pub(super) scene: PathBuf,
    /// Print one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
    /// List every ignored pair (up to 10,000), not only their number; without it `ignored` is null in JSON.
    #[arg(long)]
    pub(super) ignored: bool,
}

/// The built-in motion of a scene's bodies.
#[derive(Debug, Args)]
pub(super) struct CourseArgs {
    /// Frames per second.
    #[arg(
        long,
        default_value_t = 100.0,
        value_name = "HZ",
        allow_negative_numbers = true
    )]
    pub(super) rate: f64,
    /// Random seed of the motion, and of a scene to write.
    #[arg(
        long,
        default_value_t = 1,
        value_name = "N",
        allow_negative_numbers = true,
        value_parser = from_0
    )]
    pub(super) seed: u64,
    /// How the bodies move.
    #[arg(long, value_enum, default_value_t = Pattern::Wander)]
    pub(super) motion: Pattern,
}

impl CourseArgs {
    /// # Errors
    /// `Error::Usage` unless the rate is above 0 and at most 1e6 frames per second.
    pub(super) fn check(&self) -> crate::error::Result<()> {
        if self.rate > 0.0 && self.rate <= 1e6 {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "--rate {}: write frames per second, above 0 and at most 1e6",
            self.rate
        )))
    }
}

#[derive(Debug, Args)]
pub(super) struct FeedArgs {
    /// Scene whose bodies to move; the daemon must run the same one.
    #[arg(value_name = "SCENE", required_unless_present = "write_scene")]
    pub(super) scene: Option<PathBuf>,
    #[command(flatten)]
    pub(super) which: Which,
    /// Source to send as; by default the first one of the scene.
    #[arg(long, value_name = "NAME")]
    pub(super) source: Option<String>,
    #[command(flatten)]
    pub(super) course: CourseArgs,
    /// Number of bodies to move, while the others rest (default: all); with --write-scene the number of bodies to make
    /// (default: 200).
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = count)]
    pub(super) count: Option<usize>,
    /// Stop after N frames; by default at a signal.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = from_1)]
    pub(super) frames: Option<u64>,
    /// Simulate work of the source before each frame, such as `7ms..15ms`.
    ///
    /// The daemon gets the time that is left of each frame, and its result is waited for. At the end a summary says how
    /// well the frame time was kept.
    #[arg(long, value_name = "TIME..TIME", value_parser = span, allow_hyphen_values = true)]
    pub(super) work: Option<(u64, u64)>,
    /// How long to wait for the daemon, such as `10s`.
    #[arg(long, default_value = "10s", value_name = "TIME", value_parser = nanoseconds, allow_hyphen_values = true)]
    pub(super) wait: u64,
    /// Write a scene of --count mixed bodies to this file, and exit.
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["scene", "instance", "source", "rate", "motion", "frames", "work", "wait"]
    )]
    pub(super) write_scene: Option<PathBuf>,
    /// Kind of scene to write: `pool` (in free space) or `pile` (on a floor).
    #[arg(
        long,
        default_value = "pool",
        value_parser = ["pool", "pile"],
        value_name = "KIND",
        conflicts_with = "scene"
    )]
    pub(super) kind: String,
    /// Overwrite the file if it exists.
    #[arg(long, conflicts_with = "scene")]
    pub(super) force: bool,
}

#[derive(Debug, Args)]
pub(super) struct MonitorArgs {
    #[command(flatten)]
    pub(super) which: Which,
    /// Print one JSON object per tick instead of a screen: gaps in metres, times in nanoseconds.
    ///
    /// An open end of a gap's interval is null. `pairs_shown` and `contacts_shown` are [rows in this line, rows
    /// published]. `pairs` is present if the rows of the same tick came, `contacts` with --contacts (up to four for
    /// each of --pairs), `worst` if a pair is near. A restart of the daemon is a line of its own: `{"restarted":
    /// {"boots": [old, new], "ends": [pairs that ended by that]}}`.
    #[arg(long)]
    pub(super) json: bool,
    /// Stop after N ticks; by default at a signal. With --json a tick that is still under way, which is reported each
    /// heartbeat, then has no line.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = from_1)]
    pub(super) ticks: Option<u64>,
    /// Exit with code 3 if no tick comes for this long.
    #[arg(long, default_value = "10s", value_name = "TIME", value_parser = nanoseconds, allow_hyphen_values = true)]
    pub(super) wait: u64,
    /// Most pairs to show or print.
    #[arg(
        long,
        default_value_t = 20,
        value_name = "N",
        allow_negative_numbers = true,
        value_parser = count
    )]
    pub(super) pairs: usize,
    /// Also show contacts; the daemon then computes them.
    #[arg(long)]
    pub(super) contacts: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory as _;
        Cli::command().debug_assert();
    }
}
