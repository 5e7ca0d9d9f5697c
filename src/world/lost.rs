//! Bodies whose place is not known and whose reach has no bound: they keep their pairs, and which make new ones.
//!
//! In: judgements. Out: flags of the filters. The box of such a body says nothing, and makes no pairs; but it does
//! for a tick in which it says something: the body was there as the tick began in which its place was lost, or a frame
//! said where it went, though that is too old by now, or a refused pose or a reset came behind it.

use super::World;
use super::body::Body;
use super::filters::{BARS, KEEPS};
use super::place::Judgement;
use crate::ids::BodySlot;
use crate::wire::BodyStatus;

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

    /// Whether a body that has no place any more, because it was reset or is too old, is asked for the way that it
    /// still went in this tick.
    ///
    /// Not before all frames are there: one that follows on a reset may bring it back, and that is no motion.
    pub(super) fn stays_for_its_way(&self, slot: BodySlot) -> bool {
        !self.admits && self.goes_as_told(slot)
    }

    /// All frames are there: who went in this tick and has no place since comes back for its way. What hangs on it
    /// follows where that is settled.
    pub(super) fn recall_lost(&mut self) {
        for at in 0..self.travelled.len() {
            let slot = self.travelled[at];
            let is_own = self.entries[slot.index()].root == slot;
            if is_own && self.body(slot).is_some_and(|body| !body.in_broad) {
                self.settle(slot, false);
            }
        }
    }

    /// A tick begins: who came back for its way has been asked for it.
    pub(super) fn dismiss_lost(&mut self) {
        for at in 0..self.travelled.len() {
            let slot = self.travelled[at];
            let stays = |body: &Body| {
                let has_place = matches!(
                    body.status,
                    BodyStatus::Known | BodyStatus::Stale | BodyStatus::Held
                );
                body.in_broad && !has_place
            };
            if self.body(slot).is_some_and(stays) {
                self.settle(slot, false);
            }
        }
    }

    /// Whether a continuous body has gone in this tick, and where is known.
    fn goes_as_told(&self, slot: BodySlot) -> bool {
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
