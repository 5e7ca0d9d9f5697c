//! When the operating system, or the host below it, will interrupt the thread.
//!
//! A kernel's timer interrupts a core 100 to 1,000 times a second, precise to the microsecond. That takes 1 to 5 us; on
//! a virtual machine 20 to 60, with two timers, the guest's and its host's. Work that would end within its budget is
//! late by the duration of such an interrupt. But the interrupt comes at a predictable time: work that it would delay
//! past its end can end before it. That costs a tick some 2 us on average, with two timers of 50 us each.

use crate::time::Pause;

/// Number of pauses remembered, the oldest overwritten first.
const SEEN: usize = 128;
/// How long a pause is remembered, nanoseconds. If ticks end before an interrupt, it is not seen: where each tick has
/// the same phase, the interrupt must be met again after this time. If this is longer, outdated phases are kept: a
/// host's clock drifts against the guest's, by 7 us a second where it was measured.
const RECENT_NS: u64 = 10_000_000_000;
/// Shorter pauses between two reads of the clock are work, nanoseconds.
const SHORTEST_NS: u64 = 18_000;
/// Longer pauses have another cause than a timer, nanoseconds.
const LONGEST_NS: u64 = 100_000;
/// At 1,000 and 250 Hz the interrupts of a timer have few phases within this period, nanoseconds.
const PERIOD_NS: u64 = 4_000_000;
/// Phases this close belong to one timer, nanoseconds: the last read of the clock is up to one unit of work earlier.
const NEAR_NS: u64 = 10_000;
/// This many pauses at one phase are a timer: long units of work have random phases.
const AGREE: usize = 5;
/// Work that must end before an interrupt ends this much before it is due, nanoseconds.
const BEFORE_NS: u64 = 2_000;

/// Pauses between two reads of the clock that may have been interrupts.
#[derive(Clone, Debug)]
pub(super) struct Interrupts {
    seen: [Pause; SEEN],
    next: usize,
}

impl Default for Interrupts {
    fn default() -> Self {
        Self {
            seen: [Pause::default(); SEEN],
            next: 0,
        }
    }
}

impl Interrupts {
    /// Takes the longest pause of a stretch of work.
    pub(super) fn note(&mut self, pause: Pause) {
        if (SHORTEST_NS..=LONGEST_NS).contains(&pause.ns) {
            self.seen[self.next % SEEN] = pause;
            self.next += 1;
        }
    }

