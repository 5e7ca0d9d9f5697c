//! Bodies whose place is not known and whose reach has no bound: they keep their pairs, and which make new ones.
//!
//! In: judgements. Out: flags of the filters. The box of such a body says nothing, and makes no pairs; but it does
//! for a tick in which it says something: the body was there as the tick began in which its place was lost, or a frame
//! said where it went, though that is too old by now or a pose behind it was refused.

use super::World;
use super::filters::{BARS, KEEPS};
use super::place::Judgement;
use crate::ids::BodySlot;

impl World {
    /// Sets the flags that follow from a judgement.
    ///
    /// * `was_in` - whether the body was in the broad phase before it.
    pub(super) fn flag_lost(&mut self, slot: BodySlot, judged: Judgement, was_in: bool) {
        let keeps = judged.in_broad && judged.reach_m.is_infinite();
        let goes = keeps && self.goes_as_told(slot);
        let hot = &mut self.filters.bodies[slot.index()];
        let (kept, barred) = (hot.has(KEEPS), hot.has(BARS));
        let bars = keeps && !goes && (barred || !(kept || was_in));
        hot.set(KEEPS, keeps);
        hot.set(BARS, bars);
        if keeps && !bars && (barred || !kept) {
            self.met.push(slot);
        }
        let told_again = kept && !keeps;
        // What it was barred from is found by those methods alone that look at all of its box.
        if judged.in_broad && (told_again || keeps && barred && !bars) {
            self.lists.requery(slot);
        }
    }

    /// Whether a continuous body has gone in this tick, and where is known.
    pub(super) fn goes_as_told(&self, slot: BodySlot) -> bool {
        let Some(body) = self.body(slot) else {
            return false;
        };
        let path = body.path.as_ref();
        let root = self.body(self.entries[slot.index()].root);
        let vertices = [Some(body), root].into_iter().flatten();
        let mut vertices = vertices.filter_map(|body| body.vertices.as_ref());
        path.is_some_and(|path| path.is_swept()) && vertices.all(|v| v.refused.is_none())
    }

    /// A tick begins: who was lost in the last one makes no pairs any more.
    pub(super) fn bar_lost(&mut self) {
        for slot in self.met.drain(..) {
            if let Some(hot) = self.filters.bodies.get_mut(slot.index()) {
                hot.set(BARS, hot.has(KEEPS));
            }
        }
    }
}
