//! `sweepd completions`, `sweepd man`, and the text below `sweepd --help`. In: the flags, and the lists in this file.
//! Out: text for shells, `man` and users.

use std::path::Path;

use clap::{Command, CommandFactory as _};
use clap_mangen::Man;
use clap_mangen::roff::{Roff, bold, roman};

use crate::error::{Error, Result};

use super::args::Cli;
use super::args_tools::{CompletionsArgs, ManArgs, Shell};
use super::files::Draft;
use super::out::Out;

/// The name of the binary.
const NAME: &str = "sweepd";

/// Preamble of each part of a page: it defines a plain, not a typographic, apostrophe.
const PREAMBLE: &str = ".ie \\n(.g .ds Aq \\(aq\n.el .ds Aq '\n";

/// Example command lines and what they do, grouped by purpose.
const EXAMPLES: [(&str, &[(&str, &str)]); 3] = [
    (
        "Try it, in three terminals",
        &[
            (
                "sweepd feed --write-scene pool.toml --count 200",
                "make a scene of 200 bodies",
            ),
            ("sweepd run pool.toml", "the daemon"),
            ("sweepd feed pool.toml", "a source that moves them"),
            ("sweepd monitor", "what touches what"),
        ],
    ),
    (
        "Ask and look",
        &[
            ("sweepd query A B", "the proved gap of two bodies"),
            (
                "sweepd query --touching A --at 1,2,3",
                "what a body would touch there",
            ),
            ("sweepd doctor", "what is wrong when nothing works"),
        ],
    ),
    (
        "Measure, without a daemon",
        &[
            (
                "sweepd report error pool.toml --html error.html",
                "error against run time, over a sweep of budgets",
            ),
            (
                "sweepd report stability --html stability.html",
                "stiff and extreme cases against known truths",
            ),
        ],
    ),
];

const EXIT_CODES: [(u8, &str); 7] = [
    (0, "done"),
    (1, "a check failed"),
    (2, "usage or bad input"),
    (3, "timed out"),
    (4, "refused or could not run"),
    (5, "watchdog"),
    (101, "internal error"),
];

const ENVIRONMENT: [(&str, &str); 4] = [
    (
        "NO_COLOR",
        "Any value that is not empty switches colours off.",
    ),
    (
        "ROS_DOMAIN_ID",
        "DDS domain of `run --ros2`, 0 to 232; default: 0.",
    ),
    (
        "ROS_AUTOMATIC_DISCOVERY_RANGE",
        "SUBNET lets `run --ros2` reach other hosts; default: LOCALHOST.",
    ),
    (
        "ROS_LOCALHOST_ONLY",
        "1 keeps `run --ros2` on this host, whatever the range says.",
    ),
];

/// The text below the list of commands.
pub(super) fn after_help() -> String {
    let mut text = String::new();
    for (what, lines) in EXAMPLES {
        text += &format!("{what}:\n");
        for (line, does) in lines {
            text += &format!("  {line:<50} {does}\n");
        }
        text.push('\n');
    }
    let codes = EXIT_CODES.map(|(code, what)| format!("{code} {what}"));
    let variables = ENVIRONMENT.map(|(name, does)| format!("  {name:<30} {does}\n"));
    text + &format!(
        "Exit codes: {}.\nEnvironment:\n{}",
        codes.join(", "),
        variables.concat().trim_end()
    )
}

/// Prints the completions of a shell.
pub(super) fn completions(args: &CompletionsArgs, out: &mut Out) -> Result<bool> {
    let shell = match args.shell {
        Shell::Bash => clap_complete::Shell::Bash,
        Shell::Zsh => clap_complete::Shell::Zsh,
        Shell::Fish => clap_complete::Shell::Fish,
    };
    // Into memory first: the generator does not handle a closed pipe.
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), NAME, &mut text);
    out.text(&String::from_utf8_lossy(&text))?;
    out.flush()?;
    Ok(true)
}

/// Prints one page to standard output, or writes all pages into a directory.
pub(super) fn man(args: &ManArgs, out: &mut Out) -> Result<bool> {
    let cmd = built();
    if let Some(folder) = &args.out {
        if folder.exists() && !folder.is_dir() {
            return Err(Error::Usage(format!(
                "--out {}: this is not a directory: give one, since each page is a file of its own",
                folder.display()
            )));
        }
        let made = std::fs::create_dir_all(folder).and_then(|()| write_all(&cmd, folder));
        made.map_err(|e| {
            Error::io(
                format!("cannot write man pages into {}", folder.display()),
                e,
            )
        })?;
        return Ok(true);
    }
    let mut asked = &cmd;
    for word in &args.command {
        asked = asked.find_subcommand(word).ok_or_else(|| {
            let known: Vec<&str> = asked.get_subcommands().map(Command::get_name).collect();
            Error::Usage(match known.as_slice() {
                [] => format!("`{}` has no commands of its own", asked.get_name()),
                _ => format!(
                    "`{}` has no command `{word}`, it has: {}",
                    asked.get_name(),
                    known.join(", ")
                ),
            })
        })?;
    }
    let text = page(asked).map_err(|e| Error::io("cannot make a man page", e))?;
    out.text(&text)?;
    out.flush()?;
    Ok(true)
}

