//! The tick: what it took, what it found, and what it knows of its sources.
//!
//! Laid out as the other rows (`rows`).

use iceoryx2::prelude::ZeroCopySend;

use super::rows::{MessageHeader, SOURCE_NAME_LEN, SOURCES_MAX};

/// Places for reject counters, by `RejectReason`.
pub const REJECTS_LEN: usize = 16;
/// Places for stage times, by `Stage`.
pub const STAGES_LEN: usize = 8;

/// One source as the tick saw it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.Source")]
pub struct SourceRow {
    /// Name, NUL-padded UTF-8; empty: no source in this place.
    pub name: [u8; SOURCE_NAME_LEN],
    /// Session in force; 0: none yet.
    pub session: u64,
    /// Epoch of its newest frame.
    pub epoch: u64,
    /// Number of its newest frame.
    pub seq: u64,
    /// Sender's stamp of its newest frame, nanoseconds.
    pub stamp_ns: u64,
    /// Age of its newest frame, nanoseconds; `u64::MAX`: none yet.
    pub age_ns: u64,
    /// Frames admitted in this boot.
    pub frames: u64,
    /// Frames passed over because a newer one was there, or lost on their way (gaps in `seq`).
    pub skipped: u64,
    /// Frames refused.
    pub refused: u64,
    /// Sender's number for the clock of `stamp_ns`.
    pub clock_id: u32,
    /// 1: alive (a frame within its time-out).
    pub alive: u8,
    /// 1: its newest frame was `paused`.
    pub paused: u8,
    /// Zero.
    pub reserved: [u8; 2],
}

/// The tick: published last, at least each heartbeat, never truncated.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("sweepd.v1.Tick")]
pub struct TickRow {
    /// As in every message; `truncated` here is the sum over all messages.
    pub header: MessageHeader,
    /// When the tick ended, nanoseconds of `CLOCK_BOOTTIME`.
    pub sent_ns: u64,
    /// From wake-up to the outbox filled, and what the last sending took, nanoseconds.
    pub elapsed_ns: u64,
    /// Time this tick had from wake-up on: the budget, or less by a frame's deadline; ns; `u64::MAX`: no end.
    pub budget_ns: u64,
    /// Work budget in units; `u64::MAX`: none.
    pub budget_units: u64,
    /// What this tick could not cut (admission, broad phase, widening, publishing), nanoseconds.
    pub floor_ns: u64,
    /// Work units spent; a step under way is brought to its end, so perhaps one or two beyond the budget.
    pub units: u64,
    /// Nanoseconds by `Stage`; sending: of the tick before.
    pub stage_ns: [u64; STAGES_LEN],
    /// Refusals in this boot by `RejectReason`.
    pub rejects: [u64; REJECTS_LEN],
    /// Bodies in the scene.
    pub bodies: u64,
    /// Bodies that are stale, rejected or not received, and those whose pairs are truncated; not those held or removed.
    pub unknown: u64,
    /// Pairs of overlapping boxes.
    pub candidates: u64,
    /// Pairs certified colliding.
    pub colliding: u64,
    /// Pairs not decided.
    pub possible: u64,
    /// Pairs apart, but nearer than their `report_within_m`.
    pub near: u64,
    /// Pairs of bodies that a rule, neighbour or rigid group ignores.
    pub ignored: u64,
    /// Ticks of this boot that ended after their budget or a frame's deadline.
    pub missed: u64,
    /// Begins and their ends that were both never sent.
    pub cancelled_events: u64,
    /// Body ids of the worst pair (smaller first); 0: none.
    pub worst_a: u64,
    /// See `worst_a`.
    pub worst_b: u64,
    /// Widest interval among the pairs published, metres.
    pub widest_m: f64,
    /// Ticks for which the oldest undecided pair has been so.
    pub oldest_undecided_ticks: u64,
    /// Bits of `Reason`, by number.
    pub reasons: u32,
    /// `TickCause`.
    pub cause: u8,
    /// 1: ended after its budget or a frame's deadline.
    pub overrun: u8,
    /// Sources in use in `sources`.
    pub sources_len: u8,
    /// Place in `sources` whose frame caused the tick; 255: none.
    pub cause_source: u8,
    /// Where `validate` failed and a structure was rebuilt, times in this boot.
    pub rebuilds: u64,
    /// Bodies whose fat box the broad phase made anew.
    pub broad_renewed: u32,
    /// `BroadMode`: how the broad phase worked.
    pub broad_mode: u8,
    /// `BroadCause`: why.
    pub broad_cause: u8,
    /// Zero.
    pub reserved: [u8; 2],
    /// The sources, in the scene's order.
    pub sources: [SourceRow; SOURCES_MAX],
}

// As in `rows`: a change here is a new wire version.
const _: () = {
    assert!(size_of::<SourceRow>() == 104);
    assert!(size_of::<TickRow>() == 2088);
};
