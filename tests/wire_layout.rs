//! Goal: Rust, C, Python and the byte table in `msgs/README.md` agree on every field and every code. Method: one table
//! of fields here, whose completeness follows from the sizes (there is no padding, so they must add up); each other
//! side prints its own table, and the texts are compared line by line.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "tests"
)]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::mem::offset_of;
use std::path::{Path, PathBuf};
use std::process::Command;

use sweepd::wire::{
    AnswerHeader, BodyRow, BodyStatus, BroadCause, BroadMode, ChangesHeader, ContactKind,
    ContactRow, EndCause, Event, FrameHeader, Hello, Level, MessageHeader, NameRow, PairRow,
    Reason, RegionRow, RejectReason, RequestHeader, SourceRow, Stage, State, TickCause, TickRow,
    TransformRow, TransformVelRow, Verdict, VertexHeader, VertexRow, WIRE_VERSION, contact_flags,
    frame_flags, pair_flags, region_flags, vertex_flags,
};

struct Layout {
    name: &'static str,
    size: usize,
    /// Name, offset, size.
    fields: Vec<(&'static str, usize, usize)>,
}

fn field_size<T, F>(_field: fn(&T) -> &F) -> usize {
    size_of::<F>()
}

macro_rules! layouts {
    ($($name:ident { $($field:ident)+ })+) => {
        vec![$(Layout {
            name: stringify!($name),
            size: size_of::<$name>(),
            fields: vec![$((
                stringify!($field),
                offset_of!($name, $field),
                field_size(|row: &$name| &row.$field),
            ),)+],
        },)+]
    };
}

#[rustfmt::skip]
fn layouts() -> Vec<Layout> {
    layouts! {
        TransformRow { body flags reserved position orientation }
        TransformVelRow { transform linear angular }
        FrameHeader { session epoch seq sent_ns stamp_ns scene_rev deadline_ns time_left_ns source flags clock_id schema boot }
        VertexRow { position }
        VertexHeader { session epoch seq sent_ns body version base_version number source first count total flags schema boot }
        MessageHeader { boot_id tick scene_rev oldest_stamp_ns newest_stamp_ns truncated state reserved schema }
        ChangesHeader { message base_tick listed }
        PairRow { body_a body_b gap_min_m gap_max_m gap_best_m closing_mps toi_min toi_max begin_first_tick begin_last_tick end_first_tick end_last_tick certified_tick bound_age_ticks verdict certified_verdict events end_cause level flags reserved }
        ContactRow { id body_a body_b point_a point_b point_a_body point_b_body normal gap_m gap_min_m gap_max_m shape_a shape_b triangle_a triangle_b flags kind reserved }
        RegionRow { body_a body_b centre radius_m cone_axis cone_half_angle_rad point normal depth_m flags index count level reserved }
        BodyRow { body position orientation stamp_ns received_ns age_ns generation source status verdict reject reserved }
        NameRow { body source generation len reserved name }
        SourceRow { name session epoch seq stamp_ns age_ns frames skipped refused clock_id alive paused reserved }
        TickRow { header sent_ns elapsed_ns budget_ns budget_units floor_ns units stage_ns rejects bodies unknown candidates colliding possible near ignored missed cancelled_events worst_a worst_b widest_m oldest_undecided_ticks reasons cause overrun sources_len cause_source rebuilds broad_renewed broad_mode broad_cause reserved sources }
        Hello { magic boot_id pid uid wire_version reserved sweepd_version iceoryx2_version }
        RequestHeader { json_len request schema reserved }
        AnswerHeader { boot_id request schema ok }
    }
}

macro_rules! codes {
    ($($name:ident)+) => {
        vec![$((
            stringify!($name),
            $name::ALL.iter().map(|c| (c.word(), u32::from(c.code()))).collect::<Vec<_>>(),
        ),)+]
    };
}

fn codes() -> Vec<(&'static str, Vec<(&'static str, u32)>)> {
    let mut all = codes! {
        Verdict State Reason TickCause BroadMode BroadCause Event EndCause RejectReason BodyStatus Level ContactKind Stage
    };
    all.push((
        "FrameFlags",
        vec![
            ("FULL", frame_flags::FULL),
            ("PARTIAL", frame_flags::PARTIAL),
            ("PAUSED", frame_flags::PAUSED),
        ],
    ));
    all.push((
        "VertexFlags",
        vec![("FULL", vertex_flags::FULL), ("RANGE", vertex_flags::RANGE)],
    ));
    all.push((
        "PairFlags",
        vec![
            ("TOUCHING", pair_flags::TOUCHING.into()),
            ("ESTIMATE", pair_flags::ESTIMATE.into()),
            ("UNKNOWN_BODY", pair_flags::UNKNOWN_BODY.into()),
            ("HELD_BODY", pair_flags::HELD_BODY.into()),
            ("GONE", pair_flags::GONE.into()),
            ("SWEPT_HIT", pair_flags::SWEPT_HIT.into()),
            ("SWEPT_OPEN", pair_flags::SWEPT_OPEN.into()),
            ("TELEPORTED", pair_flags::TELEPORTED.into()),
        ],
    ));
    all.push(("ContactFlags", vec![("ESTIMATE", contact_flags::ESTIMATE)]));
    all.push((
        "RegionFlags",
        vec![
            ("COMPLETE", region_flags::COMPLETE),
            ("ESTIMATE", region_flags::ESTIMATE),
            ("CLIPPED", region_flags::CLIPPED),
        ],
    ));
    all
}

