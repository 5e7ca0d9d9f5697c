//! When the operating system, or the host below it, is due to interrupt the thread.
//!
//! A kernel's timer interrupts a core 100 to 1,000 times a second, to the microsecond. That takes 1 to 5 us; on a
//! virtual machine 20 to 60, and two timers beat there, the guest's and its host's. Work that ends within its budget
//! but for such an interrupt is late by as much as it takes. It is due at a known moment, though: work that it would
//! carry past its end can end before it. That costs a tick some 2 us on average, where two timers take 50 us each.

use crate::time::Gap;

/// Gaps remembered, the oldest overwritten first, ...
const SEEN: usize = 64;
/// ... and for how long, nanoseconds: a host's clock drifts against the guest's (7 us a second where it was measured).
const RECENT_NS: u64 = 1_000_000_000;
/// Shorter gaps between two reads of the clock are work, nanoseconds.
const SHORTEST_NS: u64 = 18_000;
/// A thread that was away for longer met more than a timer.
const LONGEST_NS: u64 = 100_000;
/// At 1,000 Hz, and at what divides it, all of a timer's interrupts have the same place in this, nanoseconds.
const PERIOD_NS: u64 = 1_000_000;
/// Places so near are one timer's, nanoseconds: the clock was last read as long before as a unit of work takes.
const NEAR_NS: u64 = 10_000;
/// So many gaps at one place are a timer: long units of work lie anywhere.
const AGREE: usize = 5;
/// Work that is to end before an interrupt ends so much before it is due, nanoseconds.
const BEFORE_NS: u64 = 2_000;

/// Gaps between two reads of the clock that may have been interrupts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interrupts {
    seen: [Gap; SEEN],
    next: usize,
}

impl Default for Interrupts {
    fn default() -> Self {
        Self {
            seen: [Gap::default(); SEEN],
            next: 0,
        }
    }
}

impl Interrupts {
    /// Takes the longest gap of a stretch of work.
    pub(super) fn note(&mut self, gap: Gap) {
        if gap.ns >= SHORTEST_NS {
            let ns = gap.ns.min(LONGEST_NS);
            self.seen[self.next % SEEN] = Gap { ns, ..gap };
            self.next += 1;
        }
    }

    /// When work is to end that goes on now and has until `end_ns`: then, or before the first interrupt that would
    /// carry it past that.
    pub(super) fn clear_end_ns(&self, now_ns: u64, end_ns: u64) -> u64 {
        let since_ns = end_ns.saturating_sub(RECENT_NS);
        let is_recent = |gap: &&Gap| gap.ns > 0 && gap.from_ns >= since_ns && gap.from_ns <= end_ns;
        let recent = || self.seen.iter().filter(is_recent);
        let of_one_timer = |one: &Gap, other: &Gap| {
            let apart_ns = one.from_ns.abs_diff(other.from_ns) % PERIOD_NS;
            apart_ns.min(PERIOD_NS - apart_ns) <= NEAR_NS
        };
        // The last time before the end when the timer that made this gap, if one did, will interrupt.
        let due_ns = |gap: &Gap| end_ns - (end_ns - gap.from_ns) % PERIOD_NS;
        recent()
            .filter(|gap| due_ns(gap) + gap.ns > end_ns && due_ns(gap) > now_ns + BEFORE_NS)
            .filter(|gap| recent().filter(|other| of_one_timer(gap, other)).count() >= AGREE)
            .map(|gap| due_ns(gap) - BEFORE_NS)
            .fold(end_ns, u64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A machine whose timers interrupt work: a guest's at 250 Hz for 50 us, and a host's at 1,000 Hz for 30 us, which
    /// drifts by 7 us a second.
    fn timers(now_ns: u64, until_ns: u64) -> impl Iterator<Item = Gap> {
        let due = move |first_ns: u64, period_ns: u64, ns: u64| {
            let after = now_ns.saturating_sub(first_ns).div_ceil(period_ns);
            let from_ns = first_ns + after * period_ns;
            (from_ns < until_ns).then_some(Gap { from_ns, ns })
        };
        let guest = due(977_000, 4_000_000, 50_000);
        let host = due(438_000, 1_000_007, 30_000);
        guest.into_iter().chain(host)
    }

    /// Numbers in no order that means anything.
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
        let mut now_ns = 5_000_000_000_u64;
        for tick in 0..20_000 {
            let end_ns = now_ns + 100_000;
            let clear_ns = interrupts.clear_end_ns(now_ns, end_ns);
            assert!(clear_ns > now_ns && clear_ns <= end_ns);
            let passes =
                |stop_ns| timers(now_ns, stop_ns).any(|t| t.from_ns + t.ns > end_ns + 5_000);
            if tick > 1_000 {
                unaware += u32::from(passes(end_ns));
                late += u32::from(passes(clear_ns));
                given_up_ns += end_ns - clear_ns;
            }
            // The clock was last read some time before; one stretch in thirty holds a long unit of work instead.
            let jitter_ns = random() % 3_000;
            if let Some(timer) = timers(now_ns, clear_ns).max_by_key(|timer| timer.ns) {
                interrupts.note(Gap {
                    from_ns: timer.from_ns - jitter_ns,
                    ns: timer.ns + jitter_ns,
                });
            } else if random() % 30 == 0 {
                interrupts.note(Gap {
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
    fn long_units_of_work_are_no_timer() {
        let (mut interrupts, mut random) = (Interrupts::default(), scattered());
        let mut heeded = 0;
        for tick in 0..10_000_u64 {
            let now_ns = 1_000_000_000 + tick * 730_001;
            let end_ns = now_ns + 100_000;
            heeded += u32::from(interrupts.clear_end_ns(now_ns, end_ns) < end_ns);
            interrupts.note(Gap {
                from_ns: now_ns + random() % 80_000,
                ns: 20_000,
            });
        }
        assert!(heeded < 600, "{heeded} of 10,000");
        let mut short = Interrupts::default();
        (0..64).for_each(|at| {
            short.note(Gap {
                from_ns: at * PERIOD_NS,
                ns: 9_000,
            });
        });
        assert_eq!(
            short.clear_end_ns(64 * PERIOD_NS - 50_000, 64 * PERIOD_NS + 1_000),
            64 * PERIOD_NS + 1_000
        );
    }

    #[test]
    fn what_was_seen_long_ago_is_forgotten() {
        let mut interrupts = Interrupts::default();
        (1..10).for_each(|at| {
            interrupts.note(Gap {
                from_ns: at * PERIOD_NS,
                ns: 30_000,
            });
        });
        let end_ns = 20 * PERIOD_NS + 10_000;
        assert_eq!(
            interrupts.clear_end_ns(end_ns - 50_000, end_ns),
            end_ns - 12_000
        );
        // It is there already, or would be over in time.
        assert_eq!(interrupts.clear_end_ns(end_ns - 10_000, end_ns), end_ns);
        assert_eq!(
            interrupts.clear_end_ns(end_ns - 10_000, end_ns + 25_000),
            end_ns + 25_000
        );
        let later_ns = end_ns + RECENT_NS;
        assert_eq!(
            interrupts.clear_end_ns(later_ns - 50_000, later_ns),
            later_ns
        );
    }
}
