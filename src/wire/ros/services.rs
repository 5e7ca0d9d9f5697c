//! `sweepd_msgs/srv`: requests and responses, field by field, with the `shape_msgs` that a body is put with.

use serde::{Deserialize, Serialize};

use super::common::{Point, Pose, Vector3};
use super::sweepd::TickHeader;

/// `geometry_msgs/Point32`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point32 {
    /// Along x, metres.
    pub x: f32,
    /// Along y, metres.
    pub y: f32,
    /// Along z, metres.
    pub z: f32,
}

/// `shape_msgs/SolidPrimitive`; its `polygon` is one list of points.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SolidPrimitive {
    /// 1 box, 2 sphere, 3 cylinder, 4 cone, 5 prism.
    #[serde(rename = "type")]
    pub kind: u8,
    /// Metres, by kind.
    pub dimensions: Vec<f64>,
    /// Of prisms.
    pub polygon: Vec<Point32>,
}

/// `shape_msgs/MeshTriangle`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshTriangle {
    /// Places of its corners.
    pub vertex_indices: [u32; 3],
}

/// `shape_msgs/Mesh`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<MeshTriangle>,
    /// Corners, metres.
    pub vertices: Vec<Point>,
}

/// `sweepd_msgs/srv/PutBody`, request.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PutBody {
    /// Its name.
    pub name: String,
    /// The source that moves it; empty: the only one.
    pub source: String,
    /// Whether it moves.
    pub moves: bool,
    /// Where it stands.
    pub pose: Pose,
    /// Boxes, spheres, cylinders, cones.
    pub primitives: Vec<SolidPrimitive>,
    /// Their poses in the body's frame.
    pub primitive_poses: Vec<Pose>,
    /// Triangle meshes.
    pub meshes: Vec<Mesh>,
    /// Their poses in the body's frame.
    pub mesh_poses: Vec<Pose>,
    /// Other keys of a scene file's body, a JSON object; empty: none.
    pub options_json: String,
}

/// `sweepd_msgs/srv/RemoveBody`, request.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RemoveBody {
    /// Its name.
    pub name: String,
}

/// `sweepd_msgs/srv/EnableBody`, request.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EnableBody {
    /// Its name.
    pub name: String,
    /// Whether it takes part.
    pub enabled: bool,
}

/// `sweepd_msgs/srv/AttachBody`, request.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AttachBody {
    /// Its name.
    pub name: String,
    /// The body to hang it on; empty: it is let go.
    pub to: String,
    /// Whether it hangs where it is now.
    pub keep_pose: bool,
    /// Its pose in the frame of `to`.
    pub pose: Pose,
}

/// `sweepd_msgs/srv/SetFilter`, request.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetFilter {
    /// 0 masks, 1 ignore, 2 check, 3 drop.
    pub action: u8,
    /// A body, or a pattern.
    pub a: String,
    /// The other side of a rule.
    pub b: String,
    /// Why.
    pub reason: String,
    /// Groups it belongs to.
    pub group: u32,
    /// Groups it collides with.
    pub mask: u32,
}

impl SetFilter {
    /// Sets the group and mask of body `a`.
    pub const MASKS: u8 = 0;
    /// Adds a rule that ignores pairs.
    pub const IGNORE: u8 = 1;
    /// Adds a rule that checks pairs.
    pub const CHECK: u8 = 2;
    /// Takes out the rules of a pair.
    pub const DROP: u8 = 3;
}

/// `sweepd_msgs/srv/Reset`, request.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reset {
    /// Of this source only; empty: of all.
    pub source: String,
}

/// The response of every edit.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Edited {
    /// Whether it was done.
    pub success: bool,
    /// If not, why and what to change.
    pub message: String,
    /// What is odd, but legal.
    pub warnings: Vec<String>,
    /// Scene revision that has the change.
    pub scene_rev: u64,
}

/// `sweepd_msgs/srv/TickNow`, request: a message without fields has one on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TickNow {
    /// Nothing.
    pub structure_needs_at_least_one_member: u8,
}

/// `sweepd_msgs/srv/TickNow`, response.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ticked {
    /// Whether a tick was run.
    pub success: bool,
    /// If not, why.
    pub message: String,
    /// Which tick.
    pub tick_header: TickHeader,
    /// Its state as a word.
    pub word: String,
}

/// `sweepd_msgs/srv/Gap`, request.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Gap {
    /// Name of A.
    pub name_a: String,
    /// Name of B.
    pub name_b: String,
}

/// `sweepd_msgs/srv/Gap`, response.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapTold {
    /// Whether there is an answer.
    pub success: bool,
    /// If not, why; if so, what is odd about it.
    pub message: String,
    /// The tick whose poses were used.
    pub tick_header: TickHeader,
    /// `Verdict`; 0: there is no answer.
    pub verdict: u8,
    /// Finished, with 0 inside the rounding interval.
    pub touching: bool,
    /// Proved lower end, metres.
    pub gap_min_m: f64,
    /// Proved upper end, metres.
    pub gap_max_m: f64,
    /// Best estimate, metres; NaN: none.
    pub gap_best_m: f64,
    /// On A, scene frame, metres; NaN: none.
    pub point_a: Point,
    /// On B, scene frame, metres; NaN: none.
    pub point_b: Point,
    /// Unit, scene frame, from A to B; NaN: none.
    pub normal: Vector3,
}