/// The command with its subcommands, each with its inherited flags.
fn built() -> Command {
    let mut cmd = Cli::command().disable_help_subcommand(true);
    cmd.build();
    cmd
}

fn write_all(cmd: &Command, folder: &Path) -> std::io::Result<()> {
    for sub in cmd.get_subcommands() {
        write_all(sub, folder)?;
    }
    let file = Man::new(cmd.clone()).get_filename();
    Draft::put(&folder.join(file), &page(cmd)?)
}

fn page(cmd: &Command) -> std::io::Result<String> {
    let man = Man::new(cmd.clone())
        .source(format!("{NAME} {}", env!("CARGO_PKG_VERSION")))
        // Blank, not empty: the fields of the title are positional.
        .date(" ")
        .manual("User Commands");
    let (mut text, is_top) = (Vec::new(), cmd.get_name() == NAME);
    man.render_title(&mut text)?;
    man.render_name_section(&mut text)?;
    man.render_synopsis_section(&mut text)?;
    man.render_description_section(&mut text)?;
    if cmd.get_arguments().next().is_some() {
        man.render_options_section(&mut text)?;
    }
    if cmd.has_subcommands() {
        man.render_subcommands_section(&mut text)?;
    }
    let mut roff = Roff::new();
    if is_top {
        examples(&mut roff);
    }
    roff.control("SH", ["EXIT STATUS"]);
    for (code, what) in EXIT_CODES {
        roff.control("TP", ["6"]);
        roff.text([bold(code.to_string())]);
        roff.text([roman(what)]);
    }
    if is_top {
        roff.control("SH", ["ENVIRONMENT"]);
        for (name, does) in ENVIRONMENT {
            roff.control("TP", []);
            roff.text([bold(name)]);
            roff.text([roman(does)]);
        }
    } else {
        roff.control("SH", ["SEE ALSO"]);
        roff.text([bold(NAME), roman("(1)")]);
    }
    roff.to_writer(&mut text)?;
    let text = String::from_utf8_lossy(&text);
    // Each part repeats the preamble; once is enough.
    let mut parts = text.split(PREAMBLE);
    let first = parts.next().unwrap_or_default();
    Ok([first, PREAMBLE].into_iter().chain(parts).collect())
}

fn examples(roff: &mut Roff) {
    roff.control("SH", ["EXAMPLES"]);
    for (what, lines) in EXAMPLES {
        roff.control("PP", []);
        roff.text([roman(format!("{what}:"))]);
        for (line, does) in lines {
            roff.control("TP", []);
            roff.text([bold(*line)]);
            roff.text([roman(*does)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The command and all its subcommands, at any depth.
    fn all(cmd: &Command) -> Vec<&Command> {
        let beneath = cmd.get_subcommands().flat_map(all);
        std::iter::once(cmd).chain(beneath).collect()
    }

    #[test]
    fn every_command_and_flag_has_a_sentence_and_every_value_a_name() {
        let cmd = built();
        let mut wrong = Vec::new();
        for cmd in all(&cmd) {
            let about = cmd.get_about().map(ToString::to_string).unwrap_or_default();
            let place = cmd.get_display_name().unwrap_or(cmd.get_name());
            if about.len() < 15 {
                wrong.push(format!("{place}: `{about}` says too little"));
            }
            for arg in cmd.get_arguments() {
                let id = arg.get_id();
                let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
                let own = ["help", "version"].contains(&id.as_str());
                if !own && help.len() < 15 {
                    wrong.push(format!("{place} {id}: `{help}` says too little"));
                }
                let takes = arg.get_num_args().is_some_and(|n| n.takes_values());
                let names = arg.get_value_names().unwrap_or_default();
                if takes
                    && names
                        .iter()
                        .any(|name| name.to_uppercase() != name.as_str() && !name.contains('.'))
                {
                    wrong.push(format!("{place} {id}: its value has no name of its own"));
                }
            }
        }
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    }

    #[test]
    fn pages_have_their_sections_and_name_every_flag() {
        let cmd = built();
        for cmd in all(&cmd) {
            let text = page(cmd).unwrap();
            assert_eq!(text.matches(PREAMBLE).count(), 1);
            for section in ["NAME", "SYNOPSIS", "DESCRIPTION", "EXIT STATUS"] {
                assert!(
                    text.contains(&format!(".SH {section}"))
                        || text.contains(&format!(".SH \"{section}\"")),
                    "{section} in {text}"
                );
            }
            for long in cmd.get_arguments().filter_map(clap::Arg::get_long) {
                let flag = format!("\\-\\-{}", long.replace('-', "\\-"));
                assert!(text.contains(&flag), "{flag} in {text}");
            }
        }
    }

    #[test]
    fn completions_name_every_command() {
        let cmd = built();
        for shell in [
            clap_complete::Shell::Bash,
            clap_complete::Shell::Zsh,
            clap_complete::Shell::Fish,
        ] {
            let mut text = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), NAME, &mut text);
            let text = String::from_utf8(text).unwrap();
            for sub in cmd.get_subcommands() {
                assert!(text.contains(sub.get_name()), "{shell} {}", sub.get_name());
            }
            assert!(text.contains("ros-domain-id"), "{shell}");
        }
    }
}
