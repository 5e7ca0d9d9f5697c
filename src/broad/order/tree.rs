//! The implicit tree over blocks: each node holds the bounds of its sixteen children, the lowest nodes those of
//! sixteen blocks. No pointers: child `i` of node `n` is node `16 n + i` one level down.

use super::links::room;
use crate::simd::boxes::{Boxes16, LANES, Lanes, Portable, WIDTH};

const _: () = assert!(WIDTH == 1 << 4, "a level is four bits of a block's number");

/// Levels a tree can have: sixteen blocks, 256, ... far more than `limits::BODIES_MAX` bodies fill.
const LEVELS_MAX: usize = 8;

/// The bound of nothing: upside down.
pub(super) const NO_BOUND: [f32; 6] = {
    let (low, high) = (f32::INFINITY, f32::NEG_INFINITY);
    [low, low, low, high, high, high]
};

/// Bounds of blocks, and of what holds them.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    /// By block: its bound, lower and upper corner; upside down where it holds no box.
    bounds: Vec<[f32; 6]>,
    /// From the lowest nodes to the root; `height` of them are in use.
    levels: Vec<Vec<Boxes16>>,
    height: usize,
    /// Nodes of the level at hand whose bounds have changed, ascending.
    dirty: Vec<u32>,
    /// Nodes still to be looked at in [`Tree::query`]: level, node.
    stack: Vec<(u8, u32)>,
}

/// Memory of the queries for a run of blocks.
#[derive(Clone, Debug, Default)]
pub(super) struct Walk {
    /// Nodes still to be looked at: level, node.
    stack: Vec<(u8, u32)>,
    /// Lowest nodes that the blocks of the lowest node at hand may meet; and by node, which of these blocks do.
    nodes: Vec<u32>,
    askers: Vec<u16>,
    /// The nodes that the block at hand meets; and those with blocks near it, and which.
    met: Vec<u32>,
    children: Vec<(u32, u16)>,
}

impl Walk {
    /// Room for a query that descends into every node above so many blocks.
    pub(super) fn reserve(&mut self, blocks: usize) {
        let nodes = nodes_above(blocks);
        room(&mut self.stack, nodes);
        room(&mut self.nodes, nodes);
        room(&mut self.askers, nodes);
        room(&mut self.met, nodes);
        room(&mut self.children, nodes);
    }
}

/// At least as many as nodes stand above so many blocks.
fn nodes_above(blocks: usize) -> usize {
    blocks / WIDTH + WIDTH * LEVELS_MAX
}

impl Tree {
    /// Makes room for so many blocks, all empty.
    pub(super) fn reset(&mut self, blocks: usize) {
        self.bounds.clear();
        self.bounds.resize(blocks, NO_BOUND);
        let (mut level, mut len) = (0, blocks);
        loop {
            len = len.div_ceil(WIDTH).max(1);
            if self.levels.len() == level {
                self.levels.push(Vec::new());
            }
            self.levels[level].clear();
            self.levels[level].resize(len, Boxes16::EMPTY);
            level += 1;
            if len == 1 {
                break;
            }
        }
        debug_assert!(level <= LEVELS_MAX);
        // Levels that this many blocks do not need keep their memory out of sight.
        self.height = level;
        self.dirty.clear();
    }

    /// Room for so many blocks.
    pub(super) fn reserve_blocks(&mut self, blocks: usize) {
        self.bounds
            .reserve(blocks.saturating_sub(self.bounds.len()));
        let (mut level, mut len) = (0, blocks);
        while len > 1 || level == 0 {
            len = len.div_ceil(WIDTH);
            if self.levels.len() == level {
                self.levels.push(Vec::new());
            }
            let nodes = &mut self.levels[level];
            nodes.reserve(len.saturating_sub(nodes.len()));
            level += 1;
        }
    }

    /// Room for a query that descends into every node.
    pub(super) fn reserve(&mut self) {
        let blocks = self.bounds.len();
        room(&mut self.stack, nodes_above(blocks));
        room(&mut self.dirty, nodes_above(blocks));
    }

    /// The bound of a block.
    #[inline(always)]
    pub(super) fn bound(&self, block: usize) -> &[f32; 6] {
        &self.bounds[block]
    }

