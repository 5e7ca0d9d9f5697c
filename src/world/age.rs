//! Ages: bodies that have become too old, the growing reach of stale ones, and the next time-out.
//!
//! In: the time of `CLOCK_BOOTTIME`, which goes on while the machine is suspended. Out: bodies settled again, the next
//! time-out, the oldest and newest stamp in use.

use super::World;
use super::body::Body;
use super::place::grows;
use super::source::SourceState;
use super::twist::Twist;
use crate::config::OnStale;
use crate::ids::{BodySlot, SourceSlot, small};

/// No deadline, no stamp.
const NONE: u64 = u64::MAX;
/// Bodies per block: four cache lines.
const BLOCK: usize = 16;

/// Deadlines and stamps by slot, and the extremes of each block of slots: a tick scans the blocks in which one was set,
/// and the extremes of all blocks.
#[derive(Clone, Debug, Default)]
pub(super) struct Ages {
    list: Vec<Age>,
    /// By block.
    ends: Vec<Ends>,
    /// Blocks in which one was set since the last sweep, and a flag by block.
    dirty: Vec<u32>,
    is_dirty: Vec<bool>,
    all: Ends,
}

#[derive(Clone, Copy, Debug)]
struct Age {
    deadline_ns: u64,
    stamp_ns: u64,
}

impl Age {
    const NONE: Self = Self {
        deadline_ns: NONE,
        stamp_ns: NONE,
    };
}

/// The nearest deadline, the oldest and the newest stamp of some bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Ends {
    next_ns: u64,
    oldest_ns: u64,
    /// The newest stamp plus one; 0: no stamp.
    newest_ns: u64,
}

impl Default for Ends {
    /// Of no body.
    fn default() -> Self {
        Self {
            next_ns: NONE,
            oldest_ns: NONE,
            newest_ns: 0,
        }
    }
}

impl Ends {
    fn of(ages: &[Age]) -> Self {
        ages.iter().fold(Self::default(), |ends, age| Self {
            next_ns: ends.next_ns.min(age.deadline_ns),
            oldest_ns: ends.oldest_ns.min(age.stamp_ns),
            // Without a stamp this wraps to 0.
            newest_ns: ends.newest_ns.max(age.stamp_ns.wrapping_add(1)),
        })
    }

    fn of_both(self, other: &Self) -> Self {
        Self {
            next_ns: self.next_ns.min(other.next_ns),
            oldest_ns: self.oldest_ns.min(other.oldest_ns),
            newest_ns: self.newest_ns.max(other.newest_ns),
        }
    }
}

impl Ages {
    pub(super) fn grow(&mut self, len: usize) {
        self.list.resize(len.max(self.list.len()), Age::NONE);
        let blocks = self.list.len().div_ceil(BLOCK);
        self.ends.resize(blocks, Ends::default());
        self.is_dirty.resize(blocks, false);
        self.dirty.reserve(blocks - self.dirty.len());
    }

    pub(super) fn set(&mut self, slot: BodySlot, deadline_ns: Option<u64>, stamp_ns: Option<u64>) {
        *self.at(slot) = Age {
            deadline_ns: deadline_ns.unwrap_or(NONE),
            // 0 means that the sender gives no stamp; it counts as older than any time.
            stamp_ns: stamp_ns
                .filter(|s| *s != 0)
                .map_or(NONE, |s| s.min(NONE - 1)),
        };
    }

    /// Makes a body due now, whatever its deadline was.
    fn set_due(&mut self, slot: BodySlot) {
        self.at(slot).deadline_ns = 0;
    }

    /// The age of a slot, to be set; its block is marked.
    fn at(&mut self, slot: BodySlot) -> &mut Age {
        let block = slot.index() / BLOCK;
        if !std::mem::replace(&mut self.is_dirty[block], true) {
            self.dirty.push(small(block));
        }
        &mut self.list[slot.index()]
    }

