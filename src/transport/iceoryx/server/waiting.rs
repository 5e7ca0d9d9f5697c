//! Waking up: by the wake-up port, or by spinning.

use std::time::Duration;

use iceoryx2::port::EventActivation;
use iceoryx2::port::listener::ListenerWaitError;

use super::Server;
use crate::error::Result;
use crate::time::Clock;
use crate::transport::Wake;
use crate::transport::iceoryx::qos::{events, failed};

/// Spins of a busy poll between two looks at the wake-up port, whose socket costs a system call.
const SPINS_PER_LOOK: u32 = 1024;

impl Server {
    fn pending(&self) -> bool {
        let some = |has: std::result::Result<bool, _>| has.unwrap_or(true);
        some(self.transforms.subscriber.has_samples())
            || some(self.transforms_vel.subscriber.has_samples())
            || some(self.answers.has_requests())
    }

    /// Spins until there is something to receive; looks at the wake-up port now and then for who came and left.
    pub(super) fn spin(&mut self, timeout_ns: u64, clock: &dyn Clock) -> Result<Wake> {
        let until_ns = clock.monotonic_ns().saturating_add(timeout_ns);
        loop {
            for _ in 0..SPINS_PER_LOOK {
                if self.pending() {
                    // the notices stay where they are: while they do, neither side pays a system call for more
                    return Ok(Wake {
                        notified: true,
                        ..Wake::default()
                    });
                }
                std::hint::spin_loop();
            }
            let wake = self.listen(Duration::ZERO)?;
            if wake != Wake::default() || clock.monotonic_ns() >= until_ns {
                return Ok(wake);
            }
        }
    }

    pub(super) fn listen(&mut self, timeout: Duration) -> Result<Wake> {
        let mut wake = Wake::default();
        let note = |activation: EventActivation| match activation.id.as_value() {
            events::DEAD | events::CREATED | events::DROPPED => wake.peers_changed = true,
            _ => wake.notified = true,
        };
        let heard = if timeout.is_zero() {
            self.wake.try_wait(note)
        } else {
            self.wake.timed_wait(note, timeout)
        };
        match heard {
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
