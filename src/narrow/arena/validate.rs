//! Checks the structure of an arena: every block is free or has an owner, and each heap is one.

use super::{Arena, BLOCK_MIN, CLASSES, Linked, NONE, PLACE_BITS, Run, split};
use crate::ids::small;

impl<T: Linked> Arena<T> {
    /// Structure check: each block is free or has one owner, and together they fill the chunks.
    ///
    /// * `owners` - the runs of all owners of blocks.
    ///
    /// # Errors
    /// One sentence on the first violation.
    pub(in crate::narrow) fn validate(&self, owners: &[&Run]) -> Result<(), String> {
        if let Some(run) = owners.iter().find(|run| run.len > run.room) {
            return Err(format!("{} items in a block of {}", run.len, run.room));
        }
        let held = owners.iter().filter(|run| run.room > 0);
        let mut blocks: Vec<(u32, usize)> = held.map(|run| (run.at, run.room as usize)).collect();
        for class in 0..CLASSES {
            self.add_free(class, &mut blocks)?;
        }
        blocks.sort_unstable();
        let mut blocks = blocks.into_iter().peekable();
        for (chunk, items) in self.chunks.iter().enumerate() {
            let mut end = 0;
            while end < items.len() {
                let place = small(chunk) << PLACE_BITS | small(end);
                let Some((_, room)) = blocks.next_if(|(at, _)| *at == place) else {
                    return Err(format!(
                        "no block begins at item {end} of chunk {chunk}: one is lost, or two overlap"
                    ));
                };
                end += room;
            }
            if end != items.len() {
                return Err(format!("a block goes beyond the end of chunk {chunk}"));
            }
        }
        if let Some((at, _)) = blocks.next() {
            return Err(format!(
                "the block at {at:#x} is there twice, or in no chunk"
            ));
        }
        let len: usize = self.chunks.iter().map(Vec::len).sum();
        if len != self.len || len > self.most {
            let (counted, most) = (self.len, self.most);
            return Err(format!("{len} items, {counted} counted, {most} allowed"));
        }
        Ok(())
    }

    /// Adds the free blocks of a size.
    fn add_free(&self, class: usize, blocks: &mut Vec<(u32, usize)>) -> Result<(), String> {
        let mut at = self.free[class];
        // More of this size than fit cannot be free.
        for _ in 0..=self.len / BLOCK_MIN {
            if at == NONE {
                return Ok(());
            }
            let (chunk, place) = split(at);
            let Some(item) = self.chunks.get(chunk).and_then(|items| items.get(place)) else {
                return Err(format!("the free block at {at:#x} is in no chunk"));
            };
            blocks.push((at, BLOCK_MIN << class));
            at = item.next();
        }
        Err(format!(
            "free blocks of {} items go round in a circle",
            BLOCK_MIN << class
        ))
    }
}

impl<T: Linked + Ord> Arena<T> {
    /// Structure check: no item of a run that is a heap is greater than its parent.
    ///
    /// # Errors
    /// The first item that is.
    pub(in crate::narrow) fn validate_heap(&self, run: &Run) -> Result<(), String> {
        let items = self.all(run);
        match (1..items.len()).find(|&at| items[(at - 1) / 2] < items[at]) {
            Some(at) => Err(format!("item {at} of a heap comes before the one above it")),
            None => Ok(()),
        }
    }
}
