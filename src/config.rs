//! How a daemon runs: mode, budget, heartbeat, limits. Read from a scene file, overridden by flags.

pub(crate) mod ros_name;

use crate::limits::{self, RATE_HZ_MAX, RATE_HZ_MIN};
use crate::time::Budget;

/// What makes a tick.
#[derive(Clone, Debug, PartialEq)]
pub enum Mode {
    /// Lockstep: one tick for each frame of this source, in order, none skipped in silence.
    OnFrame(String),
    /// A round: the newest frame of each live source, and all of one that moves continuous bodies.
    OnAll,
    /// So many ticks a second on the newest state, hertz from `limits::RATE_HZ_MIN` to `RATE_HZ_MAX`; it too with all
    /// frames of one that moves continuous bodies.
    Rate(f64),
}

impl Mode {
    /// `on_all`, `on_frame=SOURCE` or `rate=HZ`, as flags and parameters say it.
    ///
    /// # Errors
    /// One text that says what to write.
    pub fn parse(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            None if text == "on_all" => Ok(Self::OnAll),
            Some(("on_frame", source)) if !source.is_empty() => {
                Ok(Self::OnFrame(source.to_owned()))
            }
            Some(("rate", hertz)) => match hertz.parse::<f64>() {
                Ok(hertz) if (RATE_HZ_MIN..=RATE_HZ_MAX).contains(&hertz) => Ok(Self::Rate(hertz)),
                _ => Err(format!(
                    "`{hertz}` is not a rate: write hertz from {RATE_HZ_MIN} to {RATE_HZ_MAX}, such as rate=100"
                )),
            },
            _ => Err("write on_all, on_frame=SOURCE or rate=HZ".to_owned()),
        }
    }
}

impl std::fmt::Display for Mode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OnFrame(source) => write!(f, "on_frame={source}"),
            Self::OnAll => f.write_str("on_all"),
            Self::Rate(hertz) => write!(f, "rate={hertz}"),
        }
    }
}

/// Which broad phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BroadMethod {
    /// Every pair of bodies, every tick.
    BruteForce,
    /// Sorted ends of boxes on the axes, kept across ticks.
    SweepAndPrune,
    /// Blocks of boxes in the order of a space-filling curve, fat boxes and candidates kept across ticks.
    Order,
    /// Cells as large as the largest box, in an array around the scene.
    UniformGrid,
    /// Cells as large as the largest box, only those with a body, in a table.
    SpatialHash,
    /// Cells on levels by size, a factor of two between levels, in a table.
    HierarchicalGrid,
}

impl BroadMethod {
    /// Every method, with the name that it is chosen by.
    pub const NAMED: &'static [(Self, &'static str)] = &[
        (Self::BruteForce, "brute"),
        (Self::SweepAndPrune, "sap"),
        (Self::Order, "order"),
        (Self::UniformGrid, "grid"),
        (Self::SpatialHash, "hash"),
        (Self::HierarchicalGrid, "hgrid"),
    ];

    /// The method of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let found = Self::NAMED.iter().find(|(_, known)| *known == name);
        found.map(|(method, _)| *method)
    }
}

/// How a pair of surfaces is searched: the order in which pairs of their boxes are tested, and what is kept of it.
///
/// Bounds and contact sets are found in one order by all of them: best first, and to the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MeshSearch {
    /// Certificates are carried from pose to pose; depth first, the deepest overlap first.
    #[default]
    Carried,
    /// As `Carried`, but each pose starts from the roots.
    Restart,
    /// Each pose starts from the roots, level by level (Hubbard 1996): a baseline.
    BreadthFirst,
    /// Each pose starts from the roots, deepest overlap of all first (a plain priority queue): a baseline.
    Priority,
}

impl MeshSearch {
    /// Every search, with the name that it is chosen by.
    pub const NAMED: &'static [(Self, &'static str)] = &[
        (Self::Carried, "carried"),
        (Self::Restart, "restart"),
        (Self::BreadthFirst, "breadth_first"),
        (Self::Priority, "priority"),
    ];

    /// The search of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let found = Self::NAMED.iter().find(|(_, known)| *known == name);
        found.map(|(search, _)| *search)
    }
}

/// What happens to a body that is too old.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnStale {
    /// Its pairs become `possible` within its reach.
    #[default]
    Unknown,
    /// It stays at its last pose, shown as unsafe.
    Hold,
    /// It is taken out, shown as unsafe.
    Remove,
}

/// A source whose poses the ROS 2 node takes from topics of common types.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RosSource {
    /// What comes on its topics.
    pub kind: RosKind,
    /// `tf`: the topic of links; the other kinds have a topic a body.
    pub topic: String,
    /// `tf`: the topic of links that never change.
    pub static_topic: String,
    /// `tf`: where the stamps of a chain of links lie further apart, the body is unknown, nanoseconds.
    pub max_skew_ns: u64,
}