    /// Sets the bound of a block. To be called in ascending order of blocks, then [`Tree::refit`].
    #[inline(always)]
    pub(super) fn set(&mut self, block: usize, bound: [f32; 6]) {
        self.bounds[block] = bound;
        let parent = block / WIDTH;
        write(&mut self.levels[0][parent], block % WIDTH, &bound);
        #[allow(
            clippy::cast_possible_truncation,
            reason = "a node of at most 2^20 / 16"
        )]
        let parent = parent as u32;
        if self.dirty.last() != Some(&parent) {
            self.dirty.push(parent);
        }
    }

    /// Brings the nodes above changed blocks up to date.
    ///
    /// Cost: the changed nodes of each level.
    #[inline(always)]
    pub(super) fn refit<L: Lanes>(&mut self, lanes: L) {
        for level in 1..self.height {
            let (below, above) = self.levels.split_at_mut(level);
            let (below, above) = (&below[level - 1], &mut above[0]);
            let mut kept = 0;
            for at in 0..self.dirty.len() {
                let node = self.dirty[at] as usize;
                let bound = lanes.bound(&below[node], u16::MAX);
                write(&mut above[node / WIDTH], node % WIDTH, &bound);
                let parent = self.dirty[at] / LANES;
                if kept == 0 || self.dirty[kept - 1] != parent {
                    self.dirty[kept] = parent;
                    kept += 1;
                }
            }
            self.dirty.truncate(kept);
        }
        self.dirty.clear();
    }

    /// Appends the blocks whose bound meets a box.
    #[inline(always)]
    pub(super) fn query<L: Lanes>(&mut self, lanes: L, one: &[f32; 6], found: &mut Vec<u32>) {
        let mut stack = std::mem::take(&mut self.stack);
        self.query_from(lanes, one, 0, 0, (&mut stack, found));
        self.stack = stack;
    }

    /// As [`Tree::query`], in ascending order.
    ///
    /// * `floor` - the level of the nodes that are looked for: 0 for blocks, 1 for the lowest nodes, below the root.
    /// * `first` - none before this one.
    /// * `stack`, `found` - memory kept over calls, and what is appended to.
    #[inline(always)]
    fn query_from<L: Lanes>(
        &self,
        lanes: L,
        one: &[f32; 6],
        floor: u8,
        first: u32,
        (stack, found): (&mut Vec<(u8, u32)>, &mut Vec<u32>),
    ) {
        stack.clear();
        #[allow(clippy::cast_possible_truncation, reason = "at most LEVELS_MAX levels")]
        stack.push(((self.height - 1) as u8, 0));
        while let Some((level, node)) = stack.pop() {
            let mut hits = lanes.meets(&self.levels[usize::from(level)][node as usize], one);
            // Children that hold none but earlier blocks.
            let early = (first >> (4 * u32::from(level - floor))).saturating_sub(node * LANES);
            hits &= u16::MAX.checked_shl(early).unwrap_or(0);
            if level == floor {
                while hits != 0 {
                    found.push(node * LANES + hits.trailing_zeros());
                    hits &= hits - 1;
                }
            }
            // The highest first, so that the lowest is looked at first.
            while hits != 0 {
                let child = u16::BITS - 1 - hits.leading_zeros();
                hits ^= 1 << child;
                stack.push((level - 1, node * LANES + child));
            }
        }
    }

    /// Notes the lowest nodes from one on that it meets, and which of its blocks meet each, for [`Tree::query_among`]
    /// of these blocks: a walk down the tree that sixteen share.
    #[inline(always)]
    pub(super) fn query_nodes<L: Lanes>(&self, lanes: L, node: usize, walk: &mut Walk) {
        let Walk {
            stack,
            nodes,
            askers,
            ..
        } = walk;
        nodes.clear();
        askers.clear();
        if self.height > 1 {
            let bound_of = |node: usize| self.levels[1][node / WIDTH].get(node % WIDTH);
            let bound = bound_of(node);
            #[allow(
                clippy::cast_possible_truncation,
                reason = "a node of at most 2^20 / 16"
            )]
            self.query_from(lanes, &bound, 1, node as u32, (stack, nodes));
            let mine = &self.levels[0][node];
            askers.extend(
                nodes
                    .iter()
                    .map(|node| lanes.meets(mine, &bound_of(*node as usize))),
            );
        } else {
            nodes.push(0);
            askers.push(u16::MAX);
        }
    }

    /// The blocks whose bound meets that of a block of the node noted last, from the block on, ascending.
    #[inline(always)]
    pub(super) fn query_among<L: Lanes>(
        &self,
        lanes: L,
        block: u32,
        walk: &mut Walk,
        found: &mut Vec<u32>,
    ) {
        let bound = &self.bounds[block as usize];
        let Walk {
            nodes,
            askers,
            met,
            children,
            ..
        } = walk;
        // Which nodes are met, and how many blocks one has near, are guesses that fail: no branch is taken on them.
        met.clear();
        met.resize(nodes.len(), 0);
        let mut kept = 0;
        for (node, askers) in nodes.iter().zip(askers.iter()) {
            met[kept] = *node;
            kept += usize::from(askers >> (block % LANES) & 1);
        }
        met.truncate(kept);
        children.clear();
        children.resize(kept + 1, (0, 0));
        let (mut kept, mut count) = (0, 0);
        for node in met.iter() {
            let early = block.saturating_sub(node * LANES);
            let after = u16::MAX.checked_shl(early).unwrap_or(0);
            let hits = lanes.meets(&self.levels[0][*node as usize], bound) & after;
            children[kept] = (node * LANES, hits);
            kept += usize::from(hits != 0);
            count += hits.count_ones() as usize;
        }
        found.clear();
        found.resize(count, 0);
        let (mut at, (mut first, mut left)) = (0, children[0]);
        for found in found {
            *found = first + left.trailing_zeros();
            left &= left.wrapping_sub(1);
            at += usize::from(left == 0);
            let next = children[at];
            (first, left) = if left == 0 { next } else { (first, left) };
        }
    }

    /// Checks every node against the blocks' boxes.
    pub(super) fn validate(&self, boxes: &[Boxes16]) -> Result<(), String> {
        for (block, lanes) in boxes.iter().enumerate() {
            let (tight, held) = (Portable.bound(lanes, u16::MAX), &self.bounds[block]);
            let empty = tight[0] > tight[3];
            if !empty && (0..3).any(|k| held[k] > tight[k] || held[k + 3] < tight[k + 3]) {
                return Err(format!(
                    "the bound of block {block} does not hold its boxes"
                ));
            }
            let mut at = block;
            for level in &self.levels[..self.height] {
                let node = level[at / WIDTH].get(at % WIDTH);
                let holds = (0..3).all(|k| node[k] <= held[k] && held[k + 3] <= node[k + 3]);
                if !empty && !holds {
                    return Err(format!("a node above block {block} does not hold it"));
                }
                at /= WIDTH;
            }
        }
        Ok(())
    }
}