/// `body moved` or `BodyMoved` in the spelling of constants in other languages.
fn screaming(word: &str) -> String {
    let mut out = String::new();
    for (at, c) in word.chars().enumerate() {
        let capital_inside = at > 0 && c.is_ascii_uppercase() && !word.contains('_');
        if capital_inside && word != word.to_ascii_uppercase() {
            out.push('_');
        }
        out.push(if c == ' ' {
            '_'
        } else {
            c.to_ascii_uppercase()
        });
    }
    out
}

/// Every field and code of this crate, as text that the other sides must print.
fn expected() -> String {
    let mut text = format!("WIRE_VERSION {WIRE_VERSION}\n");
    for layout in layouts() {
        for (field, offset, size) in &layout.fields {
            writeln!(text, "{}.{field} {offset} {size}", layout.name).unwrap();
        }
        writeln!(text, "{} {}", layout.name, layout.size).unwrap();
    }
    for (name, words) in codes() {
        for (word, code) in words {
            writeln!(text, "{name}.{} {code}", screaming(word)).unwrap();
        }
    }
    text
}

fn msgs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("msgs")
}

fn scratch(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn assert_same(theirs: &str, side: &str) {
    let ours = expected();
    for (ours, theirs) in ours.lines().zip(theirs.lines()) {
        assert_eq!(ours, theirs, "left: src/wire, right: {side}");
    }
    assert_eq!(ours.lines().count(), theirs.lines().count(), "{side}");
}

#[test]
fn every_field_is_in_the_table_and_no_row_has_padding() {
    for layout in layouts() {
        let mut end = 0;
        for (field, offset, size) in layout.fields {
            assert_eq!(offset, end, "{}.{field}", layout.name);
            end = offset + size;
        }
        assert_eq!(end, layout.size, "{}: a field is missing here", layout.name);
    }
}

#[test]
fn the_c_header_has_the_layout_and_the_codes_of_the_daemon() {
    let mut program = String::from("#include <stdio.h>\n#include \"sweepd.h\"\nint main(void) {\n");
    program += "printf(\"WIRE_VERSION %d\\n\", SWEEPD_WIRE_VERSION);\n";
    for layout in layouts() {
        let name = layout.name;
        let c_type = format!("sweepd_{}", screaming(name).to_lowercase());
        for (field, ..) in layout.fields {
            writeln!(
                program,
                "printf(\"{name}.{field} %zu %zu\\n\", offsetof({c_type}, {field}), \
                 sizeof((({c_type}*)0)->{field}));"
            )
            .unwrap();
        }
        writeln!(program, "printf(\"{name} %zu\\n\", sizeof({c_type}));").unwrap();
    }
    for (name, words) in codes() {
        for (word, _) in words {
            let (word, prefix) = (screaming(word), screaming(name));
            writeln!(
                program,
                "printf(\"{name}.{word} %d\\n\", SWEEPD_{prefix}_{word});"
            )
            .unwrap();
        }
    }
    program += "return 0; }\n";
    let (source, binary) = (scratch("layout.c"), scratch("layout_c"));
    std::fs::write(&source, program).unwrap();
    // Rust needs a C compiler as its linker, so `cc` is present
    let compiled = Command::new("cc")
        .args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-I"])
        .arg(msgs().join("c"))
        .arg(&source)
        .arg("-o")
        .arg(&binary)
        .output()
        .expect("cc, the linker of Rust, runs");
    let errors = String::from_utf8_lossy(&compiled.stderr);
    assert!(compiled.status.success(), "{errors}");
    let run = Command::new(&binary).output().unwrap();
    assert_same(&String::from_utf8_lossy(&run.stdout), "msgs/c/sweepd.h");
}

/// Prints the text of `expected` with the standard library only: neither numpy nor iceoryx2 may be needed.
const PYTHON: &str = r#"
import ctypes, sys
sys.path.insert(0, sys.argv[1])
from sweepd import layout
loaded = {"numpy", "iceoryx2"} & set(sys.modules)
assert not loaded, loaded
print("WIRE_VERSION", layout.WIRE_VERSION)
for name in sys.argv[2].split():
    row = layout.LAYOUTS[name]
    for field, kind in row._fields_:
        place = getattr(row, field)
        print(f"{name}.{field}", place.offset, place.size)
    print(name, ctypes.sizeof(row))
for name in sys.argv[3].split():
    for code in getattr(layout, name):
        print(f"{name}.{code.name}", int(code))
"#;

#[test]
fn the_python_layout_has_the_layout_and_the_codes_of_the_daemon() {
    let names: Vec<_> = layouts().iter().map(|l| l.name).collect();
    let codes: Vec<_> = codes().iter().map(|c| c.0).collect();
    let run = Command::new("python3")
        .args(["-I", "-S", "-c", PYTHON])
        .arg(msgs().join("python"))
        .args([names.join(" "), codes.join(" ")])
        .output();
    let run = match run {
        Ok(run) => run,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            println!("no python3 here: the Python layout was not compared");
            return;
        }
        Err(e) => panic!("python3: {e}"),
    };
    let errors = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{errors}");
    assert_same(
        &String::from_utf8_lossy(&run.stdout),
        "msgs/python/sweepd/layout.py",
    );
}

