//! Checks the whole structure of the listing.

use super::{Listing, NO_ROW, Row};
use crate::ids::PairSlot;

impl Listing {
    /// Structure check: marks by ids, each with its own row that agrees with it, all other rows free, and flags that
    /// show which pairs have one.
    ///
    /// # Errors
    /// One sentence on the first check that fails.
    pub(in crate::publish) fn validate(&self) -> Result<(), String> {
        if !self.late.is_empty() || self.dropped {
            return Err("rows of the list wait for their places".into());
        }
        let mut used = vec![false; self.rows.len()];
        let marks = self.marks.iter().map(|mark| mark.row);
        for at in marks.chain(self.gaps.iter().copied()) {
            match used.get_mut(at as usize) {
                Some(used) if !*used => *used = true,
                Some(_) => {
                    return Err(format!(
                        "row {at} of the list is there twice, or free and used"
                    ));
                }
                None if at == NO_ROW => return Err("a dropped row is listed".into()),
                None => return Err(format!("row {at} of the list is not there")),
            }
        }
        if let Some(at) = used.iter().position(|used| !used) {
            return Err(format!("row {at} of the list is neither free nor used"));
        }
        if !self
            .iter()
            .map(Row::order)
            .is_sorted_by(|one, next| one < next)
        {
            return Err("rows of the list are not by ids".into());
        }
        let mut flags = 0;
        for mark in &self.marks {
            let row = &self.rows[mark.row as usize];
            if mark.lasts != row.may_last() || row.slot.unwrap_or(PairSlot(0)) != mark.slot {
                return Err(format!(
                    "the mark of {:?} says what its row does not",
                    row.ids
                ));
            }
            if row.slot.is_some_and(|slot| !self.has(slot)) {
                return Err(format!("{:?} is listed without its flag", row.ids));
            }
            flags += usize::from(row.slot.is_some());
        }
        let flagged = self.listed.iter().filter(|listed| **listed).count();
        if flagged != flags {
            return Err(format!(
                "{flagged} pairs have flags of rows, {flags} rows pairs"
            ));
        }
        Ok(())
    }

    /// Returns whether every active pair counts as having a row, except those that became active later.
    pub(in crate::publish) fn is_complete(&self) -> bool {
        self.complete
    }
}

#[cfg(test)]
mod tests {
    use super::super::NO_EVENT;
    use super::*;
    use crate::ids::BodyId;
    use crate::math::Interval;
    use crate::wire::Verdict;

    /// Three rows; the second was dropped.
    fn listing() -> Listing {
        let mut listing = Listing::default();
        for id in [1, 2, 3, 4] {
            listing.add(Row {
                ids: (BodyId(id), BodyId(id + 1)),
                gap: Interval::UNKNOWN,
                best_m: 0.0,
                slot: Some(PairSlot(u32::try_from(id).unwrap())),
                event: NO_EVENT,
                contacts: 0,
                undecided_since: 0,
                verdict: Verdict::Near,
            });
        }
        listing.finish();
        listing.drop(1);
        listing.close();
        listing
    }

    /// A fault, and the expected message.
    type Fault = (&'static str, fn(&mut Listing));

    const FAULTS: [Fault; 9] = [
        ("wait for their places", |listing| {
            let row = listing.rows[0];
            listing.add(Row { slot: None, ..row });
        }),
        ("wait for their places", |listing| listing.drop(0)),
        ("twice, or free and used", |listing| {
            listing.gaps.push(listing.marks[0].row)
        }),
        ("is not there", |listing| listing.marks[0].row = 100),
        ("neither free nor used", |listing| {
            listing.rows.push(listing.rows[0])
        }),
        ("not by ids", |listing| listing.marks.swap(0, 1)),
        ("says what its row does not", |listing| {
            listing.marks[0].lasts = false
        }),
        ("without its flag", |listing| listing.listed[1] = false),
        ("flags of rows", |listing| listing.listed[2] = true),
    ];

    #[test]
    fn what_is_broken_in_a_listing_is_found() {
        listing().validate().unwrap();
        for (told, fault) in FAULTS {
            let mut listing = listing();
            fault(&mut listing);
            let why = listing.validate().unwrap_err();
            assert!(why.contains(told), "{why}, not {told}");
        }
    }
}
