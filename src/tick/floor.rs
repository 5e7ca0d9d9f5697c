//! What a tick cannot cut, measured: admission, broad phase, widening, publishing, sending.

use std::sync::Arc;

use crate::time::Clock;
use crate::wire::{STAGES_LEN, Stage};

/// The stop-watch of one tick.
pub(super) struct Laps {
    clock: Arc<dyn Clock>,
    woke_ns: u64,
    last_ns: u64,
    stage_ns: [u64; STAGES_LEN],
    /// CPU time of this thread at the end of the narrow phase, and what publishing took of it.
    narrowed_cpu_ns: u64,
    publish_cpu_ns: u64,
}

impl Laps {
    /// Starts at the moment the daemon woke.
    pub(super) fn start(clock: Arc<dyn Clock>, woke_ns: u64) -> Self {
        let last_ns = clock.monotonic_ns();
        Self {
            clock,
            woke_ns,
            last_ns,
            stage_ns: [0; STAGES_LEN],
            narrowed_cpu_ns: 0,
            publish_cpu_ns: 0,
        }
    }

    /// Ends a stage.
    pub(super) fn lap(&mut self, stage: Stage) {
        let now_ns = self.clock.monotonic_ns();
        self.stage_ns[usize::from(stage.code())] = now_ns.saturating_sub(self.last_ns);
        self.last_ns = now_ns;
        match stage {
            Stage::Narrow => self.narrowed_cpu_ns = self.clock.thread_cpu_ns(),
            Stage::Publish => {
                self.publish_cpu_ns = self.clock.thread_cpu_ns() - self.narrowed_cpu_ns
            }
            _ => {}
        }
    }

    /// From wake-up to the end of the last stage.
    pub(super) fn elapsed_ns(&self) -> u64 {
        self.last_ns.saturating_sub(self.woke_ns)
    }

    pub(super) fn woke_ns(&self) -> u64 {
        self.woke_ns
    }

    pub(super) fn fill(&self, stage_ns: &mut [u64; STAGES_LEN]) {
        *stage_ns = self.stage_ns;
    }

    fn of(&self, stage: Stage) -> u64 {
        self.stage_ns[usize::from(stage.code())]
    }
}

/// What publishing and sending will take, learned from the ticks before.
///
/// A decaying maximum: an average would be too short every other tick, and the deadline would be missed by it. Publishing
/// is taken by the thread's CPU clock: a slice that the scheduler gave to others says nothing about the next tick.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Floor {
    publish_ns: u64,
    send_ns: u64,
    last_send_ns: u64,
}

/// Each tick the remembered maximum loses 1 / 32 of itself: a spike is forgotten in about 80 ticks. Faster (1 / 8), and one
/// tick in a hundred ended 0.1 to 0.5 ms late; slower, and more of the budget is kept back than publishing takes.
const DECAY_SHIFT: u32 = 5;
/// Kept back beside it, nanoseconds: the query that is under way at the deadline, and closing the work lists.
const CLOSING_NS: u64 = 20_000;

impl Floor {
    /// Time to keep back for publishing and sending.
    pub(super) fn reserve_ns(&self) -> u64 {
        self.publish_ns + self.send_ns + CLOSING_NS
    }

    /// The time the last outbox took to send.
    pub(super) fn last_send_ns(&self) -> u64 {
        self.last_send_ns
    }

    pub(super) fn note_send(&mut self, send_ns: u64) {
        self.last_send_ns = send_ns;
        self.send_ns = decayed(self.send_ns).max(send_ns);
    }

    /// Learns from a finished tick; returns its floor.
    pub(super) fn learn(&mut self, laps: &Laps) -> u64 {
        self.publish_ns = decayed(self.publish_ns).max(laps.publish_cpu_ns);
        let woken_ns = laps.elapsed_ns()
            - Stage::ALL
                .iter()
                .map(|&stage| laps.of(stage))
                .sum::<u64>()
                .min(laps.elapsed_ns());
        woken_ns
            + laps.of(Stage::World)
            + laps.of(Stage::Broad)
            + laps.of(Stage::Widen)
            + laps.of(Stage::Publish)
            + self.last_send_ns
    }
}

fn decayed(ns: u64) -> u64 {
    ns - (ns >> DECAY_SHIFT)
}
