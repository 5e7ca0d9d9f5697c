//! Requests to edit a running scene: JSON with the keys of scene files, followed by binary geometry.
//!
//! In: the JSON of a request and the bytes after it. Out: checked edits, in order. References to bodies and sources of
//! the scene are checked when the edits are applied; either all edits are applied or none.
//!
//! ```json
//! { "edits": [
//!     { "put": { "name": "box", "source": "sim", "shape": { "type": "box", "half_extents": [1, 1, 1] } } },
//!     { "put": { "name": "part", "moves": false, "shape": { "type": "trimesh",
//!         "vertices_blob": { "offset": 0, "count": 8 }, "faces_blob": { "offset": 192, "count": 12 } } } },
//!     { "remove": "old" },
//!     { "enable": { "body": "box", "enabled": false } },
//!     { "filter": { "body": "box", "group": 1, "mask": 4294967295 } },
//!     { "margin": { "body": "box", "report_within_m": 0.2 } },
//!     { "rule": { "action": "ignore", "a": "box", "b": "part", "reason": "glued" } },
//!     { "drop_rules": { "a": "box", "b": "part" } },
//!     { "attach": { "body": "box", "to": "part", "position": [0, 0, 1] } },
//!     { "detach": "box" },
//!     { "reset": { "source": "sim" } }
//! ] }
//! ```
//!
//! `{ "validate": true }`, alone or together with `edits`, makes the daemon check every structure before the next tick
//! and rebuild those that are inconsistent; the answer's warnings list them.
//!
//! A request may instead be one question, which changes nothing: see `question`.
//!
//! A blob is `count` rows, starting `offset` bytes after the JSON, little-endian: three f64 per vertex, three u32 per
//! face.

use std::path::Path;

use crate::error::nearest;
use crate::limits::EXTENT_MAX_M;
use crate::math::Pose;
use crate::scene::node::{Fault, Node, Value};
use crate::scene::question::{QUESTIONS, Question, read_question};
use crate::scene::read_body::{
    BODY_NAME_BYTES_MAX, BodyDraft, SOURCE_NAME_BYTES_MAX, read_body, title,
};
use crate::scene::read_ros::check_ros;
use crate::scene::read_rule::read_rule;
use crate::scene::read_shape::read_pose;
use crate::scene::resolve::{check_files, settle_source};
use crate::scene::table::{Table, list, shortened};
use crate::scene::{BodySpec, PairRule, SourceSpec};

/// Most edits in one request; more must be sent in several requests.
pub const EDITS_MAX: usize = 1 << 17;

/// A client's request to a running daemon.
#[derive(Debug)]
pub enum Request {
    /// To change the scene.
    Edits(EditRequest),
    /// A question that changes nothing.
    Ask(Question),
}

/// Edits that are applied all together or not at all.
#[derive(Debug)]
pub struct EditRequest {
    /// In order.
    pub edits: Vec<Edit>,
    /// Check every structure first, and rebuild those that are inconsistent.
    pub validate: bool,
}

/// One change of the scene, checked except for its references to the scene.
///
/// * `P` - the body to put: as read, or built, as the engine takes it.
#[derive(Clone, Debug)]
pub enum Edit<P = Box<BodyDraft>> {
    /// Adds a body, or replaces the one of the same name. Equal content changes nothing.
    Put(P),
    /// Removes a body.
    Remove {
        /// Its name.
        name: String,
    },
    /// Enables or disables a body.
    Enable {
        /// Its name.
        name: String,
        /// Whether it takes part.
        enabled: bool,
    },
    /// Sets a body's group and mask.
    Filter {
        /// Its name.
        name: String,
        /// Groups it belongs to; `None`: unchanged.
        group: Option<u32>,
        /// Groups it collides with; `None`: unchanged.
        mask: Option<u32>,
    },
    /// Sets the distance below which a pair is reported as near.
    Margin {
        /// The body's name; `None`: every present body.
        name: Option<String>,
        /// Distance, metres; `None`: the value the body was put with.
        report_within_m: Option<f64>,
    },
    /// Adds a pair rule after all others, so that it takes precedence.
    Rule(PairRule),
    /// Removes every pair rule with these two sides, in either order.
    DropRules {
        /// One side, as written in the rule.
        a: String,
        /// The other side.
        b: String,
    },
    /// Attaches a body to another, or detaches it.
    Attach {
        /// Its name.
        name: String,
        /// Name of the body to attach it to; `None`: detach it.
        to: Option<String>,
        /// Its pose in that body's frame; `None`: its current pose.
        pose: Option<Pose>,
    },
    /// Forgets poses: pairs end, and the poses of moving bodies are unknown until they are received again.
    Reset {
        /// Only for the bodies of this source; `None`: for all bodies.
        source: Option<String>,
    },
}

