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
    /// Its id, as clients use it.
    pub id: BodyId,
    /// Unique name.
    pub name: String,
    /// Raised when a body of this name is put again; caches use it as part of their key.
    pub generation: u32,
    /// Its shapes.
    pub shapes: Parts,
    /// Whether frames may move it.
    pub moves: bool,
    /// Whether one of its shapes is a half-space: no box, no motion accumulators.
    pub unbounded: bool,
    /// Whether each of its shapes is one: with another such body it makes no pair.
    pub only_half_spaces: bool,
    /// Last admitted pose, scene frame.
    pub pose: Pose,
    /// Velocity of that pose, if the sender gave it; for a body attached to another, as the other moves it.
    pub velocity: Option<Twist>,
    /// Centre of its geometry in the body frame: the reference point of its motion.
    pub centre: Point,
    /// Greatest distance of its geometry from `centre`, metres.
    pub radius: f64,
    /// How far it has moved, for certificates.
    pub motion: Motion,
    /// Its path since the last tick, if it is continuous or a continuous body is attached to it.
    pub path: Option<Box<Path>>,
    /// State of its vertices, if it deforms: then its single shape is not shared.
    pub vertices: Option<Box<Vertices>>,
    /// Its proxy: the tight box at `pose` (for a continuous body: around its path), widened by `report_within_m` and
    /// `reach_m`.
    pub proxy: Aabb,
    /// Whether its place is known.
    pub status: BodyStatus,
    /// How far any of its surface points may be from where `pose` puts it, metres: 0 for a known body, infinite for
    /// an unknown one whose speed is not bounded.
    pub reach_m: f64,
    /// Why its newest pose or vertices were refused, if they were.
    pub reject: Option<RejectReason>,
    /// The source that may move it.
    pub source: Option<SourceSlot>,
    /// Sender's stamp of `pose`, nanoseconds.
    pub stamp_ns: u64,
    /// When the age of `pose` starts, nanoseconds of `CLOCK_BOOTTIME`; `None`: never received.
    pub since_ns: Option<u64>,
    /// When `pose` was received, nanoseconds of `CLOCK_BOOTTIME`.
    pub received_ns: u64,
    /// The time-out of the source of `pose`, if that is not the body's own source but that of a body it was attached
    /// to.
    pub(super) lent_timeout_ns: u64,
    /// Pairs with a smaller gap are reported, metres.
    pub report_within_m: f64,
    /// Greatest speed of any of its surface points, metres per second.
    pub max_speed_mps: Option<f64>,
    /// Weight of its pairs in the order of work; 1: normal.
    pub priority: f64,
    /// What happens when its pose is too old; `None`: as its source says.
    pub on_stale: Option<OnStale>,
    /// Whether it has a proxy in the broad phase.
    pub in_broad: bool,
}

impl Body {
    /// Velocity of a frame fixed to the body, if the body's own velocity is known.
    ///
    /// * `point` - the frame's origin, body frame, metres.
    #[must_use]
    pub fn twist_at(&self, point: &Point) -> Option<Twist> {
        Some(self.velocity?.at(&self.pose, point))
    }
}

/// How far a body has moved: a path length over anchors, and the displacement from the newest anchor.
///
/// A path length alone would grow by a metre a second with 1 mm of vibration at 1 kHz; with the displacement from an
/// anchor, vibration costs nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Pose from which `offset_m` is measured.
    pub anchor: Pose,
    /// `S`: length of the path over all anchors, plus all deformation, metres, rounded up.
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

    /// Takes new vertices, none of which moved farther than `step_m`.
    ///
    /// The sum, not the displacement since some time: a vertex that moved 1 cm there and back has been there. It is
    /// added to `S` and not to `d`, where every test would count it twice.
    ///
    /// * `radius` - with the new vertices.
    pub fn bend(&mut self, step_m: f64, pose: &Pose, centre: &Point, radius: f64) {
        if step_m > 0.0 {
            self.path_m = (self.path_m + step_m).next_up();
            self.bent_m = (self.bent_m + step_m).next_up();
        }
        self.offset_m = displacement(&self.anchor, pose, centre, radius);
    }

    /// Takes a new anchor at the last pose: for a body that enters the broad phase, whose certificates are yet to be
    /// made and should not be charged for earlier motion.
    pub fn anchor_here(&mut self, pose: &Pose) {
        if self.offset_m > 0.0 {
            self.path_m = self.spent_m();
            self.offset_m = 0.0;
        }
        self.anchor = *pose;
    }

    /// `S + d`: compared with a certificate's expiry.
    #[must_use]
    pub fn spent_m(&self) -> f64 {
        (self.path_m + self.offset_m).next_up()
    }

    /// `S - d`: stored with a certificate.
    #[must_use]
    pub fn credit_m(&self) -> f64 {
        (self.path_m - self.offset_m).next_down()
    }
}

/// A body removed from the broad phase, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Removed {
    /// Its slot; free for another body from the next tick on.
    pub slot: BodySlot,
    /// The cause reported with the ends of its pairs.
    pub cause: EndCause,
}

/// What a tick changed, for the broad and narrow phase. Cleared and refilled each tick; each slot is at most once in
/// each list. A body that leaves and comes back in one tick is in `removed` and in `inserted`: removals first.
#[derive(Clone, Debug, Default)]
pub struct ChangeSet {
    /// Bodies that left the broad phase (removed, disabled, reset, or too old).
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
    /// Clears every list, keeps the memory.
    pub fn clear(&mut self) {
        self.removed.clear();
        self.inserted.clear();
        self.moved.clear();
        self.requery.clear();
        self.restated.clear();
    }
}
