//! The rows: `repr(C)`, widest fields first, reserved bytes explicit, no bool, enum, usize or pointer.
//!
//! SI units, right-handed, z up, the scene's one `frame_id`. Quaternions are x, y, z, w. `Default` is all zeros.

use iceoryx2::prelude::ZeroCopySend;

use super::codes::Event;
pub use crate::limits::SOURCES_MAX;
/// Bytes of a source's name, NUL-padded UTF-8.
pub const SOURCE_NAME_LEN: usize = 32;
/// Bytes of a body's name, NUL-padded UTF-8.
pub const BODY_NAME_LEN: usize = 104;

/// User header of `transforms` and `transforms_vel`: whose frame, which one, how old, how urgent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.FrameHeader")]
pub struct FrameHeader {
    /// Random number drawn at each client start; never 0.
    pub session: u64,
    /// Raised by the client when its world resets.
    pub epoch: u64,
    /// Counts the frames of a session; order within a session is `(epoch, seq)`.
    pub seq: u64,
    /// When the client sent it, nanoseconds of `CLOCK_BOOTTIME`; 0: not said, then age counts from receipt.
    pub sent_ns: u64,
    /// The sender's own stamp of the poses, nanoseconds of the clock `clock_id`; echoed, never trusted.
    pub stamp_ns: u64,
    /// Least scene revision these poses need; 0: any.
    pub scene_rev: u64,
    /// Deadline of the tick on `CLOCK_MONOTONIC`, nanoseconds; 0: none. Can shorten the budget, never lengthen it.
    pub deadline_ns: u64,
    /// Time left for the tick from receipt, nanoseconds; 0: not said.
    pub time_left_ns: u64,
    /// Name of the source, NUL-padded UTF-8.
    pub source: [u8; SOURCE_NAME_LEN],
    /// `frame_flags`: full, partial or paused.
    pub flags: u32,
    /// The sender's number for the clock of `stamp_ns`; echoed.
    pub clock_id: u32,
    /// `WIRE_VERSION` of the sender.
    pub schema: u32,
    /// Low half of the `boot_id` whose body ids the rows have; 0: not said. What is of another boot is refused.
    pub boot: u32,
}

/// One body's pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.Transform")]
pub struct TransformRow {
    /// Body id.
    pub body: u64,
    /// Zero.
    pub flags: u32,
    /// Zero.
    pub reserved: u32,
    /// Origin of the body's frame in the scene's frame, metres.
    pub position: [f64; 3],
    /// Orientation x, y, z, w, unit length within 1e-2.
    pub orientation: [f64; 4],
}

/// One body's pose and velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.TransformVel")]
pub struct TransformVelRow {
    /// Pose, as [`TransformRow`].
    pub transform: TransformRow,
    /// Velocity of the body frame's origin in the scene's frame, metres a second.
    pub linear: [f64; 3],
    /// Angular velocity in the scene's frame, radians a second.
    pub angular: [f64; 3],
}

/// User header of every message the daemon publishes.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend, serde::Serialize, serde::Deserialize,
)]
#[repr(C)]
#[type_name("sweepd.v1.MessageHeader")]
pub struct MessageHeader {
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
    /// Rows that did not fit into this message.
    pub truncated: u64,
    /// `State` of the tick.
    pub state: u8,
    /// Zero.
    pub reserved: [u8; 3],
    /// `WIRE_VERSION`.
    pub schema: u32,
}

/// One pair that is not plainly apart, or one last event of a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.Pair")]
pub struct PairRow {
    /// Smaller body id.
    pub body_a: u64,
    /// Larger body id.
    pub body_b: u64,
    /// Lower end of the proved gap, metres, signed; minus infinity: nothing known.
    pub gap_min_m: f64,
    /// Upper end of the proved gap, metres, signed; infinity: nothing known.
    pub gap_max_m: f64,
    /// Best estimate of the gap, metres, signed; NaN: none.
    pub gap_best_m: f64,
    /// How fast the gap shrinks along the normal, metres a second; negative: it grows; NaN: not known (no velocity was
    /// sent, or a body is silent, refused or deforms).
    pub closing_mps: f64,
    /// Of a swept pair that touched, or may have, on the way from the last tick's poses (0) to this one's (1): the
    /// share before which it did not (steps that jumped, which are not swept, aside); NaN: not swept, or free of touch.
    pub toi_min: f64,
    /// The share by which it had touched first (`SWEPT_HIT`), or 1 (`SWEPT_OPEN`); NaN as `toi_min`.
    pub toi_max: f64,
    /// Begin: the earliest tick in which it may have happened.
    pub begin_first_tick: u64,
    /// Begin: the tick in which it was certified.
    pub begin_last_tick: u64,
    /// End: the earliest tick in which it may have happened.
    pub end_first_tick: u64,
    /// End: the tick in which it was certified or caused.
    pub end_last_tick: u64,
    /// Tick of the last certified verdict; 0: never.
    pub certified_tick: u64,
    /// Ticks since the interval was computed at the poses of its tick.
    pub bound_age_ticks: u32,
    /// `Verdict` at this tick's poses.
    pub verdict: u8,
    /// Last certified `Verdict`: apart, near or colliding.
    pub certified_verdict: u8,
    /// Bits of `Event`, by number.
    pub events: u8,
    /// `EndCause` of the end in this row.
    pub end_cause: u8,
    /// `Level` reached.
    pub level: u8,
    /// `pair_flags`.
    pub flags: u8,
    /// Zero.
    pub reserved: [u8; 6],
}