/// What comes on the topics of a ROS 2 source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RosKind {
    /// `tf2_msgs/TFMessage`: links between frames; each body is a frame.
    Tf,
    /// `geometry_msgs/PoseStamped`, a topic a body.
    Pose,
    /// `nav_msgs/Odometry`, a topic a body.
    Odometry,
}

/// From where somebody looks: pairs in view have turns before others when the budget does not reach for all.
#[derive(Clone, Debug, PartialEq)]
pub struct Viewpoint {
    /// The body that carries it; `None`: it stands in the scene.
    pub body: Option<String>,
    /// The eye, in the frame of that body or of the scene, metres.
    pub position: [f64; 3],
    /// Where it looks, same frame, unit.
    pub direction: [f64; 3],
    /// Half of what is seen across, radians.
    pub half_angle_rad: f64,
    /// How many times as much what is right ahead counts as what is not seen; 1 to `limits::VIEW_WEIGHT_MAX`.
    pub weight: f64,
    /// How far away half of that is left, metres; `None`: however far.
    pub half_m: Option<f64>,
}

/// How a daemon runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// What makes a tick.
    pub mode: Mode,
    /// What a tick may spend.
    pub budget: Budget,
    /// A tick goes out at least this often, nanoseconds.
    pub heartbeat_ns: u64,
    /// `on_all`: how long after its first frame a round waits for the others, nanoseconds.
    pub late_ns: u64,
    /// The broad phase that the scene asks for; `None`: the plan chooses.
    pub broad_phase: Option<BroadMethod>,
    /// Threads that a tick may work with, its own with them, 1 to `limits::THREADS_MAX`; `None`: two, where the machine
    /// has them. Any number gives the same answers.
    pub threads: Option<usize>,
    /// How pairs of surfaces are searched; `None`: the scene leaves it to the daemon, which carries certificates.
    pub mesh_search: Option<MeshSearch>,
    /// Beyond this reach a stale body makes no new pairs, metres.
    pub stale_reach_m: f64,
    /// From where somebody looks.
    pub viewpoint: Option<Viewpoint>,
    /// Sizes of messages and sets.
    pub limits: Limits,
}

/// Sizes of messages and sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bodies.
    pub bodies: usize,
    /// Pairs kept.
    pub pairs: usize,
    /// Rows of `pairs`.
    pub pair_rows: usize,
    /// Rows of `contacts`.
    pub contact_rows: usize,
    /// Rows of `regions`, at least 8: a pair's regions go out together.
    pub region_rows: usize,
    /// Contacts of one pair, at most 16. All surfaces on which the pair touches share it: at most four points each, the
    /// deepest first, then what lies farthest from those kept, in place and in normal.
    pub contacts_per_pair: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            bodies: limits::BODIES_MAX,
            pairs: limits::PAIRS_DEFAULT,
            pair_rows: limits::PAIR_ROWS_DEFAULT,
            contact_rows: limits::CONTACT_ROWS_DEFAULT,
            region_rows: limits::REGION_ROWS_DEFAULT,
            contacts_per_pair: limits::CONTACTS_PER_PAIR_DEFAULT,
        }
    }
}

impl Config {
    /// Threads that a tick may work with on this machine.
    #[must_use]
    pub fn threads_here(&self) -> usize {
        let two = || std::thread::available_parallelism().map_or(1, |cores| cores.get().min(2));
        self.threads.unwrap_or_else(two)
    }
}

impl Default for Config {
    fn default() -> Self {
        Self {
            mode: Mode::OnAll,
            budget: Budget::UNLIMITED,
            heartbeat_ns: limits::HEARTBEAT_MS_DEFAULT * 1_000_000,
            late_ns: limits::LATE_MS_DEFAULT * 1_000_000,
            broad_phase: None,
            threads: None,
            mesh_search: None,
            stale_reach_m: limits::STALE_REACH_M_DEFAULT,
            viewpoint: None,
            limits: Limits::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_rates_have_one_range_and_a_message_that_says_it() {
        assert_eq!(Mode::parse("rate=100000"), Ok(Mode::Rate(RATE_HZ_MAX)));
        assert_eq!(Mode::parse("rate=0.001"), Ok(Mode::Rate(RATE_HZ_MIN)));
        for bad in ["0", "-1", "nan", "inf", "0.0001", "100001", "2000000", "x"] {
            let text = Mode::parse(&format!("rate={bad}")).unwrap_err();
            assert_eq!(
                text,
                format!(
                    "`{bad}` is not a rate: write hertz from 0.001 to 100000, such as rate=100"
                )
            );
        }
    }
}
