//! The fixed costs of a tick, measured: admission, broad phase, widening, publishing, sending.

use std::sync::Arc;

use crate::time::Clock;
use crate::wire::{STAGES_LEN, Stage};

/// The stop-watch of one tick.
pub(super) struct Laps {
    clock: Arc<dyn Clock>,
    woke_ns: u64,
    last_ns: u64,
    stage_ns: [u64; STAGES_LEN],
    /// CPU time of this thread at the end of the narrow phase, and the CPU time of publishing.
    narrowed_cpu_ns: u64,
    publish_cpu_ns: u64,
}

impl Laps {
    /// Starts at the time when the daemon woke.
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

/// When timed work began, by the wall clock and by the thread's CPU clock.
#[derive(Clone, Copy, Debug)]
pub(super) struct Began {
    wall_ns: u64,
    cpu_ns: u64,
}

impl Began {
    pub(super) fn now(clock: &dyn Clock) -> Self {
        Self {
            wall_ns: clock.monotonic_ns(),
            cpu_ns: clock.thread_cpu_ns(),
        }
    }

    pub(super) fn wall_ns(&self) -> u64 {
        self.wall_ns
    }

    /// Time left until `end_ns` when it began.
    pub(super) fn left_ns(&self, end_ns: u64) -> u64 {
        end_ns.saturating_sub(self.wall_ns)
    }

