//! One body, its motion bound, and the changes of a tick.

use crate::config::OnStale;
use crate::ids::{BodyId, BodySlot, SourceSlot};
use crate::math::{Aabb, Point, Pose, displacement};
use crate::wire::{BodyStatus, EndCause, RejectReason};

use super::bend::Vertices;
use super::parts::Parts;
use super::path::Path;
use super::twist::Twist;

/// A body as the engine sees it in this tick.
#[derive(Clone, Debug)]
pub struct Body {
    /// What clients call it.
    pub id: BodyId,
    /// Unique name.
    pub name: String,
    /// Raised when a body of this name is put again; caches carry it.
    pub generation: u32,
    /// Its shapes.
    pub shapes: Parts,
    /// Whether frames may move it.
    pub moves: bool,
    /// Whether one of its shapes is a half-space: no box, no motion accumulators.
    pub unbounded: bool,
    /// Last admitted pose, scene frame.
    pub pose: Pose,
    /// How fast that pose moves, where the sender said it; of a body that hangs on another as the other moves it.
    pub velocity: Option<Twist>,
    /// Centre of its geometry in the body frame: the reference point of its motion.
    pub centre: Point,
    /// Greatest distance of its geometry from `centre`, metres.
    pub radius: f64,
    /// How far it has moved, for certificates.
    pub motion: Motion,
    /// Its way since the last tick, where it is continuous or a continuous body hangs on it.
    pub path: Option<Box<Path>>,
    /// What is known of its vertices, where it deforms: then its one shape is its own.
    pub vertices: Option<Box<Vertices>>,
    /// Tight box at `pose` (of a continuous body: around its way), widened by `report_within_m` and `reach_m`: its
    /// proxy.
    pub proxy: Aabb,
    /// Whether its place is known.
    pub status: BodyStatus,
    /// How far any of its surface points may be from where `pose` puts it, metres: 0 for a known body, infinite for
    /// an unknown one whose speed is not bounded.
    pub reach_m: f64,
    /// Why its newest pose or vertices were refused, when they were.
    pub reject: Option<RejectReason>,
    /// The source that may move it.
    pub source: Option<SourceSlot>,
    /// Sender's stamp of `pose`, nanoseconds.
    pub stamp_ns: u64,
    /// When the age of `pose` starts, nanoseconds of `CLOCK_BOOTTIME`; `None`: never received.
    pub since_ns: Option<u64>,
    /// When `pose` was received, nanoseconds of `CLOCK_BOOTTIME`.
    pub received_ns: u64,
    /// The time-out of the source that `pose` is from, where that is not the body's own: of what it hung on.
    pub(super) lent_timeout_ns: u64,
    /// Pairs nearer than this are reported, metres.
    pub report_within_m: f64,
    /// Greatest speed of any of its surface points, metres a second.
    pub max_speed_mps: Option<f64>,
    /// Weight of its pairs in the order of work; 1: as any other.
    pub priority: f64,
    /// What happens when it is too old; `None`: what its source says.
    pub on_stale: Option<OnStale>,
    /// Whether it has a proxy in the broad phase.
    pub in_broad: bool,
}

impl Body {
    /// How fast a frame moves that is fixed to the body, where the body's own velocity is known.
    ///
    /// * `point` - the frame's origin, body frame, metres.
    #[must_use]
    pub fn twist_at(&self, point: &Point) -> Option<Twist> {
        Some(self.velocity?.at(&self.pose, point))
    }
}

/// How far a body has moved: a path over anchors, and the displacement from the newest anchor.
///
/// A path length alone would burn a metre a second on 1 mm of vibration at 1 kHz; the displacement from an anchor
/// costs a vibrating body nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Pose from which `offset_m` is measured.
    pub anchor: Pose,
    /// `S`: length of the path over all anchors, and all that it was deformed by, metres, rounded up.
    pub path_m: f64,
    /// The largest displacement of a vertex, summed over all updates, metres, rounded up.
    pub bent_m: f64,
    /// `d`: bound on the displacement of any surface point from the anchor, metres, rounded up.
    pub offset_m: f64,
}

impl Motion {
    /// At rest at `pose`.
    #[must_use]
    pub fn at(pose: &Pose) -> Self {
        Self {
            anchor: *pose,
            path_m: 0.0,
            bent_m: 0.0,
            offset_m: 0.0,
        }
    }

    /// Moves to `pose`; takes a new anchor when the displacement exceeds the body's radius.
    pub fn advance(&mut self, pose: &Pose, centre: &Point, radius: f64) {
        self.offset_m = displacement(&self.anchor, pose, centre, radius);
        if self.offset_m > radius {
            self.path_m = (self.path_m + self.offset_m).next_up();
            self.anchor = *pose;
            self.offset_m = 0.0;
        }
    }

    /// Takes vertices none of which went farther than `step_m`.
    ///
    /// The sum, not the displacement since some moment: what went 1 cm there and back has been there. It is in `S` and
    /// not in `d`, where every test would pay for it twice.
    ///
    /// * `radius` - with the new vertices.
    pub fn bend(&mut self, step_m: f64, pose: &Pose, centre: &Point, radius: f64) {
        if step_m > 0.0 {
            self.path_m = (self.path_m + step_m).next_up();
            self.bent_m = (self.bent_m + step_m).next_up();
        }
        self.offset_m = displacement(&self.anchor, pose, centre, radius);
    }

    /// Takes a new anchor at the pose last moved to: for a body that enters the broad phase, whose certificates are yet
    /// to be made and should not pay for where it was before.
    pub fn anchor_here(&mut self, pose: &Pose) {
        if self.offset_m > 0.0 {
            self.path_m = self.spent_m();
            self.offset_m = 0.0;
        }
        self.anchor = *pose;
    }

    /// `S + d`: what a certificate's expiry is compared with.
    #[must_use]
    pub fn spent_m(&self) -> f64 {
        (self.path_m + self.offset_m).next_up()
    }

    /// `S - d`: what is stored with a certificate.
    #[must_use]
    pub fn credit_m(&self) -> f64 {
        (self.path_m - self.offset_m).next_down()
    }
}

/// A body taken out of the broad phase, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Removed {
    /// Its slot; free for another body from the next tick on.
    pub slot: BodySlot,
    /// What its pairs' ends will say.
    pub cause: EndCause,
}

/// What a tick changed, for the broad and narrow phase. Emptied and refilled each tick; each slot stands at most once
/// in each list. A body that leaves and comes back in one tick stands in `removed` and in `inserted`: removals first.
#[derive(Clone, Debug, Default)]
pub struct ChangeSet {
    /// Bodies that left the broad phase (removed, disabled, reset, taken out by age).
    pub removed: Vec<Removed>,
    /// Bodies that entered it (first pose, put, enabled).
    pub inserted: Vec<BodySlot>,
    /// Bodies in it whose proxy or pose changed.
    pub moved: Vec<BodySlot>,
    /// Bodies whose filters changed, or whose pairs must be found again by a query.
    pub requery: Vec<BodySlot>,
    /// Bodies whose status, reach or velocity changed without their pose.
    pub restated: Vec<BodySlot>,
}

impl ChangeSet {
    /// Empties every list, keeps the memory.
    pub fn clear(&mut self) {
        self.removed.clear();
        self.inserted.clear();
        self.moved.clear();
        self.requery.clear();
        self.restated.clear();
    }
}
