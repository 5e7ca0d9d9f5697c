//! Flags and arguments of the tool commands: `record`, `list`, `doctor`, `completions`, `man`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::args::Which;
use super::values::{from_1, nanoseconds, some_time};

#[derive(Debug, Args)]
#[cfg_attr(
    not(feature = "mcap"),
    allow(dead_code, reason = "this build refuses to record")
)]
pub(super) struct RecordArgs {
    /// File to write (MCAP, profile `ros2`).
    #[arg(value_name = "FILE.mcap")]
    pub(super) file: PathBuf,
    #[command(flatten)]
    pub(super) which: Which,
    /// Record only these, beside state, tick and names, which are always recorded. The daemon computes what is
    /// recorded.
    #[arg(long, value_name = "TOPIC,...", value_delimiter = ',')]
    pub(super) only: Vec<Recorded>,
    /// Stop after N ticks; by default at a signal.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = from_1)]
    pub(super) ticks: Option<u64>,
    /// Stop after this time, such as `10s`.
    #[arg(long = "for", value_name = "TIME", value_parser = some_time, allow_hyphen_values = true)]
    pub(super) time: Option<u64>,
    /// Exit with code 3 if no tick comes for this long; the file keeps what came before.
    #[arg(long, default_value = "10s", value_name = "TIME", value_parser = nanoseconds, allow_hyphen_values = true)]
    pub(super) wait: u64,
    /// Frame name in the recorded messages: give the scene's `frame_id`, which the daemon does not publish.
    #[arg(long, default_value = "world", value_name = "NAME")]
    pub(super) frame_id: String,
    /// Overwrite the file if it exists.
    #[arg(long)]
    pub(super) force: bool,
}

/// What can be recorded or left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Recorded {
    /// Pairs that are not plainly apart, and last events.
    Pairs,
    /// Contacts of colliding pairs.
    Contacts,
    /// Poses of bodies.
    Bodies,
}

#[derive(Debug, Args)]
pub(super) struct ListArgs {
    /// Print one JSON object per instance, one per line, instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct DoctorArgs {
    /// Check only this instance, and with --clean remove only its leftovers; by default all instances.
    #[arg(long, value_name = "NAME")]
    pub(super) instance: Option<String>,
    /// Print one JSON object per finding, one per line, instead of text: `level`, `check`, `what`, `do`.
    #[arg(long)]
    pub(super) json: bool,
    /// Remove what dead processes of this user left behind: iceoryx2 nodes with their shared memory, and locks that
    /// nobody holds. Nothing of living processes is removed. Without --instance this includes other iceoryx2 programs.
    #[arg(long)]
    pub(super) clean: bool,
}

#[derive(Debug, Args)]
pub(super) struct CompletionsArgs {
    /// Shell to write completions for.
    #[arg(value_name = "SHELL")]
    pub(super) shell: Shell,
}

/// A shell, and where it looks for completions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Shell {
    /// Save as `~/.local/share/bash-completion/completions/sweepd`.
    Bash,
    /// Save as `_sweepd` in a directory of `$fpath`.
    Zsh,
    /// Save as `~/.config/fish/completions/sweepd.fish`.
    Fish,
}

#[derive(Debug, Args)]
pub(super) struct ManArgs {
    /// Command to print the page of, such as `query` or `report error`; by default sweepd itself.
    #[arg(value_name = "COMMAND", conflicts_with = "out")]
    pub(super) command: Vec<String>,
    /// Write the pages of all commands into this directory, such as `~/.local/share/man/man1`; it is created if
    /// missing.
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
}
