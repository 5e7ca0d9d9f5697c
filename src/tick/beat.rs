//! The tick that goes out alone while one takes longer than a heartbeat.
//!
//! In: what the tick under way was given. Out: a row, and from when a heartbeat counts.

use super::{Engine, TickInput, place};
use crate::time::Clock;
use crate::wire::{MessageHeader, Reason, State, TickRow, WIRE_VERSION};

/// Of a heartbeat, a quarter is what a tick may take after one that woke for want of anything else: it would else be
/// told as `unknown` each time that it takes a little longer than the one before.
const GRACE_SHIFT: u32 = 2;

impl Engine {
    /// From when the heartbeat counts, nanoseconds of `CLOCK_MONOTONIC`: from the end of the tick before, whose message
    /// is the last that anybody heard, but for a grace; never later than the wake-up.
    pub(super) fn beats_from(&self, woke_ns: u64) -> u64 {
        let grace_ns = self.config.heartbeat_ns >> GRACE_SHIFT;
        let told_ns = self.told_ns.map(|told_ns| told_ns.saturating_add(grace_ns));
        told_ns.map_or(woke_ns, |told_ns| told_ns.min(woke_ns))
    }

    /// The tick that goes out alone while this one takes longer than a heartbeat. It has this tick's number, an earlier
    /// `sent_ns`, and no sources: it is the result of no frame. What counts up in a boot is as it was.
    pub(super) fn bare_tick(&self, input: &TickInput<'_>) -> TickRow {
        TickRow {
            header: MessageHeader {
                boot_id: self.boot_id,
                tick: self.tick,
                scene_rev: self.world.scene_rev(),
                state: State::Unknown.code(),
                schema: WIRE_VERSION,
                ..MessageHeader::default()
            },
            budget_ns: self.end.budget_ns(),
            budget_units: input.budget.units.unwrap_or(u64::MAX),
            rejects: *self.world.rejects(),
            bodies: self.world.counts().bodies,
            unknown: self.world.counts().unknown,
            candidates: self.pairs.len() as u64,
            reasons: Reason::Undecided.bit(),
            cause: input.cause.code(),
            cause_source: place(input.cause_source),
            missed: self.missed,
            cancelled_events: self.out.tick.cancelled_events,
            rebuilds: self.rebuilds,
            ..TickRow::default()
        }
    }
}

/// Sends a bare tick, now.
pub(super) fn beat<'a>(
    pulse: &'a mut Option<&mut dyn FnMut(&TickRow)>,
    mut row: TickRow,
    clock: &'a dyn Clock,
) -> impl FnMut() + 'a {
    move || {
        if let Some(pulse) = pulse {
            row.sent_ns = clock.boottime_ns();
            pulse(&row);
        }
    }
}
