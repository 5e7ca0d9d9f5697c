//! Flags and arguments.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use super::args_query::QueryArgs;
use super::args_report::Report;
use super::args_tools::{CompletionsArgs, DoctorArgs, ListArgs, ManArgs, RecordArgs};
use super::manual::after_help;
use crate::builtin::Pattern;
use crate::error::Error;

/// A collision server: body poses in over shared memory, colliding pairs and contacts out, within a time budget a tick.
#[derive(Debug, Parser)]
#[command(name = "sweepd", version, max_term_width = 100, after_help = after_help())]
pub(super) struct Cli {
    /// Say more on stderr (twice: everything).
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(super) verbose: u8,
    /// Say errors only.
    #[arg(short, long, global = true)]
    pub(super) quiet: bool,
    #[command(subcommand)]
    pub(super) command: Command,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Run the daemon for a scene until SIGINT or SIGTERM (or SIGHUP, but under `nohup`).
    Run(RunArgs),
    /// Read and validate a scene; print the plan, ignored pairs and warnings.
    Check(CheckArgs),
    /// Move a scene's bodies by a built-in motion: a source for demos and load.
    Feed(FeedArgs),
    /// Watch a running daemon: state, pairs by name, gaps, budget, sources, rejects.
    ///
    /// `q` or Ctrl-C ends it. On a terminal of fewer than some 110 columns (60 at least) names are shortened, `closing`
    /// goes where there is no room for it, and an event is one word.
    Monitor(MonitorArgs),
    /// Ask a running daemon: gaps, what touches, rays, times of impact; or answer shape-pair questions offline.
    Query(Box<QueryArgs>),
    /// List running instances, their sources and readers.
    List(ListArgs),
    /// Find what is wrong when nothing works: shared memory, rights, leftovers, daemons, limits; a line a finding.
    ///
    /// Each line says ok, warning or wrong, what is so, and what to do. Nothing is changed without --clean. Ends with
    /// code 1 when something is wrong; warnings alone are no reason.
    Doctor(DoctorArgs),
    /// Record what a running daemon publishes, as any client hears it, to an MCAP file for Foxglove or `ros2 bag`.
    ///
    /// What the daemon was given is not in it: to run its engine again, give `run --record FILE` to the daemon itself.
    /// A daemon that starts anew is followed.
    Record(RecordArgs),
    /// Run the engine again on what `run --record` wrote, and report the first tick that differs.
    Replay(ReplayArgs),
    /// Measure: error against run time, and numerical stability.
    Report(ReportArgs),
    /// Write completions of commands and flags for a shell to standard output.
    Completions(CompletionsArgs),
    /// Write the manual to standard output, or as man pages into a directory.
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
    /// Name of the daemon: a-z, 0-9 and _, at most 32.
    #[arg(long, default_value = "default", value_name = "NAME")]
    pub(super) instance: String,
}

#[derive(Debug, Args)]
pub(super) struct RunArgs {
    /// The scene file (TOML); `launch-free-scripts/example_scene.toml` shows every key.
    #[arg(value_name = "SCENE")]
    pub(super) scene: PathBuf,
    #[command(flatten)]
    pub(super) which: Which,
    /// Time a tick may take, such as `2ms`, `500us`, or `none`; the scene's value otherwise.
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub(super) budget: Option<Limit>,
    /// Work units a tick may take, or `none`; the scene's value otherwise. Runs replay bit for bit.
    #[arg(long, value_name = "UNITS", value_parser = units, allow_hyphen_values = true)]
    pub(super) budget_units: Option<Limit>,
    /// What makes a tick: `on_all`, `on_frame=SOURCE` or `rate=HZ`; the scene's value otherwise.
    #[arg(long, value_name = "MODE", value_parser = mode)]
    pub(super) mode: Option<crate::config::Mode>,
    /// How long to look for the next frame before going to sleep, such as `100us`, or `0us`: less latency for more CPU
    /// time. The default is 50us where there is more than one core.
    #[arg(long, value_name = "TIME", value_parser = nanoseconds, allow_hyphen_values = true)]
    pub(super) spin: Option<u64>,
    /// Never go to sleep: microseconds less latency for a whole core.
    #[arg(long, conflicts_with = "spin")]
    pub(super) busy_poll: bool,
    /// End with exit code 5 when the tick thread makes no progress for this long, such as `10s`, or `none`; a second
    /// more than the heartbeat at least.
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true, default_value = "10s")]
    pub(super) watchdog: Limit,
    /// End after so many ticks; until a signal otherwise.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(1..))]
    pub(super) ticks: Option<u64>,
    /// Be a ROS 2 node too; on this host only, unless `ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET`.
    ///
    /// `--ros-args ... [--]` says so as well: -r FROM:=TO, -p NAME:=VALUE, --params-file FILE, --log-level LEVEL,
    /// --disable-rosout-logs, as of every ROS 2 node.
    #[arg(long)]
    pub(super) ros2: bool,
    /// DDS domain, 0 to 232; `ROS_DOMAIN_ID` otherwise.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) ros_domain_id: Option<i64>,
    /// Record all that the engine is given and says to this file (MCAP), for `sweepd replay` and for people.
    ///
    /// The recording listens to pairs and contacts, and ten times a second to bodies: these are then computed.
    #[arg(long, value_name = "FILE.mcap")]
    pub(super) record: Option<PathBuf>,
    /// Write over a recording that is there.
    #[arg(long, requires = "record")]
    pub(super) force: bool,
}

