//! Ages: which bodies have become too old, how far stale ones may have got, and when the next one is due.
//!
//! In: the time on `CLOCK_BOOTTIME`, which runs on while the machine is suspended. Out: bodies settled anew, the
//! nearest time-out, the oldest and newest stamp in use.

use super::World;
use super::body::Body;
use super::census::{slot_at, source_at};
use super::source::SourceState;
use crate::config::OnStale;
use crate::ids::BodySlot;
use crate::wire::BodyStatus;

/// No deadline, no stamp.
const NONE: u64 = u64::MAX;

/// Deadlines and stamps by slot, side by side so that a tick reads them in one sweep (some 1 ns a body).
#[derive(Clone, Debug, Default)]
pub(super) struct Ages {
    list: Vec<Age>,
    oldest_ns: u64,
    newest_ns: u64,
    next_ns: Option<u64>,
}

#[derive(Clone, Copy, Debug)]
struct Age {
    deadline_ns: u64,
    stamp_ns: u64,
}

impl Ages {
    pub(super) fn grow(&mut self, len: usize) {
        let nothing = Age {
            deadline_ns: NONE,
            stamp_ns: NONE,
        };
        self.list.resize(len.max(self.list.len()), nothing);
    }

    pub(super) fn set(&mut self, slot: BodySlot, deadline_ns: Option<u64>, stamp_ns: Option<u64>) {
        self.list[slot.index()] = Age {
            deadline_ns: deadline_ns.unwrap_or(NONE),
            // A sender that does not stamp says 0, which is older than any time.
            stamp_ns: stamp_ns
                .filter(|s| *s != 0)
                .map_or(NONE, |s| s.min(NONE - 1)),
        };
    }

    /// Whatever its deadline was, it is now.
    fn set_due(&mut self, slot: BodySlot) {
        self.list[slot.index()].deadline_ns = 0;
    }

    pub(super) fn deadline_ns(&self, slot: BodySlot) -> Option<u64> {
        let deadline_ns = self.list.get(slot.index())?.deadline_ns;
        (deadline_ns != NONE).then_some(deadline_ns)
    }

    pub(super) fn stamps(&self) -> (u64, u64) {
        (self.oldest_ns, self.newest_ns)
    }

    /// Nearest deadline, oldest and newest stamp.
    fn sweep(&mut self) {
        let (mut next_ns, mut oldest_ns, mut newest_ns) = (NONE, NONE, 0);
        for age in &self.list {
            next_ns = next_ns.min(age.deadline_ns);
            oldest_ns = oldest_ns.min(age.stamp_ns);
            // No stamp wraps to 0: it is newer than nothing.
            newest_ns = newest_ns.max(age.stamp_ns.wrapping_add(1));
        }
        self.next_ns = (next_ns != NONE).then_some(next_ns);
        self.oldest_ns = if oldest_ns == NONE { 0 } else { oldest_ns };
        self.newest_ns = newest_ns.saturating_sub(1);
    }
}

impl World {
    /// Sets the time-out of a source: from the next tick on it is what every age is judged by, also of what was sent
    /// before.
    pub fn set_timeout(&mut self, source: usize, timeout_ns: u64) {
        if let Some(source) = self.sources.get_mut(source) {
            source.next_timeout_ns = Some(timeout_ns);
        }
    }

    /// A tick begins with the time-outs that were set since the last: whom one concerns [`World::age`] judges anew.
    pub(super) fn take_timeouts(&mut self) {
        for (place, state) in self.sources.iter_mut().enumerate() {
            let Some(timeout_ns) = state.next_timeout_ns.take() else {
                continue;
            };
            state.timeout_ns = timeout_ns;
            for (_, slot) in &self.order {
                let body = self.bodies[slot.index()].as_ref();
                if body.is_some_and(|body| body.source == Some(source_at(place))) {
                    self.ages.set_due(*slot);
                }
            }
        }
    }

    /// Judges every age at `now_boot_ns` and closes the tick's change set: frames that waited, bodies too old, the
    /// growing reach of stale ones, attached bodies, what edits mean for the filters.
    pub fn age(&mut self, now_boot_ns: u64) {
        self.now_ns = self.now_ns.max(now_boot_ns);
        for place in 0..self.sources.len() {
            self.flush_waiting(source_at(place));
            let source = &mut self.sources[place];
            let age_ns = self.now_ns.saturating_sub(source.since_ns);
            source.alive = source.newest.is_some() && age_ns < source.timeout_ns;
        }
        self.settle_attached();
        self.recount();
        self.ages.sweep();
        if self.ages.next_ns.is_some_and(|next| next <= self.now_ns) {
            self.settle_expired();
            self.ages.sweep();
        }
        self.grow_reaches();
    }

    /// When the next body, source or waiting frame reaches its time-out, nanoseconds of `CLOCK_BOOTTIME`; `None`: none
    /// will. As of [`World::age`].
    #[must_use]
    pub fn next_timeout(&self) -> Option<u64> {
        let sources = self
            .sources
            .iter()
            .flat_map(|s| [s.deadline_ns(), s.waiting.until_ns]);
        sources.chain([self.ages.next_ns]).flatten().min()
    }

    fn settle_expired(&mut self) {
        for index in 0..self.bodies.len() {
            let slot = slot_at(index);
            if self
                .ages
                .deadline_ns(slot)
                .is_some_and(|d| d <= self.now_ns)
            {
                self.settle(slot, false);
            }
        }
    }

    /// Stale bodies get farther with every tick; those that are stale no more leave the list.
    fn grow_reaches(&mut self) {
        let mut growing = std::mem::take(&mut self.growing);
        growing.retain(|&slot| {
            self.settle(slot, false);
            let still = self
                .body(slot)
                .is_some_and(|body| body.status == BodyStatus::Stale && body.reach_m.is_finite());
            self.entries[slot.index()].growing = still;
            still
        });
        self.growing = growing;
    }

    /// Attached bodies take pose, age and unknown from the body they hang on.
    pub(super) fn settle_attached(&mut self) {
        for place in 0..self.attached.len() {
            let slot = self.attached[place];
            let entry = &self.entries[slot.index()];
            let (root, root_pose) = (entry.root, entry.root_pose);
            if self.entries[root.index()].touched != self.tick && entry.touched != self.tick {
                continue;
            }
            let Some(root) = self.body(root) else {
                continue;
            };
            let pose = root.pose * root_pose;
            let (stamp_ns, since_ns, received_ns) =
                (root.stamp_ns, root.since_ns, root.received_ns);
            let reject = root.reject;
            let moved = self.place_attached(slot, &pose);
            if let Some(body) = self.bodies[slot.index()].as_mut() {
                body.stamp_ns = stamp_ns;
                body.since_ns = since_ns;
                body.received_ns = received_ns;
                body.reject = reject;
                // Not that of the root: a lever makes it larger.
                body.velocity = None;
            }
            self.settle(slot, moved);
        }
    }

    fn source_of(&self, body: &Body) -> Option<&SourceState> {
        body.source.and_then(|s| self.sources.get(s.index()))
    }

    /// The time-out of a body's source; none for a body without one, which cannot move.
    pub(super) fn timeout_of(&self, body: &Body) -> u64 {
        self.source_of(body).map_or(u64::MAX, |s| s.timeout_ns)
    }

    /// What happens to a body that is too old, as it or its source says.
    pub(super) fn on_stale_of(&self, body: &Body) -> OnStale {
        let of_source = self.source_of(body).map(|s| s.on_stale);
        body.on_stale.or(of_source).unwrap_or_default()
    }
}