impl Request {
    /// Reads a request.
    ///
    /// * `json` - the JSON at the start of the payload.
    /// * `blobs` - the bytes after it.
    ///
    /// # Errors
    /// A text that names the edit, the body, what is wrong and what to change.
    pub fn parse(json: &[u8], blobs: &[u8]) -> Result<Self, String> {
        read(json, blobs).map_err(|fault| fault.text)
    }
}

impl<P> Edit<P> {
    /// Converts the body that the edit puts, if any.
    ///
    /// # Errors
    /// The error of `build`.
    pub fn build<Q, E>(self, build: impl FnOnce(P) -> Result<Q, E>) -> Result<Edit<Q>, E> {
        Ok(match self {
            Self::Put(put) => Edit::Put(build(put)?),
            Self::Remove { name } => Edit::Remove { name },
            Self::Enable { name, enabled } => Edit::Enable { name, enabled },
            Self::Filter { name, group, mask } => Edit::Filter { name, group, mask },
            Self::Margin {
                name,
                report_within_m,
            } => Edit::Margin {
                name,
                report_within_m,
            },
            Self::Rule(rule) => Edit::Rule(rule),
            Self::DropRules { a, b } => Edit::DropRules { a, b },
            Self::Attach { name, to, pose } => Edit::Attach { name, to, pose },
            Self::Reset { source } => Edit::Reset { source },
        })
    }
}

impl BodyDraft {
    /// The body, with its source resolved and its mesh files found; an id that was not given stays 0.
    ///
    /// * `sources` - of the running scene.
    /// * `base` - the folder that mesh files are relative to; `None`: they are not looked for.
    ///
    /// # Errors
    /// A text that names the body, what is wrong and what to change.
    pub fn settle(
        mut self,
        sources: &[SourceSpec],
        base: Option<&Path>,
    ) -> Result<BodySpec, String> {
        settle_source(&mut self, sources)
            .and_then(|()| check_ros(&self, sources, &mut std::collections::BTreeMap::new()))
            .and_then(|()| match base {
                Some(base) => check_files(&self, base, &mut std::collections::BTreeSet::new()),
                None => Ok(()),
            })
            .map_err(|fault| fault.text)?;
        Ok(self.spec)
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.spec.name
    }
}

fn read(json: &[u8], blobs: &[u8]) -> Result<Request, Fault> {
    let keys = [&["edits", "validate"], QUESTIONS].concat();
    let mut table = Table::open(Node::from_json(json)?, "a request", &keys)?;
    if let Some(kind) = QUESTIONS.iter().find(|kind| table.has(kind)) {
        if table.places().count() > 1 {
            let text = format!("`{kind}` is not alone: ask for it in a request of its own");
            return Err(Fault::new(None, text));
        }
        let question = read_question(kind, table.need(kind)?, blobs);
        return question
            .map(Request::Ask)
            .map_err(|fault| fault.within(kind));
    }
    let validate = table.flag("validate")?.unwrap_or(false);
    if !table.has("edits") {
        let text = format!(
            "a request has none of `edits`, `validate`, `{}`: add one",
            QUESTIONS.join("`, `")
        );
        return if validate {
            Ok(Request::Edits(EditRequest {
                edits: Vec::new(),
                validate,
            }))
        } else {
            Err(Fault::new(None, text))
        };
    }
    let nodes = list(table.need("edits")?, "edits")?;
    if nodes.is_empty() || nodes.len() > EDITS_MAX {
        let text = format!("edits has {} edits: write 1 to {EDITS_MAX}", nodes.len());
        return Err(Fault::new(None, text));
    }
    let mut edits = Vec::with_capacity(nodes.len());
    for (place, node) in nodes.into_iter().enumerate() {
        let edit = read_edit(node, blobs);
        edits.push(edit.map_err(|fault| fault.within(&format!("edit {}", place + 1)))?);
    }
    Ok(Request::Edits(EditRequest { edits, validate }))
}

const VERBS: &[&str] = &[
    "put",
    "remove",
    "enable",
    "filter",
    "margin",
    "rule",
    "drop_rules",
    "attach",
    "detach",
    "reset",
];

