//! Questions to a running daemon. A question is the only key of its request and changes nothing.
//!
//! In: JSON with the keys of scene files. Out: a checked [`Question`]; whether its names are those of bodies is checked
//! when it is answered.
//!
//! ```json
//! { "gap": { "a": "box", "b": "part" } }
//! { "touching": { "body": "box", "position": [0, 0, 1], "orientation": [0, 0, 0, 1], "within_m": 0.05 } }
//! { "impact": { "a": "box", "b": "part", "linear_a": [1, 0, 0], "angular_b": [0, 0, 3], "within_s": 2 } }
//! { "ray": { "from": [0, 0, 1], "direction": [1, 0, 0], "max_m": 10, "mask": 1 } }
//! { "touching": { "shape": { "type": "sphere", "radius": 0.5 }, "position": [0, 0, 1], "group": 1, "mask": 6 } }
//! ```

use crate::limits::{COORDINATE_MAX_M, EXTENT_MAX_M, RAY_MAX_M};
use crate::math::Pose;
use crate::scene::PlacedSpec;
use crate::scene::node::{Fault, Node, Value};
use crate::scene::read_body::{BODY_NAME_BYTES_MAX, read_all_shapes};
use crate::scene::read_shape::read_pose;
use crate::scene::request::need_name;
use crate::scene::table::Table;

/// Largest component of a velocity in a question, metres per second: a larger one is a mistake.
const SPEED_MAX_MPS: f64 = 1e6;
/// Largest component of an angular velocity in a question, radians per second: a larger one is a mistake.
const SPIN_MAX_RADPS: f64 = 1e6;
/// Longest time ahead in a question, seconds: no motion is known for longer.
const WITHIN_MAX_S: f64 = 1e5;

/// The keys that are questions.
pub(super) const QUESTIONS: &[&str] = &["gap", "touching", "ray", "impact"];

/// A question to a running daemon.
#[derive(Clone, Debug, PartialEq)]
pub enum Question {
    /// The gap of two bodies.
    Gap {
        /// Name of one body.
        a: String,
        /// Name of the other body.
        b: String,
    },
    /// What a body or a shape touches, or would touch.
    Touching(Touching),
    /// What a ray hits first.
    Ray(Ray),
    /// When two bodies touch first.
    Impact(Impact),
}

/// Two bodies and their velocities.
#[derive(Clone, Debug, PartialEq)]
pub struct Impact {
    /// Name of one body.
    pub a: String,
    /// Name of the other body.
    pub b: String,
    /// Velocity of `a`.
    pub velocity_a: Velocity,
    /// Velocity of `b`.
    pub velocity_b: Velocity,
    /// Time ahead that is searched, seconds.
    pub within_s: f64,
}

/// Velocity of a body; a missing part is taken from its source.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity {
    /// Velocity of its frame's origin, scene frame, metres per second.
    pub linear: Option<[f64; 3]>,
    /// Angular velocity, scene frame, radians per second.
    pub angular: Option<[f64; 3]>,
}

/// A ray.
#[derive(Clone, Debug, PartialEq)]
pub struct Ray {
    /// Its start, scene frame, metres.
    pub from: [f64; 3],
    /// Its direction, scene frame; any length except 0.
    pub direction: [f64; 3],
    /// Its length, metres.
    pub max_m: f64,
    /// Only bodies in one of these groups are tested.
    pub mask: u32,
}

/// What touches a body or a shape, or would if it were at a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Touching {
    /// The body or shapes.
    pub subject: Subject,
    /// Its pose in the scene's frame; `None`: the body's current pose, or the identity for shapes.
    pub pose: Option<Pose>,
    /// Bodies nearer than this are reported too, metres.
    pub within_m: f64,
    /// Whether the scene's filters apply.
    pub filters: bool,
}

/// What is tested at a pose.
#[derive(Clone, Debug, PartialEq)]
pub enum Subject {
    /// Name of a body of the scene; the bodies attached to it are included.
    Body(String),
    /// Shapes that belong to no body.
    Shapes {
        /// At least one.
        shapes: Vec<PlacedSpec>,
        /// Groups it belongs to.
        group: u32,
        /// Groups it collides with.
        mask: u32,
    },
}

impl Question {
    /// The shapes that must be built before it can be answered.
    #[must_use]
    pub fn shapes(&self) -> &[PlacedSpec] {
        match self {
            Self::Touching(Touching {
                subject: Subject::Shapes { shapes, .. },
                ..
            }) => shapes,
            _ => &[],
        }
    }
}

/// Reads the value of a question's key.
///
/// * `blobs` - the bytes after the JSON of the request.
pub(super) fn read_question(kind: &str, node: Node, blobs: &[u8]) -> Result<Question, Fault> {
    match kind {
        "touching" => read_touching(node, blobs).map(Question::Touching),
        "ray" => read_ray(node).map(Question::Ray),
        "impact" => read_impact(node).map(Question::Impact),
        _ => read_gap(node),
    }
}