/// Writes a bound into a node; an empty one becomes an empty lane.
#[inline(always)]
fn write(node: &mut Boxes16, lane: usize, bound: &[f32; 6]) {
    if bound[0] <= bound[3] {
        node.set(lane, bound);
    } else {
        node.set(lane, &[f32::NAN; 6]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::small;

    #[test]
    fn a_block_is_told_every_block_from_it_on_that_it_meets() {
        for blocks in [1, 16, 17, 300] {
            let mut tree = Tree::default();
            tree.reset(blocks);
            for block in (0..blocks).filter(|block| block % 5 != 2) {
                let places = [block / 4 + block * 7 % 11, block % 4];
                let [low, wide] = places.map(|at| f32::from(u16::try_from(at).unwrap()));
                tree.set(block, [low, low, 0.0, low + wide, low + wide, 1.0]);
            }
            tree.refit(Portable);
            let (mut walk, mut found) = (Walk::default(), Vec::new());
            for block in 0..blocks {
                if block.is_multiple_of(WIDTH) {
                    tree.query_nodes(Portable, block / WIDTH, &mut walk);
                }
                tree.query_among(Portable, small(block), &mut walk, &mut found);
                let one = tree.bound(block);
                let meets = |other: &usize| {
                    let other = tree.bound(*other);
                    (0..3).all(|k| one[k] <= other[k + 3] && other[k] <= one[k + 3])
                };
                let wanted: Vec<u32> = (block..blocks).filter(meets).map(small).collect();
                assert_eq!(found, wanted, "block {block} of {blocks}");
            }
        }
    }
}