    /// The first slot from `from` on whose deadline has passed, as of the last sweep.
    fn next_due(&self, from: usize, now_ns: u64) -> Option<BodySlot> {
        let first = from / BLOCK;
        let blocks = self.ends.iter().enumerate().skip(first);
        let due = blocks.filter(|(_, ends)| ends.next_ns <= now_ns);
        let mut slots = due.flat_map(|(block, _)| from.max(block * BLOCK)..(block + 1) * BLOCK);
        let is_due = |age: &Age| age.deadline_ns <= now_ns;
        let at = slots.find(|&at| self.list.get(at).is_some_and(is_due))?;
        Some(BodySlot::at(at))
    }

    /// The oldest and the newest stamp, as of the last sweep.
    pub(super) fn stamps(&self) -> (u64, u64) {
        let Ends {
            oldest_ns,
            newest_ns,
            ..
        } = self.all;
        let oldest_ns = if oldest_ns == NONE { 0 } else { oldest_ns };
        (oldest_ns, newest_ns.saturating_sub(1))
    }

    /// The nearest deadline, as of the last sweep.
    fn next_ns(&self) -> Option<u64> {
        (self.all.next_ns != NONE).then_some(self.all.next_ns)
    }

    /// Updates the extremes of blocks in which an age was set.
    fn sweep(&mut self) {
        if self.dirty.is_empty() {
            return;
        }
        for block in self.dirty.drain(..) {
            let block = block as usize;
            let end = self.list.len().min((block + 1) * BLOCK);
            self.ends[block] = Ends::of(&self.list[block * BLOCK..end]);
            self.is_dirty[block] = false;
        }
        let of_nobody = Ends::default();
        self.all = self.ends.iter().fold(of_nobody, Ends::of_both);
    }

    /// Structure check: whether the extremes agree with deadlines and stamps.
    pub(super) fn are_whole(&self) -> bool {
        let mut blocks = self.list.chunks(BLOCK).zip(&self.ends).enumerate();
        blocks.all(|(at, (ages, ends))| self.is_dirty[at] || Ends::of(ages) == *ends)
            && (!self.dirty.is_empty() || self.all == Ends::of(&self.list))
    }
}

impl World {
    /// Sets the time-out of a source. From the next tick on it applies to all of its ages, also of poses sent before.
    pub fn set_timeout(&mut self, source: usize, timeout_ns: u64) {
        if let Some(source) = self.sources.get_mut(source) {
            source.next_timeout_ns = Some(timeout_ns);
        }
    }

    /// Applies the time-outs that were set since the last tick: [`World::age`] judges the bodies concerned again.
    pub(super) fn take_timeouts(&mut self) {
        for (place, state) in self.sources.iter_mut().enumerate() {
            let Some(timeout_ns) = state.next_timeout_ns.take() else {
                continue;
            };
            state.timeout_ns = timeout_ns;
            for (_, slot) in &self.order {
                let body = self.bodies[slot.index()].as_ref();
                if body.is_some_and(|body| body.source == Some(SourceSlot::at(place))) {
                    self.ages.set_due(*slot);
                }
            }
        }
    }

    /// Judges every age at `now_boot_ns` and completes the change set of the tick: waiting frames, bodies too old, the
    /// growing reach of stale ones, attached bodies, and the filters after edits.
    pub fn age(&mut self, now_boot_ns: u64) {
        self.now_ns = self.now_ns.max(now_boot_ns);
        for place in 0..self.sources.len() {
            self.flush_waiting(SourceSlot::at(place));
            let source = &mut self.sources[place];
            let age_ns = self.now_ns.saturating_sub(source.since_ns);
            source.alive = source.newest.is_some() && age_ns < source.timeout_ns;
        }
        self.admits = false;
        self.recall_lost();
        self.settle_attached();
        self.recount();
        self.ages.sweep();
        if self.ages.next_ns().is_some_and(|next| next <= self.now_ns) {
            self.settle_expired();
            self.ages.sweep();
        }
        self.grow_reaches();
        self.count_frames();
    }

    /// Time of the next time-out of a body, source or waiting frame, nanoseconds of `CLOCK_BOOTTIME`; `None`: none. As
    /// of [`World::age`].
    #[must_use]
    pub fn next_timeout(&self) -> Option<u64> {
        let sources = self
            .sources
            .iter()
            .flat_map(|s| [s.deadline_ns(), s.waiting.until_ns()]);
        sources.chain([self.ages.next_ns()]).flatten().min()
    }

