//! Results certified for a tick's poses after its messages were sent.
//!
//! In: pairs decided in the rest of a tick's budget. Out: their histories record it, and an end or a begin waits for
//! the next tick's messages, with a range that ends at the tick whose poses were tested. Bodies move on, so the next
//! tick may not find it: without this an end followed by a begin would look like one collision that persists.

use super::{Events, Ids, Ticks};
use crate::ids::PairSlot;
use crate::narrow::Finding;
use crate::wire::{EndCause, Verdict};

impl Events {
    /// Takes the verdict of a pair at the poses of a tick for which [`Events::certify`] had none; must be followed by
    /// [`Events::merge`].
    pub(in crate::publish) fn certify_late(
        &mut self,
        tick: u64,
        slot: PairSlot,
        finding: &Finding<'_>,
        ids: Ids,
    ) {
        let Some(history) = self.histories.get_mut(slot.index()) else {
            return;
        };
        // Nothing was left open for a pair that is not active in this tick. One that stays undecided is, though it was
        // not reviewed.
        if history.ids != ids || (history.active != tick && !history.open) {
            return;
        }
        history.go_on_to(tick);
        let colliding = match finding.verdict {
            Verdict::Colliding => true,
            Verdict::Near | Verdict::Apart => false,
            Verdict::Possible | Verdict::None => return,
        };
        // After a touch during the motion it may have ended in that very tick.
        let first = if history.tick == 0 {
            history.born
        } else {
            history.next_first().min(tick)
        };
        let ticks = Ticks { first, last: tick };
        (history.verdict, history.tick) = (finding.verdict, tick);
        (history.open, history.on_way, history.late) = (false, false, true);
        let was = std::mem::replace(&mut history.colliding, colliding);
        let begins = colliding && !was;
        history.late_begin = if begins { first } else { 0 };
        match (was, colliding) {
            (false, true) => self.push(ids, None, Some(ticks)),
            (true, false) => self.push(ids, Some((ticks, EndCause::Separated)), None),
            _ => {}
        }
    }
}
