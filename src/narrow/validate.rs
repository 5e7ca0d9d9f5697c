//! Checks the whole structure of the narrow phase's memory: counts and verdicts, work lists, pools, arenas, fronts.
//!
//! Each block must be free or have one owner, so the owners are collected first and compared with the records of the
//! pools and arenas before any block is read.

use super::Narrow;
use super::memo::Memo;
use crate::ids::PairSlot;
use crate::pairs::PairSet;
use crate::wire::Verdict;

impl Narrow {
    /// Structure check: counts, lists and memories agree, and all memory is free or has one owner.
    ///
    /// # Errors
    /// The first violation, in words.
    pub fn validate(&self, pairs: &PairSet) -> Result<(), String> {
        let lens = [self.hot.len(), self.memos.len(), self.urgencies.len()];
        if lens != [lens[0]; 3] {
            return Err(format!("memories of pairs of different lengths: {lens:?}"));
        }
        self.validate_pairs(pairs)?;
        self.validate_list("undecided", &self.undecided, |memo| memo.queued)?;
        self.validate_list("to be refreshed", &self.refresh, |memo| memo.refreshing)?;
        self.sweeps.validate()?;
        let places = |place: fn(&Memo) -> u32| self.memos.iter().map(place);
        (self.compounds).validate("fronts of bodies", places(|memo| memo.compound))?;
        (self.contact_sets).validate("contact sets", places(|memo| memo.contacts))?;
        (self.kept).validate("regions", places(|memo| memo.regions))?;
        self.shelves.validate(&self.memos, &self.compounds)
    }

    /// Each pair has a memory, and a verdict that is counted and listed.
    fn validate_pairs(&self, pairs: &PairSet) -> Result<(), String> {
        let mut counts = [0; Verdict::ALL.len()];
        for (slot, key) in pairs.iter() {
            let Some(hot) = self.hot.get(slot.index()).filter(|hot| hot.live) else {
                return Err(format!("pair {slot:?} has no memory"));
            };
            let (low, high) = key.slots();
            if (hot.a, hot.b) != (low, high) && (hot.a, hot.b) != (high, low) {
                return Err(format!("pair {slot:?} remembers other bodies"));
            }
            counts[usize::from(hot.verdict.code())] += 1;
            let memo = &self.memos[slot.index()];
            let listed = self.active.get(memo.active_at as usize) == Some(&slot);
            if listed != (hot.verdict != Verdict::Apart) {
                return Err(format!(
                    "pair {slot:?} is {} but listed: {listed}",
                    hot.verdict
                ));
            }
        }
        if counts != self.counts {
            return Err(format!(
                "verdict counts {:?}, by hand {counts:?}",
                self.counts
            ));
        }
        let live = self.hot.iter().filter(|hot| hot.live).count();
        if live != pairs.len() {
            return Err(format!(
                "memories of {live} pairs, {} there are",
                pairs.len()
            ));
        }
        let active: u64 = counts.iter().sum::<u64>() - self.count(Verdict::Apart);
        if active != self.active.len() as u64 {
            let listed = self.active.len();
            return Err(format!("{listed} pairs listed as active, {active} are"));
        }
        Ok(())
    }

    /// A work list has each pair that is marked as on it once, and no others except pairs that have ended since.
    fn validate_list(
        &self,
        what: &str,
        list: &[PairSlot],
        says: impl Fn(&Memo) -> bool,
    ) -> Result<(), String> {
        let mut listed = vec![false; self.memos.len()];
        for slot in list {
            match listed.get_mut(slot.index()) {
                Some(listed) if !*listed => *listed = true,
                Some(_) => return Err(format!("pair {slot:?} is listed twice as {what}")),
                None => return Err(format!("{slot:?} of no pair is listed as {what}")),
            }
        }
        let all = self.memos.iter().zip(&self.hot).zip(listed);
        for (at, ((memo, hot), listed)) in all.enumerate() {
            let gone = listed && !hot.live;
            if says(memo) != listed && !gone {
                let told = says(memo);
                return Err(format!("pair {at} is {what}: {told}, and listed: {listed}"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
