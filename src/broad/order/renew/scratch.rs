//! Scratch data of the queries of renewed bodies.

use crate::broad::order::NONE;
use crate::broad::order::links::room;
use crate::simd::boxes::WIDTH;

/// Memory of the queries, kept across ticks.
#[derive(Clone, Debug, Default)]
pub(in crate::broad::order) struct Scratch {
    /// Blocks that a query found.
    pub(super) near: Vec<u32>,
    /// Those of them that are compared.
    pub(super) close: Vec<Close>,
    /// Records of the current block: the other block, the record.
    pub(super) have: Vec<(u32, u32)>,
    /// By block: the stamp of the last query that met it, and its record with the querying block.
    pub(super) mark: Vec<(u32, u32)>,
    pub(super) stamp: u32,
}

impl Scratch {
    /// The stamp of a query for blocks with a record; the stamp after it is for those of them that it met. After a
    /// wrap-around old stamps are cleared.
    pub(super) fn next_stamp(&mut self) -> u32 {
        self.stamp = self.stamp.wrapping_add(2);
        if self.stamp == 0 {
            self.mark.fill((0, NONE));
            self.stamp = 2;
        }
        self.stamp
    }

    /// Reserves memory for a query that meets every block.
    pub(in crate::broad::order) fn reserve(&mut self, blocks: usize) {
        room(&mut self.near, blocks + WIDTH);
        room(&mut self.close, blocks);
        room(&mut self.have, blocks);
        room(&mut self.mark, blocks);
    }
}

/// A block to compare.
#[derive(Clone, Copy, Debug)]
pub(super) struct Close {
    pub(super) block: u32,
    /// Its record with the querying block, or `NONE`.
    pub(super) record: u32,
    /// Renewed lanes of the querying block that meet its bound.
    pub(super) lanes: u16,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_a_stamp_that_comes_again_is_no_block_s_of_the_round_before() {
        let mut scratch = Scratch {
            mark: vec![(2, 7), (u32::MAX - 1, 8)],
            stamp: u32::MAX - 3,
            ..Scratch::default()
        };
        assert_eq!(scratch.next_stamp(), u32::MAX - 1);
        assert_eq!(scratch.mark[0], (2, 7));
        assert_eq!(scratch.next_stamp(), 2);
        assert_eq!(scratch.mark, [(0, NONE); 2]);
    }
}
