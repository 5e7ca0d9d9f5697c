//! What is left of a tick's budget after its outbox was handed over: narrowing goes on, and the next tick tells what it
//! found.
//!
//! More is kept back for publishing than it mostly takes, because how long it takes varies; what it did not take is
//! used here.

use super::Engine;
use crate::narrow::Wanted;
use crate::time::Meter;
use crate::world::{BuiltTree, TreeOf, WornTree};

/// Kept back of the tick's end, nanoseconds: the query that is under way then, and closing the work lists.
const LAST_NS: u64 = 10_000;

/// The last tick's budget after its outbox was handed over.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rest {
    /// What was asked of the narrow phase, and when the tick's time is up, `CLOCK_MONOTONIC` nanoseconds; `None`:
    /// nothing is left to do, or to do it in.
    pub(super) open: Option<(Wanted, u64)>,
    /// Used so far, nanoseconds and work units.
    pub(super) spent_ns: u64,
    pub(super) units: u64,
}

impl Engine {
    /// A tree that has become loose, to be built by a worker; see [`crate::world::World::worn_tree`].
    #[must_use]
    pub fn worn_tree(&self) -> Option<WornTree> {
        self.world.worn_tree()
    }

    /// Puts a built tree in place, between two ticks; pairs of the body then start from its root. Whether it was taken.
    pub fn take_tree(&mut self, built: BuiltTree) -> bool {
        self.world.take_tree(built)
    }

    /// A tree could not be built; see [`crate::world::World::refuse_tree`].
    pub fn refuse_tree(&mut self, of: TreeOf) -> Option<String> {
        self.world.refuse_tree(of)
    }

    /// Works on what the last tick left undone, within its budget of time and for at most `slice_ns`; what is found
    /// goes out with the next tick. Returns whether there is more to do and time to do it.
    ///
    /// Ticks under a budget of work units do not go on: they replay bit for bit.
    pub fn work_on(&mut self, slice_ns: u64) -> bool {
        let Some((wanted, end_ns)) = self.rest.open.take() else {
            return false;
        };
        let start_ns = self.clock.monotonic_ns();
        let left_ns = end_ns.saturating_sub(start_ns + LAST_NS);
        if left_ns == 0 {
            return false;
        }
        let stop_ns = start_ns + left_ns.min(slice_ns);
        let mut meter = Meter::new(self.clock.as_ref(), Some(stop_ns), None);
        let done = self.narrow.go_on(&mut self.world, wanted, &mut meter);
        self.rest.units += meter.spent();
        self.rest.spent_ns += self.clock.monotonic_ns().saturating_sub(start_ns);
        let more = !done && left_ns > slice_ns;
        self.rest.open = more.then_some((wanted, end_ns));
        more
    }
}
