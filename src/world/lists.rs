//! Fills a [`ChangeSet`] during the tick: each slot at most once per list; undone changes leave no trace.
//!
//! In: what happened to a slot. Out: the change set as the broad phase reads it, removals first.

use super::body::{ChangeSet, Removed};
use crate::ids::BodySlot;
use crate::wire::EndCause;

/// Not in the list.
const NONE: u32 = u32::MAX;

/// Index of a slot in each list of the change set.
#[derive(Clone, Copy, Debug)]
struct Places {
    removed: u32,
    inserted: u32,
    moved: u32,
    requery: u32,
    restated: u32,
}

impl Places {
    const NOWHERE: Self = Self {
        removed: NONE,
        inserted: NONE,
        moved: NONE,
        requery: NONE,
        restated: NONE,
    };
}

/// The change set of this tick, and each slot's index in it.
#[derive(Clone, Debug, Default)]
pub(super) struct Lists {
    set: ChangeSet,
    places: Vec<Places>,
}

impl Lists {
    /// Clears every list. Cost: their contents.
    pub(super) fn clear(&mut self) {
        let set = &self.set;
        let slots = set
            .removed
            .iter()
            .map(|r| r.slot)
            .chain(set.inserted.iter().copied())
            .chain(set.moved.iter().copied())
            .chain(set.requery.iter().copied())
            .chain(set.restated.iter().copied());
        for slot in slots {
            if let Some(places) = self.places.get_mut(slot.index()) {
                *places = Places::NOWHERE;
            }
        }
        self.set.clear();
    }

    /// Makes room for slots below `len`, so that no later call allocates more than a list's growth.
    pub(super) fn grow(&mut self, len: usize) {
        if self.places.len() < len {
            self.places.resize(len, Places::NOWHERE);
            let reserve = |list: &mut Vec<BodySlot>| list.reserve(len - list.len());
            reserve(&mut self.set.inserted);
            reserve(&mut self.set.moved);
            reserve(&mut self.set.requery);
            reserve(&mut self.set.restated);
            let have = self.set.removed.len();
            self.set.removed.reserve(len - have);
        }
    }

    /// What has changed so far.
    pub(super) fn set(&self) -> &ChangeSet {
        &self.set
    }

    /// The slot entered the broad phase.
    pub(super) fn insert(&mut self, slot: BodySlot) {
        let places = &mut self.places[slot.index()];
        push(&mut self.set.inserted, &mut places.inserted, slot);
        // Earlier changes of this slot in this tick do not apply to the new body.
        self.drop_changes(slot);
    }

    /// The slot left the broad phase. If it only entered in this tick, no trace is left.
    pub(super) fn remove(&mut self, slot: BodySlot, cause: EndCause) {
        let at = self.places[slot.index()].inserted;
        if at == NONE {
            self.places[slot.index()].removed = place_of(self.set.removed.len());
            self.set.removed.push(Removed { slot, cause });
        } else {
            self.drop_from(slot, |set| &mut set.inserted, |p| &mut p.inserted);
        }
        self.drop_changes(slot);
    }

    /// The proxy or the pose changed.
    pub(super) fn moved(&mut self, slot: BodySlot) {
        let places = &mut self.places[slot.index()];
        if places.inserted == NONE {
            push(&mut self.set.moved, &mut places.moved, slot);
        }
    }

    /// The filters changed, or pairs must be found again.
    pub(super) fn requery(&mut self, slot: BodySlot) {
        let places = &mut self.places[slot.index()];
        if places.inserted == NONE {
            push(&mut self.set.requery, &mut places.requery, slot);
        }
    }

    /// Status or reach changed without the pose.
    pub(super) fn restated(&mut self, slot: BodySlot) {
        let places = &mut self.places[slot.index()];
        push(&mut self.set.restated, &mut places.restated, slot);
    }

    /// The slot's body is gone for good.
    pub(super) fn forget(&mut self, slot: BodySlot) {
        self.drop_changes(slot);
        self.drop_from(slot, |set| &mut set.restated, |p| &mut p.restated);
    }

