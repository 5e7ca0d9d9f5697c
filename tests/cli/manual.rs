//! `sweepd completions` and `sweepd man`, checked with real shells and readers of man pages.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use super::{code, err, head, out};
use crate::live::{Desk, finish, output};

/// Runs a program; `None` if it is not installed.
fn run(program: &str, args: &[&str]) -> Option<Output> {
    let child = Command::new(program)
        .args(args)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let Ok(child) = child else {
        eprintln!("SKIPPED: no {program} here");
        return None;
    };
    Some(finish(child))
}

#[test]
fn shells_take_their_completions() {
    let desk = Desk::new();
    for shell in ["bash", "zsh", "fish"] {
        let ended = output(&["completions", shell]);
        assert_eq!(code(&ended), Some(0), "{}", err(&ended));
        let path = desk.write(shell, &out(&ended));
        let Some(read) = run(shell, &["-n", path.to_str().unwrap()]) else {
            continue;
        };
        assert_eq!(
            (code(&read), err(&read)),
            (Some(0), String::new()),
            "{shell}"
        );
    }
    // Bash itself completes a command, flags and a value.
    let complete = |words: &[&str]| {
        let (last, at) = (words.len() - 1, words.len() - 1);
        let script = format!(
            "source {}; COMP_WORDS=({}); COMP_CWORD={at}; _sweepd sweepd '{}' '{}'; echo \"${{COMPREPLY[@]}}\"",
            desk.dir.join("bash").display(),
            words.join(" "),
            words[last],
            words[last - 1],
        );
        run("bash", &["-c", &script]).map(|ended| {
            assert_eq!(code(&ended), Some(0), "{}", err(&ended));
            out(&ended)
        })
    };
    for (words, wanted) in [
        (&["sweepd", "qu"][..], "query"),
        (&["sweepd", "doctor", "--cl"], "--clean"),
        (&["sweepd", "report", "st"], "stability"),
        (&["sweepd", "completions", "f"], "fish"),
    ] {
        if let Some(found) = complete(words) {
            assert!(
                found.split_whitespace().any(|word| word == wanted),
                "{words:?}: {found}"
            );
        }
    }
}

#[test]
fn man_pages_are_written_for_every_command_and_read_without_a_complaint() {
    let desk = Desk::new();
    let folder = desk.dir.join("share/man1");
    let ended = output(&["man", "--out", folder.to_str().unwrap()]);
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    assert!(ended.stdout.is_empty());
    let mut names: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    let help = out(&output(&["--help"]));
    let commands = help.split("Commands:").nth(1).unwrap().lines().skip(1);
    let commands: Vec<&str> = commands
        .take_while(|line| !line.is_empty())
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|command| *command != "help")
        .collect();
    assert!(commands.len() >= 10, "{commands:?}");
    for command in commands
        .iter()
        .copied()
        .chain(["report-error", "report-stability"])
    {
        assert!(
            names.contains(&format!("sweepd-{command}.1")),
            "{command} in {names:?}"
        );
    }
    assert!(names.contains(&"sweepd.1".to_owned()));
    for name in &names {
        let path = folder.join(name);
        let read = run(
            "groff",
            &["-man", "-Tutf8", "-P-cbou", "-ww", path.to_str().unwrap()],
        );
        let Some(read) = read else { break };
        assert_eq!(
            (code(&read), err(&read)),
            (Some(0), String::new()),
            "{name}"
        );
        assert!(out(&read).contains("EXIT STATUS"), "{name}");
    }
    assert_eq!(
        page(&[]),
        std::fs::read_to_string(folder.join("sweepd.1")).unwrap()
    );
    let query = page(&["query"]);
    assert_eq!(
        query,
        std::fs::read_to_string(folder.join("sweepd-query.1")).unwrap()
    );
    assert!(page(&["report", "error"]).contains("sweepd\\-report\\-error"));
    let ended = output(&["man", "report", "fly"]);
    assert_eq!(code(&ended), Some(2));
    assert!(
        err(&ended).contains("it has: error, stability"),
        "{}",
        err(&ended)
    );
    // A file exists where the folder should be.
    let file = desk.write("file", "");
    let ended = output(&["man", "--out", file.to_str().unwrap()]);
    assert_eq!(code(&ended), Some(2), "{}", err(&ended));
    assert!(Path::new(&file).is_file());
    for args in [&["man"][..], &["completions", "bash"]] {
        assert_eq!(code(&head(args, 0)), Some(0), "{args:?}");
    }
}

fn page(words: &[&str]) -> String {
    let ended = output(&[&["man"], words].concat());
    assert_eq!(code(&ended), Some(0), "{}", err(&ended));
    out(&ended)
}
