//! Flags and arguments of the commands that look, listen and tell: `record`, `list`, `doctor`, `completions`, `man`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::args::{Which, nanoseconds};

#[derive(Debug, Args)]
#[cfg_attr(
    not(feature = "mcap"),
    allow(dead_code, reason = "this build refuses to record")
)]
pub(super) struct RecordArgs {
    /// The file to write: MCAP, profile `ros2`.
    #[arg(value_name = "FILE.mcap")]
    pub(super) file: PathBuf,
    #[command(flatten)]
    pub(super) which: Which,
    /// Record these only, beside state, tick and names, which always are; the daemon computes contacts for who listens.
    #[arg(long, value_name = "TOPIC,...", value_delimiter = ',')]
    pub(super) only: Vec<Recorded>,
    /// End after so many ticks; until a signal otherwise.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) ticks: Option<u64>,
    /// End after so long, such as `10s`.
    #[arg(long = "for", value_name = "TIME", value_parser = nanoseconds, allow_hyphen_values = true)]
    pub(super) time: Option<u64>,
    /// End with code 3 when no tick comes for so long; what was heard until then is in the file.
    #[arg(long, default_value = "10s", value_name = "TIME", value_parser = nanoseconds, allow_hyphen_values = true)]
    pub(super) wait: u64,
    /// What messages call the frame of poses and points: the scene's `frame_id`, which clients are not told.
    #[arg(long, default_value = "world", value_name = "NAME")]
    pub(super) frame_id: String,
    /// Write over a file that is there.
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
    /// Where bodies are.
    Bodies,
}

#[derive(Debug, Args)]
pub(super) struct ListArgs {
    /// One JSON object an instance, a line each, instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct DoctorArgs {
    /// Look at this instance, and with --clean at its leftovers only; by default at all that there are.
    #[arg(long, value_name = "NAME")]
    pub(super) instance: Option<String>,
    /// One JSON object a finding, a line each, instead of text: `level`, `check`, `what`, `do`.
    #[arg(long)]
    pub(super) json: bool,
    /// Remove what dead processes of this user left: nodes of iceoryx2 with their shared memory (also those of its
    /// programs that are no sweepd, unless --instance is given), and locks that nobody holds. Never of living ones.
    #[arg(long)]
    pub(super) clean: bool,
}

#[derive(Debug, Args)]
pub(super) struct CompletionsArgs {
    /// The shell to complete for.
    #[arg(value_name = "SHELL")]
    pub(super) shell: Shell,
}

/// A shell, and where it looks for completions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Shell {
    /// Into `~/.local/share/bash-completion/completions/sweepd`.
    Bash,
    /// Into a file `_sweepd` in a directory of `$fpath`.
    Zsh,
    /// Into `~/.config/fish/completions/sweepd.fish`.
    Fish,
}

#[derive(Debug, Args)]
pub(super) struct ManArgs {
    /// Of this command, such as `query` or `report error`; by default of sweepd itself.
    #[arg(value_name = "COMMAND", conflicts_with = "out")]
    pub(super) command: Vec<String>,
    /// Write all pages, each command's too, into this directory (it is made), such as `~/.local/share/man/man1`.
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
}
