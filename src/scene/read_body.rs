//! Reads one body as a user writes it: in a scene file's `[[body]]`, or in the `put` of a request.

use crate::config::OnStale;
use crate::ids::BodyId;
use crate::limits::{EXTENT_MAX_M, EXTENT_MIN_M, PRIORITY_MAX, PRIORITY_MIN, SHAPES_PER_BODY_MAX};
use crate::math::Pose;
use crate::scene::node::{Fault, Node, Value};
use crate::scene::read_ros::read_topic;
use crate::scene::read_shape::{read_pose, read_shape};
use crate::scene::table::{Table, shortened};
use crate::scene::{BodySpec, PlacedSpec};
use crate::shape::ShapeSpec;

/// Longest name of a body, bytes: what a row of `names` holds.
pub const BODY_NAME_BYTES_MAX: usize = 104;
/// Longest name of a source, bytes.
pub const SOURCE_NAME_BYTES_MAX: usize = 31;

/// Longest name of a frame or topic of ROS 2, bytes.
pub(crate) const ROS_NAME_BYTES_MAX: usize = 255;

/// A body as written: checked by itself, its references not yet resolved.
#[derive(Debug)]
pub struct BodyDraft {
    /// Its properties. `source` is `None`, and an id that was not given is 0, until they are resolved.
    pub(crate) spec: BodySpec,
    /// Its source, by name.
    pub(crate) source: Option<String>,
    /// Byte offsets of its keys in the file.
    pub(crate) places: Places,
}

/// Byte offsets of the keys that messages refer to; all `None` in a request.
#[derive(Debug, Default)]
pub(crate) struct Places {
    pub(crate) name: Option<usize>,
    pub(crate) id: Option<usize>,
    pub(crate) source: Option<usize>,
    pub(crate) ros: Option<usize>,
    pub(crate) parent: Option<usize>,
    pub(crate) attached_to: Option<usize>,
    pub(crate) shapes: Vec<Option<usize>>,
}

const KEYS: &[&str] = &[
    "name",
    "id",
    "position",
    "orientation",
    "moves",
    "deforms",
    "continuous",
    "teleport_m",
    "source",
    "ros_frame",
    "ros_topic",
    "group",
    "mask",
    "parent",
    "attached_to",
    "rigid_group",
    "report_within_m",
    "max_speed_mps",
    "priority",
    "on_stale",
    "enabled",
    "shape",
];

/// The body in messages: its name, or its position in the list, from 1.
pub(crate) fn title(node: &Node, nth: usize) -> String {
    match node.peek_text("name") {
        Some(name) => format!("body \"{}\"", shortened(name)),
        None => format!("body number {nth}"),
    }
}

/// Reads a body.
///
/// * `blobs` - the bytes after the JSON of a request; `None` for a scene file.
pub(crate) fn read_body(node: Node, blobs: Option<&[u8]>) -> Result<BodyDraft, Fault> {
    let at = node.at;
    let mut table = Table::open(node, "a body", KEYS)?;
    let deforms_at = table.at("deforms");
    let mut places = Places {
        name: table.at("name"),
        id: table.at("id"),
        source: table.at("source"),
        ros: ["ros_frame", "ros_topic"]
            .into_iter()
            .find(|key| table.has(key))
            .and_then(|key| table.at(key)),
        parent: table.at("parent"),
        attached_to: table.at("attached_to"),
        shapes: Vec::new(),
    };
    let Some(name) = table.name("name", BODY_NAME_BYTES_MAX)? else {
        return Err(Fault::new(at, "a body needs `name`: add it"));
    };
    // Ids may be larger than i64 holds.
    let id = table.whole("id", 1, u64::MAX)?.unwrap_or(0);
    let pose = read_pose(&mut table)?;
    let moves = table.flag("moves")?.unwrap_or(true);
    let source = table.name("source", SOURCE_NAME_BYTES_MAX)?;
    let parent = table.name("parent", BODY_NAME_BYTES_MAX)?;
    let attached_to = table.name("attached_to", BODY_NAME_BYTES_MAX)?;
    if !moves && source.is_some() {
        let text =
            "a body with moves = false takes no source: remove `source`, or write moves = true";
        return Err(Fault::new(places.source, text));
    }
    let shapes = read_shapes(&mut table, at, blobs, &mut places)?;
    let plain = BodySpec::new(name, BodyId(id), shapes);
    let spec = BodySpec {
        pose,
        moves,
        deforms: table.flag("deforms")?.unwrap_or(plain.deforms),
        continuous: table.flag("continuous")?.unwrap_or(plain.continuous),
        teleport_m: table.number_within("teleport_m", EXTENT_MIN_M, EXTENT_MAX_M)?,
        ros_frame: table.name("ros_frame", ROS_NAME_BYTES_MAX)?,
        ros_topic: read_topic(&mut table, "ros_topic")?,
        group: table.bits("group")?.unwrap_or(plain.group),
        mask: table.bits("mask")?.unwrap_or(plain.mask),
        parent,
        attached_to,
        rigid_group: table.name("rigid_group", BODY_NAME_BYTES_MAX)?,
        report_within_m: table
            .number_within("report_within_m", 0.0, EXTENT_MAX_M)?
            .unwrap_or(plain.report_within_m),
        max_speed_mps: table.number_within("max_speed_mps", 0.0, EXTENT_MAX_M)?,
        priority: table
            .number_within("priority", PRIORITY_MIN, PRIORITY_MAX)?
            .unwrap_or(plain.priority),
        on_stale: read_on_stale(&mut table)?,
        enabled: table.flag("enabled")?.unwrap_or(plain.enabled),
        ..plain
    };
    check_deforms(&spec).map_err(|text| Fault::new(deforms_at, text))?;
    Ok(BodyDraft {
        spec,
        source,
        places,
    })
}

