//! Reads a scene file: sources, bodies, rules and the settings of the daemon.
//!
//! In: TOML text. Out: a checked [`Scene`], or one error that names file, line, body and the fix.

use std::path::Path;

use crate::config::{BroadMethod, Config, Limits, MeshSearch, Mode};
use crate::error::{Error, Result};
use crate::limits;
use crate::scene::node::{Fault, Node, Value};
use crate::scene::read_body::{BodyDraft, SOURCE_NAME_BYTES_MAX, read_body, read_on_stale, title};
use crate::scene::read_ros::{no_lockstep, read_ros};
use crate::scene::read_rule::read_rule;
use crate::scene::read_viewpoint::read_viewpoint;
use crate::scene::resolve::resolve;
use crate::scene::table::{Table, list, mend_name, shortened};
use crate::scene::{Origin, Scene, SourceSpec};
use crate::time::Budget;

/// Longest time in a setting, milliseconds: one day.
const TIME_MS_MAX: f64 = 86_400_000.0;
/// Longest `frame_id`, bytes.
const FRAME_ID_BYTES_MAX: usize = 63;

const KEYS: &[&str] = &[
    "frame_id",
    "run",
    "limits",
    "viewpoint",
    "source",
    "body",
    "rule",
];
const RUN_KEYS: &[&str] = &[
    "mode",
    "on_frame",
    "rate",
    "budget_ms",
    "budget_units",
    "heartbeat_ms",
    "late_ms",
    "stale_reach_m",
    "broad_phase",
    "threads",
    "mesh_search",
];
const LIMIT_KEYS: &[&str] = &[
    "bodies",
    "pairs",
    "pair_rows",
    "contact_rows",
    "region_rows",
    "contacts_per_pair",
];

impl Scene {
    /// Reads and checks a scene file; mesh files must exist, and are read when shapes are built.
    ///
    /// # Errors
    /// `Error::Scene` with file, line, body and the fix, at the first mistake, or if the file cannot be read.
    pub fn load(path: &Path) -> Result<Self> {
        Self::parse_at(&Self::read_text(path)?, path)
    }

    /// As [`Scene::parse`], with the text of the file at `path`.
    ///
    /// # Errors
    /// As [`Scene::parse`].
    pub fn parse_at(text: &str, path: &Path) -> Result<Self> {
        let base = path.parent().unwrap_or_else(|| Path::new(""));
        Self::parse(text, &path.display().to_string(), base)
    }

    /// As [`Scene::parse`], but mesh files are stored elsewhere and are not looked for on disk.
    ///
    /// # Errors
    /// As [`Scene::parse`].
    pub fn parse_kept(text: &str, file: &str) -> Result<Self> {
        Self::parse_by(text, file, None)
    }

    /// Reads and checks the text of a scene file.
    ///
    /// * `file` - its name in messages.
    /// * `base` - the folder that mesh files are relative to.
    ///
    /// # Errors
    /// `Error::Scene` with file, line, body and the fix, at the first mistake.
    pub fn parse(text: &str, file: &str, base: &Path) -> Result<Self> {
        Self::parse_by(text, file, Some(base))
    }

    fn parse_by(text: &str, file: &str, base: Option<&Path>) -> Result<Self> {
        read(text, file, base).map_err(|fault| {
            let line = fault.at.map_or(1, |at| line_of(text.as_bytes(), at));
            let other = fault.other.map_or(String::new(), |at| {
                format!(
                    " (the other one is at line {})",
                    line_of(text.as_bytes(), at)
                )
            });
            Error::Scene(format!("{file}:{line}: {}{other}", fault.text))
        })
    }
}

/// The line of a byte offset, from 1.
pub(super) fn line_of(text: &[u8], at: usize) -> usize {
    let head = &text[..at.min(text.len())];
    1 + head.iter().filter(|byte| **byte == b'\n').count()
}

/// The lines of all shapes, found in one pass over the text.
fn lines_of_shapes(text: &str, drafts: &[BodyDraft]) -> Vec<Vec<u32>> {
    let breaks: Vec<usize> = text
        .bytes()
        .enumerate()
        .filter(|(_, b)| *b == b'\n')
        .map(|(at, _)| at)
        .collect();
    let line = |at: &Option<usize>| {
        let line = at.map_or(0, |at| 1 + breaks.partition_point(|end| *end < at));
        u32::try_from(line).unwrap_or(u32::MAX)
    };
    drafts
        .iter()
        .map(|draft| draft.places.shapes.iter().map(line).collect())
        .collect()
}

