//! Histories whose slots were lost because the pair set was rebuilt, until their pairs are found again.
//!
//! In: the new pair set, bodies that left the world in this tick. Out: a history at its pair's new slot, or an end with
//! its cause. For a pair that is absent because nothing is known about it (a place is unknown, the set is full) nothing
//! is reported until something is known.

use std::collections::BTreeMap;

use super::{Events, History, Ticks};
use crate::ids::{BodySlot, PairKey};
use crate::narrow::Narrow;
use crate::pairs::PairSet;
use crate::wire::EndCause;
use crate::world::World;

/// A history whose slot was lost.
#[derive(Debug)]
pub(super) struct Adrift {
    history: History,
    /// Its bodies at that time; `None`: one was gone by then.
    key: Option<PairKey>,
}

impl Adrift {
    pub(super) fn history(&self) -> &History {
        &self.history
    }

    /// Why its pair is gone; `None`: unknown.
    fn cause(
        &self,
        removed: &BTreeMap<BodySlot, EndCause>,
        world: &World,
        pairs: &PairSet,
    ) -> Option<EndCause> {
        let Some(key) = self.key else {
            return Some(EndCause::Removed);
        };
        let (low, high) = key.slots();
        let filters = world.filters();
        let gone = [low, high]
            .into_iter()
            .filter_map(|slot| removed.get(&slot));
        if let Some(cause) = gone.min() {
            Some(*cause)
        } else if !filters.allows(low, high) {
            Some(EndCause::Filtered)
        } else {
            let kept = filters.keeps(low) || filters.keeps(high);
            let cut = pairs.is_truncated(low) && pairs.is_truncated(high);
            (!kept && !cut).then_some(EndCause::Separated)
        }
    }
}

impl Events {
    /// The slots of all pairs are void.
    ///
    /// * `last` - the last tick in which they were valid.
    pub(in crate::publish) fn forget_slots(&mut self, last: u64, world: &World) {
        for mut history in self.histories.drain(..) {
            if history.born != 0 {
                history.go_on_to(last);
                let slots = (world.slot_of(history.ids.0)).zip(world.slot_of(history.ids.1));
                let key = slots.map(|(a, b)| PairKey::new(a, b));
                self.adrift.push(Adrift { history, key });
            }
        }
    }

    /// Moves histories whose slots were lost to the new slots of the same pairs; if there is no such pair any more, its
    /// collision has ended.
    pub(in crate::publish) fn find_slots(
        &mut self,
        tick: u64,
        world: &World,
        pairs: &PairSet,
        narrow: &Narrow,
    ) {
        if self.adrift.is_empty() {
            return;
        }
        let removed = world.changes().removed.iter();
        let removed: BTreeMap<_, _> = removed.map(|gone| (gone.slot, gone.cause)).collect();
        let is_same = |slot: &BodySlot| !removed.contains_key(slot);
        for mut lost in std::mem::take(&mut self.adrift) {
            let history = lost.history;
            // The slot of a body that left in this tick now holds another body.
            let key = lost.key.filter(|key| {
                let (low, high) = key.slots();
                is_same(&low) && is_same(&high)
            });
            if let Some(slot) = key.and_then(|key| pairs.find(key)) {
                if self.histories.len() <= slot.index() {
                    self.histories.resize(slot.index() + 1, History::NONE);
                }
                self.histories[slot.index()] = history;
                if let Some(finding) = narrow.finding(slot) {
                    self.certify(tick, slot, &finding, history.ids, narrow);
                }
            } else if let Some(cause) = lost.cause(&removed, world, pairs) {
                if history.colliding {
                    let ticks = Ticks {
                        first: history.next_first(),
                        last: tick,
                    };
                    self.push(history.ids, Some((ticks, cause)), None);
                }
            } else {
                // Nothing is known of it in this tick.
                lost.history.open = true;
                self.adrift.push(lost);
            }
        }
    }
}
