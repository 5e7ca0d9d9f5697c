//! The dependency rule: a module of `src` (a room) may name only rooms on lines above its own in `HOUSE`. Each external
//! crate may be named only in its own files. Both are checked on the text of the sources.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test")]

use std::fs;
use std::path::{Path, PathBuf};

/// The rooms from the lowest to the highest layer. Rooms on one line may not name each other.
const HOUSE: &[&[&str]] = &[
    // foundation: used by all rooms
    &["error", "ids", "limits", "time", "math", "simd"],
    // wire format and transport
    &["wire"],
    &["config"],
    &["transport"],
    // geometry and collision, from shapes to results
    &["shape"],
    &["scene"],
    &["world"],
    &["pairs"],
    &["broad"],
    &["narrow"],
    &["publish"],
    // engine
    &["plan"],
    &["tick"],
    // users of the engine
    &["query"],
    &["builtin"],
    &["record"],
    &["report"],
    &["daemon"],
    &["cli"],
];

/// Rooms that may name `transport`; those of the lines from `shape` to `tick` may not.
const OUTSIDE: &[&str] = &["transport", "query", "record", "report", "daemon", "cli"];

/// An external crate and the only files that may name it.
const DOORS: &[(&str, &[&str])] = &[
    ("iceoryx2", &["transport/iceoryx", "wire/"]),
    ("parry3d_f64", &["shape/", "narrow/exact"]),
    ("glamx", &["math.rs"]),
    ("ros2_client", &["transport/ros2"]),
    ("rustdds", &["transport/ros2"]),
    ("yaml_rust2", &["transport/ros2"]),
    ("mcap", &["record/file"]),
    ("cdr_encoding", &["record/file"]),
];

fn line_of(room: &str) -> usize {
    HOUSE
        .iter()
        .position(|rooms| rooms.contains(&room))
        .unwrap_or_else(|| panic!("room `{room}` is not in the house"))
}

fn sources(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
}

fn all() -> Vec<(String, String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    files.sort();
    let with_room = files.iter().filter_map(|path| {
        let name = path
            .strip_prefix(&root)
            .unwrap()
            .to_string_lossy()
            .replace('\\', "/");
        let room = name
            .split('/')
            .next()
            .unwrap()
            .trim_end_matches(".rs")
            .to_owned();
        // The root files of the library and the binary belong to no room.
        (room != "lib" && room != "main")
            .then(|| (name.clone(), room, fs::read_to_string(path).unwrap()))
    });
    with_room.collect()
}

/// The code without comments and without tests, which may name any room: an inline test module ends the code of its
/// file, a declaration of a test module is skipped.
fn code(text: &str) -> String {
    let mut body = String::new();
    for (at, part) in text.split("#[cfg(test)]\nmod ").enumerate() {
        if at == 0 {
            body.push_str(part);
            continue;
        }
        let Some((name, rest)) = part.split_once([';', '{']) else {
            break;
        };
        if part[name.len()..].starts_with('{') {
            break;
        }
        body.push_str(rest);
    }
    body.lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .collect::<Vec<_>>()
        .join("\n")
}

/// The rooms that a text names as `crate::ROOM`. For `crate::{..}` the entry starts with a brace, which is no room's
/// name.
fn named(text: &str) -> Vec<String> {
    let mut rooms: Vec<String> = text
        .split("crate::")
        .skip(1)
        .map(|rest| {
            rest.chars()
                .take_while(|c| c.is_ascii_alphanumeric() || "_{".contains(*c))
                .collect()
        })
        .collect();
    rooms.sort();
    rooms.dedup();
    rooms.retain(|room| !room.is_empty());
    rooms
}

#[test]
fn what_is_no_code_is_left_out_and_nothing_else() {
    let text = "//! crate::a\nuse crate::b;\n#[cfg(test)]\nmod tests;\nuse crate::c::D;\n#[cfg(test)]\nmod inner {\n use crate::e;\n}\n";
    assert_eq!(named(&code(text)), ["b", "c"]);
    assert_eq!(named("use crate::{f, g}; crate::h::x()"), ["h", "{f"]);
}

#[test]
fn a_room_names_only_rooms_above_it() {
    let mut wrong = Vec::new();
    for (file, room, text) in all() {
        if file.ends_with("/tests.rs") {
            continue;
        }
        for other in named(&code(&text)) {
            let (own, theirs) = (line_of(&room), line_of(&other));
            let foundation = theirs == 0 && own > 0;
            let above = theirs < own || other == room;
            let walled = other == "transport" && !OUTSIDE.contains(&room.as_str());
            if !(foundation || above) || walled {
                wrong.push(format!("src/{file} names `{other}`"));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "imports against the law:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn outside_crates_have_one_door() {
    let mut wrong = Vec::new();
    for (file, _, text) in all() {
        if file.ends_with("/tests.rs") {
            continue;
        }
        let text = code(&text);
        for (name, doors) in DOORS {
            let path = format!("{name}::");
            if text.contains(&path) && !doors.iter().any(|door| file.starts_with(door)) {
                wrong.push(format!("src/{file} names `{name}`"));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "outside crates beside their door:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn every_file_says_its_duty_and_stays_short() {
    let mut wrong = Vec::new();
    for (file, _, text) in all() {
        if !text.starts_with("//!") {
            wrong.push(format!("src/{file} does not open with its duty (//!)"));
        }
        for (at, line) in text.lines().enumerate() {
            let words = line.trim_start();
            // A line of a table may be wider.
            let prose = words.starts_with("//") && !words.contains(" | ");
            if prose && line.chars().count() > 120 {
                wrong.push(format!(
                    "src/{file}:{}: a comment beyond 120 columns",
                    at + 1
                ));
            }
        }
        let lines = text.lines().count();
        if lines > 400 {
            wrong.push(format!(
                "src/{file} has {lines} lines: would two rooms be clearer?"
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_room_stands_in_the_house_and_in_the_library() {
    let library =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).unwrap();
    for (file, room, _) in all() {
        let _ = line_of(&room);
        assert!(
            library.contains(&format!("pub mod {room};")),
            "src/{file}: `{room}` is not declared in lib.rs"
        );
    }
}
