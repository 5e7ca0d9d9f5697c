//! The lists of pairs and of contacts, built from `changes` and `contact_changes`: messages are applied in order, and
//! each only to the list that it builds on.
//!
//! A reader that has missed a message has an incomplete list. It hides that list, opens its port again, and gets the
//! whole list with the daemon's next tick.

mod rows;

use super::follow::{Message, Wait};
use super::link::Link;
use crate::error::Result;
use crate::wire::{ChangesHeader, ContactRow, MessageHeader, PairRow};

use rows::{Contacts, Pairs, Rows};

/// Messages skipped while the whole list is awaited, before the port is opened again: the daemon sends it with the
/// first or second tick.
const PATIENCE: u32 = 8;

/// The rows of `pairs`, as built from `changes`: by ids, with the ages of the tick.
pub type PairList = List<Pairs>;

/// The rows of `contacts`, as built from `contact_changes`.
pub type ContactList = List<Contacts>;

/// A list that is built from messages with changes.
#[derive(Clone, Debug, Default)]
pub struct List<R: Rows> {
    /// The newest message taken.
    news: Message<R::Row, ChangesHeader>,
    /// One that came early.
    ahead: Message<R::Row, ChangesHeader>,
    has_ahead: bool,
    wait: Wait,
    rows: R,
    is_whole: bool,
    /// Messages skipped since the whole list was last requested.
    passed: u32,
}

impl PairList {
    /// The row of a pair, the smaller id first; `None`: it is not listed.
    #[must_use]
    pub fn get(&self, body_a: u64, body_b: u64) -> Option<PairRow> {
        self.rows.get((body_a, body_b), self.tick())
    }

    /// The rows, by ids.
    pub fn iter(&self) -> impl Iterator<Item = PairRow> {
        self.rows.iter(self.tick())
    }
}

impl ContactList {
    /// The contacts of a pair, the smaller id first; an empty slice if it has none.
    #[must_use]
    pub fn get(&self, body_a: u64, body_b: u64) -> &[ContactRow] {
        self.rows.get((body_a, body_b))
    }

    /// The contacts, in the order of `contacts`.
    pub fn iter(&self) -> impl Iterator<Item = &ContactRow> {
        self.rows.iter()
    }
}

