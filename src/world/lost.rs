//! Bodies whose place is unknown and whose reach is unbounded: they keep their pairs; and which of them make new ones.
//!
//! In: judgements. Out: flags of the filters. The box of such a body is meaningless, and makes no pairs, except in a
//! tick in which it has a meaning: the body was there when the tick began in which its place was lost; or a frame
//! reported where it went, although that is too old by now or was followed by a refused pose or a reset.

use super::World;
use super::body::Body;
use super::filters::{BARS, KEEPS};
use super::place::Judgement;
use crate::ids::BodySlot;
use crate::wire::BodyStatus;

impl World {
    /// Sets the flags that follow from a judgement.
    ///
    /// * `was_in` - whether the body was in the broad phase before.
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
        // Pairs that it was barred from are found only by queries of its whole box.
        if judged.in_broad && (told_again || keeps && barred && !bars) {
            self.lists.requery(slot);
        }
    }

    /// Returns whether a body that has no place any more, because it was reset or is too old, is still swept along the
    /// path that it moved in this tick.
    ///
    /// Not before all frames are in: one after a reset may bring it back, and that is no motion.
    pub(super) fn stays_for_its_way(&self, slot: BodySlot) -> bool {
        !self.admits && self.goes_as_told(slot)
    }

    /// After all frames: a body that moved in this tick and lost its place since comes back to be swept. Bodies
    /// attached to it follow when it is settled.
    pub(super) fn recall_lost(&mut self) {
        for at in 0..self.travelled.len() {
            let slot = self.travelled[at];
            let is_own = self.entries[slot.index()].root == slot;
            if is_own && self.body(slot).is_some_and(|body| !body.in_broad) {
                self.settle(slot, false);
            }
        }
    }

    /// A tick begins: bodies that came back to be swept have been, and leave.
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

    /// Returns whether a continuous body has moved in this tick along a known path.
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

    /// A tick begins: bodies lost in the last one make no pairs any more.
    pub(super) fn bar_lost(&mut self) {
        for slot in self.met.drain(..) {
            if let Some(hot) = self.filters.bodies.get_mut(slot.index()) {
                hot.set(BARS, hot.has(KEEPS));
            }
        }
    }
}