    /// When work must end that starts at `now_ns` and has until `end_ns`: at that time, or before the first interrupt
    /// that would delay it past that; before `now_ns` if that interrupt is just due.
    ///
    /// * `closing_ns` - time needed after the last unit of work.
    pub(super) fn clear_end_ns(&self, now_ns: u64, end_ns: u64, closing_ns: u64) -> u64 {
        let lately = end_ns.saturating_sub(RECENT_NS)..=end_ns;
        let recent = || {
            let seen = self.seen.iter().filter(|pause| pause.ns > 0);
            seen.filter(|pause| lately.contains(&pause.from_ns))
        };
        let of_one_timer = |one: &Pause, other: &Pause| {
            let apart_ns = one.from_ns.abs_diff(other.from_ns) % PERIOD_NS;
            apart_ns.min(PERIOD_NS - apart_ns) <= NEAR_NS
        };
        // The last time before the end at which the timer behind this pause, if there is one, will interrupt.
        let due_ns = |pause: &Pause| end_ns - (end_ns - pause.from_ns) % PERIOD_NS;
        recent()
            .filter(|pause| due_ns(pause) + pause.ns + closing_ns > end_ns)
            .filter(|pause| due_ns(pause) + NEAR_NS > now_ns)
            .filter(|pause| recent().filter(|other| of_one_timer(pause, other)).count() >= AGREE)
            .map(|pause| due_ns(pause).saturating_sub(BEFORE_NS))
            .fold(end_ns, u64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLOSING_NS: u64 = 5_000;

    /// A machine whose timers interrupt work: a guest's at 250 Hz for 50 us, and a host's at 1,000 Hz for 30 us, which
    /// drifts by 7 us a second.
    fn timers(now_ns: u64, until_ns: u64) -> impl Iterator<Item = Pause> {
        let due = move |first_ns: u64, period_ns: u64, ns: u64| {
            let after = now_ns.saturating_sub(first_ns).div_ceil(period_ns);
            let from_ns = first_ns + after * period_ns;
            (from_ns < until_ns).then_some(Pause { from_ns, ns })
        };
        let guest = due(977_000, 4_000_000, 50_000);
        let host = due(438_000, 1_000_007, 30_000);
        guest.into_iter().chain(host)
    }

    /// Pseudo-random numbers.
    fn scattered() -> impl FnMut() -> u64 {
        let mut random = 7_u64;
        move || {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            random >> 33
        }
    }

    #[test]
    fn work_ends_before_a_timer_that_would_carry_it_past_its_end_and_gives_up_little() {
        let (mut interrupts, mut random) = (Interrupts::default(), scattered());
        let (mut late, mut unaware, mut given_up_ns) = (0, 0, 0);
        let mut now_ns = 50_000_000_000_u64;
        for tick in 0..20_000 {
            let end_ns = now_ns + 100_000;
            let clear_ns = interrupts.clear_end_ns(now_ns, end_ns, CLOSING_NS);
            assert!(clear_ns + BEFORE_NS + NEAR_NS >= now_ns && clear_ns <= end_ns);
            let passes =
                |stop_ns| timers(now_ns, stop_ns).any(|timer| timer.from_ns + timer.ns > end_ns);
            if tick > 1_000 {
                unaware += u32::from(passes(end_ns));
                late += u32::from(passes(clear_ns));
                given_up_ns += end_ns - clear_ns;
            }
            // The clock was last read some time before; one stretch in thirty has a long unit of work instead.
            let jitter_ns = random() % 3_000;
            if let Some(timer) = timers(now_ns, clear_ns).max_by_key(|timer| timer.ns) {
                interrupts.note(Pause {
                    from_ns: timer.from_ns - jitter_ns,
                    ns: timer.ns + jitter_ns,
                });
            } else if random() % 30 == 0 {
                interrupts.note(Pause {
                    from_ns: now_ns + random() % 80_000,
                    ns: 20_000,
                });
            }
            now_ns = end_ns + 200_000 + random() % 50_000;
        }
        assert!(unaware > 500, "{unaware} of 19,000 would be late");
        assert!(late * 20 < unaware, "{late} late, {unaware} unaware");
        assert!(given_up_ns / 19_000 < 4_000, "{given_up_ns} ns given up");
    }

    #[test]
    fn a_tick_that_has_one_place_among_interrupts_meets_few() {
        let mut interrupts = Interrupts::default();
        let mut late = 0;
        // 100 Hz ticks with a guest's timer at 250 Hz: each second tick would overrun by 30 us.
        for tick in 0..10_000_u64 {
            let now_ns = 1_000_000_000 + tick * 10_000_000 + 697_000;
            let end_ns = now_ns + 300_000;
            let clear_ns = interrupts.clear_end_ns(now_ns, end_ns, CLOSING_NS);
            let mut met = timers(now_ns, clear_ns).filter(|timer| timer.ns == 50_000);
            if let Some(timer) = met.next() {
                interrupts.note(timer);
                late += 1;
            }
        }
        assert!((5..100).contains(&late), "{late} of 10,000");
    }

    #[test]
    fn long_units_of_work_are_no_timer() {
        let (mut interrupts, mut random) = (Interrupts::default(), scattered());
        let mut heeded = 0;
        for tick in 0..10_000_u64 {
            let now_ns = 1_000_000_000 + tick * 730_001;
            let end_ns = now_ns + 100_000;
            heeded += u32::from(interrupts.clear_end_ns(now_ns, end_ns, CLOSING_NS) < end_ns);
            interrupts.note(Pause {
                from_ns: now_ns + random() % 80_000,
                ns: 20_000,
            });
        }
        assert!(heeded < 100, "{heeded} of 10,000");
        let mut short = Interrupts::default();
        for at in 1..=64 {
            short.note(Pause {
                from_ns: at * PERIOD_NS,
                ns: 9_000,
            });
        }
        let (now_ns, end_ns) = (65 * PERIOD_NS - 50_000, 65 * PERIOD_NS + 1_000);
        assert_eq!(short.clear_end_ns(now_ns, end_ns, 0), end_ns);
    }

    #[test]
    fn an_interrupt_counts_until_it_has_come_and_is_forgotten_when_none_comes() {
        let mut interrupts = Interrupts::default();
        for at in 1..10 {
            interrupts.note(Pause {
                from_ns: at * PERIOD_NS,
                ns: 30_000,
            });
        }
        let due_ns = 20 * PERIOD_NS;
        let clear = |now_ns, end_ns| interrupts.clear_end_ns(now_ns, end_ns, CLOSING_NS);
        let before_ns = due_ns - BEFORE_NS;
        assert_eq!(clear(due_ns - 50_000, due_ns + 10_000), before_ns);
        // Just due: work does not wait for it; then it is over.
        assert_eq!(clear(due_ns + 5_000, due_ns + 34_000), before_ns);
        assert_eq!(clear(due_ns + 11_000, due_ns + 34_000), due_ns + 34_000);
        // It would be over in time, including the closing work.
        assert_eq!(clear(due_ns - 50_000, due_ns + 36_000), due_ns + 36_000);
        let later_ns = due_ns + RECENT_NS + 10_000;
        assert_eq!(clear(later_ns - 50_000, later_ns), later_ns);
    }
}
