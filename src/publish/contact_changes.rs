//! Rows of `contact_changes`: the contacts of the pairs with news since the last tick, and a row for each pair that has
//! no contacts any more.
//!
//! In: the list of pairs with its news, and the pairs whose contacts were dropped. Out: rows that turn the contacts of
//! the last tick into those of this one; all of them if readers have no base. The contacts of a pair are sent all or
//! none.

use crate::ids::small;
use crate::wire::{ChangesHeader, ContactRow, MessageHeader, Outbox};

use super::contacts::push_rows;
use super::{AHEAD, Publisher, View};

impl Publisher {
    /// Fills `contact_changes`.
    ///
    /// * `header` - with the number of contacts that do not fit.
    /// * `told` - number of contacts that fit.
    pub(super) fn fill_contact_changes(
        &mut self,
        view: &mut View<'_>,
        header: MessageHeader,
        told: usize,
        out: &mut Outbox,
    ) {
        out.contact_changes.clear();
        if !view.demand.contact_changes {
            self.contact_chain.break_off();
            return;
        }
        let cut = header.truncated > 0;
        let base_tick = if cut || view.demand.changes_anew {
            self.choose_all_contacts(cut)
        } else {
            self.choose_new_contacts(view.tick, told)
        };
        self.push_contact_changes(view, &mut out.contact_changes);
        out.contact_changes_header = ChangesHeader {
            message: header,
            base_tick,
            listed: told as u64,
        };
        let next = if cut { 0 } else { view.tick };
        self.contact_chain.end(next, self.listing.len());
        let more = told.saturating_sub(out.contact_changes.len());
        out.contact_changes.reserve(more);
    }

    /// Chooses the pairs with news; returns the base tick, 0 if all are chosen.
    fn choose_new_contacts(&mut self, tick: u64, all: usize) -> u64 {
        let (chain, listing) = (&mut self.contact_chain, &self.listing);
        let base_tick = chain.base(tick);
        if base_tick == 0 {
            return self.choose_all_contacts(false);
        }
        let count_at = |at: usize| listing.row(at).contacts as usize;
        let has_none = |at: usize| count_at(at) == 0;
        (chain.dropped).retain(|ids| listing.find(*ids).map_or(true, has_none));
        chain.places.clear();
        let mut rows = chain.dropped.len();
        for at in listing.news() {
            let count = count_at(at as usize);
            if count > 0 {
                chain.places.push(at);
                rows += count;
            }
        }
        if rows > all.max(1) {
            return self.choose_all_contacts(false);
        }
        base_tick
    }

    /// Chooses every pair that has contacts, or those that fit; returns 0, as there is no base.
    fn choose_all_contacts(&mut self, cut: bool) -> u64 {
        let (chain, listing, chosen) = (&mut self.contact_chain, &self.listing, &self.chosen);
        chain.dropped.clear();
        chain.places.clear();
        let is_sent = |at: usize| !cut || chosen.get(at) == Some(&true);
        let with_some = |at: &u32| {
            let at = *at as usize;
            listing.row(at).contacts > 0 && is_sent(at)
        };
        chain
            .places
            .extend((0..small(listing.len())).filter(with_some));
        0
    }

    /// Appends the contacts of the chosen pairs, and a row for each that has none any more.
    fn push_contact_changes(&mut self, view: &mut View<'_>, rows: &mut Vec<ContactRow>) {
        let places = &self.contact_chain.places;
        let mut dropped = self.contact_chain.dropped.iter().copied().peekable();
        for (nth, &at) in places.iter().enumerate() {
            if let Some(&ahead) = places.get(nth + AHEAD)
                && let Some(slot) = self.listing.row(ahead as usize).slot
            {
                view.narrow.ask_ahead_for_contacts(slot);
            }
            let row = self.listing.row(at as usize);
            while let Some(ids) = dropped.next_if(|ids| *ids < row.ids) {
                rows.push(ContactRow::gone(ids));
            }
            if let Some(slot) = row.slot {
                view.narrow.name_contacts(slot, &mut self.next_contact);
                push_rows(view, slot, rows);
            }
        }
        rows.extend(dropped.map(ContactRow::gone));
    }
}