/// The rows of the tables under each `### Name` of the page.
fn page() -> BTreeMap<String, Vec<Vec<String>>> {
    let text = std::fs::read_to_string(msgs().join("README.md")).unwrap();
    let mut tables: BTreeMap<String, Vec<Vec<String>>> = BTreeMap::new();
    let mut name = String::new();
    for line in text.lines() {
        if let Some(heading) = line.strip_prefix("### ") {
            name = heading.to_owned();
        } else if let Some(row) = line.strip_prefix("| ")
            && !row.starts_with("---")
        {
            let cells = row.split('|').map(|cell| cell.trim().to_owned()).collect();
            tables.entry(name.clone()).or_default().push(cells);
        }
    }
    tables
}

fn rust_bytes(kind: &str) -> usize {
    let (base, count) = match kind.split_once('[') {
        Some((base, rest)) => (base, rest.trim_end_matches(']').parse().unwrap()),
        None => (kind, 1),
    };
    let base = match base {
        "u8" => 1,
        "u32" | "f32" => 4,
        "u64" | "f64" => 8,
        row => layouts().iter().find(|l| l.name == row).unwrap().size,
    };
    base * count
}

#[test]
fn the_byte_table_in_the_readme_has_the_layout_and_the_codes_of_the_daemon() {
    let tables = page();
    for layout in layouts() {
        // the first row is the header
        let rows = &tables[layout.name][1..];
        assert_eq!(rows.len(), layout.fields.len(), "{}", layout.name);
        for (row, (field, offset, size)) in rows.iter().zip(&layout.fields) {
            let ours = [(*field).to_owned(), offset.to_string(), size.to_string()];
            assert_eq!(row[..3], ours, "{}", layout.name);
            assert_eq!(rust_bytes(&row[3]), *size, "{}.{field}", layout.name);
            assert!(!row[4].is_empty(), "{}.{field} says nothing", layout.name);
        }
    }
    for (name, words) in codes() {
        let heading = if tables.contains_key(name) {
            name.to_owned()
        } else {
            screaming(name).to_lowercase()
        };
        let rows = &tables[&heading][1..];
        let theirs: Vec<_> = rows
            .iter()
            .map(|row| (screaming(&row[1]), row[0].clone()))
            .collect();
        let ours: Vec<_> = words
            .iter()
            .map(|(word, code)| (screaming(word), code.to_string()))
            .collect();
        assert_eq!(theirs, ours, "{name}");
    }
}

