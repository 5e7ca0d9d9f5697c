//! Waking up: what comes within a short spin is found at once, then the thread sleeps on the wake-up port.

use std::time::Duration;

use iceoryx2::port::EventActivation;
use iceoryx2::port::listener::ListenerWaitError;
use iceoryx2::prelude::CallbackProgression;
use iceoryx2::waitset::WaitSetRunResult;

use super::Server;
use crate::error::Result;
use crate::time::Clock;
use crate::transport::Wake;
use crate::transport::iceoryx::qos::{events, failed};

/// Checks between two readings of the clock: they take as long as one reading.
const LOOKS_PER_READING: u32 = 8;
/// A thread that finds something in every spin, or never sleeps, still checks the wake-up port this often, nanoseconds:
/// it reports peers that came and left, and costs a system call.
const LISTEN_EVERY_NS: u64 = 1_000_000;
/// Shortest wait on a set of ports, which uses whole milliseconds.
const SET_WAIT_MIN: Duration = Duration::from_millis(1);
/// For longer waits an extra millisecond makes no difference, and an idle daemon wakes once.
const LONG: Duration = Duration::from_millis(20);
/// The rest of a shorter wait is slept in slices of this length: events are noticed at the end of one.
const SLICE: Duration = Duration::from_micros(100);

impl Server {
    fn pending(&self) -> bool {
        let some = |has: std::result::Result<bool, _>| has.unwrap_or(true);
        some(self.transforms.subscriber.has_samples())
            || some(self.transforms_vel.subscriber.has_samples())
            || some(self.vertices.subscriber.has_samples())
            || some(self.answers.has_requests())
    }

    /// Spins as long as the options say, then sleeps for the rest of the time.
    ///
    /// The notifications of what a spin has found stay in the port: meanwhile neither side pays a system call for more,
    /// and the next sleep ends at once without need.
    pub(super) fn spin_then_sleep(&mut self, timeout_ns: u64, clock: &dyn Clock) -> Result<Wake> {
        // A large request is copied in parts, with checks for other messages between them.
        if self.arrivals.is_more() {
            let mut wake = self.listen()?;
            wake.notified = true;
            return Ok(wake);
        }
        let mut now_ns = clock.monotonic_ns();
        let until_ns = now_ns.saturating_add(timeout_ns);
        // A check without waiting does not show how soon the other side answers.
        let look_ns = if timeout_ns == 0 {
            0
        } else {
            self.patience.begin()
        };
        let looked_ns = now_ns.saturating_add(look_ns).min(until_ns);
        while now_ns < looked_ns {
            let found = (0..LOOKS_PER_READING).any(|_| {
                std::hint::spin_loop();
                self.pending()
            });
            let mut wake = self.listen_now_and_then(now_ns)?;
            wake.notified |= found;
            if wake != Wake::default() {
                self.patience.found();
                return Ok(wake);
            }
            now_ns = clock.monotonic_ns();
        }
        if look_ns > 0 && now_ns < until_ns {
            self.patience.missed();
        }
        self.sleep_until(until_ns, clock)
    }

    /// Sleeps until something comes or the time is up: precise to a millisecond for a long time, to a tenth of that for
    /// a short one.
    ///
    /// Not by the wake-up port's own time-out: the system counts that in ticks of its timer, 4 ms with the usual 250
    /// Hz, and rounds it up, so that 100 beats a second became 70. A wait on a set of ports uses whole milliseconds;
    /// the rest is slept in slices.
    fn sleep_until(&mut self, until_ns: u64, clock: &dyn Clock) -> Result<Wake> {
        loop {
            self.listened_ns = clock.monotonic_ns();
            let left = Duration::from_nanos(until_ns.saturating_sub(self.listened_ns));
            let mut interrupted = false;
            if left >= LONG {
                interrupted = self.wait_on_set(left)?;
            } else if left >= SET_WAIT_MIN {
                interrupted = self.wait_on_set(whole(left))?;
            } else if !left.is_zero() {
                #[allow(
                    clippy::disallowed_methods,
                    reason = "less than a wait on ports is for"
                )]
                std::thread::sleep(left.min(SLICE));
            }
            let mut wake = self.listen()?;
            wake.interrupted |= interrupted;
            if wake != Wake::default() || left.is_zero() {
                return Ok(wake);
            }
        }
    }

    /// Waits for a time, rounded up to milliseconds, or until something comes; returns whether a signal came.
    fn wait_on_set(&self, time: Duration) -> Result<bool> {
        let port = (self.sleeper.attach_notification(&self.wake)).map_err(|e| failed("wake", e))?;
        let ran = self
            .sleeper
            .wait_and_process_once_with_timeout(|_| CallbackProgression::Continue, time);
        drop(port);
        match ran {
            Ok(ran) => Ok(ran == WaitSetRunResult::Interrupt),
            Err(e) => Err(failed("wake", e)),
        }
    }

    fn listen_now_and_then(&mut self, now_ns: u64) -> Result<Wake> {
        if now_ns.saturating_sub(self.listened_ns) < LISTEN_EVERY_NS {
            return Ok(Wake::default());
        }
        self.listened_ns = now_ns;
        self.listen()
    }

    /// Takes the events from the wake-up port.
    pub(super) fn listen(&mut self) -> Result<Wake> {
        let mut wake = Wake::default();
        let note = |activation: EventActivation| match activation.id.as_value() {
            events::DEAD | events::CREATED | events::DROPPED => wake.peers_changed = true,
            _ => wake.notified = true,
        };
        match self.wake.try_wait(note) {
            Ok(_) => {}
            Err(ListenerWaitError::InterruptSignal) => {
                wake.interrupted = true;
            }
            Err(e) => return Err(failed("wake", e)),
        }
        self.peers_changed |= wake.peers_changed;
        Ok(wake)
    }
}

/// A time rounded to whole milliseconds.
fn whole(time: Duration) -> Duration {
    Duration::from_millis(u64::try_from(time.as_millis()).unwrap_or(u64::MAX))
}
