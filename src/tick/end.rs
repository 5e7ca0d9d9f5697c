//! When a tick is to end: its budget of time, shortened by the deadlines that its frames carry.

use crate::narrow::Order;
use crate::time::{Budget, Clock};
use crate::wire::FrameHeader;

/// The time of a tick, nanoseconds of `CLOCK_MONOTONIC`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct End {
    woke_ns: u64,
    /// `None`: nothing limits it.
    end_ns: Option<u64>,
}

impl End {
    /// Of the budget alone.
    pub(super) fn of(woke_ns: u64, budget: Budget) -> Self {
        let end_ns = budget.time_ns.map(|ns| woke_ns.saturating_add(ns));
        Self { woke_ns, end_ns }
    }

    /// Shortens it by what a frame says, where it says so; never lengthens it. For frames that were admitted only: who
    /// is refused has no say in how long others' answers may take.
    ///
    /// * `received_ns` - when it was received, `CLOCK_BOOTTIME`; 0: at `now_ns`. The time that it has left counts from
    ///   there, not from the wake-up: what the tick takes before it begins would be charged twice.
    /// * `now_ns` - `CLOCK_BOOTTIME`.
    pub(super) fn shorten(
        &mut self,
        header: &FrameHeader,
        (received_ns, now_ns): (u64, u64),
        clock: &dyn Clock,
    ) {
        let own = (header.deadline_ns != 0).then_some(header.deadline_ns);
        let left = (header.time_left_ns != 0).then(|| {
            let received_ns = if received_ns == 0 {
                now_ns
            } else {
                received_ns
            };
            // The receipt on `CLOCK_MONOTONIC`.
            let read_ns = clock.monotonic_ns();
            let ago_ns = clock.boottime_ns().saturating_sub(received_ns);
            let end_ns = read_ns.saturating_add(header.time_left_ns);
            // A receipt is a little behind the wake-up, from which the budget counts: that is never more than was left.
            let most_ns = self.woke_ns.saturating_add(header.time_left_ns);
            end_ns.saturating_sub(ago_ns).min(most_ns)
        });
        let earliest = [self.end_ns, own, left].into_iter().flatten().min();
        self.end_ns = earliest;
    }

    /// When it is; `None`: nothing limits it.
    pub(super) fn at_ns(self) -> Option<u64> {
        self.end_ns
    }

    /// The time it leaves from wake-up on, for the tick's row.
    pub(super) fn budget_ns(self) -> u64 {
        (self.end_ns).map_or(u64::MAX, |end_ns| end_ns.saturating_sub(self.woke_ns))
    }

    /// Whether a tick of this length ends after it.
    pub(super) fn is_over(self, elapsed_ns: u64) -> bool {
        (self.end_ns).is_some_and(|end_ns| self.woke_ns.saturating_add(elapsed_ns) > end_ns)
    }

    /// The order of work for it. Where work may be cut off each pair is to have its turn, whoever cuts it.
    pub(super) fn order(self, budget: Budget) -> Order {
        match (budget.time_ns, budget.units) {
            (None, Some(_)) => Order::Counted,
            _ if self.end_ns.is_some() => Order::Aged,
            _ => Order::AsFound,
        }
    }
}
