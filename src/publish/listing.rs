//! The pairs that are not plainly apart, ordered by their bodies' ids, kept from tick to tick with what the tick and
//! the messages need of each.
//!
//! In: pairs that may have news, and pairs that are gone. Out: rows by ids; for a pair without changes, the row of the
//! last tick. A sort of all rows would cost a sixth of publishing them, and looking up every pair's data most of it.
//!
//! Rows stay in place once made; what is sorted, and scanned in every tick, are marks of 24 bytes.

mod validate;

use super::kept::Span;
use crate::ids::{BodyId, PairSlot, small};
use crate::math::Interval;
use crate::wire::Verdict;

/// A pair, with its sort keys by ids and by rank.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) ids: (BodyId, BodyId),
    /// At this tick's poses, metres.
    pub(super) gap: Interval,
    /// Best estimate of the gap; its lower end where there is none, metres.
    pub(super) best_m: f64,
    /// `None`: the pair is gone.
    pub(super) slot: Option<PairSlot>,
    /// Index of its event among the waiting ones; [`NO_EVENT`]: none.
    pub(super) event: u32,
    /// Number of its contact rows.
    pub(super) contacts: u32,
    /// First tick without a verdict; 0: decided.
    pub(super) undecided_since: u64,
    /// Verdict of the pair or of its motion, whichever is worse.
    pub(super) verdict: Verdict,
}

/// No event.
pub(super) const NO_EVENT: u32 = u32::MAX;

impl Row {
    /// The order of rows: by ids, the smaller first. One number, so that a comparison does not branch.
    pub(super) fn order(&self) -> u128 {
        order_of(self.ids)
    }

    /// Events first, then colliding, possible, near.
    pub(super) fn class(&self) -> u8 {
        match self.verdict {
            _ if self.event != NO_EVENT => 0,
            Verdict::Colliding => 1,
            Verdict::Possible => 2,
            Verdict::Near | Verdict::Apart | Verdict::None => 3,
        }
    }

    /// Sort key for choosing rows if not all fit, the least first: the class, then the depth as a number in the order
    /// of [`f64::total_cmp`].
    pub(super) fn rank(&self) -> (u8, i64) {
        let bits = self.gap.min.to_bits().cast_signed();
        // For negative numbers all bits except the sign are inverted.
        (self.class(), bits ^ ((bits >> 63) & i64::MAX))
    }

    /// Returns whether it can be kept unchanged from the last tick, unless its pair was stirred. An event is over after
    /// one tick, and so is a row that exists only for it.
    fn may_last(&self) -> bool {
        self.slot.is_some()
            && self.event == NO_EVENT
            && matches!(
                self.verdict,
                Verdict::Colliding | Verdict::Possible | Verdict::Near
            )
    }
}

fn order_of(ids: (BodyId, BodyId)) -> u128 {
    u128::from(ids.0.0) << 64 | u128::from(ids.1.0)
}

/// The part of a row that is scanned in every tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    /// Index of the row; [`NO_ROW`]: it is dropped.
    row: u32,
    /// The pair; meaningless if the row does not last.
    slot: PairSlot,
    /// Index of the row in the last tick, if it is not fresh.
    pub(super) was: u32,
    /// Where its contacts were in `contacts` when that was last filled.
    pub(super) contacts: Span,
    /// The row has changed.
    pub(super) fresh: bool,
    /// More has changed than its age.
    news: bool,
    /// See [`Row::may_last`].
    lasts: bool,
}

const _: () = assert!(
    size_of::<Mark>() == 24,
    "all are gone through in every tick"
);

/// No row.
const NO_ROW: u32 = u32::MAX;

/// The rows, and memory kept across calls.
#[derive(Debug, Default)]
pub(super) struct Listing {
    /// By ids.
    pub(super) marks: Vec<Mark>,
    /// Unordered, with gaps.
    rows: Vec<Row>,
    gaps: Vec<u32>,
    /// By pair: whether it has a row.
    listed: Vec<bool>,
    /// Indices of marks whose rows must be checked again.
    dirty: Vec<u32>,
    /// New rows that are not inserted yet.
    late: Vec<Row>,
    /// There are marks without rows.
    dropped: bool,
    /// Every active pair has a row, except those that became active since the last tick.
    complete: bool,
}

