//! The pairs that are not plainly apart, in the order of their bodies' ids, kept from tick to tick with what the tick
//! and the messages need of each.
//!
//! In: the active pairs, in no order, and of which of them there may be something new to say. Out: rows by ids; of a
//! pair that nothing happened to, the row of the tick before. A sort of all rows would be a sixth of what publishing
//! them takes, and to ask what is known of every pair most of it.

use super::kept::Span;
use crate::ids::{BodyId, PairSlot};
use crate::math::Interval;
use crate::wire::Verdict;

/// A pair: where it stands by ids and by rank, and where its rows stand in the messages.
///
/// Kept small: a sort moves these, and above 96 bytes it branches at each comparison.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) ids: (BodyId, BodyId),
    /// At this tick's poses, metres.
    pub(super) gap: Interval,
    /// Best estimate of the gap; its lower end where there is none, metres.
    pub(super) best_m: f64,
    /// `None`: the pair is gone.
    pub(super) slot: Option<PairSlot>,
    /// Place of its event among those that wait; [`NO_EVENT`]: it has none.
    pub(super) event: u32,
    /// How many contact rows it has.
    pub(super) contacts: u32,
    /// Where it stood in `pairs` when they were last filled.
    pub(super) in_pairs: Span,
    /// Where its contacts stood in `contacts` when they were last filled.
    pub(super) in_contacts: Span,
    /// What the pair or its way says, whichever is worse.
    pub(super) verdict: Verdict,
    /// There is something new to say of it.
    pub(super) fresh: bool,
}

const _: () = assert!(size_of::<Row>() <= 96, "larger rows make a sort branch");

/// No event.
pub(super) const NO_EVENT: u32 = u32::MAX;

impl Row {
    /// The order of rows: by ids, the smaller first. One number, so that a comparison does not branch.
    pub(super) fn order(&self) -> u128 {
        u128::from(self.ids.0.0) << 64 | u128::from(self.ids.1.0)
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

    /// Whether it may be taken over from the tick before as it is, unless its pair was stirred. What is undecided ages
    /// by ticks, and an event is over.
    pub(super) fn may_last(&self) -> bool {
        self.event == NO_EVENT && matches!(self.verdict, Verdict::Colliding | Verdict::Near)
    }
}

/// The rows, and memory kept over calls.
#[derive(Debug, Default)]
pub(super) struct Listing {
    /// By ids.
    pub(super) rows: Vec<Row>,
    /// By pair: the last tick in which it was listed.
    seen: Vec<u64>,
    /// Rows that are yet to find their places.
    late: Vec<Row>,
}

impl Listing {
    /// Whether a pair has come in this tick already.
    pub(super) fn was_seen(&self, slot: PairSlot, tick: u64) -> bool {
        self.seen.get(slot.index()) == Some(&tick)
    }

    /// Notes that a pair has come.
    pub(super) fn see(&mut self, slot: PairSlot, tick: u64) {
        if self.seen.len() <= slot.index() {
            self.seen.resize(slot.index() + 1, 0);
        }
        self.seen[slot.index()] = tick;
    }

    /// Takes a row that was not there before; [`Listing::finish`] puts it in its place.
    pub(super) fn add(&mut self, row: Row) {
        self.late.push(row);
    }

    /// Puts what was added in its place.
    pub(super) fn finish(&mut self) {
        let Self { rows, late, .. } = self;
        late.sort_unstable_by_key(Row::order);
        let (mut to, mut from) = (rows.len() + late.len(), rows.len());
        rows.extend_from_slice(late);
        // From the end: a place is written after what stood there has been moved on.
        while let Some(row) = late.pop() {
            to -= 1;
            while from > 0 && rows[from - 1].order() > row.order() {
                from -= 1;
                rows[to] = rows[from];
                to -= 1;
            }
            rows[to] = row;
        }
        // How many are added differs from tick to tick: room for all of them is made when rows are more than ever.
        late.reserve(rows.len());
    }

    /// Nothing of the last tick holds: every row is made anew.
    pub(super) fn forget(&mut self) {
        self.rows.clear();
    }

    /// The slots of all pairs are void.
    pub(super) fn forget_slots(&mut self) {
        self.rows.clear();
        self.seen.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::Random;

    fn row(id: u64) -> Row {
        Row {
            ids: (BodyId(id), BodyId(id + 1)),
            gap: Interval::UNKNOWN,
            best_m: 0.0,
            slot: Some(PairSlot(u32::try_from(id).unwrap())),
            event: NO_EVENT,
            contacts: 0,
            in_pairs: Span::default(),
            in_contacts: Span::default(),
            verdict: Verdict::Near,
            fresh: true,
        }
    }

    #[test]
    fn rows_are_by_ids_whatever_left_or_came() {
        let (mut listing, mut random) = (Listing::default(), Random::new(3));
        for tick in 0..200 {
            let mut wanted: Vec<u64> = (0..60).filter(|_| random.unit() < 0.6).collect();
            listing.rows.retain(|row| wanted.contains(&row.ids.0.0));
            for row in &listing.rows {
                wanted.retain(|id| *id != row.ids.0.0);
            }
            wanted.sort_unstable_by_key(|id| id * 37 % 61);
            let mut all: Vec<u64> = listing.rows.iter().map(|row| row.ids.0.0).collect();
            all.extend(&wanted);
            wanted.iter().for_each(|id| listing.add(row(*id)));
            listing.finish();
            all.sort_unstable();
            let got: Vec<u64> = listing.rows.iter().map(|row| row.ids.0.0).collect();
            assert_eq!(got, all, "tick {tick}");
        }
    }
}
