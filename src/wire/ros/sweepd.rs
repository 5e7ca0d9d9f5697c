//! `sweepd_msgs`: the structs of `msgs/sweepd_msgs/msg`, field by field.

use serde::{Deserialize, Serialize};

use super::common::{Header, Point, Pose, Twist, Vector3};
use crate::wire::{REJECTS_LEN, STAGES_LEN};

/// `sweepd_msgs/TickHeader`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TickHeader {
    /// Random number of this start of the daemon.
    pub boot_id: u64,
    /// Tick, from 1.
    pub tick: u64,
    /// Scene revision the tick used.
    pub scene_rev: u64,
    /// Oldest sender's stamp among the poses used, nanoseconds; of no meaning where sources have clocks of their own.
    pub oldest_stamp_ns: u64,
    /// Newest sender's stamp among the poses used, nanoseconds; of no meaning where sources have clocks of their own.
    pub newest_stamp_ns: u64,
    /// Rows that did not fit.
    pub truncated: u64,
    /// `State` of the tick.
    pub state: u8,
}

/// `sweepd_msgs/BodyTransform`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BodyTransform {
    /// Name of the body; empty: `body` says which.
    pub name: String,
    /// Id of the body, where the name is empty.
    pub body: u64,
    /// Its pose, scene frame.
    pub pose: Pose,
}

/// `sweepd_msgs/BodyTransforms`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BodyTransforms {
    /// Time of the poses, and the scene's frame.
    pub header: Header,
    /// Name of the source.
    pub source: String,
    /// Random number drawn at each start of the sender.
    pub session: u64,
    /// Raised when the sender's world resets.
    pub epoch: u64,
    /// Counts the frames of a session.
    pub seq: u64,
    /// When it was sent, nanoseconds of `CLOCK_BOOTTIME`; 0: not said.
    pub sent_ns: u64,
    /// Least scene revision these poses need; 0: any.
    pub scene_rev: u64,
    /// The run of the daemon that ids are of; needed where a body has no name.
    pub boot_id: u64,
    /// Deadline of the tick on `CLOCK_MONOTONIC`, nanoseconds; 0: none.
    pub deadline_ns: u64,
    /// Time left for the tick from receipt, nanoseconds; 0: not said.
    pub time_left_ns: u64,
    /// `frame_flags`.
    pub flags: u32,
    /// The sender's number for the clock of its stamp.
    pub clock_id: u32,
    /// The poses.
    pub transforms: Vec<BodyTransform>,
    /// None, or one a pose.
    pub velocities: Vec<Twist>,
}

/// `sweepd_msgs/Pair`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// Name of A.
    pub name_a: String,
    /// Name of B.
    pub name_b: String,
    /// Smaller body id.
    pub body_a: u64,
    /// Larger body id.
    pub body_b: u64,
    /// Lower end of the proved gap, metres.
    pub gap_min_m: f64,
    /// Upper end of the proved gap, metres.
    pub gap_max_m: f64,
    /// Best estimate of the gap, metres.
    pub gap_best_m: f64,
    /// How fast the gap shrinks, metres a second.
    pub closing_mps: f64,
    /// Share of the way to this tick's poses before which they did not touch.
    pub toi_min: f64,
    /// Share by which they had, or 1.
    pub toi_max: f64,
    /// Begin: the earliest tick in which it may have happened.
    pub begin_first_tick: u64,
    /// Begin: the tick in which it was certified.
    pub begin_last_tick: u64,
    /// End: the earliest tick in which it may have happened.
    pub end_first_tick: u64,
    /// End: the tick in which it was certified or caused.
    pub end_last_tick: u64,
    /// Tick of the last certified verdict.
    pub certified_tick: u64,
    /// Ticks since the interval was computed.
    pub bound_age_ticks: u32,
    /// `Verdict` at this tick's poses.
    pub verdict: u8,
    /// Last certified `Verdict`.
    pub certified_verdict: u8,
    /// Bits of `Event`.
    pub events: u8,
    /// `EndCause`.
    pub end_cause: u8,
    /// `Level` reached.
    pub level: u8,
    /// `pair_flags`.
    pub flags: u8,
}

/// `sweepd_msgs/Pairs`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pairs {
    /// Oldest pose used, scene frame.
    pub header: Header,
    /// Which tick.
    pub tick_header: TickHeader,
    /// Place among the messages of the tick, from 0.
    pub chunk_index: u32,
    /// Messages of the tick.
    pub chunk_count: u32,
    /// Whether the chunks hold every pair.
    pub complete: bool,
    /// By ids.
    pub pairs: Vec<Pair>,
}

/// `sweepd_msgs/Contact`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Stays while the contact does; 0: the kind `closest`, of which a pair has one at most.
    pub id: u64,
    /// Name of A.
    pub name_a: String,
    /// Name of B.
    pub name_b: String,
    /// Smaller body id.
    pub body_a: u64,
    /// Larger body id.
    pub body_b: u64,
    /// Point on A, scene frame, metres.
    pub point_a: Point,
    /// Point on B, scene frame, metres.
    pub point_b: Point,
    /// Point on A, A's body frame, metres.
    pub point_a_body: Point,
    /// Point on B, B's body frame, metres.
    pub point_b_body: Point,
    /// Unit, scene frame, from A to B.
    pub normal: Vector3,
    /// Gap at this contact, metres.
    pub gap_m: f64,
    /// Lower end of the proved gap, metres.
    pub gap_min_m: f64,
    /// Upper end of the proved gap, metres.
    pub gap_max_m: f64,
    /// Shape of A.
    pub shape_a: u32,
    /// Shape of B.
    pub shape_b: u32,
    /// Triangle of A's shape.
    pub triangle_a: u32,
    /// Triangle of B's shape.
    pub triangle_b: u32,
    /// `contact_flags`.
    pub flags: u32,
    /// `ContactKind`.
    pub kind: u8,
}