fn read(text: &str, file: &str, base: Option<&Path>) -> std::result::Result<Scene, Fault> {
    let mut table = Table::open(Node::from_toml(text)?, "a scene", KEYS).map_err(|fault| {
        let misplaced = RUN_KEYS
            .iter()
            .find(|key| fault.text.contains(&format!("key `{key}`")));
        match misplaced {
            Some(key) => Fault::new(
                fault.at,
                format!("`{key}` stands outside its table: move it under [run]"),
            ),
            None => fault,
        }
    })?;
    let frame_id = table.name("frame_id", FRAME_ID_BYTES_MAX)?;
    let sources = read_sources(table.take("source"))?;
    let limits = read_limits(table.take("limits"))?;
    let mut config = read_run(table.take("run"), limits, &sources)?;

    let mut drafts = Vec::new();
    for (place, node) in items(table.take("body"), "body")?.into_iter().enumerate() {
        let title = title(&node, place + 1);
        drafts.push(read_body(node, None).map_err(|fault| fault.within(&title))?);
    }
    let mut rules = Vec::new();
    for (place, node) in items(table.take("rule"), "rule")?.into_iter().enumerate() {
        let context = format!("rule {}", place + 1);
        rules.push(read_rule(node).map_err(|fault| fault.within(&context))?);
    }
    let origin = Origin {
        file: file.to_owned(),
        base: base.unwrap_or_else(|| Path::new("")).to_owned(),
        shape_lines: lines_of_shapes(text, &drafts),
    };
    let bodies = resolve(drafts, &sources, &config.limits, base)?;
    if let Some(node) = table.take("viewpoint") {
        let names: Vec<&str> = bodies.iter().map(|body| body.name.as_str()).collect();
        config.viewpoint = Some(read_viewpoint(node, &names)?);
    }
    Ok(Scene {
        frame_id: frame_id.unwrap_or_else(|| "world".to_owned()),
        config,
        sources,
        bodies,
        rules,
        origin,
    })
}

/// The tables of `[[what]]`; empty if the key is missing.
fn items(node: Option<Node>, what: &str) -> std::result::Result<Vec<Node>, Fault> {
    let Some(node) = node else {
        return Ok(Vec::new());
    };
    if matches!(node.value, Value::Table(_)) {
        let text = format!("`{what}` is one table: write [[{what}]] with double brackets");
        return Err(Fault::new(node.at, text));
    }
    list(node, what)
}

fn read_sources(node: Option<Node>) -> std::result::Result<Vec<SourceSpec>, Fault> {
    let mut sources: Vec<SourceSpec> = Vec::new();
    for node in items(node, "source")? {
        let at = node.at;
        let mut table = Table::open(
            node,
            "a source",
            &["name", "timeout_ms", "on_stale", "ros2"],
        )?;
        let at_name = table.at("name");
        let Some(name) = table.name("name", SOURCE_NAME_BYTES_MAX)? else {
            return Err(Fault::new(at, "a source needs `name`: add it"));
        };
        let shown = shortened(&name);
        if sources.iter().any(|known| known.name == name) {
            let text = format!("source \"{shown}\": this name is taken: give it another");
            return Err(Fault::new(at_name, text));
        }
        if sources.len() == limits::SOURCES_MAX {
            let text = format!(
                "source \"{shown}\" is one too many: a daemon has at most {}; let one client send for several",
                limits::SOURCES_MAX
            );
            return Err(Fault::new(at, text));
        }
        let timeout_ns = time_ns(&mut table, "timeout_ms", 1e-3)
            .map_err(|fault| fault.within(&format!("source \"{shown}\"")))?
            .unwrap_or(limits::TIMEOUT_MS_DEFAULT * 1_000_000);
        let on_stale = read_on_stale(&mut table)
            .map_err(|fault| fault.within(&format!("source \"{shown}\"")))?
            .unwrap_or_default();
        let ros2 = read_ros(table.take("ros2"))
            .map_err(|fault| fault.within(&format!("source \"{shown}\"")))?;
        sources.push(SourceSpec {
            name,
            timeout_ns,
            on_stale,
            ros2,
        });
    }
    Ok(sources)
}

/// Reads a time, milliseconds in the file, as nanoseconds.
pub(crate) fn time_ns(
    table: &mut Table,
    key: &str,
    min_ms: f64,
) -> std::result::Result<Option<u64>, Fault> {
    let ms = table.number_within(key, min_ms, TIME_MS_MAX)?;
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to a day, checked above"
    )]
    Ok(ms.map(|ms| (ms * 1e6).round() as u64))
}