fn read_gap(node: Node) -> Result<Question, Fault> {
    let mut table = Table::open(node, "this question", &["a", "b"])?;
    Ok(Question::Gap {
        a: need_name(&mut table, "a")?,
        b: need_name(&mut table, "b")?,
    })
}

fn read_touching(node: Node, blobs: &[u8]) -> Result<Touching, Fault> {
    let keys = &[
        "body",
        "shape",
        "position",
        "orientation",
        "within_m",
        "filters",
        "group",
        "mask",
    ];
    let mut table = Table::open(node, "this question", keys)?;
    let has_pose = table.has("position") || table.has("orientation");
    if table.has("body") && table.has("orientation") && !table.has("position") {
        let text = "`orientation` without `position`: say where the body is to be";
        return Err(Fault::new(None, text));
    }
    let subject = read_subject(&mut table, blobs)?;
    let pose = read_pose(&mut table)?;
    Ok(Touching {
        subject,
        pose: has_pose.then_some(pose),
        within_m: table
            .number_within("within_m", 0.0, EXTENT_MAX_M)?
            .unwrap_or_default(),
        filters: table.flag("filters")?.unwrap_or(true),
    })
}

fn read_ray(node: Node) -> Result<Ray, Fault> {
    let keys = &["from", "direction", "max_m", "mask"];
    let mut table = Table::open(node, "this question", keys)?;
    let mut need = |key: &str| {
        let triple = table.triple(key)?;
        triple.ok_or_else(|| Fault::new(None, format!("`{key}` is missing: write [x, y, z]")))
    };
    let (from, direction) = (need("from")?, need("direction")?);
    if let Some(far) = from.iter().find(|x| x.abs() > COORDINATE_MAX_M) {
        let text = format!("from holds {far:e} m: stay within {COORDINATE_MAX_M:e} m");
        return Err(Fault::new(None, text));
    }
    if direction.iter().all(|x| *x == 0.0) {
        let text = "direction is all 0: write where the ray goes";
        return Err(Fault::new(None, text));
    }
    Ok(Ray {
        from,
        direction,
        max_m: table
            .number_within("max_m", 0.0, RAY_MAX_M)?
            .unwrap_or(RAY_MAX_M),
        mask: table.bits("mask")?.unwrap_or(u32::MAX),
    })
}

fn read_impact(node: Node) -> Result<Impact, Fault> {
    let keys = &[
        "a",
        "b",
        "linear_a",
        "angular_a",
        "linear_b",
        "angular_b",
        "within_s",
    ];
    let mut table = Table::open(node, "this question", keys)?;
    let mut velocity = |key: &str, most: f64| {
        let triple = table.triple(key)?;
        let far = triple.and_then(|v| v.into_iter().find(|x| x.abs() > most));
        match far {
            Some(far) => {
                let text = format!("{key} holds {far:e}: stay within {most:e}");
                Err(Fault::new(None, text))
            }
            None => Ok(triple),
        }
    };
    let velocity_a = Velocity {
        linear: velocity("linear_a", SPEED_MAX_MPS)?,
        angular: velocity("angular_a", SPIN_MAX_RADPS)?,
    };
    let velocity_b = Velocity {
        linear: velocity("linear_b", SPEED_MAX_MPS)?,
        angular: velocity("angular_b", SPIN_MAX_RADPS)?,
    };
    let within_s = table.number_within("within_s", 1e-9, WITHIN_MAX_S)?;
    Ok(Impact {
        a: need_name(&mut table, "a")?,
        b: need_name(&mut table, "b")?,
        velocity_a,
        velocity_b,
        within_s: within_s.unwrap_or(1.0),
    })
}

fn read_subject(table: &mut Table, blobs: &[u8]) -> Result<Subject, Fault> {
    let (group, mask) = (table.bits("group")?, table.bits("mask")?);
    let name = table.name("body", BODY_NAME_BYTES_MAX)?;
    match (name, table.take("shape")) {
        (Some(_), None) if group.is_some() || mask.is_some() => Err(Fault::new(
            None,
            "`group` and `mask` are for a `shape`: a body has its own",
        )),
        (Some(name), None) => Ok(Subject::Body(name)),
        (None, Some(Node { at, value })) => {
            let nodes = match value {
                Value::List(nodes) => nodes,
                value => vec![Node { at, value }],
            };
            if nodes.is_empty() {
                return Err(Fault::new(at, "`shape` is an empty list: write a shape"));
            }
            Ok(Subject::Shapes {
                shapes: read_all_shapes(nodes, at, Some(blobs))?,
                group: group.unwrap_or(1),
                mask: mask.unwrap_or(u32::MAX),
            })
        }
        (Some(_), Some(_)) => Err(Fault::new(
            None,
            "`body` and `shape` are both given: keep one",
        )),
        (None, None) => Err(Fault::new(
            None,
            "neither `body` nor `shape` is given: name a body, or write a shape",
        )),
    }
}