    fn drop_changes(&mut self, slot: BodySlot) {
        self.drop_from(slot, |set| &mut set.moved, |p| &mut p.moved);
        self.drop_from(slot, |set| &mut set.requery, |p| &mut p.requery);
    }

    /// Removes a slot from one list; the list's last slot takes its place.
    fn drop_from(
        &mut self,
        slot: BodySlot,
        list: fn(&mut ChangeSet) -> &mut Vec<BodySlot>,
        place: fn(&mut Places) -> &mut u32,
    ) {
        let at = std::mem::replace(place(&mut self.places[slot.index()]), NONE);
        if at == NONE {
            return;
        }
        let list = list(&mut self.set);
        list.swap_remove(at as usize);
        if let Some(&other) = list.get(at as usize) {
            *place(&mut self.places[other.index()]) = at;
        }
    }

    /// Returns an error if the indices are inconsistent.
    pub(super) fn validate(&self) -> Result<(), String> {
        let set = &self.set;
        type Place = fn(&Places) -> u32;
        let lists = [
            ("inserted", &set.inserted, (|p| p.inserted) as Place),
            ("moved", &set.moved, |p| p.moved),
            ("requery", &set.requery, |p| p.requery),
            ("restated", &set.restated, |p| p.restated),
        ];
        for (name, list, place) in lists {
            let listed = self.places.iter().filter(|p| place(p) != NONE).count();
            let right = |(at, slot): (usize, &BodySlot)| {
                self.places
                    .get(slot.index())
                    .is_some_and(|p| place(p) as usize == at)
            };
            if listed != list.len() || !list.iter().enumerate().all(right) {
                return Err(format!("a slot stands twice or nowhere in `{name}`"));
            }
        }
        let removed = self.places.iter().filter(|p| p.removed != NONE).count();
        if removed != set.removed.len() {
            return Err("a slot stands twice in `removed`".to_owned());
        }
        Ok(())
    }
}

fn push(list: &mut Vec<BodySlot>, place: &mut u32, slot: BodySlot) {
    if *place == NONE {
        *place = place_of(list.len());
        list.push(slot);
    }
}

/// A list is never longer than the number of slots, and those are u32.
fn place_of(len: usize) -> u32 {
    u32::try_from(len).unwrap_or(NONE - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lists(len: usize) -> Lists {
        let mut lists = Lists::default();
        lists.grow(len);
        lists
    }

    #[test]
    fn a_body_that_enters_and_leaves_in_one_tick_leaves_no_trace() {
        let mut lists = lists(3);
        for k in 0..3 {
            lists.insert(BodySlot(k));
        }
        lists.remove(BodySlot(0), EndCause::Reset);
        assert_eq!(lists.set().inserted, [BodySlot(2), BodySlot(1)]);
        assert!(lists.set().removed.is_empty());
        lists.validate().unwrap();
    }

    #[test]
    fn a_body_that_leaves_and_comes_back_stands_in_removed_and_inserted_only() {
        let mut lists = lists(1);
        lists.moved(BodySlot(0));
        lists.requery(BodySlot(0));
        lists.remove(BodySlot(0), EndCause::Reset);
        lists.insert(BodySlot(0));
        lists.moved(BodySlot(0));
        assert_eq!(lists.set().removed.len(), 1);
        assert_eq!(lists.set().inserted, [BodySlot(0)]);
        assert!(lists.set().moved.is_empty() && lists.set().requery.is_empty());
        // Removed again: the first cause stays, and it is listed once.
        lists.remove(BodySlot(0), EndCause::Removed);
        assert_eq!(lists.set().removed.len(), 1);
        assert_eq!(lists.set().removed[0].cause, EndCause::Reset);
        lists.validate().unwrap();
    }

    #[test]
    fn clearing_forgets_every_place() {
        let mut lists = lists(2);
        lists.moved(BodySlot(1));
        lists.restated(BodySlot(1));
        lists.clear();
        lists.moved(BodySlot(1));
        assert_eq!(lists.set().moved, [BodySlot(1)]);
        lists.validate().unwrap();
    }
}
