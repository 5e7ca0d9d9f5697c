//! The `sweepd` binary.

use std::process::ExitCode;

fn main() -> ExitCode {
    sweepd::cli::main()
}