    fn settle_expired(&mut self) {
        let mut from = 0;
        while let Some(slot) = self.ages.next_due(from, self.now_ns) {
            self.settle(slot, false);
            from = slot.index() + 1;
        }
    }

    /// Settles stale bodies, whose reach grows with every tick; bodies that are no longer stale leave the list.
    fn grow_reaches(&mut self) {
        let mut growing = std::mem::take(&mut self.growing);
        growing.retain(|&slot| {
            self.settle(slot, false);
            let body = self.body(slot);
            let still = body.is_some_and(|body| grows(body.status, body.reach_m));
            self.entries[slot.index()].growing = still;
            still
        });
        self.growing = growing;
    }

    /// Sets the velocity of a body; returns whether it changed.
    pub(super) fn take_velocity(&mut self, slot: BodySlot, velocity: Option<Twist>) -> bool {
        let Some(body) = self.bodies[slot.index()].as_mut() else {
            return false;
        };
        let was = std::mem::replace(&mut body.velocity, velocity);
        !Twist::is_same(was, velocity)
    }

    fn source_of(&self, body: &Body) -> Option<&SourceState> {
        body.source.and_then(|s| self.sources.get(s.index()))
    }

    /// The shorter time-out of the body's source and of the source of its pose; none for a body without a source, which
    /// cannot move.
    pub(super) fn timeout_of(&self, body: &Body) -> u64 {
        let own_ns = self.source_of(body).map_or(u64::MAX, |s| s.timeout_ns);
        own_ns.min(body.lent_timeout_ns)
    }

    /// Whether a body that is not attached is too old at a time, whatever its `on_stale`.
    pub(super) fn is_too_old(&self, body: &Body, now_ns: u64) -> bool {
        let age_ns = now_ns.saturating_sub(body.since_ns.unwrap_or_default());
        age_ns >= self.timeout_of(body)
    }

    /// `on_stale` of a body, or else of its source.
    pub(super) fn on_stale_of(&self, body: &Body) -> OnStale {
        let of_source = self.source_of(body).map(|s| s.on_stale);
        body.on_stale.or(of_source).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small numbers by chance"
    )]

    use super::*;
    use crate::builtin::Random;

    #[test]
    fn ends_are_those_of_all_whatever_is_set() {
        let (mut ages, mut random) = (Ages::default(), Random::new(4));
        let mut set: Vec<(Option<u64>, Option<u64>)> = Vec::new();
        for _ in 0..400 {
            if random.unit() < 0.1 || set.is_empty() {
                set.resize(
                    set.len() + (random.unit() * 40.0) as usize + 1,
                    (None, None),
                );
                ages.grow(set.len());
            }
            let mut maybe = || (random.unit() < 0.8).then(|| (random.unit() * 1e6) as u64);
            let age = (maybe(), maybe());
            let at = (random.unit() * set.len() as f64) as usize;
            set[at] = age;
            ages.set(BodySlot(at as u32), age.0, age.1);
            assert!(ages.are_whole());
            if random.unit() < 0.7 {
                ages.sweep();
                let stamps = || {
                    set.iter()
                        .filter_map(|age| age.1)
                        .filter(|stamp| *stamp != 0)
                };
                let ends = (stamps().min().unwrap_or(0), stamps().max().unwrap_or(0));
                assert_eq!(ages.stamps(), ends);
                assert_eq!(ages.next_ns(), set.iter().filter_map(|age| age.0).min());
                assert!(ages.are_whole());
                let now_ns = (random.unit() * 1e6) as u64;
                let is_due = |at: &usize| set[*at].0.is_some_and(|due_ns| due_ns <= now_ns);
                let mut told = Vec::new();
                while let Some(slot) = ages.next_due(told.last().map_or(0, |at| at + 1), now_ns) {
                    told.push(slot.index());
                }
                assert_eq!(told, (0..set.len()).filter(is_due).collect::<Vec<_>>());
            }
        }
        ages.sweep();
        ages.ends[0].newest_ns += 1;
        assert!(!ages.are_whole());
    }
}
