//! The rest of a tick's budget after its outbox was sent: narrowing goes on, and the next tick reports what it found.
//!
//! More time is reserved for publishing than it usually takes, because its duration varies; what it did not use is used
//! here.

use super::Engine;
use super::floor::Began;
use super::interrupts::Interrupts;
use crate::ids::BodyId;
use crate::narrow::Wanted;
use crate::time::Meter;
use crate::wire::Undelivered;
use crate::world::{BuiltTree, TreeOf, WornTree};

/// Least reserve before the tick's end, nanoseconds: for the query in progress then, and for closing the work lists.
/// Timer interrupts are avoided separately, see [`Interrupts`].
const LAST_NS: u64 = 6_000;
/// Largest reserve, as a fraction (1 / `LAST_PARTS`) of the budget above the floor.
const LAST_PARTS: u64 = 8;
/// The reserve grows by this with each tick that overruns in spite of it, nanoseconds.
const LATE_NS: u64 = 4_000;
/// The reserve shrinks by this with each tick that does not overrun, nanoseconds. Its ratio to [`LATE_NS`] sets how
/// many overrun: within the bounds one tick in a hundred and forty. With more, more are late; with less, unneeded time
/// is reserved for longer.
const IN_TIME_NS: u64 = 28;

/// The last tick's budget after its outbox was sent.
#[derive(Clone, Debug, Default)]
pub(super) struct Rest {
    /// What the narrow phase shall compute, and when the tick's time is up, `CLOCK_MONOTONIC` nanoseconds; `None`: no
    /// work or no time is left.
    pub(super) open: Option<(Wanted, u64)>,
    /// Used so far, nanoseconds and work units.
    pub(super) spent_ns: u64,
    pub(super) units: u64,
    /// Reserve before the tick's end, nanoseconds.
    last_ns: u64,
    /// Largest reserve, unless that is less than [`LAST_NS`].
    most_ns: u64,
    /// Periodic interrupts of the thread, so that none falls on the tick's end.
    pub(super) interrupts: Interrupts,
}

impl Rest {
    /// Takes the part of the budget above the floor, nanoseconds.
    pub(super) fn leave(&mut self, above_ns: u64) {
        self.most_ns = above_ns / LAST_PARTS;
        self.keep(self.last_ns);
    }

    /// Work went on until a tick's end, and overran by `late_ns` more than the reserve.
    fn note_end(&mut self, late_ns: u64) {
        let last_ns = if late_ns > 0 {
            self.last_ns + LATE_NS
        } else {
            self.last_ns.saturating_sub(IN_TIME_NS)
        };
        self.keep(last_ns);
    }

    fn keep(&mut self, last_ns: u64) {
        self.last_ns = last_ns.min(self.most_ns).max(LAST_NS);
    }
}

impl Engine {
    /// The last outbox has been sent, which took `send_ns`: part of the next tick's floor.
    pub fn note_sent(&mut self, send_ns: u64) {
        self.floor.note_send(send_ns);
        self.out.plan_changed = false;
    }

    /// What could not be delivered of the last outbox: the next one contains the missing events.
    pub fn note_undelivered(&mut self, unsent: Undelivered) {
        self.publisher.note_undelivered(unsent);
    }

    /// A tree that has become loose, for a worker to rebuild; see [`crate::world::World::worn_tree`].
    #[must_use]
    pub fn worn_tree(&self) -> Option<WornTree> {
        self.world.worn_tree()
    }

    /// The same for one body; see [`crate::world::World::worn_tree_of`].
    #[must_use]
    pub fn worn_tree_of(&self, body: BodyId) -> Option<WornTree> {
        self.world.worn_tree_of(body)
    }

    /// Puts a built tree in place, between two ticks; pairs of the body then start from its root. Returns whether it
    /// was taken.
    pub fn take_tree(&mut self, built: BuiltTree) -> bool {
        self.world.take_tree(built)
    }

    /// A tree could not be built; see [`crate::world::World::refuse_tree`].
    pub fn refuse_tree(&mut self, of: TreeOf) -> Option<String> {
        self.world.refuse_tree(of)
    }

    /// Works on what the last tick left undone, within its time budget and for at most `slice_ns`; results are sent
    /// with the next tick. Returns whether there is more to do and time for it.
    ///
    /// Not used for ticks with a budget of work units: they replay bit for bit.
    pub fn work_on(&mut self, slice_ns: u64) -> bool {
        let Some((wanted, end_ns)) = self.rest.open.take() else {
            return false;
        };
        let began = Began::now(self.clock.as_ref());
        let last_ns = self.rest.last_ns;
        let kept_ns = end_ns.saturating_sub(last_ns);
        let clear_ns = (self.rest.interrupts).clear_end_ns(began.wall_ns(), end_ns, last_ns);
        let left_ns = began.left_ns(kept_ns.min(clear_ns));
        if left_ns == 0 {
            return false;
        }
        let stop_ns = began.wall_ns() + left_ns.min(slice_ns);
        let mut meter = Meter::new(self.clock.as_ref(), Some(stop_ns), None);
        let done = self.narrow.go_on(&mut self.world, wanted, &mut meter);
        (self.publisher).note_late(self.tick, &self.world, &self.narrow);
        self.rest.units += meter.spent();
        self.rest.interrupts.note(meter.longest_pause());
        self.rest.spent_ns += self.clock.monotonic_ns().saturating_sub(began.wall_ns());
        if !done && left_ns <= slice_ns && kept_ns <= clear_ns {
            (self.rest).note_end(began.passed_ns(end_ns, self.clock.as_ref()));
        }
        let more = !done && left_ns > slice_ns;
        self.rest.open = more.then_some((wanted, end_ns));
        more
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn less_than_one_end_in_a_hundred_is_passed_and_never_more_than_its_part_is_kept_back() {
        let mut rest = Rest::default();
        rest.leave(1_200_000);
        // Each 100th end comes 60 us late, each 20th 25 us; at first these cannot be told apart.
        let late_ns = |end: u64| match (end % 100, end % 20) {
            (0, _) => 60_000,
            (_, 1) => 25_000,
            _ => 2_000_u64,
        };
        let mut passed = 0;
        for end in 1..=20_000 {
            let late_ns = late_ns(end).saturating_sub(rest.last_ns);
            passed += u64::from(late_ns > 0 && end > 10_000);
            rest.note_end(late_ns);
        }
        assert!((40..100).contains(&passed), "{passed} of 10,000");
        assert!(rest.last_ns > 25_000 && rest.last_ns < 70_000);
        rest.leave(240_000);
        assert_eq!(rest.last_ns, 30_000);
        rest.leave(0);
        assert_eq!(rest.last_ns, LAST_NS);
    }
}
