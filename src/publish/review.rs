//! The review: what is new about the active pairs, for the events, the tick's counts and the rows.
//!
//! In: the rows of the last tick, the narrow phase's findings. Out: the rows of this one. For a pair without changes
//! since its row was made, neither its finding nor its row is read.

use crate::ids::PairSlot;
use crate::narrow::{Finding, Narrow, Passage};
use crate::wire::Verdict;
use crate::world::World;

use super::contacts::contacts_of;
use super::events::Ids;
use super::listing::{NO_EVENT, Row};
use super::pairs::worst_of;
use super::{AHEAD, Heard, Publisher, View};

impl Publisher {
    /// Updates the rows to this tick.
    pub(super) fn review(&mut self, view: &mut View<'_>) {
        self.survey.begin();
        self.reviewed = 0;
        self.events
            .find_slots(view.tick, view.world, view.pairs, view.narrow);
        self.events
            .begin(view.tick, view.world, view.narrow, view.delta);
        self.events.give_back_slots(view.pairs.slots_len());
        let heard = Heard {
            pairs: view.demand.pairs,
            contacts: view.demand.contacts,
            contact_changes: view.demand.contact_changes,
        };
        if std::mem::replace(&mut self.heard, heard) != heard {
            // What had no readers was not made.
            self.forget_rows();
        }
        self.renew_rows(view);
        self.find_rows(view);
        self.review_ways(view);
        self.events.merge();
        self.listing.finish();
        self.survey.look_again(self.listing.iter());
    }

    /// Renews the rows of the last tick whose pairs are still listed.
    fn renew_rows(&mut self, view: &mut View<'_>) {
        self.listing.begin(|slot| view.narrow.is_stirred(slot));
        self.chain.begin();
        self.contact_chain.begin();
        let mut n = 0;
        while let Some(at) = self.listing.dirty(n) {
            let ahead = self.listing.dirty(n + AHEAD);
            if let Some(slot) = ahead.and_then(|at| self.listing.row(at).slot) {
                view.narrow.ask_ahead(slot);
            }
            n += 1;
            let was = *self.listing.row(at);
            self.survey.leave(&was);
            // An event is sent once: without it the row is different.
            let stirred = was.slot.is_none_or(|slot| view.narrow.is_stirred(slot));
            let news = stirred || was.event != NO_EVENT;
            let now = was.slot.and_then(|slot| self.look(view, slot));
            let has_some = |now: &Row| now.ids == was.ids && now.contacts > 0;
            if was.contacts > 0 && !now.as_ref().is_some_and(has_some) {
                let told = view.demand.contact_changes;
                self.contact_chain.note_dropped(told, was.ids);
            }
            match now {
                Some(now) if now.ids == was.ids => self.listing.renew(at, now, news),
                // The slot holds another pair now.
                Some(now) => {
                    self.chain.note_dropped(view.demand.changes, was.ids);
                    self.listing.drop(at);
                    self.listing.add(now);
                }
                None => {
                    self.chain.note_dropped(view.demand.changes, was.ids);
                    self.listing.drop(at);
                    if was.slot.is_some_and(|slot| view.narrow.is_active(slot)) {
                        self.listing.lacks();
                    }
                }
            }
        }
        self.listing.close();
    }

    /// Takes results found after the last tick's messages were sent, at the poses of that tick.
    pub fn note_late(&mut self, tick: u64, world: &World, narrow: &Narrow) {
        for &slot in narrow.late() {
            if let Some(finding) = narrow.finding(slot)
                && let (Some(a), Some(b)) = (world.tag(finding.a), world.tag(finding.b))
            {
                (self.events).certify_late(tick, slot, &finding, (a.id, b.id));
            }
        }
        if !narrow.late().is_empty() {
            self.events.merge();
        }
    }

    /// Makes rows for active pairs without one.
    fn find_rows(&mut self, view: &mut View<'_>) {
        let those: fn(&Narrow) -> &[PairSlot] = if self.listing.take_complete() {
            Narrow::entered
        } else {
            Narrow::active
        };
        for at in 0..those(view.narrow).len() {
            let all = those(view.narrow);
            if let Some(&ahead) = all.get(at + AHEAD)
                && !self.listing.has(ahead)
            {
                view.narrow.ask_ahead(ahead);
            }
            let slot = all[at];
            if self.listing.has(slot) {
                continue;
            }
            match self.look(view, slot) {
                Some(row) => self.listing.add(row),
                None if view.narrow.is_active(slot) => self.listing.lacks(),
                None => {}
            }
        }
        view.narrow.clear_entered();
    }

    /// Takes what is known about a pair; `None`: it is plainly apart, or gone.
    fn look(&mut self, view: &mut View<'_>, slot: PairSlot) -> Option<Row> {
        self.reviewed += 1;
        let finding = view.narrow.finding(slot);
        let finding = finding.filter(|finding| finding.verdict != Verdict::Apart)?;
        let (a, b) = (view.world.tag(finding.a)?, view.world.tag(finding.b)?);
        let ids = (a.id, b.id);
        (self.events).certify(view.tick, slot, &finding, ids, view.narrow);
        let swept = view.narrow.passage(slot).map(|swept| swept.passage);
        let passage = swept.filter(|passage| self.events.is_news(slot, *passage));
        let row = row_of(view, slot, ids, &finding, passage);
        self.survey.take(&row, passage);
        view.narrow.told(slot);
        Some(row)
    }

    /// As [`Publisher::look`], for pairs that are apart and not active, but may have touched during the motion.
    fn review_ways(&mut self, view: &View<'_>) {
        for swept in view.narrow.swept() {
            let finding = view.narrow.finding(swept.slot);
            let apart = finding.filter(|finding| finding.verdict == Verdict::Apart);
            let Some(finding) = apart.filter(|_| swept.passage != Passage::Free) else {
                continue;
            };
            let (Some(a), Some(b)) = (view.world.tag(finding.a), view.world.tag(finding.b)) else {
                continue;
            };
            let (slot, ids) = (swept.slot, (a.id, b.id));
            (self.events).certify(view.tick, slot, &finding, ids, view.narrow);
            if self.events.is_news(slot, swept.passage) {
                let row = row_of(view, slot, ids, &finding, Some(swept.passage));
                self.survey.take(&row, Some(swept.passage));
                self.listing.add(row);
            }
        }
    }
}

/// The row of a pair.
///
/// * `passage` - result of its motion, if that is news.
fn row_of(
    view: &View<'_>,
    slot: PairSlot,
    ids: Ids,
    finding: &Finding<'_>,
    passage: Option<Passage>,
) -> Row {
    let contacts = if view.demand.tells_contacts() {
        contacts_of(view, slot, finding)
    } else {
        0
    };
    Row {
        ids,
        gap: finding.gap,
        best_m: finding
            .witness
            .map_or(finding.gap.min, |witness| witness.best_m),
        slot: Some(slot),
        event: NO_EVENT,
        contacts: u32::try_from(contacts).unwrap_or(u32::MAX),
        undecided_since: finding.undecided_since,
        verdict: worst_of(finding.verdict, passage),
    }
}
