//! Rows in the order of their bodies' ids, kept from tick to tick: what was in order stays so, and only what is new has
//! to find its place.
//!
//! In: the active pairs, in no order. Out: rows by ids. A sort of all rows would be a sixth of what publishing takes.

use super::pairs::Row;
use crate::ids::PairSlot;

/// The order of the last tick, and memory kept over calls.
#[derive(Debug, Default)]
pub(super) struct Listing {
    /// Pairs by ids, as of the last tick in which rows were made.
    order: Vec<PairSlot>,
    /// By pair: the last tick in which it was listed.
    seen: Vec<u64>,
    /// Rows that stand before their neighbours.
    late: Vec<Row>,
}

impl Listing {
    /// The slots to look at, in order: first those of the last tick, of which some may be active no more (or be other
    /// pairs now), then all that are active, of which most were among them.
    pub(super) fn at(&self, active: &[PairSlot], place: usize) -> Option<PairSlot> {
        let later = || active.get(place - self.order.len()).copied();
        self.order.get(place).copied().or_else(later)
    }

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

    /// Takes the next row.
    pub(super) fn push(&mut self, rows: &mut Vec<Row>, row: Row) {
        if rows.last().is_some_and(|last| row.order() < last.order()) {
            self.late.push(row);
        } else {
            rows.push(row);
        }
    }

    /// Puts the late rows in their places.
    pub(super) fn finish(&mut self, rows: &mut Vec<Row>) {
        self.late.sort_unstable_by_key(Row::order);
        let (mut to, mut from) = (rows.len() + self.late.len(), rows.len());
        rows.extend_from_slice(&self.late);
        // From the end: a place is written after what stood there has been moved on.
        while let Some(late) = self.late.pop() {
            to -= 1;
            while from > 0 && rows[from - 1].order() > late.order() {
                from -= 1;
                rows[to] = rows[from];
                to -= 1;
            }
            rows[to] = late;
        }
        // How many come late differs from tick to tick: room for all of them is made when rows are more than ever.
        self.late.reserve(rows.len());
        self.order.clear();
        self.order.extend(rows.iter().filter_map(|row| row.slot));
    }

    /// The slots of all pairs are void.
    pub(super) fn forget_slots(&mut self) {
        self.order.clear();
        self.seen.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::Random;
    use crate::ids::BodyId;

    fn row(id: u64) -> Row {
        Row {
            ids: (BodyId(id), BodyId(id + 1)),
            slot: Some(PairSlot(u32::try_from(id).unwrap())),
            depth_m: 0.0,
            event: u32::MAX,
            contacts: 0,
            class: 1,
        }
    }

    #[test]
    fn rows_are_by_ids_whatever_left_came_or_took_a_slot() {
        let (mut listing, mut random) = (Listing::default(), Random::new(3));
        for tick in 1..200 {
            let mut wanted: Vec<u64> = (0..60).filter(|_| random.unit() < 0.6).collect();
            let active: Vec<PairSlot> = {
                let mut any = wanted.clone();
                any.sort_by_key(|id| id * 37 % 61);
                any.iter().map(|id| row(*id).slot.unwrap()).collect()
            };
            // What a slot stands for changes now and then.
            let shift = tick / 50;
            let id_of = |slot: PairSlot| (u64::from(slot.0) * (1 + shift)) % 61;
            let mut rows = Vec::new();
            let mut place = 0;
            while let Some(slot) = listing.at(&active, place) {
                place += 1;
                if active.contains(&slot) && !listing.was_seen(slot, tick) {
                    listing.see(slot, tick);
                    let made = Row {
                        slot: Some(slot),
                        ..row(id_of(slot))
                    };
                    listing.push(&mut rows, made);
                }
            }
            listing.finish(&mut rows);
            wanted = wanted.iter().map(|id| id * (1 + shift) % 61).collect();
            wanted.sort_unstable();
            let got: Vec<u64> = rows.iter().map(|row| row.ids.0.0).collect();
            assert_eq!(got, wanted, "tick {tick}");
        }
    }
}
