//! Turns of pairs of which at least one body has several shapes, and what they prove of the bodies.

use crate::ids::PairSlot;
use crate::math::relative;
use crate::narrow::Narrow;
use crate::narrow::around::radii_m;
use crate::narrow::carry::{CARRY_COST, Told, slice_units};
use crate::narrow::mesh::Goal;
use crate::time::Meter;
use crate::world::Body;

use super::Tools;

impl Narrow {
    /// One turn of a pair on the front of its shapes. Returns whether there is more to do for `goal`.
    pub(in crate::narrow) fn turn_compound(
        &mut self,
        slot: PairSlot,
        (a, b): (&Body, &Body),
        goal: Goal,
        meter: &mut Meter<'_>,
    ) -> bool {
        let memo = &mut self.memos[slot.index()];
        let goal = memo.goal(goal);
        let Some(front) = self.compounds.get_or_take(&mut memo.compound) else {
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
        meter.charge_weighted(0, CARRY_COST);
        let slice_units = slice_units(memo.undecided_since, self.tick);
        let asked = (goal, memo.report_m);
        let done = front.advance(&mut tools, (a, b), asked, slice_units, meter);
        let told = Told {
            gap: front.interval(),
            done,
            certain: front.is_certain(),
            witness: front.witness(),
        };
        if !memo.take_over(&told, goal, (a, b, &rel), self.tick) {
            return true;
        }
        if done && goal == Goal::Contacts {
            self.found.clear();
            (self.found).extend_from_slice(front.contacts(&self.shelves.contacts));
            let [of_a, of_b] = radii_m(a, b);
            self.keep_contacts(slot, of_a.min(of_b), self.tick);
        }
        !done
    }
}