#[derive(Debug, Args)]
#[cfg_attr(
    not(feature = "mcap"),
    allow(dead_code, reason = "this build refuses to replay")
)]
pub(super) struct ReplayArgs {
    /// What `sweepd run SCENE --record FILE` wrote.
    #[arg(value_name = "FILE.mcap")]
    pub(super) file: PathBuf,
    /// One JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
    /// Compare from this tick on; those before it are run.
    #[arg(long, value_name = "TICK", allow_negative_numbers = true)]
    pub(super) from: Option<u64>,
    /// End with this tick.
    #[arg(long, value_name = "TICK", allow_negative_numbers = true)]
    pub(super) until: Option<u64>,
}

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    /// The scene file (TOML): metres, seconds, quaternions x, y, z, w.
    #[arg(value_name = "SCENE")]
    pub(super) scene: PathBuf,
    /// One JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
    /// List every ignored pair, not only how many (up to 10,000); in JSON `ignored` is null without it.
    #[arg(long)]
    pub(super) ignored: bool,
}

/// The built-in motion of a scene's bodies.
#[derive(Debug, Args)]
pub(super) struct CourseArgs {
    /// Frames a second.
    #[arg(
        long,
        default_value_t = 100.0,
        value_name = "HZ",
        allow_negative_numbers = true
    )]
    pub(super) rate: f64,
    /// Seed of the motion, and of a scene that is made.
    #[arg(
        long,
        default_value_t = 1,
        value_name = "N",
        allow_negative_numbers = true
    )]
    pub(super) seed: u64,
    /// How bodies move: half a metre about their start, 1 mm about it, turning in place, or not at all.
    #[arg(long, value_enum, default_value_t = Pattern::Wander)]
    pub(super) motion: Pattern,
}

impl CourseArgs {
    /// # Errors
    /// `Error::Usage` for a rate that is none.
    pub(super) fn check(&self) -> crate::error::Result<()> {
        if self.rate > 0.0 && self.rate <= 1e6 {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "--rate {}: give frames a second, above 0 and at most 1e6",
            self.rate
        )))
    }
}

#[derive(Debug, Args)]
pub(super) struct FeedArgs {
    /// The scene whose bodies to move; the daemon must run the same.
    #[arg(value_name = "SCENE", required_unless_present = "write_scene")]
    pub(super) scene: Option<PathBuf>,
    #[command(flatten)]
    pub(super) which: Which,
    /// The source to be; the scene's first otherwise.
    #[arg(long, value_name = "NAME")]
    pub(super) source: Option<String>,
    #[command(flatten)]
    pub(super) course: CourseArgs,
    /// Bodies to move, the others are sent at rest (default: all); with --write-scene: bodies to make (default: 200).
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) count: Option<usize>,
    /// End after so many frames; until a signal otherwise.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) frames: Option<u64>,
    /// Work of the source's own before each frame, such as `7ms..15ms`: what is left of the frame is said to be the
    /// daemon's, its result is waited for, and how well the frame time was kept is told at the end.
    #[arg(long, value_name = "TIME..TIME", value_parser = span, allow_hyphen_values = true)]
    pub(super) work: Option<(u64, u64)>,
    /// How long to wait for the daemon, such as `10s`.
    #[arg(long, default_value = "10s", value_name = "TIME", value_parser = nanoseconds, allow_hyphen_values = true)]
    pub(super) wait: u64,
    /// Write a scene of `--count` mixed bodies to this file, and end.
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["scene", "instance", "source", "rate", "motion", "frames", "work", "wait"]
    )]
    pub(super) write_scene: Option<PathBuf>,
    /// The scene to write: `pool` (in free space) or `pile` (on a floor).
    #[arg(
        long,
        default_value = "pool",
        value_parser = ["pool", "pile"],
        value_name = "KIND",
        conflicts_with = "scene"
    )]
    pub(super) kind: String,
    /// Write over a file that is there.
    #[arg(long, conflicts_with = "scene")]
    pub(super) force: bool,
}

