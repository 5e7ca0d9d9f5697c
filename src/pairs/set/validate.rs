//! Checks the whole structure.

use super::PairSet;

impl PairSet {
    /// Checks the whole structure: links both ways, counts, free slots, marks.
    ///
    /// # Errors
    /// One sentence on the first check that fails.
    pub fn validate(&self) -> Result<(), String> {
        let live = self.iter().count();
        if live != self.len || self.len > self.limit {
            return Err(format!("{live} pairs live, {} counted", self.len));
        }
        if live + self.free.len() + self.resting.len() != self.keys.len() {
            return Err("a pair slot is neither live nor free nor resting".into());
        }
        if let Some((slot, _)) = self.iter().find(|(slot, _)| self.free.has(slot.index())) {
            return Err(format!("{slot:?} is free and holds a pair"));
        }
        self.lists.validate(|slot| self.get(slot), self.len)?;
        self.index.validate(self.len)?;
        if self.iter().any(|(slot, key)| self.find(key) != Some(slot)) {
            return Err("a pair is not found by its key".into());
        }
        let marked = self.is_truncated.iter().filter(|m| **m).count();
        if marked != self.truncated.len() || self.truncated.iter().any(|b| !self.is_truncated(*b)) {
            return Err("the truncated bodies and their marks differ".into());
        }
        Ok(())
    }
}
