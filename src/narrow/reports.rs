//! What listeners get once every pair has its verdict: bounds first, then contacts.
//!
//! When time runs out, manifolds and contact sets are left out first, then bounds, then verdicts; what boxes and motion
//! prove is always available. So contacts get what bounds leave. For two convex bodies that collide, one query gives
//! both, so their bound comes along with their contacts, unless the last tick had no time for all bounds: then the
//! bounds of all pairs come before contacts of any.

use crate::ids::PairSlot;
use crate::time::Meter;
use crate::wire::Verdict;
use crate::world::World;

use super::mesh::Goal;
use super::pass::Pass;
use super::{Narrow, Wanted};

impl Narrow {
    /// Refreshes bounds and contacts of reported pairs. Returns whether all are done.
    pub(super) fn spend_on_reports(
        &mut self,
        world: &World,
        wanted: Wanted,
        meter: &mut Meter<'_>,
    ) -> bool {
        self.follow_demand(wanted);
        let at_once = wanted.contacts && !self.scarce;
        if wanted.bounds {
            self.spend_on_level(world, wanted, Goal::Gap, meter, |narrow, slot| {
                narrow.lacks_bound(slot) && !(at_once && narrow.says_both(slot))
            });
        }
        if wanted.contacts {
            self.spend_on_level(world, wanted, Goal::Contacts, meter, Self::lacks_contacts);
        }
        let mut all = std::mem::take(&mut self.refresh);
        all.retain(|&slot| {
            let lacks = (wanted.bounds && self.lacks_bound(slot))
                || (wanted.contacts && self.lacks_contacts(slot));
            self.memos[slot.index()].refreshing = lacks;
            lacks
        });
        self.refresh = all;
        self.refresh.is_empty()
    }

    /// Turns of the listed pairs that lack this level.
    fn spend_on_level(
        &mut self,
        world: &World,
        wanted: Wanted,
        goal: Goal,
        meter: &mut Meter<'_>,
        lacks: impl Fn(&Self, PairSlot) -> bool,
    ) {
        if !meter.open() {
            return;
        }
        let mut work = std::mem::take(&mut self.level);
        work.clear();
        work.extend(self.refresh.iter().filter(|&&slot| lacks(self, slot)));
        let pass = Pass {
            world,
            order: wanted.order,
            idle: |narrow: &Self, slot: PairSlot| !lacks(narrow, slot),
        };
        self.level = self.spend_on(work, &pass, meter, |narrow, slot, meter| {
            (pass.idle)(narrow, slot) || narrow.work(slot, goal, world, meter)
        });
    }

    /// When somebody begins to listen, pairs at rest lack what was left out before.
    fn follow_demand(&mut self, wanted: Wanted) {
        let more =
            (wanted.contacts && !self.contacts_wanted) || (wanted.bounds && !self.bounds_wanted);
        self.contacts_wanted = wanted.contacts;
        self.bounds_wanted = wanted.bounds;
        if !more {
            return;
        }
        for at in 0..self.active.len() {
            let slot = self.active[at];
            let memo = &mut self.memos[slot.index()];
            if !memo.refreshing {
                memo.refreshing = true;
                self.refresh.push(slot);
            }
        }
    }

    /// Records whether there was time for all bounds that have listeners.
    pub(super) fn note_scarcity(&mut self, wanted: Wanted) {
        let lacks = |&slot: &PairSlot| self.lacks_bound(slot);
        self.scarce = wanted.bounds && self.refresh.iter().any(lacks);
    }

    /// Whether a reported pair's bound is older than its poses.
    fn lacks_bound(&self, slot: PairSlot) -> bool {
        let verdict = self.hot[slot.index()].verdict;
        matches!(verdict, Verdict::Near | Verdict::Colliding) && !self.is_tight(slot)
    }

    /// Whether the query for a pair's contacts also gives its bound at no extra cost: two convex bodies that collide.
    fn says_both(&self, slot: PairSlot) -> bool {
        let hot = &self.hot[slot.index()];
        hot.verdict == Verdict::Colliding && !hot.meshed
    }

    /// Whether a colliding pair's contacts are older than its poses.
    fn lacks_contacts(&self, slot: PairSlot) -> bool {
        let memo = &self.memos[slot.index()];
        self.hot[slot.index()].verdict == Verdict::Colliding
            && !(self.is_tight(slot) && memo.contacts_tick >= memo.tested)
    }

    /// Whether a pair's interval is as narrow as its exact query can make it, at this tick's poses.
    fn is_tight(&self, slot: PairSlot) -> bool {
        let memo = &self.memos[slot.index()];
        memo.tight && (memo.tested == self.tick || memo.rest)
    }
}