/// The quoted text after `mark`: the last one before `place`, or the first one after it, with no other row in between.
fn quoted<'a>(text: &'a str, place: &str, before: bool, mark: &str) -> &'a str {
    let at = text.find(place).unwrap_or_else(|| panic!("no `{place}`"));
    let (from, between) = if before {
        let from = text[..at].rfind(mark).unwrap();
        (from, &text[from..at])
    } else {
        let from = at + text[at..].find(mark).unwrap();
        (from, &text[at + place.len()..from])
    };
    assert!(
        !between.contains('}') && !between.contains("class ") && !between.contains("###"),
        "`{place}` has no `{mark}` of its own"
    );
    let quote = mark.chars().last().unwrap();
    text[from + mark.len()..].split(quote).next().unwrap()
}

#[test]
fn every_side_gives_a_row_the_same_type_name() {
    let read = |path: &Path| std::fs::read_to_string(path).unwrap();
    let wire = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/wire");
    let mut rust = String::new();
    for entry in std::fs::read_dir(wire).unwrap().flatten() {
        if entry.path().is_file() {
            rust += &read(&entry.path());
        }
    }
    let c = read(&msgs().join("c/sweepd.h"));
    let python = read(&msgs().join("python/sweepd/layout.py"));
    let page = read(&msgs().join("README.md"));
    let mut names = Vec::new();
    for layout in layouts() {
        let name = layout.name;
        let ours = quoted(
            &rust,
            &format!("pub struct {name} {{"),
            true,
            "#[type_name(\"",
        );
        let c_type = screaming(name).to_lowercase();
        let theirs = [
            quoted(
                &c,
                &format!("typedef struct sweepd_{c_type} {{"),
                true,
                "Type name \"",
            ),
            quoted(
                &python,
                &format!("\nclass {name}(_Row):"),
                false,
                "TYPE_NAME = \"",
            ),
            quoted(&page, &format!("\n### {name}\n"), false, "Type name `"),
        ];
        assert_eq!(theirs, [ours; 3], "{name}");
        let size = format!("{} bytes", layout.size);
        assert!(
            c.contains(&format!("Type name \"{ours}\", {size}")),
            "{name}"
        );
        assert!(
            page.contains(&format!("Type name `{ours}`, {size}")),
            "{name}"
        );
        names.push(ours);
    }
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count, "two rows of one name");
    // iceoryx2 compares the types of both sides of a service by this attribute.
    assert!(names.iter().all(|name| name.starts_with("sweepd.")));
}
