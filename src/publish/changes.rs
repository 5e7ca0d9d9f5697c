//! Rows of `changes`: what is new in the list of pairs since the last tick, at a cost proportional to that.
//!
//! In: the list with its news, and the pairs whose rows were dropped. Out: rows that turn the list of the last tick
//! into that of this one; the whole list if its readers have no base.
//!
//! It is cut off like `pairs`, so that a reader who builds the list from it has the same rows as `pairs`: if not all
//! fit, the message is the whole list, and so is the next. A message with changes is therefore never cut off.

use crate::ids::small;
use crate::wire::{ChangesHeader, MessageHeader, Outbox, PairRow};

use super::events::Ids;
use super::listing::NO_EVENT;
use super::owed::Debt;
use super::{AHEAD, Publisher, View};

/// The base of the next message, and memory kept across calls.
#[derive(Debug, Default)]
pub(super) struct Chain {
    /// The tick whose list the readers have; 0: none, or not all of it.
    base_tick: u64,
    /// Pairs whose rows, or whose contacts, were dropped in this tick, by ids.
    pub(super) dropped: Vec<Ids>,
    /// Indices of the rows to send, by ids.
    pub(super) places: Vec<u32>,
}

impl Chain {
    /// Begins a tick.
    pub(super) fn begin(&mut self) {
        self.dropped.clear();
    }

    /// Records that the row of a pair, or its contacts, was dropped; it may get another row yet.
    ///
    /// * `told` - whether the message has readers.
    pub(super) fn note_dropped(&mut self, told: bool, ids: Ids) {
        if told {
            self.dropped.push(ids);
        }
    }

    /// The tick whose list a message of this tick may build on; 0: none.
    pub(super) fn base(&self, tick: u64) -> u64 {
        if self.base_tick + 1 == tick {
            self.base_tick
        } else {
            0
        }
    }

    /// Ends a tick.
    ///
    /// * `base_tick` - the base of the next message; 0: none.
    /// * `all` - number of rows of the list: the number of new ones varies from tick to tick, so memory for all is
    ///   reserved when there are more than ever.
    pub(super) fn end(&mut self, base_tick: u64, all: usize) {
        self.base_tick = base_tick;
        self.dropped.clear();
        self.dropped.reserve(all);
        self.places.clear();
        self.places.reserve(all);
    }

    /// Structure check, between two ticks.
    ///
    /// # Errors
    /// One sentence on the first check that fails.
    pub(super) fn validate(&self, tick: u64) -> Result<(), String> {
        if self.base_tick > tick {
            return Err(format!(
                "changes build on the list of tick {}",
                self.base_tick
            ));
        }
        if !self.dropped.is_empty() && self.base_tick != 0 {
            return Err("pairs that have left the list wait to be told of".into());
        }
        Ok(())
    }

    /// The list is made from scratch, and what is new in it is unknown.
    pub(super) fn break_off(&mut self) {
        self.base_tick = 0;
    }
}

impl Publisher {
    /// Fills `changes`.
    ///
    /// * `left_out` - rows of the list that do not fit.
    pub(super) fn fill_changes(
        &mut self,
        view: &mut View<'_>,
        header: MessageHeader,
        left_out: u64,
        out: &mut Outbox,
    ) {
        out.changes.clear();
        let owes = self.begin_owed_changes(view.demand.changes);
        if !view.demand.changes {
            self.chain.break_off();
            return;
        }
        let holds = left_out == 0 && !view.demand.changes_anew && !owes;
        let base_tick = self.choose_changes(holds, view.tick);
        let whole = base_tick == 0;
        let mut debt = std::mem::take(&mut self.owed.changes);
        self.push_changes(view, whole, &mut debt, &mut out.changes);
        self.owed.changes = debt;
        out.changes_header = ChangesHeader {
            message: MessageHeader {
                truncated: left_out,
                ..header
            },
            base_tick,
            listed: if whole {
                out.changes.len() as u64
            } else {
                self.listing.len() as u64
            },
        };
        let all = self.listing.len();
        // A row sent with owed events differs from the plain row, and no mark records that: the next message must not
        // build on it.
        let holds_on = left_out == 0 && !owes;
        self.chain.end(if holds_on { view.tick } else { 0 }, all);
        let more = all.saturating_sub(out.changes.len());
        out.changes.reserve(more);
    }

    /// Chooses which rows are sent; returns the base tick, 0 if they are the whole list.
    ///
    /// * `holds` - whether the list of the last tick may be the base.
    fn choose_changes(&mut self, holds: bool, tick: u64) -> u64 {
        let (chain, listing, chosen) = (&mut self.chain, &self.listing, &self.chosen);
        let all = small(listing.len());
        let base_tick = chain.base(tick);
        chain.places.clear();
        if holds && base_tick != 0 {
            chain.dropped.retain(|ids| listing.find(*ids).is_err());
            if !chain.dropped.is_sorted() {
                chain.dropped.sort_unstable();
            }
            chain.places.extend(listing.news());
            if chain.places.len() + chain.dropped.len() <= listing.len() {
                return base_tick;
            }
            chain.places.clear();
        }
        chain.dropped.clear();
        let cut = listing.len() > self.limits.pair_rows;
        let is_sent = |at: &u32| !cut || chosen.get(*at as usize) == Some(&true);
        chain.places.extend((0..all).filter(is_sent));
        let places = chain.places.len();
        self.owed_of_unlisted(places);
        0
    }

    /// Appends the chosen rows, and rows for pairs that have left the list.
    ///
    /// * `whole` - whether they are the whole list.
    /// * `debt` - events owed to its readers: these are sent as well.
    fn push_changes(
        &self,
        view: &mut View<'_>,
        whole: bool,
        debt: &mut Debt,
        rows: &mut Vec<PairRow>,
    ) {
        let places = &self.chain.places;
        let mut dropped = self.chain.dropped.iter().copied().peekable();
        for (nth, &at) in places.iter().enumerate() {
            if let Some(&ahead) = places.get(nth + AHEAD)
                && let Some(slot) = self.listing.row(ahead as usize).slot
            {
                view.narrow.ask_ahead(slot);
            }
            let row = self.listing.row(at as usize);
            while let Some(ids) = dropped.next_if(|ids| *ids < row.ids) {
                rows.push(self.last_row(view, ids, debt));
            }
            let row = self.owed_row(view, row, debt);
            // It was listed for an event that cancels an owed one.
            if !(whole && row.has_left()) {
                rows.push(row);
            }
        }
        for ids in dropped {
            rows.push(self.last_row(view, ids, debt));
        }
    }

    /// The row of a pair that has left the list, or is sent only for owed events.
    fn last_row(&self, view: &mut View<'_>, ids: Ids, debt: &mut Debt) -> PairRow {
        let row = Self::row_of_apart(view, ids, NO_EVENT);
        let row = self.owed_row(view, &row, debt);
        let owes = !debt.is_empty();
        debug_assert!(row.has_left() || owes, "what is new of {ids:?} is listed");
        row
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::BodyId;

    #[test]
    fn what_is_broken_in_a_chain_is_found() {
        let chain = |base_tick, dropped: &[u64]| Chain {
            base_tick,
            dropped: dropped.iter().map(|id| (BodyId(*id), BodyId(9))).collect(),
            ..Chain::default()
        };
        chain(4, &[]).validate(4).unwrap();
        assert!(chain(5, &[]).validate(4).unwrap_err().contains("tick 5"));
        assert!(
            chain(4, &[1])
                .validate(4)
                .unwrap_err()
                .contains("wait to be told")
        );
    }
}
