//! Checks the storage of a pair's entries: the heap of certificates, and the open list in the order of its search.

use super::{Arena, Group, Open, OpenList, Proved, Run, Search};

impl Proved {
    /// Its block.
    pub(in crate::narrow) fn run(&self) -> &Run {
        &self.heap
    }

    /// Structure check: a heap of non-empty groups, with the soonest expiry cached.
    ///
    /// # Errors
    /// One sentence on the first violation.
    pub(in crate::narrow) fn validate(&self, arena: &Arena<Group>) -> Result<(), String> {
        arena.validate_heap(&self.heap)?;
        let groups = arena.all(&self.heap);
        let soonest_m = groups.first().map_or(f64::INFINITY, |group| group.expiry_m);
        if soonest_m.total_cmp(&self.soonest_m).is_ne() {
            let told_m = self.soonest_m;
            return Err(format!(
                "the soonest certificate is told to expire at {told_m} m, not {soonest_m} m"
            ));
        }
        if groups.iter().any(|group| group.mask == 0) {
            return Err("a certificate is of no pair of boxes".into());
        }
        Ok(())
    }
}

impl OpenList {
    /// Its block.
    pub(in crate::narrow) fn run(&self) -> &Run {
        &self.items
    }

    /// Structure check: a heap, a queue whose head is in it, or a stack.
    ///
    /// # Errors
    /// One sentence on the first violation.
    pub(in crate::narrow) fn validate(&self, arena: &Arena<Open>) -> Result<(), String> {
        let (head, len) = (self.head, self.items.len());
        match self.search {
            Search::Priority => arena.validate_heap(&self.items)?,
            // A queue that is used up starts again.
            Search::BreadthFirst if head < len.max(1) => return Ok(()),
            Search::BreadthFirst => {
                return Err(format!("the head of a queue of {len} is at {head}"));
            }
            Search::Carried | Search::Restart => {}
        }
        if head != 0 {
            return Err(format!(
                "an open list that is no queue has its head at {head}"
            ));
        }
        Ok(())
    }
}
