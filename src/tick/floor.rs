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
/// Publishing is taken by the thread's CPU clock: a slice that the scheduler gave to others says nothing about the next
/// tick. How long it takes varies by a fifth from tick to tick with what is in the caches, so a mean would be too short
/// every other tick. What is kept back is a decaying maximum, and where the budget leaves more, up to the longest of
/// the window for half of what it leaves: a safety that a small budget could not pay.
#[derive(Clone, Debug)]
pub(super) struct Floor {
    /// CPU time of the last publishings, nanoseconds, the oldest overwritten first.
    window_ns: [u64; WINDOW],
    ticks: usize,
    /// Decaying maximum.
    recent_ns: u64,
    /// Median and maximum of the window.
    median_ns: u64,
    longest_ns: u64,
    send_ns: u64,
    last_send_ns: u64,
}

/// Publishings remembered: the longest of so many is exceeded by about one tick in a hundred.
const WINDOW: usize = 128;
/// Each tick the decaying maximum loses 1 / 32 of itself: a spike is forgotten in about 80 ticks. Faster (1 / 8), and
/// one tick in a hundred ended 0.1 to 0.5 ms late; slower, and more of the budget is kept back than publishing takes.
const DECAY_SHIFT: u32 = 5;
/// Of what is left above the floor, a half may be kept back beyond the median of publishing. With a sixth one tick in a
/// hundred ended 34 to 76 us late, with a half 24 to 45; with all of it no sooner, and with a small budget most answers
/// a tick later. What is kept back for nothing is used after publishing.
const SAFETY_SHARE: u64 = 2;
/// Kept back beside it, nanoseconds: the query that is under way at the deadline, and closing the work lists.
const CLOSING_NS: u64 = 20_000;

impl Default for Floor {
    fn default() -> Self {
        Self {
            window_ns: [0; WINDOW],
            ticks: 0,
            recent_ns: 0,
            median_ns: 0,
            longest_ns: 0,
            send_ns: 0,
            last_send_ns: 0,
        }
    }
}

impl Floor {
    /// Time to keep back for publishing and sending, of `left_ns` until the tick's end.
    pub(super) fn reserve_ns(&self, left_ns: u64) -> u64 {
        let certain_ns = self.recent_ns + self.send_ns + CLOSING_NS;
        let rest_ns = left_ns.saturating_sub(self.median_ns + self.send_ns + CLOSING_NS);
        let safe_ns = (self.median_ns + rest_ns / SAFETY_SHARE).min(self.longest_ns);
        certain_ns.max(safe_ns + self.send_ns + CLOSING_NS)
    }

    /// The time the last outbox took to send.
    pub(super) fn last_send_ns(&self) -> u64 {
        self.last_send_ns
    }

    pub(super) fn note_send(&mut self, send_ns: u64) {
        self.last_send_ns = send_ns;
        self.send_ns = decayed(self.send_ns).max(send_ns);
    }

    fn note_publish(&mut self, publish_ns: u64) {
        self.recent_ns = decayed(self.recent_ns).max(publish_ns);
        self.window_ns[self.ticks % WINDOW] = publish_ns;
        self.ticks += 1;
        let mut sorted_ns = self.window_ns;
        let seen_ns = &mut sorted_ns[..self.ticks.min(WINDOW)];
        self.longest_ns = seen_ns.iter().copied().max().unwrap_or(0);
        let middle = seen_ns.len() / 2;
        self.median_ns = *seen_ns.select_nth_unstable(middle).1;
    }

    /// Learns from a finished tick; returns its floor.
    pub(super) fn learn(&mut self, laps: &Laps) -> u64 {
        self.note_publish(laps.publish_cpu_ns);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn after(publishings_us: impl Iterator<Item = u64>) -> Floor {
        let mut floor = Floor::default();
        publishings_us.for_each(|us| floor.note_publish(1_000 * us));
        floor
    }

    #[test]
    fn a_small_budget_keeps_back_what_publishing_took_lately_and_a_large_one_what_it_took_at_worst()
    {
        let quiet = std::iter::repeat_n(500, 100);
        let floor = after([900].into_iter().chain(quiet));
        let kept_us = |left_us: u64| floor.reserve_ns(1_000 * left_us) / 1_000;
        assert_eq!(kept_us(0), 520);
        assert_eq!(kept_us(600), 560);
        assert_eq!(kept_us(520 + 400), 720);
        assert_eq!(kept_us(50_000), 920);
    }

    #[test]
    fn a_spike_is_forgotten_after_the_window() {
        let floor = after([5_000].into_iter().chain(std::iter::repeat_n(500, WINDOW)));
        assert!(floor.reserve_ns(50_000_000) < 600_000);
    }

    #[test]
    fn before_the_first_tick_only_closing_is_kept_back() {
        assert_eq!(Floor::default().reserve_ns(1_000_000), CLOSING_NS);
    }
}
