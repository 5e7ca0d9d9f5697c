//! Clocks, and the work budget of a tick.
//!
//! Two clocks: `boottime` for ages (it includes suspended time, so data from before a suspend counts as old)
//! and `monotonic` for deadlines. Nothing else in the crate reads a clock.

mod meter;
mod seldom;

pub use meter::{Meter, Pause, Reserve, Share};
pub use seldom::Seldom;

use std::sync::atomic::{AtomicU64, Ordering};

/// The engine's source of time.
pub trait Clock: Send + Sync {
    /// Nanoseconds on `CLOCK_BOOTTIME`: ages, time-outs.
    fn boottime_ns(&self) -> u64;
    /// Nanoseconds on `CLOCK_MONOTONIC`: deadlines, durations.
    fn monotonic_ns(&self) -> u64;
    /// Nanoseconds of CPU time of the calling thread: overshoot without the scheduler's share.
    fn thread_cpu_ns(&self) -> u64;
}

/// The machine's clocks.
#[derive(Clone, Copy, Debug, Default)]
pub struct SystemClock;

impl SystemClock {
    /// Nanoseconds since 1970 on `CLOCK_REALTIME`: only for stamps that people and other programs read.
    #[must_use]
    pub fn realtime_ns(&self) -> u64 {
        Self::read(rustix::time::ClockId::Realtime)
    }

    fn read(id: rustix::time::ClockId) -> u64 {
        let now = rustix::time::clock_gettime(id);
        let seconds = u64::try_from(now.tv_sec).unwrap_or(0);
        seconds * 1_000_000_000 + u64::try_from(now.tv_nsec).unwrap_or(0)
    }
}

impl Clock for SystemClock {
    fn boottime_ns(&self) -> u64 {
        Self::read(rustix::time::ClockId::Boottime)
    }

    fn monotonic_ns(&self) -> u64 {
        Self::read(rustix::time::ClockId::Monotonic)
    }

    fn thread_cpu_ns(&self) -> u64 {
        Self::read(rustix::time::ClockId::ThreadCPUTime)
    }
}

/// A clock for tests, advanced explicitly; each read can also advance it by a fixed step.
#[derive(Debug, Default)]
pub struct ManualClock {
    now_ns: AtomicU64,
    step_ns: AtomicU64,
}

impl ManualClock {
    /// A clock that shows `now_ns` until it is advanced.
    #[must_use]
    pub fn new(now_ns: u64) -> Self {
        Self {
            now_ns: AtomicU64::new(now_ns),
            step_ns: AtomicU64::new(0),
        }
    }

    /// Advances the clock, nanoseconds.
    pub fn advance(&self, ns: u64) {
        self.now_ns.fetch_add(ns, Ordering::Relaxed);
    }

    /// From now on each read advances the clock by `ns` nanoseconds, so that a loop that polls the clock ends.
    pub fn step_each_read(&self, ns: u64) {
        self.step_ns.store(ns, Ordering::Relaxed);
    }

    fn read(&self) -> u64 {
        self.now_ns
            .fetch_add(self.step_ns.load(Ordering::Relaxed), Ordering::Relaxed)
    }
}

impl Clock for ManualClock {
    fn boottime_ns(&self) -> u64 {
        self.read()
    }

    fn monotonic_ns(&self) -> u64 {
        self.read()
    }

    fn thread_cpu_ns(&self) -> u64 {
        self.read()
    }
}

/// What one tick may spend on narrowing: until a deadline, or for a count of work units, whichever ends first.
///
/// A work unit is one exact convex query, triangle pair, node test or node of an inside test.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Budget {
    /// Wall time from wake-up to the last message handed over, nanoseconds; `None`: no limit.
    pub time_ns: Option<u64>,
    /// Work units; `None`: no limit. With units and no time every choice depends on counted work only.
    pub units: Option<u64>,
}

impl Budget {
    /// Neither time nor units are limited.
    pub const UNLIMITED: Self = Self {
        time_ns: None,
        units: None,
    };

    /// Whether time or units are limited.
    #[must_use]
    pub fn is_limited(self) -> bool {
        self.time_ns.is_some() || self.units.is_some()
    }

    /// Limited by counted work only, so that a run can be replayed bit for bit.
    #[must_use]
    pub fn units(units: u64) -> Self {
        Self {
            time_ns: None,
            units: Some(units),
        }
    }

    /// Limited by wall time only.
    #[must_use]
    pub const fn time_ns(time_ns: u64) -> Self {
        Self {
            time_ns: Some(time_ns),
            units: None,
        }
    }
}
