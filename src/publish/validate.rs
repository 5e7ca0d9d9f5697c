//! Checks all data kept from tick to tick for publishing: the list of pairs, the events, and that the messages of the
//! last tick agree with rows and marks.

use super::Publisher;
use super::fit::Stood;
use super::pairs::worst_of;
use crate::narrow::Narrow;
use crate::pairs::PairSet;
use crate::wire::Outbox;
use crate::world::World;

impl Publisher {
    /// Structure check, between two ticks.
    ///
    /// * `tick` - the last one; `world`, `pairs`, `narrow` and `out` belong to it.
    ///
    /// # Errors
    /// One sentence on the first check that fails.
    pub fn validate(
        &self,
        tick: u64,
        (world, pairs, narrow): (&World, &PairSet, &Narrow),
        out: &Outbox,
    ) -> Result<(), String> {
        self.listing.validate()?;
        self.events.validate(tick, world, pairs, narrow)?;
        self.owed.pairs.validate()?;
        self.owed.changes.validate()?;
        self.validate_rows(narrow)?;
        self.survey.validate(self.listing.iter())?;
        self.chain.validate(tick)?;
        self.contact_chain.validate(tick)?;
        // The messages still contain rows that were forgotten.
        if !self.listing.is_complete() {
            return Ok(());
        }
        self.validate_pairs(out)?;
        self.validate_contacts(out)
    }

    /// Checks that rows kept unchanged agree with the findings, and that every active pair has one.
    fn validate_rows(&self, narrow: &Narrow) -> Result<(), String> {
        for row in self.listing.iter() {
            let Some(slot) = row.slot.filter(|slot| !narrow.is_stirred(*slot)) else {
                continue;
            };
            let passage = narrow.passage(slot).map(|swept| swept.passage);
            let known = narrow.finding(slot).map(|finding| finding.verdict);
            // A motion counts only if it is news.
            let verdicts = [known, known.map(|verdict| worst_of(verdict, passage))];
            if !verdicts.contains(&Some(row.verdict)) {
                return Err(format!(
                    "the row of {:?} says {}, known is {known:?}",
                    row.ids, row.verdict
                ));
            }
        }
        let is_new = |slot| narrow.entered().contains(slot);
        let without =
            (narrow.active().iter()).find(|slot| !self.listing.has(**slot) && !is_new(slot));
        match without {
            Some(slot) if self.listing.is_complete() => {
                Err(format!("{slot:?} is not apart and has no row"))
            }
            _ => Ok(()),
        }
    }

    /// Checks that `pairs` is ordered by ids, and has a row for each of the list if all fit.
    fn validate_pairs(&self, out: &Outbox) -> Result<(), String> {
        if !self.heard.pairs {
            return Ok(());
        }
        let sent = || out.pairs.iter().map(|row| (row.body_a, row.body_b));
        if !sent().is_sorted_by(|one, next| one < next) {
            return Err("rows of pairs are not by ids".into());
        }
        let listed = self.listing.iter().map(|row| (row.ids.0.0, row.ids.1.0));
        if matches!(self.stood, Stood::Listed) && !sent().eq(listed) {
            return Err("rows of pairs are not those of the list".into());
        }
        if self.kept_pairs.rows() != out.pairs.len() {
            let settled = self.kept_pairs.rows();
            return Err(format!(
                "{settled} rows of pairs settled, {} there are",
                out.pairs.len()
            ));
        }
        Ok(())
    }

    /// Checks that `contacts` are those of the list's rows, adjacent at the positions in their marks.
    fn validate_contacts(&self, out: &Outbox) -> Result<(), String> {
        if !self.heard.contacts {
            return Ok(());
        }
        let mut end = 0;
        for (mark, row) in self.listing.marks.iter().zip(self.listing.iter()) {
            let (first, len) = (mark.contacts.first as usize, mark.contacts.len as usize);
            let ids = (row.ids.0.0, row.ids.1.0);
            let its = out.contacts.get(first..first + len).unwrap_or_default();
            let are_its = its.iter().all(|row| (row.body_a, row.body_b) == ids);
            if len > 0 && (first != end || its.len() != len || !are_its) {
                return Err(format!(
                    "the contacts of {:?} are not where its mark says",
                    row.ids
                ));
            }
            if self.had_all_contacts && len != row.contacts as usize {
                return Err(format!(
                    "{len} contacts of {:?} are sent, {} there are",
                    row.ids, row.contacts
                ));
            }
            end += len;
        }
        if end != out.contacts.len() || end != self.kept_contacts.rows() {
            let settled = self.kept_contacts.rows();
            return Err(format!(
                "{settled} contacts settled, {end} marked, {} sent",
                out.contacts.len()
            ));
        }
        if out.contacts.iter().any(|row| row.id >= self.next_contact) {
            return Err("a contact has an id that was not given yet".into());
        }
        Ok(())
    }
}

#[cfg(test)]
pub(in crate::publish) mod tests;