/// Checks that a deforming body has no property that excludes deforming.
fn check_deforms(spec: &BodySpec) -> Result<(), &'static str> {
    if !spec.deforms {
        return Ok(());
    }
    match spec.shapes.as_slice() {
        [one] if !matches!(one.shape, ShapeSpec::Trimesh { .. }) => Err(
            "deforms = true is for a body whose shape is a trimesh: give one, or remove `deforms`",
        ),
        [one] if one.pose != Pose::identity() => Err(
            "deforms = true, and its shape has a position or orientation: vertices are in the body's frame, remove it",
        ),
        [_] => Ok(()),
        _ => Err("deforms = true is for a body of one shape: split it into several bodies"),
    }?;
    if !spec.moves {
        return Err("deforms = true, but nobody may move it: remove moves = false");
    }
    if spec.continuous {
        return Err(
            "deforms = true and continuous = true: a body that deforms is not swept, let what meets it be continuous",
        );
    }
    if spec.attached_to.is_some() {
        return Err(
            "deforms = true and attached_to: its source sends its vertices, so it hangs on no other; remove one",
        );
    }
    Ok(())
}

/// Reads what happens to stale bodies.
pub(super) fn read_on_stale(table: &mut Table) -> Result<Option<OnStale>, Fault> {
    let at = table.at("on_stale");
    let Some(word) = table.text("on_stale")? else {
        return Ok(None);
    };
    match word.as_str() {
        "unknown" => Ok(Some(OnStale::Unknown)),
        "hold" => Ok(Some(OnStale::Hold)),
        "remove" => Ok(Some(OnStale::Remove)),
        _ => {
            let text = format!(
                "on_stale is \"{}\": write \"unknown\", \"hold\" or \"remove\"",
                shortened(&word)
            );
            Err(Fault::new(at, text))
        }
    }
}

/// One shape, or a list of them.
fn read_shapes(
    table: &mut Table,
    body_at: Option<usize>,
    blobs: Option<&[u8]>,
    places: &mut Places,
) -> Result<Vec<PlacedSpec>, Fault> {
    let missing = "a body needs at least one shape: add shape = { type = \"sphere\", radius = 0.1 }, or [[body.shape]]";
    let Some(node) = table.take("shape") else {
        return Err(Fault::new(body_at, missing));
    };
    let at = node.at;
    let nodes = match node.value {
        Value::List(nodes) => nodes,
        value => vec![Node { at, value }],
    };
    if nodes.is_empty() {
        return Err(Fault::new(at, missing));
    }
    places.shapes.extend(nodes.iter().map(|node| node.at));
    read_all_shapes(nodes, at, blobs)
}

/// Shapes of one body.
pub(crate) fn read_all_shapes(
    nodes: Vec<Node>,
    at: Option<usize>,
    blobs: Option<&[u8]>,
) -> Result<Vec<PlacedSpec>, Fault> {
    if nodes.len() > SHAPES_PER_BODY_MAX {
        let text = format!(
            "{} shapes, more than {SHAPES_PER_BODY_MAX}: split the body",
            nodes.len()
        );
        return Err(Fault::new(at, text));
    }
    let several = nodes.len() > 1;
    let mut shapes = Vec::with_capacity(nodes.len());
    for (place, node) in nodes.into_iter().enumerate() {
        let shape = read_shape(node, blobs).map_err(|fault| {
            if several {
                fault.within(&format!("shape {}", place + 1))
            } else {
                fault
            }
        })?;
        shapes.push(shape);
    }
    Ok(shapes)
}