    /// By how much this thread has passed a deadline, not counting lateness from before it began and time that other
    /// threads used its core.
    pub(super) fn passed_ns(&self, deadline_ns: u64, clock: &dyn Clock) -> u64 {
        let now_ns = clock.monotonic_ns();
        let late_ns = now_ns.saturating_sub(deadline_ns.max(self.wall_ns));
        if late_ns == 0 {
            return 0;
        }
        let cpu_ns = clock.thread_cpu_ns().saturating_sub(self.cpu_ns);
        late_ns.saturating_sub((now_ns - self.wall_ns).saturating_sub(cpu_ns))
    }
}

/// Expected duration of publishing and sending, learned from earlier ticks.
///
/// Publishing is measured by the thread's CPU clock: a slice that the scheduler gave to others does not predict the
/// next tick. Its duration varies by a fifth from tick to tick with the state of the caches, so a mean would be too
/// short every other tick. The reserve is a decaying maximum. If the budget allows, it is increased up to the longest
/// time of the windows plus a quarter, using at most three quarters of the time left: a safety that a small budget
/// cannot afford.
///
/// The overrun of the narrow phase is added: the query in progress at its deadline, and closing the work lists.
#[derive(Clone, Debug)]
pub(super) struct Floor {
    /// CPU time of the last endings, nanoseconds, the oldest overwritten first.
    window_ns: [u64; WINDOW],
    ticks: usize,
    /// Decaying maximum.
    recent_ns: u64,
    /// Median of the window, and maxima of the last windows, the current one first.
    median_ns: u64,
    maxima_ns: [u64; WINDOWS],
    /// By how much the narrow phase passed its deadline in this tick.
    late_ns: u64,
    send_ns: u64,
    last_send_ns: u64,
}

/// Number of endings remembered one by one: a window.
const WINDOW: usize = 128;
/// Number of windows whose longest ending is remembered: that of a single one is exceeded in about one tick in a
/// hundred. With more, more is reserved for longer after a spike.
const WINDOWS: usize = 4;
/// Ticks after which the median is computed again.
const MEDIAN_TICKS: usize = 16;
/// Each tick the decaying maximum loses 1 / 32 of itself: a spike is forgotten in about 80 ticks. Faster (1 / 8), and
/// one tick in a hundred ended 0.1 to 0.5 ms late; slower, and more is reserved than publishing takes.
const DECAY_SHIFT: u32 = 5;
/// Up to three quarters of the time left above the floor may be reserved beyond the median of publishing. In a pool of
/// 4,000 bodies, 100 and 250 us above the floor, one tick in a hundred ended 43 to 93 us late with a half, 38 to 73
/// with two thirds, 26 to 58 with four fifths; and the more is reserved, the more answers come a tick later. Unused
/// reserve is spent after publishing.
const SAFETY_QUARTERS: u64 = 3;
/// Additional reserve, nanoseconds: wall time of the two beyond their CPU time.
const CLOSING_NS: u64 = 10_000;

impl Default for Floor {
    fn default() -> Self {
        Self {
            window_ns: [0; WINDOW],
            ticks: 0,
            recent_ns: 0,
            median_ns: 0,
            maxima_ns: [0; WINDOWS],
            late_ns: 0,
            send_ns: 0,
            last_send_ns: 0,
        }
    }
}

impl Floor {
    /// Time to reserve for publishing and sending, out of `left_ns` until the tick's end.
    pub(super) fn reserve_ns(&self, left_ns: u64) -> u64 {
        let certain_ns = self.recent_ns + self.send_ns + CLOSING_NS;
        let rest_ns = left_ns.saturating_sub(self.usual_ns() + CLOSING_NS);
        let longest_ns = self.maxima_ns.iter().copied().max().unwrap_or(0);
        let worse_ns = longest_ns + longest_ns / 4;
        let safe_ns = (self.median_ns + rest_ns / 4 * SAFETY_QUARTERS).min(worse_ns);
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

    /// By how much the narrow phase passed its deadline in this tick.
    pub(super) fn note_late(&mut self, late_ns: u64) {
        self.late_ns = late_ns;
    }

    /// Usual duration of publishing and sending.
    pub(super) fn usual_ns(&self) -> u64 {
        self.median_ns + self.send_ns
    }

    fn note_ending(&mut self, ending_ns: u64) {
        self.recent_ns = decayed(self.recent_ns).max(ending_ns);
        let place = self.ticks % WINDOW;
        if place == 0 {
            self.maxima_ns.rotate_right(1);
            self.maxima_ns[0] = 0;
        }
        self.maxima_ns[0] = self.maxima_ns[0].max(ending_ns);
        self.window_ns[place] = ending_ns;
        self.ticks += 1;
        if self.ticks < WINDOW || self.ticks.is_multiple_of(MEDIAN_TICKS) {
            let mut sorted_ns = self.window_ns;
            let seen_ns = &mut sorted_ns[..self.ticks.min(WINDOW)];
            let middle = seen_ns.len() / 2;
            self.median_ns = *seen_ns.select_nth_unstable(middle).1;
        }
    }

    /// Updates from a finished tick; returns its floor.
    pub(super) fn learn(&mut self, laps: &Laps) -> u64 {
        let late_ns = std::mem::take(&mut self.late_ns);
        self.note_ending(late_ns + laps.publish_cpu_ns);
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
    use crate::time::ManualClock;

    fn after(publishings_us: impl Iterator<Item = u64>) -> Floor {
        let mut floor = Floor::default();
        publishings_us.for_each(|us| floor.note_ending(1_000 * us));
        floor
    }

    #[test]
    fn a_small_budget_keeps_back_what_publishing_took_lately_and_a_large_one_what_it_took_at_worst()
    {
        let quiet = std::iter::repeat_n(500, 100);
        let floor = after([900].into_iter().chain(quiet));
        let kept_us = |left_us: u64| floor.reserve_ns(1_000 * left_us) / 1_000;
        assert_eq!(kept_us(0), 510);
        assert_eq!(kept_us(600), 577);
        assert_eq!(kept_us(510 + 400), 810);
        assert_eq!(kept_us(50_000), 900 + 225 + 10);
    }

    #[test]
    fn a_spike_is_forgotten_after_the_windows() {
        let kept_ns = |ticks: usize| {
            let floor = after([5_000].into_iter().chain(std::iter::repeat_n(500, ticks)));
            floor.reserve_ns(50_000_000)
        };
        assert!(kept_ns(WINDOW * (WINDOWS - 1)) > 5_000_000);
        assert!(kept_ns(WINDOW * WINDOWS) < 650_000);
    }

    #[test]
    fn a_deadline_is_passed_by_what_this_thread_did_and_not_by_what_was_late_before_or_others_had()
    {
        let late_us = |began_us: u64, deadline_us: u64, ran_us: u64, others_us: u64| {
            let clock = ManualClock::new(1_000 * began_us);
            let mut began = Began::now(&clock);
            clock.advance(1_000 * (ran_us + others_us));
            // The manual clock has no other threads: the thread had run for that much longer before.
            began.cpu_ns += 1_000 * others_us;
            began.passed_ns(1_000 * deadline_us, &clock) / 1_000
        };
        assert_eq!(late_us(100, 200, 130, 0), 30);
        assert_eq!(late_us(100, 200, 80, 0), 0);
        assert_eq!(late_us(300, 200, 10, 0), 10);
        assert_eq!(late_us(100, 200, 130, 5_000), 30);
    }

    #[test]
    fn before_the_first_tick_only_closing_is_kept_back() {
        assert_eq!(Floor::default().reserve_ns(1_000_000), CLOSING_NS);
    }
}