impl<R: Rows> List<R> {
    /// The message of the tick: changed rows of pairs, or the contacts of pairs with news; with `base_tick` 0 the whole
    /// list.
    #[must_use]
    pub fn changes(&self) -> &Message<R::Row, ChangesHeader> {
        &self.news
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Returns whether there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(super) fn boot_id(&self) -> u64 {
        self.news.header.message.boot_id
    }

    pub(super) fn tick(&self) -> u64 {
        self.news.header.message.tick
    }

    /// The list, if it is complete and belongs to this tick.
    pub(super) fn of(&self, tick: &MessageHeader) -> Option<&Self> {
        let is_of = self.boot_id() == tick.boot_id && self.tick() == tick.tick;
        (self.is_whole && is_of).then_some(self)
    }

    /// Takes messages up to the tick; one of a later tick or boot is kept for later.
    pub(super) fn advance(
        &mut self,
        tick: &MessageHeader,
        boots_over: &mut Vec<u64>,
        link: &mut dyn Link,
    ) -> Result<()> {
        loop {
            if !self.has_ahead {
                if !R::read(link, &mut self.ahead)? {
                    return Ok(());
                }
                self.has_ahead = true;
                self.wait.begin();
            }
            let header = &self.ahead.header.message;
            let is_over = boots_over.contains(&header.boot_id);
            let same_boot = header.boot_id == tick.boot_id;
            if !is_over && (!same_boot || header.tick > tick.tick) {
                if same_boot || !self.wait.is_in_vain(header.boot_id, boots_over) {
                    return Ok(());
                }
                continue;
            }
            self.has_ahead = false;
            if !is_over && self.take() {
                R::renew(link)?;
            }
        }
    }

    /// Applies the message that came; returns whether to request the whole list.
    fn take(&mut self) -> bool {
        let (header, had) = (self.ahead.header, self.is_whole);
        let (boot_id, tick) = (header.message.boot_id, header.message.tick);
        let follows = had && self.boot_id() == boot_id && self.tick() == header.base_tick;
        self.is_whole = header.base_tick == 0 || follows;
        if header.base_tick == 0 {
            self.rows.clear();
        }
        if self.is_whole {
            self.rows.take(tick, &self.ahead.rows);
        }
        // The length stated by the sender is checked, so that a fault of either side is detected and repaired.
        self.is_whole = self.is_whole && self.rows.len() as u64 == header.listed;
        if self.is_whole {
            std::mem::swap(&mut self.news, &mut self.ahead);
            self.passed = 0;
            return false;
        }
        self.passed += 1;
        let ask = had || self.passed >= PATIENCE;
        if ask {
            self.passed = 0;
        }
        ask
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::Verdict;

    fn row(body_b: u64, verdict: Verdict) -> PairRow {
        PairRow {
            body_a: 1,
            body_b,
            verdict: verdict.code(),
            certified_tick: 90,
            ..PairRow::default()
        }
    }

    /// Applies a message of a tick; returns whether the whole list is requested.
    fn hear(list: &mut PairList, tick: u64, base_tick: u64, rows: &[PairRow], listed: u64) -> bool {
        let message = MessageHeader {
            boot_id: 7,
            tick,
            ..MessageHeader::default()
        };
        list.ahead.header = ChangesHeader {
            message,
            base_tick,
            listed,
        };
        list.ahead.rows = rows.to_vec();
        list.take()
    }

    fn ids(list: &PairList, tick: u64) -> Option<Vec<u64>> {
        let header = MessageHeader {
            boot_id: 7,
            tick,
            ..MessageHeader::default()
        };
        let list = list.of(&header)?;
        Some(list.iter().map(|row| row.body_b).collect())
    }

    #[test]
    fn rows_come_change_age_and_leave() {
        let mut list = PairList::default();
        let [near, open] = [row(4, Verdict::Near), row(2, Verdict::Possible)];
        assert!(!hear(&mut list, 90, 0, &[open, near], 2));
        assert!(!hear(&mut list, 91, 90, &[row(3, Verdict::Colliding)], 3));
        assert_eq!(ids(&list, 91), Some(vec![2, 3, 4]));
        assert_eq!(ids(&list, 92), None, "it is of another tick");
        let told = |list: &PairList, b| {
            let row = list.get(1, b).unwrap();
            (row.bound_age_ticks, row.certified_tick)
        };
        assert_eq!(
            (told(&list, 2), told(&list, 3), told(&list, 4)),
            ((1, 90), (0, 90), (1, 91))
        );
        assert!(!hear(&mut list, 92, 91, &[row(4, Verdict::Apart)], 2));
        assert_eq!(ids(&list, 92), Some(vec![2, 3]));
        assert_eq!(told(&list, 3), (1, 91));
        assert!(!hear(&mut list, 93, 0, &[], 0));
        assert!(list.is_empty());
    }

    #[test]
    fn a_list_that_missed_a_message_or_miscounts_is_not_shown_until_the_whole_of_it_came() {
        for miscounts in [false, true] {
            let mut list = PairList::default();
            assert!(!hear(&mut list, 5, 0, &[row(2, Verdict::Near)], 1));
            let asked = if miscounts {
                hear(&mut list, 6, 5, &[row(3, Verdict::Near)], 3)
            } else {
                hear(&mut list, 7, 6, &[], 1)
            };
            assert!(asked);
            assert_eq!((ids(&list, 6), ids(&list, 7)), (None, None));
            // The daemon needs a tick or two; the request is not repeated in each.
            let again: Vec<_> = (8..8 + u64::from(PATIENCE))
                .map(|tick| hear(&mut list, tick, tick - 1, &[], 1))
                .collect();
            assert_eq!(again.iter().filter(|asked| **asked).count(), 1);
            assert_eq!(again.last(), Some(&true));
            assert!(!hear(&mut list, 30, 0, &[row(9, Verdict::Near)], 1));
            assert_eq!(ids(&list, 30), Some(vec![9]));
            assert!(!hear(&mut list, 31, 30, &[], 1));
            assert_eq!(ids(&list, 31), Some(vec![9]));
        }
    }

    #[test]
    fn a_list_of_another_boot_is_not_built_on() {
        let mut list = PairList::default();
        assert!(!hear(&mut list, 5, 0, &[row(2, Verdict::Near)], 1));
        list.ahead.header = ChangesHeader {
            base_tick: 5,
            listed: 1,
            ..list.news.header
        };
        (
            list.ahead.header.message.boot_id,
            list.ahead.header.message.tick,
        ) = (8, 6);
        assert!(list.take());
        assert_eq!(ids(&list, 6), None);
    }
}
