//! Checks the whole structure.

use super::{NONE, PairSet};
use crate::ids::BodySlot;

impl PairSet {
    /// Checks the whole structure: links both ways, counts, free slots, marks.
    ///
    /// # Errors
    /// One sentence on the first thing that does not hold.
    pub fn validate(&self) -> Result<(), String> {
        let live = self.iter().count();
        if live != self.len || self.len > self.limit {
            return Err(format!("{live} pairs live, {} counted", self.len));
        }
        if live + self.free.len() + self.resting.len() != self.nodes.len() {
            return Err("a pair slot is neither live nor free nor resting".into());
        }
        let mut seen = 0;
        for (at, head) in (0_u32..).zip(&self.heads) {
            let body = BodySlot(at);
            let mut before = NONE;
            let mut count = 0;
            for slot in self.pairs_of(body).take(self.len + 1) {
                let node = &self.nodes[slot.index()];
                let side = node.side(body);
                if !node.is_live() || node.bodies()[side] != body || node.prev[side] != before {
                    return Err(format!("the list of body slot {at} is broken at {slot:?}"));
                }
                before = slot.0;
                count += 1;
            }
            if count != head.len {
                return Err(format!(
                    "body slot {at} has {count} pairs, not {}",
                    head.len
                ));
            }
            seen += count as usize;
        }
        if seen != 2 * self.len {
            return Err(format!("{seen} list entries for {} pairs", self.len));
        }
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