/// One point of contact, or the closest points of a near pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.Contact")]
pub struct ContactRow {
    /// Stays while the contact does; 0: the kind `closest`, of which a pair has one at most.
    pub id: u64,
    /// Smaller body id.
    pub body_a: u64,
    /// Larger body id.
    pub body_b: u64,
    /// Point on A's surface, scene frame, metres.
    pub point_a: [f64; 3],
    /// Point on B's surface, scene frame, metres.
    pub point_b: [f64; 3],
    /// Point on A's surface, A's body frame, metres.
    pub point_a_body: [f64; 3],
    /// Point on B's surface, B's body frame, metres.
    pub point_b_body: [f64; 3],
    /// Unit, scene frame, from A to B.
    pub normal: [f64; 3],
    /// Gap at this contact, metres; negative: depth.
    pub gap_m: f64,
    /// Lower end of the shape pair's proved gap, metres.
    pub gap_min_m: f64,
    /// Upper end of the shape pair's proved gap, metres.
    pub gap_max_m: f64,
    /// Shape of A, by its place in the body.
    pub shape_a: u32,
    /// Shape of B, by its place in the body.
    pub shape_b: u32,
    /// Triangle of A's shape; `u32::MAX`: none.
    pub triangle_a: u32,
    /// Triangle of B's shape; `u32::MAX`: none.
    pub triangle_b: u32,
    /// `contact_flags`.
    pub flags: u32,
    /// `ContactKind`.
    pub kind: u8,
    /// Zero.
    pub reserved: [u8; 3],
}

/// One body.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.Body")]
pub struct BodyRow {
    /// Body id.
    pub body: u64,
    /// Last admitted position of the body's frame, scene frame, metres.
    pub position: [f64; 3],
    /// Last admitted orientation x, y, z, w.
    pub orientation: [f64; 4],
    /// The sender's stamp of that pose, nanoseconds.
    pub stamp_ns: u64,
    /// Receipt of that pose, nanoseconds of `CLOCK_BOOTTIME`.
    pub received_ns: u64,
    /// Age at this tick, nanoseconds; `u64::MAX`: never received.
    pub age_ns: u64,
    /// Generation: raised when a body of this name is put again.
    pub generation: u32,
    /// Place of its source in `TickRow::sources`; `u32::MAX`: none.
    pub source: u32,
    /// `BodyStatus`.
    pub status: u8,
    /// Worst `Verdict` over all its pairs.
    pub verdict: u8,
    /// Last `RejectReason`, when the status is `rejected`.
    pub reject: u8,
    /// Zero.
    pub reserved: [u8; 5],
}

/// A body's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.Name")]
pub struct NameRow {
    /// Body id.
    pub body: u64,
    /// Place of its source in `TickRow::sources`; `u32::MAX`: none.
    pub source: u32,
    /// Generation of the body.
    pub generation: u32,
    /// Bytes of the name in use.
    pub len: u32,
    /// Zero.
    pub reserved: u32,
    /// UTF-8, NUL-padded.
    pub name: [u8; BODY_NAME_LEN],
}

/// What a client reads before anything else. This layout is frozen for ever.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.Hello")]
pub struct Hello {
    /// `b"sweepd\0\0"`.
    pub magic: [u8; 8],
    /// Random number of this start of the daemon.
    pub boot_id: u64,
    /// Process id of the daemon.
    pub pid: u32,
    /// User id of the daemon.
    pub uid: u32,
    /// `WIRE_VERSION` of the daemon.
    pub wire_version: u32,
    /// Zero.
    pub reserved: u32,
    /// sweepd's version, NUL-padded ASCII.
    pub sweepd_version: [u8; 16],
    /// iceoryx2's version, NUL-padded ASCII.
    pub iceoryx2_version: [u8; 16],
}

impl PairRow {
    /// Its events in the order in which they happened: what ended by cause may have begun anew, what passed on the way
    /// began and ended.
    pub fn told_events(&self) -> impl Iterator<Item = Event> {
        let events = self.events;
        let mut all = [Event::End, Event::Begin, Event::Persist, Event::Passed];
        if events & Event::Passed.bit() != 0 {
            all.swap(0, 1);
        }
        all.into_iter()
            .filter(move |event| events & event.bit() != 0)
    }
}

impl Default for NameRow {
    fn default() -> Self {
        Self {
            body: 0,
            source: 0,
            generation: 0,
            len: 0,
            reserved: 0,
            name: [0; BODY_NAME_LEN],
        }
    }
}

// The layouts are a promise: a change here is a new wire version.
const _: () = {
    assert!(size_of::<FrameHeader>() == 112);
    assert!(size_of::<TransformRow>() == 72);
    assert!(size_of::<TransformVelRow>() == 120);
    assert!(size_of::<MessageHeader>() == 56);
    assert!(size_of::<PairRow>() == 120);
    assert!(size_of::<ContactRow>() == 192);
    assert!(size_of::<BodyRow>() == 104);
    assert!(size_of::<NameRow>() == 128);
    assert!(size_of::<Hello>() == 64);
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_told_in_the_order_in_which_they_happened() {
        let words = |events| {
            let row = PairRow {
                events,
                ..PairRow::default()
            };
            row.told_events().map(Event::word).collect::<Vec<_>>()
        };
        let anew = Event::Begin.bit() | Event::End.bit();
        assert_eq!(words(anew), ["end", "begin"]);
        let passed = anew | Event::Passed.bit();
        assert_eq!(words(passed), ["begin", "end", "passed"]);
    }
}