/// `sweepd_msgs/Contacts`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Contacts {
    /// Oldest pose used, scene frame.
    pub header: Header,
    /// Which tick.
    pub tick_header: TickHeader,
    /// Place among the messages of the tick, from 0.
    pub chunk_index: u32,
    /// Messages of the tick.
    pub chunk_count: u32,
    /// Whether the chunks hold every contact.
    pub complete: bool,
    /// By ids.
    pub contacts: Vec<Contact>,
}

/// `sweepd_msgs/Name`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Name {
    /// Body id.
    pub body: u64,
    /// Raised when a body of this name is put again.
    pub generation: u32,
    /// Place of its source.
    pub source: u32,
    /// The name.
    pub name: String,
}

/// `sweepd_msgs/Names`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Names {
    /// When it was sent, scene frame.
    pub header: Header,
    /// Random number of this start of the daemon.
    pub boot_id: u64,
    /// Scene revision that has these names.
    pub scene_rev: u64,
    /// Place among the messages of the revision, from 0.
    pub chunk_index: u32,
    /// Messages of the revision.
    pub chunk_count: u32,
    /// By body id.
    pub names: Vec<Name>,
}

/// `sweepd_msgs/Source`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    /// Its name.
    pub name: String,
    /// Session in force.
    pub session: u64,
    /// Epoch of its newest frame.
    pub epoch: u64,
    /// Number of its newest frame.
    pub seq: u64,
    /// Sender's stamp of its newest frame, nanoseconds.
    pub stamp_ns: u64,
    /// Sender's number for that clock.
    pub clock_id: u32,
    /// Age of its newest frame, nanoseconds.
    pub age_ns: u64,
    /// Frames admitted in this boot.
    pub frames: u64,
    /// Frames passed over.
    pub skipped: u64,
    /// Frames refused.
    pub refused: u64,
    /// A frame came within its time-out.
    pub alive: bool,
    /// Its newest frame was paused.
    pub paused: bool,
}

/// `sweepd_msgs/State`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct State {
    /// Oldest pose used, scene frame.
    pub header: Header,
    /// Which tick.
    pub tick_header: TickHeader,
    /// The state as a word.
    pub word: String,
    /// Bits of `Reason`.
    pub reasons: u32,
    /// The reasons as words.
    pub reason_words: Vec<String>,
    /// Worst pair, smaller id; 0: none.
    pub worst_a: u64,
    /// Worst pair, larger id.
    pub worst_b: u64,
    /// Worst pair by name.
    pub worst_name_a: String,
    /// Worst pair by name.
    pub worst_name_b: String,
}

/// `sweepd_msgs/Tick`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tick {
    /// Oldest pose used, scene frame.
    pub header: Header,
    /// Which tick.
    pub tick_header: TickHeader,
    /// When the tick ended, nanoseconds of `CLOCK_BOOTTIME`.
    pub sent_ns: u64,
    /// From wake-up to the outbox filled, and what the last sending took, nanoseconds.
    pub elapsed_ns: u64,
    /// Time this tick had from wake-up on: the budget, or less by a frame's deadline; nanoseconds.
    pub budget_ns: u64,
    /// Work budget in units.
    pub budget_units: u64,
    /// What could not be cut, nanoseconds.
    pub floor_ns: u64,
    /// Work units spent; a step under way is brought to its end, so perhaps one or two beyond the budget.
    pub units: u64,
    /// Nanoseconds by stage.
    pub stage_ns: [u64; STAGES_LEN],
    /// Refusals in this boot by reason.
    pub rejects: [u64; REJECTS_LEN],
    /// Bodies in the scene.
    pub bodies: u64,
    /// Bodies whose place is not known.
    pub unknown: u64,
    /// Pairs of overlapping boxes.
    pub candidates: u64,
    /// Pairs certified colliding.
    pub colliding: u64,
    /// Pairs not decided.
    pub possible: u64,
    /// Pairs apart, but near.
    pub near: u64,
    /// Pairs ignored.
    pub ignored: u64,
    /// Ticks that ended after their budget or a frame's deadline.
    pub missed: u64,
    /// Events that were never sent.
    pub cancelled_events: u64,
    /// Worst pair, smaller id.
    pub worst_a: u64,
    /// Worst pair, larger id.
    pub worst_b: u64,
    /// Widest interval published, metres.
    pub widest_m: f64,
    /// Ticks for which the oldest undecided pair has been so.
    pub oldest_undecided_ticks: u64,
    /// Bits of `Reason`.
    pub reasons: u32,
    /// `TickCause`.
    pub cause: u8,
    /// Ended after its budget or a frame's deadline.
    pub overrun: bool,
    /// Place of the source that caused it.
    pub cause_source: u8,
    /// Structures rebuilt in this boot.
    pub rebuilds: u64,
    /// Bodies whose fat box was made anew.
    pub broad_renewed: u32,
    /// `BroadMode`.
    pub broad_mode: u8,
    /// `BroadCause`.
    pub broad_cause: u8,
    /// The sources.
    pub sources: Vec<Source>,
    /// Messages of this node that were not sent.
    pub sends_dropped: u64,
    /// Samples that could not be decoded.
    pub receipts_undecodable: u64,
    /// Samples that were refused, or passed over for newer ones.
    pub receipts_refused: u64,
    /// Widest skew of a chain, seconds; NaN: no chain.
    pub tf_skew_s: f64,
}
