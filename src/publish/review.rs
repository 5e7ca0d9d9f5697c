//! The review: one walk over the active pairs, for the events, the tick's counts and the rows.
//!
//! In: the rows of the last tick, the narrow phase's findings. Out: the rows of this one. A pair that nothing happened
//! to since its row was made is not asked about.

use crate::ids::PairSlot;
use crate::narrow::{Finding, Passage};
use crate::wire::Verdict;

use super::contacts::contacts_of;
use super::events::Ids;
use super::kept::Span;
use super::listing::{Listing, NO_EVENT, Row};
use super::pairs::worst_of;
use super::state::Survey;
use super::{AHEAD, Publisher, View};

impl Publisher {
    /// Brings the rows up to this tick.
    pub(super) fn review(&mut self, view: &mut View<'_>) {
        self.survey = Survey::default();
        self.events
            .find_slots(view.tick, view.world, view.pairs, view.narrow);
        self.events
            .begin(view.tick, view.world, view.narrow, view.delta);
        let heard = (view.demand.pairs, view.demand.contacts);
        if std::mem::replace(&mut self.heard, heard) != heard {
            // What nobody listened to was not made.
            self.listing.forget();
        }
        self.renew_rows(view);
        self.find_rows(view);
        self.review_ways(view);
        self.events.merge();
        self.listing.finish();
    }

    /// Of the rows of the last tick, those that still are.
    fn renew_rows(&mut self, view: &mut View<'_>) {
        let mut kept = 0;
        for at in 0..self.listing.rows.len() {
            ask_ahead(&self.listing, view, at);
            let row = &mut self.listing.rows[at];
            let Some(slot) = row.slot else { continue };
            if row.may_last() && !view.narrow.is_stirred(slot) {
                row.fresh = false;
                self.survey.take(row, None);
                self.listing.see(slot, view.tick);
                // Most stay where they are: nothing is copied until one has left.
                if kept != at {
                    self.listing.rows[kept] = self.listing.rows[at];
                }
            } else {
                let was = *row;
                let Some(now) = self.look(view, slot) else {
                    continue;
                };
                if now.ids != was.ids {
                    // The slot holds another pair now.
                    self.listing.add(now);
                    continue;
                }
                self.listing.rows[kept] = Row {
                    in_pairs: was.in_pairs,
                    in_contacts: was.in_contacts,
                    ..now
                };
            }
            kept += 1;
        }
        self.listing.rows.truncate(kept);
    }

    /// Rows of pairs that are active and were not in the tick before.
    fn find_rows(&mut self, view: &mut View<'_>) {
        for at in 0..view.narrow.active().len() {
            let active = view.narrow.active();
            if let Some(&ahead) = active.get(at + AHEAD)
                && !self.listing.was_seen(ahead, view.tick)
            {
                view.narrow.ask_ahead(ahead);
            }
            let slot = active[at];
            if !self.listing.was_seen(slot, view.tick)
                && let Some(row) = self.look(view, slot)
            {
                self.listing.add(row);
            }
        }
    }

    /// Takes down what is known of a pair; `None`: it is plainly apart, or gone.
    fn look(&mut self, view: &mut View<'_>, slot: PairSlot) -> Option<Row> {
        let finding = view.narrow.finding(slot);
        let finding = finding.filter(|finding| finding.verdict != Verdict::Apart)?;
        let (a, b) = (view.world.tag(finding.a)?, view.world.tag(finding.b)?);
        let ids = (a.id, b.id);
        (self.events).certify(view.tick, slot, &finding, ids, view.narrow);
        let swept = view.narrow.passage(slot).map(|swept| swept.passage);
        let passage = swept.filter(|passage| self.events.is_news(slot, *passage));
        let row = row_of(view, slot, ids, &finding, passage);
        self.survey.take(&row, passage);
        self.survey.wait(view.tick, finding.undecided_since);
        self.listing.see(slot, view.tick);
        view.narrow.told(slot);
        Some(row)
    }

    /// As [`Publisher::look`], of pairs that are apart and not active, but may have touched on the way.
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
/// * `passage` - what its way says, where that is news.
fn row_of(
    view: &View<'_>,
    slot: PairSlot,
    ids: Ids,
    finding: &Finding<'_>,
    passage: Option<Passage>,
) -> Row {
    let contacts = if view.demand.contacts {
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
        in_pairs: Span::default(),
        in_contacts: Span::default(),
        verdict: worst_of(finding.verdict, passage),
        fresh: true,
    }
}

/// Asks memory for what the walk will want of the rows ahead of the one at hand.
fn ask_ahead(listing: &Listing, view: &View<'_>, at: usize) {
    let slot_at = |at: usize| listing.rows.get(at).and_then(|row| row.slot);
    if let Some(far) = slot_at(at + 2 * AHEAD) {
        view.narrow.ask_ahead_if_stirred(far);
    }
    if let Some(near) = slot_at(at + AHEAD)
        && view.narrow.is_stirred(near)
    {
        view.narrow.ask_ahead(near);
    }
}