fn read_limits(node: Option<Node>) -> std::result::Result<Limits, Fault> {
    let mut all = Limits::default();
    let Some(node) = node else {
        return Ok(all);
    };
    let mut table = Table::open(node, "[limits]", LIMIT_KEYS)?;
    for (key, slot, max) in [
        ("bodies", &mut all.bodies, limits::BODIES_MAX),
        ("pairs", &mut all.pairs, u32::MAX as usize - 1),
        ("pair_rows", &mut all.pair_rows, limits::ROWS_MAX),
        ("contact_rows", &mut all.contact_rows, limits::ROWS_MAX),
        ("region_rows", &mut all.region_rows, limits::ROWS_MAX),
        (
            "contacts_per_pair",
            &mut all.contacts_per_pair,
            limits::CONTACTS_PER_PAIR_MAX,
        ),
    ] {
        if let Some(given) = table.whole(key, 1, max as u64)? {
            *slot = usize::try_from(given).unwrap_or(max);
        }
    }
    Ok(all)
}

fn read_run(
    node: Option<Node>,
    limits: Limits,
    sources: &[SourceSpec],
) -> std::result::Result<Config, Fault> {
    let mut config = Config {
        limits,
        ..Config::default()
    };
    let Some(node) = node else {
        return Ok(config);
    };
    let mut table = Table::open(node, "[run]", RUN_KEYS)?;
    if let Some(mode) = read_mode(&mut table, sources)? {
        config.mode = mode;
    }
    config.budget = Budget {
        time_ns: time_ns(&mut table, "budget_ms", 0.0)?,
        units: table.whole("budget_units", 0, i64::MAX.unsigned_abs())?,
    };
    if let Some(heartbeat_ns) = time_ns(&mut table, "heartbeat_ms", 1.0)? {
        config.heartbeat_ns = heartbeat_ns;
    }
    if let Some(late_ns) = time_ns(&mut table, "late_ms", 0.0)? {
        config.late_ns = late_ns;
    }
    if let Some(reach_m) = table.number_within("stale_reach_m", 0.0, limits::EXTENT_MAX_M)? {
        config.stale_reach_m = reach_m;
    }
    config.broad_phase = read_named(&mut table, "broad_phase", BroadMethod::NAMED)?;
    let threads = table.whole("threads", 1, limits::THREADS_MAX as u64)?;
    config.threads = threads.and_then(|threads| usize::try_from(threads).ok());
    config.mesh_search = read_named(&mut table, "mesh_search", MeshSearch::NAMED)?;
    Ok(config)
}

/// `"auto"`, or the name of a method.
fn read_named<T: Copy>(
    table: &mut Table,
    key: &str,
    named: &[(T, &str)],
) -> std::result::Result<Option<T>, Fault> {
    let at = table.at(key);
    let Some(word) = table.text(key)? else {
        return Ok(None);
    };
    if word == "auto" {
        return Ok(None);
    }
    let unknown = || {
        let names: Vec<_> = named.iter().map(|(_, name)| *name).collect();
        let text = format!(
            "{key} is \"{}\": write \"auto\" or one of {}",
            shortened(&word),
            names.join(", ")
        );
        Fault::new(at, text)
    };
    let found = named.iter().find(|(_, name)| *name == word);
    found.map(|(method, _)| Some(*method)).ok_or_else(unknown)
}

/// `mode = "on_all"`, `on_frame = "SOURCE"` or `rate = HZ`; one of them.
fn read_mode(
    table: &mut Table,
    sources: &[SourceSpec],
) -> std::result::Result<Option<Mode>, Fault> {
    let given: Vec<&str> = ["mode", "on_frame", "rate"]
        .into_iter()
        .filter(|key| table.has(key))
        .collect();
    if let [first, second, ..] = given[..] {
        let text = format!("`{second}` beside `{first}`: keep one of mode, on_frame, rate");
        return Err(Fault::new(table.at(second), text));
    }
    let at = given.first().and_then(|key| table.at(key));
    if let Some(word) = table.text("mode")? {
        if word == "on_all" {
            return Ok(Some(Mode::OnAll));
        }
        let text = format!(
            "mode is \"{}\": write mode = \"on_all\", on_frame = \"SOURCE\" or rate = HZ",
            shortened(&word)
        );
        return Err(Fault::new(at, text));
    }
    if let Some(name) = table.name("on_frame", SOURCE_NAME_BYTES_MAX)? {
        if let Some(source) = sources.iter().find(|source| source.name == name) {
            if source.ros2.is_some() {
                return Err(Fault::new(at, no_lockstep(&name)));
            }
            return Ok(Some(Mode::OnFrame(name)));
        }
        let known: Vec<&str> = sources.iter().map(|s| s.name.as_str()).collect();
        let text = format!(
            "on_frame names source \"{}\", which is not there: {}",
            shortened(&name),
            mend_name(&name, &known, "[[source]]")
        );
        return Err(Fault::new(at, text));
    }
    Ok(table
        .number_within("rate", limits::RATE_HZ_MIN, limits::RATE_HZ_MAX)?
        .map(Mode::Rate))
}