impl Listing {
    pub(super) fn len(&self) -> usize {
        self.marks.len()
    }

    /// The row at an index by ids.
    pub(super) fn row(&self, at: usize) -> &Row {
        &self.rows[self.marks[at].row as usize]
    }

    /// All rows, by ids.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Row> {
        self.marks.iter().map(|mark| &self.rows[mark.row as usize])
    }

    /// Index of a pair's row, or where it would be.
    pub(super) fn find(&self, ids: (BodyId, BodyId)) -> Result<usize, usize> {
        let order = order_of(ids);
        (self.marks).binary_search_by(|mark| self.rows[mark.row as usize].order().cmp(&order))
    }

    /// Indices of the rows in which more has changed than their age, by ids.
    pub(super) fn news(&self) -> impl Iterator<Item = u32> {
        let marks = (0..).zip(&self.marks);
        marks.filter(|(_, mark)| mark.news).map(|(at, _)| at)
    }

    /// Returns whether a pair has a row.
    pub(super) fn has(&self, slot: PairSlot) -> bool {
        self.listed.get(slot.index()) == Some(&true)
    }

    /// Returns whether every active pair had a row at the end of the last tick; from now on it counts as so.
    pub(super) fn take_complete(&mut self) -> bool {
        std::mem::replace(&mut self.complete, true)
    }

    /// An active pair has no row: all active pairs must be scanned in the next tick.
    pub(super) fn lacks(&mut self) {
        self.complete = false;
    }

    /// Begins a tick: nothing is fresh; rows that do not last or are stirred are dirty.
    pub(super) fn begin(&mut self, is_stirred: impl Fn(PairSlot) -> bool) {
        self.dirty.clear();
        for (at, mark) in (0..).zip(&mut self.marks) {
            mark.was = at;
            (mark.fresh, mark.news) = (false, false);
            if !mark.lasts || is_stirred(mark.slot) {
                self.dirty.push(at);
            }
        }
    }

    /// Index of the n-th dirty row.
    pub(super) fn dirty(&self, n: usize) -> Option<usize> {
        self.dirty.get(n).map(|&at| at as usize)
    }

    /// Replaces a row by another of the same pair.
    ///
    /// * `news` - whether more may have changed than its age.
    pub(super) fn renew(&mut self, at: usize, row: Row, news: bool) {
        let mark = &mut self.marks[at];
        (mark.fresh, mark.lasts) = (true, row.may_last());
        mark.news |= news;
        self.rows[mark.row as usize] = row;
    }

    /// Gives a row its event.
    pub(super) fn set_event(&mut self, at: usize, event: u32) {
        let row = *self.row(at);
        self.renew(at, Row { event, ..row }, true);
    }

    /// Drops a row; [`Listing::close`] closes the gap.
    pub(super) fn drop(&mut self, at: usize) {
        let row = std::mem::replace(&mut self.marks[at].row, NO_ROW);
        if let Some(slot) = self.rows[row as usize].slot
            && let Some(listed) = self.listed.get_mut(slot.index())
        {
            *listed = false;
        }
        self.gaps.push(row);
        self.dropped = true;
    }

    /// Removes the marks of dropped rows.
    pub(super) fn close(&mut self) {
        if std::mem::take(&mut self.dropped) {
            self.marks.retain(|mark| mark.row != NO_ROW);
        }
        // The number of dirty rows varies from tick to tick: room for all is reserved when there are more rows than
        // ever.
        self.dirty.clear();
        self.dirty.reserve(self.marks.len());
    }

    /// Adds a new row; [`Listing::finish`] inserts it in order.
    pub(super) fn add(&mut self, row: Row) {
        if let Some(slot) = row.slot {
            if self.listed.len() <= slot.index() {
                self.listed.resize(slot.index() + 1, false);
            }
            self.listed[slot.index()] = true;
        }
        self.late.push(row);
    }

    /// Inserts the added rows in order.
    pub(super) fn finish(&mut self) {
        let mut late = std::mem::take(&mut self.late);
        late.sort_unstable_by_key(Row::order);
        let mut end = self.marks.len();
        let hole = Mark {
            row: NO_ROW,
            slot: PairSlot(0),
            was: 0,
            contacts: Span::default(),
            fresh: true,
            news: true,
            lasts: false,
        };
        self.marks.resize(end + late.len(), hole);
        // From the end: a position is written after its old content has been moved on.
        while let Some(row) = late.pop() {
            let before = late.len();
            let rows = &self.rows;
            let at = (self.marks[..end])
                .partition_point(|mark| rows[mark.row as usize].order() < row.order());
            self.marks.copy_within(at..end, at + before + 1);
            self.marks[at + before] = Mark {
                row: self.put(row),
                slot: row.slot.unwrap_or(PairSlot(0)),
                lasts: row.may_last(),
                ..hole
            };
            end = at;
        }
        late.reserve(self.marks.len());
        self.late = late;
    }

    fn put(&mut self, row: Row) -> u32 {
        if let Some(at) = self.gaps.pop() {
            self.rows[at as usize] = row;
            return at;
        }
        self.rows.push(row);
        // Reserves room to drop every one of them.
        self.gaps.reserve(self.rows.capacity());
        small(self.rows.len() - 1)
    }

    /// Nothing of the last tick is valid: every row is made again.
    pub(super) fn forget(&mut self) {
        self.marks.clear();
        self.rows.clear();
        self.gaps.clear();
        self.listed.fill(false);
        self.complete = false;
    }

    /// The slots of all pairs are void.
    pub(super) fn forget_slots(&mut self) {
        self.forget();
        self.listed.clear();
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small numbers by chance"
    )]

    use super::*;
    use crate::builtin::Random;

    fn row(id: u64, slot: u32, made: u64) -> Row {
        Row {
            ids: (BodyId(id), BodyId(id + 1)),
            gap: Interval::UNKNOWN,
            best_m: made as f64,
            slot: Some(PairSlot(slot)),
            event: NO_EVENT,
            contacts: 0,
            undecided_since: 0,
            verdict: Verdict::Near,
        }
    }

    /// Each pair by its id: its slot, and when its row was made.
    #[test]
    fn rows_are_by_ids_whatever_left_or_came() {
        let (mut listing, mut random) = (Listing::default(), Random::new(3));
        let mut pairs: Vec<(u64, u32, u64)> = Vec::new();
        for tick in 1..400 {
            if tick % 97 == 0 {
                listing.forget();
                pairs.clear();
            }
            // Some are stirred: some of those are gone, and some of these leave their slots to others.
            let chance = random.unit();
            let stirred: Vec<bool> = (0..90).map(|_| random.unit() < chance).collect();
            let before: Vec<u64> = pairs.iter().map(|pair| pair.0).collect();
            listing.begin(|slot| stirred[slot.index()]);
            let mut n = 0;
            while let Some(at) = listing.dirty(n) {
                n += 1;
                let slot = listing.row(at).slot.unwrap().0;
                let known = pairs.iter_mut().find(|pair| pair.1 == slot).unwrap();
                if random.unit() < 0.7 {
                    known.2 = tick;
                    listing.renew(at, row(known.0, slot, tick), true);
                    continue;
                }
                listing.drop(at);
                let free = 100 * tick + u64::from(slot);
                if random.unit() < 0.3 {
                    *known = (free, slot, tick);
                    listing.add(row(free, slot, tick));
                } else {
                    pairs.retain(|pair| pair.1 != slot);
                }
            }
            listing.close();
            for slot in 0..90 {
                let id = (random.unit() * 1e6) as u64;
                if !listing.has(PairSlot(slot)) && random.unit() < 0.1 {
                    pairs.push((id, slot, tick));
                    listing.add(row(id, slot, tick));
                }
            }
            listing.finish();
            pairs.sort_unstable();
            let wanted: Vec<(u64, u64)> = pairs.iter().map(|pair| (pair.0, pair.2)).collect();
            let got: Vec<(u64, u64)> = (listing.iter())
                .map(|row| (row.ids.0.0, row.best_m as u64))
                .collect();
            assert_eq!(got, wanted, "tick {tick}");
            for (at, mark) in listing.marks.iter().enumerate() {
                let row = listing.row(at);
                assert_eq!(mark.fresh, row.best_m as u64 == tick);
                assert_eq!(listing.find(row.ids), Ok(at));
                assert!(mark.fresh || before[mark.was as usize] == row.ids.0.0);
            }
        }
    }
}
