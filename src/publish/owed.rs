//! Events in a message that could not be delivered: they are owed to the readers of that message.
//!
//! In: the events of the last tick, and which of its messages were not delivered. Out: rows of the next tick for
//! readers that lack them, each event once and in order. Other readers (ROS 2, a recording, readers of the other
//! message) have them already: `pairs` itself stays unchanged, so that a replay, which loses nothing, says the same.

use super::events::{Ids, PairEvent};
use super::listing::{NO_EVENT, Row};
use super::{Publisher, View};
use crate::wire::{Outbox, PairRow, Undelivered};

/// Most events owed to the readers of a message, if fewer rows fit into one.
const OWED_MAX: usize = 1 << 16;

/// What is owed to the readers of each message.
#[derive(Debug, Default)]
pub(super) struct Owed {
    pub(super) pairs: Debt,
    pub(super) changes: Debt,
}

impl Owed {
    /// Begins, with their ends, that were never sent; of the two messages, the higher count.
    pub(super) fn cancelled(&self) -> u64 {
        self.pairs.cancelled.max(self.changes.cancelled)
    }
}

/// What is owed to the readers of one message.
#[derive(Debug, Default)]
pub(super) struct Debt {
    /// By ids, one entry per pair.
    owed: Vec<PairEvent>,
    /// By entry of `owed`: whether it is in the message of this tick.
    sent: Vec<bool>,
    cancelled: u64,
}

impl Debt {
    pub(super) fn is_empty(&self) -> bool {
        self.owed.is_empty()
    }

    /// The message has no readers any more; new ones get the full state.
    fn forget(&mut self) {
        self.owed.clear();
        self.sent.clear();
    }

    /// Begins a tick's message: nothing is in it yet.
    fn begin(&mut self) {
        self.sent.clear();
        self.sent.resize(self.owed.len(), false);
    }

    fn find(&self, ids: Ids) -> Option<usize> {
        self.owed.binary_search_by_key(&ids, |owed| owed.ids).ok()
    }

    /// A pair's event preceded by what is owed for it; both are sent together.
    ///
    /// * returns - `None`: nothing is owed for this pair.
    pub(super) fn take(&mut self, ids: Ids, now: Option<&PairEvent>) -> Option<PairEvent> {
        if self.owed.is_empty() {
            return None;
        }
        let at = self.find(ids)?;
        *self.sent.get_mut(at)? = true;
        let mut event = *self.owed.get(at)?;
        if let Some(now) = now {
            event.follow(now);
        }
        Some(event)
    }

    /// Ends a tick: events in its message are settled if it was delivered, and otherwise owed too.
    ///
    /// * `told` - the events of the tick.
    /// * `most` - most entries. Beyond it passes cancel, as a begin with its end, and then other owed events.
    pub(super) fn settle(&mut self, lost: bool, told: &[PairEvent], most: usize) {
        if !lost && self.owed.is_empty() {
            return;
        }
        let had = self.owed.len();
        self.sent.resize(had, false);
        for event in told {
            let before = (self.owed.get(..had)).unwrap_or_default();
            match before.binary_search_by_key(&event.ids, |owed| owed.ids) {
                Ok(at) => self.cancelled += self.owed[at].follow(event),
                Err(_) if lost => self.owed.push(*event),
                Err(_) => {}
            }
        }
        if !lost {
            let mut sent = self.sent.iter();
            self.owed.retain(|_| sent.next() != Some(&true));
        }
        self.owed.retain(|owed| !owed.is_over());
        self.owed.sort_unstable_by_key(|owed| owed.ids);
        if self.owed.len() > most {
            let had = self.owed.len();
            self.owed.retain(|owed| !owed.is_pass_alone());
            // A list that is cut off has no room for unlisted pairs: meanwhile their number may grow without limit,
            // with bodies that come and go.
            self.owed.truncate(most.max(OWED_MAX));
            self.cancelled += (had - self.owed.len()) as u64;
        }
        self.begin();
    }

    /// Structure check, between two ticks.
    ///
    /// # Errors
    /// One sentence on the first check that fails.
    pub(super) fn validate(&self) -> Result<(), String> {
        if !(self.owed).is_sorted_by(|one, next| one.ids < next.ids) {
            return Err("events that are owed are not by ids, one a pair".into());
        }
        match self.owed.iter().find(|owed| owed.is_over()) {
            Some(owed) => Err(format!("nothing is owed of {:?}", owed.ids)),
            None => Ok(()),
        }
    }
}

impl Publisher {
    /// Takes which of the last tick's messages could not be delivered.
    pub fn note_undelivered(&mut self, unsent: Undelivered) {
        let (told, most) = (self.events.told(), self.limits.pair_rows);
        self.owed.pairs.settle(unsent.pairs, told, most);
        self.owed.changes.settle(unsent.changes, told, most);
    }

    /// Fills `owed`, after `pairs`. A pair that is not listed gets its own row if `pairs` has room for it; otherwise
    /// its event waits.
    pub(super) fn fill_owed(&mut self, view: &mut View<'_>, out: &mut Outbox) {
        out.owed.clear();
        out.owed_cancelled = self.owed.cancelled();
        if !view.demand.pairs {
            self.owed.pairs.forget();
        }
        self.owed.pairs.begin();
        let mut room = self.limits.pair_rows.saturating_sub(out.pairs.len());
        let mut debt = std::mem::take(&mut self.owed.pairs);
        for at in 0..debt.owed.len() {
            let ids = debt.owed[at].ids;
            let row = match self.listing.find(ids) {
                Ok(at) if self.is_sent(at) => *self.listing.row(at),
                Err(_) if room > 0 => {
                    room -= 1;
                    Self::row_of_apart(view, ids, NO_EVENT)
                }
                _ => continue,
            };
            let row = self.owed_row(view, &row, &mut debt);
            out.owed.push(row);
        }
        self.owed.pairs = debt;
    }

    /// Adds pairs that are owed something and are not listed to `changes`, if there is room for them.
    ///
    /// * `places` - rows of the list that are sent.
    pub(super) fn owed_of_unlisted(&mut self, places: usize) {
        let room = self.limits.pair_rows.saturating_sub(places);
        let (listing, chain) = (&self.listing, &mut self.chain);
        let owed = self.owed.changes.owed.iter().map(|owed| owed.ids);
        let unlisted = owed.filter(|ids| listing.find(*ids).is_err());
        chain.dropped.extend(unlisted.take(room));
    }

    /// Begins the owed part of `changes`; returns whether there is any.
    pub(super) fn begin_owed_changes(&mut self, is_read: bool) -> bool {
        if !is_read {
            self.owed.changes.forget();
        }
        self.owed.changes.begin();
        !self.owed.changes.is_empty()
    }

    /// The row of a pair for readers to whom something may be owed.
    pub(super) fn owed_row(&self, view: &View<'_>, row: &Row, debt: &mut Debt) -> PairRow {
        let now = self.events.waiting().get(row.event as usize);
        let owed = debt.take(row.ids, now);
        self.pair_row_with(view, row, owed.as_ref().or(now))
    }

    /// Returns whether the row at an index is among those that fit.
    fn is_sent(&self, at: usize) -> bool {
        let cut = self.listing.len() > self.limits.pair_rows;
        !cut || self.chosen.get(at) == Some(&true)
    }
}
