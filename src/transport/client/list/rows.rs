//! What a list holds, and how a message changes it.

use std::collections::BTreeMap;
use std::fmt::Debug;

use crate::error::Result;
use crate::transport::client::follow::Message;
use crate::transport::client::link::Link;
use crate::wire::{ChangesHeader, ContactRow, PairRow};

/// Rows by their pairs.
pub trait Rows: Debug + Default {
    /// A row of its message.
    type Row: Debug + Default + Clone + Copy + PartialEq;

    /// Removes all rows.
    fn clear(&mut self);
    /// Applies the rows of a tick.
    fn take(&mut self, tick: u64, rows: &[Self::Row]);
    /// Number of rows.
    fn len(&self) -> usize;
    /// The next message.
    fn read(link: &mut dyn Link, into: &mut Message<Self::Row, ChangesHeader>) -> Result<bool>;
    /// Opens the port of the message again.
    fn renew(link: &mut dyn Link) -> Result<()>;
}

/// By listed pair: the tick that sent its row, and the row.
#[derive(Clone, Debug, Default)]
pub struct Pairs(BTreeMap<(u64, u64), (u64, PairRow)>);

impl Pairs {
    pub(super) fn get(&self, ids: (u64, u64), tick: u64) -> Option<PairRow> {
        self.0.get(&ids).map(|row| at_tick(row, tick))
    }

    pub(super) fn iter(&self, tick: u64) -> impl Iterator<Item = PairRow> {
        self.0.values().map(move |row| at_tick(row, tick))
    }
}

fn at_tick((sent, row): &(u64, PairRow), tick: u64) -> PairRow {
    let mut row = *row;
    row.age(tick.saturating_sub(*sent));
    row
}

impl Rows for Pairs {
    type Row = PairRow;

    fn clear(&mut self) {
        self.0.clear();
    }

    fn take(&mut self, tick: u64, rows: &[PairRow]) {
        for row in rows {
            let ids = (row.body_a, row.body_b);
            if row.has_left() {
                self.0.remove(&ids);
            } else {
                self.0.insert(ids, (tick, *row));
            }
        }
    }

    fn len(&self) -> usize {
        self.0.len()
    }

    fn read(link: &mut dyn Link, into: &mut Message<PairRow, ChangesHeader>) -> Result<bool> {
        link.changes(into)
    }

    fn renew(link: &mut dyn Link) -> Result<()> {
        link.renew_changes()
    }
}

/// By pair: its contacts; and the total number of contacts.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    pairs: BTreeMap<(u64, u64), Vec<ContactRow>>,
    len: usize,
}

impl Contacts {
    pub(super) fn get(&self, ids: (u64, u64)) -> &[ContactRow] {
        self.pairs.get(&ids).map_or(&[], Vec::as_slice)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &ContactRow> {
        self.pairs.values().flatten()
    }
}

impl Rows for Contacts {
    type Row = ContactRow;

    fn clear(&mut self) {
        self.pairs.clear();
        self.len = 0;
    }

    fn take(&mut self, _: u64, rows: &[ContactRow]) {
        let ids_of = |row: &ContactRow| (row.body_a, row.body_b);
        for rows in rows.chunk_by(|one, next| ids_of(one) == ids_of(next)) {
            let Some(first) = rows.first() else { continue };
            let now = if first.is_gone() { &[] } else { rows };
            let before = if now.is_empty() {
                self.pairs.remove(&ids_of(first))
            } else {
                self.pairs.insert(ids_of(first), now.to_vec())
            };
            self.len = self.len + now.len() - before.map_or(0, |rows| rows.len());
        }
    }

    fn len(&self) -> usize {
        self.len
    }

    fn read(link: &mut dyn Link, into: &mut Message<ContactRow, ChangesHeader>) -> Result<bool> {
        link.contact_changes(into)
    }

    fn renew(link: &mut dyn Link) -> Result<()> {
        link.renew_contact_changes()
    }
}
