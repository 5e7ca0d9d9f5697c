//! The checked scene.

use std::path::PathBuf;

use crate::config::{Config, OnStale, RosSource};
use crate::ids::BodyId;
use crate::math::Pose;
use crate::shape::ShapeSpec;

/// A checked scene: names are unique, numbers finite, references resolve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// Name of the frame that all poses are given in.
    pub frame_id: String,
    /// Mode, budget, heartbeat, limits.
    pub config: Config,
    /// Sources, at most 16.
    pub sources: Vec<SourceSpec>,
    /// Bodies, in the order of the file.
    pub bodies: Vec<BodySpec>,
    /// Pair rules; the last one that matches applies.
    pub rules: Vec<PairRule>,
    /// Where it was read from; used for mesh paths and in messages.
    pub origin: Origin,
}

/// Where a scene was read from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Path of the file as shown in messages; empty if the scene was not read from a file.
    pub file: String,
    /// The folder that mesh files are relative to.
    pub base: PathBuf,
    /// `[body][shape]`, indexed as `Scene::bodies`: line of each shape, from 1. Bodies added later have no entry.
    pub shape_lines: Vec<Vec<u32>>,
}

/// A source: a client that sends frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceSpec {
    /// Unique, 1 to 31 bytes.
    pub name: String,
    /// After this time without a frame it is no longer alive and its bodies are stale, nanoseconds.
    pub timeout_ns: u64,
    /// What happens to its stale bodies, unless a body has its own setting.
    pub on_stale: OnStale,
    /// The ROS 2 topics it consists of; `None`: a client over shared memory or on `~/transforms`.
    pub ros2: Option<RosSource>,
}

/// A body.
#[derive(Clone, Debug, PartialEq)]
pub struct BodySpec {
    /// Unique, 1 to 104 bytes.
    pub name: String,
    /// Unique, never 0: as given, or else the least free one, assigned in the order of the file.
    pub id: BodyId,
    /// At least one.
    pub shapes: Vec<PlacedSpec>,
    /// Start pose in the scene's frame, or in the frame of the body it is attached to, if any.
    pub pose: Pose,
    /// Whether frames may move it. The pose of a moving body is unknown until a frame has given one.
    pub moves: bool,
    /// Whether its source sends vertices of its one triangle mesh.
    pub deforms: bool,
    /// Whether it is swept between its last two poses.
    pub continuous: bool,
    /// A longer step of its centre between two frames is a teleport and is not swept, metres; `None`: no step is one.
    pub teleport_m: Option<f64>,
    /// Index of its source in `Scene::sources`. `None` if it cannot move. An attached body may also have none; then no
    /// frame moves it after it is detached.
    pub source: Option<usize>,
    /// Its ROS 2 frame if its source is of kind `tf`; `None`: its name.
    pub ros_frame: Option<String>,
    /// Its topic if its source is of kind `pose` or `odometry`.
    pub ros_topic: Option<String>,
    /// Groups it belongs to, one bit each.
    pub group: u32,
    /// Groups it collides with.
    pub mask: u32,
    /// Name of its neighbour; the pair of the two is ignored by default.
    pub parent: Option<String>,
    /// Name of the body it is attached to, which determines its pose, its age and whether its pose is unknown.
    pub attached_to: Option<String>,
    /// Bodies of one rigid group never move relative to each other; their pairs are ignored.
    pub rigid_group: Option<String>,
    /// Pairs nearer than this are reported, metres.
    pub report_within_m: f64,
    /// Greatest speed of any of its surface points, metres per second.
    pub max_speed_mps: Option<f64>,
    /// Weight of its pairs in the order of work, `limits::PRIORITY_MIN` to `PRIORITY_MAX`; 1: the default.
    pub priority: f64,
    /// What happens when it is stale; `None`: the setting of its source.
    pub on_stale: Option<OnStale>,
    /// Whether it takes part in collision checks.
    pub enabled: bool,
}

impl BodySpec {
    /// A body with the defaults of a scene file for everything else, and without a source.
    #[must_use]
    pub fn new(name: String, id: BodyId, shapes: Vec<PlacedSpec>) -> Self {
        Self {
            name,
            id,
            shapes,
            pose: Pose::identity(),
            moves: true,
            deforms: false,
            continuous: false,
            teleport_m: None,
            source: None,
            ros_frame: None,
            ros_topic: None,
            group: 1,
            mask: u32::MAX,
            parent: None,
            attached_to: None,
            rigid_group: None,
            report_within_m: 0.0,
            max_speed_mps: None,
            priority: 1.0,
            on_stale: None,
            enabled: true,
        }
    }

    /// Returns whether the two are equal except for ids and shapes.
    #[must_use]
    pub(crate) fn reads_as(&self, other: &Self) -> bool {
        let Self {
            id: _,
            shapes: _,
            name,
            pose,
            moves,
            deforms,
            continuous,
            teleport_m,
            source,
            ros_frame,
            ros_topic,
            group,
            mask,
            parent,
            attached_to,
            rigid_group,
            report_within_m,
            max_speed_mps,
            priority,
            on_stale,
            enabled,
        } = self;
        *name == other.name
            && *pose == other.pose
            && *moves == other.moves
            && *deforms == other.deforms
            && *continuous == other.continuous
            && *teleport_m == other.teleport_m
            && *source == other.source
            && *ros_frame == other.ros_frame
            && *ros_topic == other.ros_topic
            && *group == other.group
            && *mask == other.mask
            && *parent == other.parent
            && *attached_to == other.attached_to
            && *rigid_group == other.rigid_group
            && *max_speed_mps == other.max_speed_mps
            && (*report_within_m, *priority) == (other.report_within_m, other.priority)
            && *on_stale == other.on_stale
            && *enabled == other.enabled
    }
}

/// A shape and its pose in a body.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedSpec {
    /// The shape.
    pub shape: ShapeSpec,
    /// Its pose in the body's frame.
    pub pose: Pose,
}

/// What a pair rule does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairAction {
    /// Check the pair, regardless of masks and neighbours.
    Check,
    /// Never check it.
    Ignore,
}

/// A rule for pairs of bodies, by name or pattern (`*` any run, `?` one character).
#[derive(Clone, Debug, PartialEq)]
pub struct PairRule {
    /// Check or ignore.
    pub action: PairAction,
    /// Name or pattern of one side.
    pub a: String,
    /// Name or pattern of the other side.
    pub b: String,
    /// The reason for the rule; shown by `check`.
    pub reason: String,
    /// Overrides the bodies' `report_within_m` for these pairs.
    pub report_within_m: Option<f64>,
}