#[derive(Debug, Args)]
pub(super) struct MonitorArgs {
    #[command(flatten)]
    pub(super) which: Which,
    /// One JSON object a tick instead of a screen: gaps in metres, times in nanoseconds.
    ///
    /// An open end of a gap's interval is null. `pairs_shown` and `contacts_shown` are [rows in this line, rows
    /// published]. `pairs` is there with the rows of the same tick, `contacts` with --contacts (up to four for each of
    /// --pairs), `worst` where a pair is near. Where the daemon has started anew there is a line
    /// `{"restarted": {"boots": [old, new], "ends": [pairs that ended by that]}}`.
    #[arg(long)]
    pub(super) json: bool,
    /// End after so many ticks; until a signal otherwise. With --json those that are under way, of which there is word
    /// each heartbeat, have no line then.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) ticks: Option<u64>,
    /// End with code 3 when no tick comes for so long.
    #[arg(long, default_value = "10s", value_name = "TIME", value_parser = nanoseconds, allow_hyphen_values = true)]
    pub(super) wait: u64,
    /// Pairs shown (or written) at most.
    #[arg(
        long,
        default_value_t = 20,
        value_name = "N",
        allow_negative_numbers = true
    )]
    pub(super) pairs: usize,
    /// Also read contacts: the daemon then computes them.
    #[arg(long)]
    pub(super) contacts: bool,
}

/// A limit given by hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Limit {
    /// No limit.
    None,
    /// Nanoseconds or units.
    Of(u64),
}

pub(super) fn duration(text: &str) -> Result<Limit, String> {
    if text == "none" {
        Ok(Limit::None)
    } else {
        nanoseconds(text).map(Limit::Of)
    }
}

pub(super) fn units(text: &str) -> Result<Limit, String> {
    if text == "none" {
        return Ok(Limit::None);
    }
    text.parse()
        .map(Limit::Of)
        .map_err(|_| "a whole number of work units, or none".to_owned())
}

/// Nanoseconds of `2ms`, `1.5s`, `500us`, `100ns`, `0`.
pub(super) fn nanoseconds(text: &str) -> Result<u64, String> {
    let wanted = || {
        format!(
            "`{text}` is no time: write a number that is not below 0 and ns, us, ms or s, such as 2ms"
        )
    };
    let split = text
        .find(|c: char| c.is_ascii_alphabetic())
        .unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let number: f64 = number.trim().parse().map_err(|_| wanted())?;
    let scale = match unit {
        "ns" => 1.0,
        "us" => 1e3,
        "ms" => 1e6,
        "s" => 1e9,
        "" if number == 0.0 => 1.0,
        _ => return Err(wanted()),
    };
    let ns = number * scale;
    if ns >= 1e18 {
        return Err(format!(
            "`{text}` is too long: write a time of less than 31 years"
        ));
    }
    if ns.is_nan() || ns < 0.0 {
        return Err(wanted());
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked just above"
    )]
    Ok(ns.round() as u64)
}

/// Nanoseconds of `7ms..15ms`, or of one time for both ends.
fn span(text: &str) -> Result<(u64, u64), String> {
    let (least, most) = text.split_once("..").unwrap_or((text, text));
    let (least, most) = (nanoseconds(least)?, nanoseconds(most)?);
    if least > most {
        return Err(format!("`{text}`: the first time is the longer one"));
    }
    Ok((least, most))
}

fn mode(text: &str) -> Result<crate::config::Mode, String> {
    crate::config::Mode::parse(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_with_their_units() {
        assert_eq!(nanoseconds("2ms"), Ok(2_000_000));
        assert_eq!(nanoseconds("1.5s"), Ok(1_500_000_000));
        assert_eq!(duration("none"), Ok(Limit::None));
        assert_eq!(nanoseconds("0"), Ok(0));
        for bad in ["", "ms", "2", "-1ms", "2 hours", "1e30s", "nan ms"] {
            assert!(nanoseconds(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn spans_are_read_from_the_shorter_to_the_longer_time() {
        assert_eq!(span("7ms..15ms"), Ok((7_000_000, 15_000_000)));
        assert_eq!(span("2us"), Ok((2_000, 2_000)));
        for bad in ["15ms..7ms", "7ms..", "7..15ms", "..", ""] {
            assert!(span(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn modes_are_read_as_in_scene_files() {
        use crate::config::Mode;
        assert_eq!(mode("on_all"), Ok(Mode::OnAll));
        assert_eq!(mode("on_frame=sim"), Ok(Mode::OnFrame("sim".to_owned())));
        assert!(mode("rate=0").is_err());
        assert!(mode("on_frame=").is_err());
    }

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory as _;
        Cli::command().debug_assert();
    }
}
