//! Turns of pairs of which at least one body has several shapes, and what they say of the bodies.

use crate::ids::PairSlot;
use crate::math::relative;
use crate::narrow::Narrow;
use crate::narrow::carry::slice_units;
use crate::narrow::memo::bent;
use crate::narrow::mesh::Goal;
use crate::narrow::pool::NONE;
use crate::time::Meter;
use crate::world::Body;

use super::{CompoundFront, Tools};

impl Narrow {
    /// One turn of a pair on the front of its shapes; whether there is more to do for `goal`.
    pub(in crate::narrow) fn turn_compound(
        &mut self,
        slot: PairSlot,
        (a, b): (&Body, &Body),
        goal: Goal,
        meter: &mut Meter<'_>,
    ) -> bool {
        let memo = &mut self.memos[slot.index()];
        if memo.compound == NONE {
            memo.compound = self.compounds.take(CompoundFront::default);
        }
        let Some(front) = self.compounds.get_mut(memo.compound) else {
            return false;
        };
        let mut tools = Tools {
            shelves: &mut self.shelves,
            found: &mut self.found,
            counters: &mut self.counters,
            search: self.search,
            tick: self.tick,
        };
        let rel = relative(&a.pose, &b.pose);
        front.move_to(&mut tools, (a, b), &rel);
        meter.charge(0);
        let slice_units = slice_units(memo.undecided_since, self.tick);
        let asked = (goal, memo.report_m);
        let done = front.advance(&mut tools, (a, b), asked, slice_units, meter);
        let (found, now) = (front.interval(), memo.now);
        if !done && found.min <= now.min && found.max >= now.max {
            return true;
        }
        // What was known before holds at these poses too.
        memo.gap = found.meet(now);
        memo.rel = rel;
        memo.credit_m = a.motion.credit_m() + b.motion.credit_m();
        (memo.bent_m, memo.tested) = (bent(a, b), self.tick);
        let whole = done && !(goal == Goal::Verdict && memo.gap.max <= 0.0);
        memo.finished = whole && front.is_certain();
        memo.tight = whole && goal != Goal::Verdict;
        if let Some(witness) = front.witness() {
            memo.witness = Some(witness);
        } else if memo.gap.min > 0.0 && memo.witness.is_some_and(|w| w.best_m <= 0.0) {
            // Where it touched says nothing of a pair that is apart.
            memo.witness = None;
        }
        if done && goal == Goal::Contacts {
            self.found.clear();
            (self.found).extend_from_slice(front.contacts(&self.shelves.contacts));
            self.keep_contacts(slot, a.radius.min(b.radius));
        }
        !done
    }
}