fn read_edit(node: Node, blobs: &[u8]) -> Result<Edit, Fault> {
    let mend = format!("write one of {}", VERBS.join(", "));
    let Value::Table(entries) = node.value else {
        let text = format!("an edit is a table with one key: {mend}");
        return Err(Fault::new(None, text));
    };
    let count = entries.len();
    let Ok([entry]) = <[_; 1]>::try_from(entries) else {
        let text = format!("an edit has one key, this one has {count}: {mend}");
        return Err(Fault::new(None, text));
    };
    let verb = entry.key.as_str();
    let fault_within = |fault: Fault| fault.within(verb);
    match verb {
        "put" => {
            let title = title(&entry.node, 1);
            return read_body(entry.node, Some(blobs))
                .map(|draft| Edit::Put(Box::new(draft)))
                .map_err(|fault| fault.within(&title));
        }
        "rule" => read_rule(entry.node).map(Edit::Rule),
        "remove" => plain_name(entry.node).map(|name| Edit::Remove { name }),
        "detach" => plain_name(entry.node).map(|name| Edit::Attach {
            name,
            to: None,
            pose: None,
        }),
        "enable" => read_enable(entry.node),
        "filter" => read_filter(entry.node),
        "margin" => read_margin(entry.node),
        "drop_rules" => read_drop(entry.node),
        "attach" => read_attach(entry.node),
        "reset" => {
            let source = Table::open(entry.node, "this edit", &["source"])
                .and_then(|mut table| table.name("source", SOURCE_NAME_BYTES_MAX));
            source.map(|source| Edit::Reset { source })
        }
        _ => {
            let mend = match nearest(verb, VERBS) {
                Some(nearest) => format!("did you mean `{nearest}`?"),
                None => mend,
            };
            let text = format!("there is no edit `{}`: {mend}", shortened(verb));
            return Err(Fault::new(None, text));
        }
    }
    .map_err(fault_within)
}

/// A value that is a body's name.
fn plain_name(node: Node) -> Result<String, Fault> {
    let text = match node.value {
        Value::Text(name) if (1..=BODY_NAME_BYTES_MAX).contains(&name.len()) => return Ok(name),
        Value::Text(name) => format!("the name has {} bytes", name.len()),
        _ => format!("here stands {}", node.kind()),
    };
    let mend = format!("write a body's name, 1 to {BODY_NAME_BYTES_MAX} bytes");
    Err(Fault::new(None, format!("{text}: {mend}")))
}

pub(super) fn need_name(table: &mut Table, key: &str) -> Result<String, Fault> {
    let name = table.name(key, BODY_NAME_BYTES_MAX)?;
    name.ok_or_else(|| Fault::new(None, format!("`{key}` is missing: write a body's name")))
}

fn read_enable(node: Node) -> Result<Edit, Fault> {
    let mut table = Table::open(node, "this edit", &["body", "enabled"])?;
    let name = need_name(&mut table, "body")?;
    let enabled = table.flag("enabled")?;
    let text = "`enabled` is missing: write true or false";
    Ok(Edit::Enable {
        name,
        enabled: enabled.ok_or_else(|| Fault::new(None, text))?,
    })
}

fn read_filter(node: Node) -> Result<Edit, Fault> {
    let mut table = Table::open(node, "this edit", &["body", "group", "mask"])?;
    let name = need_name(&mut table, "body")?;
    let (group, mask) = (table.bits("group")?, table.bits("mask")?);
    if group.is_none() && mask.is_none() {
        let text = "neither `group` nor `mask` is given: add one";
        return Err(Fault::new(None, text));
    }
    Ok(Edit::Filter { name, group, mask })
}

fn read_margin(node: Node) -> Result<Edit, Fault> {
    let mut table = Table::open(node, "this edit", &["body", "report_within_m"])?;
    Ok(Edit::Margin {
        name: table.name("body", BODY_NAME_BYTES_MAX)?,
        report_within_m: table.number_within("report_within_m", 0.0, EXTENT_MAX_M)?,
    })
}

fn read_drop(node: Node) -> Result<Edit, Fault> {
    let mut table = Table::open(node, "this edit", &["a", "b"])?;
    Ok(Edit::DropRules {
        a: need_name(&mut table, "a")?,
        b: need_name(&mut table, "b")?,
    })
}

fn read_attach(node: Node) -> Result<Edit, Fault> {
    let keys = &["body", "to", "position", "orientation"];
    let mut table = Table::open(node, "this edit", keys)?;
    let name = need_name(&mut table, "body")?;
    let to = need_name(&mut table, "to")?;
    if name == to {
        let text = format!(
            "body \"{}\" cannot hang on itself: name another",
            shortened(&name)
        );
        return Err(Fault::new(None, text));
    }
    let has_pose = table.has("position") || table.has("orientation");
    let pose = read_pose(&mut table)?;
    Ok(Edit::Attach {
        name,
        to: Some(to),
        pose: has_pose.then_some(pose),
    })
}

#[cfg(test)]
mod tests;
