//! The implicit tree over blocks: each node holds the bounds of its sixteen children, the lowest nodes those of sixteen
//! blocks. No pointers: child `i` of node `n` is node `16 n + i` one level down.

use super::links::room;
use crate::simd::boxes::{Boxes16, LANES, Lanes, Portable, WIDTH};

const _: () = assert!(WIDTH == 1 << 4, "a level is four bits of a block's number");

/// Levels a tree can have: sixteen blocks, 256, ... far more than `limits::BODIES_MAX` bodies fill.
const LEVELS_MAX: usize = 8;

/// An empty bound: inverted.
pub(super) const NO_BOUND: [f32; 6] = {
    let (low, high) = (f32::INFINITY, f32::NEG_INFINITY);
    [low, low, low, high, high, high]
};

/// Bounds of blocks, and of the nodes above.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    /// By block: its bound, lower and upper corner; inverted if it holds no box.
    bounds: Vec<[f32; 6]>,
    /// From the lowest nodes to the root; `height` of them are in use.
    levels: Vec<Vec<Boxes16>>,
    height: usize,
    /// Nodes of the current level whose bounds have changed, ascending.
    dirty: Vec<u32>,
    /// Memory of [`Tree::query`].
    descent: Descent,
}

/// Memory of a walk down the tree.
#[derive(Clone, Debug, Default)]
struct Descent {
    /// The nodes of a level to visit; and the nodes with children that are met, as the first child and a bit mask.
    nodes: Vec<u32>,
    children: Vec<(u32, u16)>,
}

impl Descent {
    fn reserve(&mut self, nodes: usize) {
        room(&mut self.nodes, nodes + WIDTH);
        room(&mut self.children, nodes);
    }
}

/// Memory of the queries for a run of blocks.
#[derive(Clone, Debug, Default)]
pub(super) struct Walk {
    descent: Descent,
    /// Lowest nodes that the blocks of the current lowest node may meet; and by node, which of these blocks do.
    nodes: Vec<u32>,
    askers: Vec<u16>,
}

impl Walk {
    /// Reserves memory for a query that visits every node above `blocks` blocks.
    pub(super) fn reserve(&mut self, blocks: usize) {
        let nodes = nodes_above(blocks);
        self.descent.reserve(nodes);
        room(&mut self.nodes, nodes + WIDTH);
        room(&mut self.askers, nodes);
    }
}

/// Upper limit of the number of nodes above `blocks` blocks.
fn nodes_above(blocks: usize) -> usize {
    blocks / WIDTH + WIDTH * LEVELS_MAX
}

impl Tree {
    /// Resizes to `blocks` blocks, all empty.
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
        // Levels that this many blocks do not need keep their memory, unused.
        self.height = level;
        self.dirty.clear();
    }

    /// Reserves memory for `blocks` blocks.
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

    /// Reserves memory for a query that visits every node.
    pub(super) fn reserve(&mut self) {
        let blocks = self.bounds.len();
        self.descent.reserve(nodes_above(blocks));
        room(&mut self.dirty, nodes_above(blocks));
    }

    /// The bound of a block.
    #[inline(always)]
    pub(super) fn bound(&self, block: usize) -> &[f32; 6] {
        &self.bounds[block]
    }

    /// Sets the bound of a block. Must be called in ascending order of blocks, then [`Tree::refit`].
    #[inline(always)]
    pub(super) fn set(&mut self, block: usize, bound: [f32; 6]) {
        // A changed box is rarely the outermost of sixteen.
        if is_same(&self.bounds[block], &bound) {
            return;
        }
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

    /// Updates the nodes above changed blocks.
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
                let (parent, lane) = (&mut above[node / WIDTH], node % WIDTH);
                if is_same(&parent.get(lane), &bound) {
                    continue;
                }
                write(parent, lane, &bound);
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

    /// Appends the blocks whose bound meets a box, ascending.
    #[inline(always)]
    pub(super) fn query<L: Lanes>(&mut self, lanes: L, one: &[f32; 6], found: &mut Vec<u32>) {
        let mut descent = std::mem::take(&mut self.descent);
        self.query_from(lanes, one, (0, 0), &mut descent, found);
        self.descent = descent;
    }

    /// As [`Tree::query`].
    ///
    /// * `floor` - the level of the result nodes: 0 for blocks, 1 for the lowest nodes, below the root.
    /// * `first` - earlier ones are left out.
    /// * `found` - results are appended here.
    #[inline(always)]
    fn query_from<L: Lanes>(
        &self,
        lanes: L,
        one: &[f32; 6],
        (floor, first): (usize, u32),
        descent: &mut Descent,
        found: &mut Vec<u32>,
    ) {
        descent.nodes.clear();
        descent.nodes.push(0);
        for level in (floor + 1..self.height).rev() {
            // Skips nodes that hold only earlier ones.
            let first = first >> (4 * (level - floor));
            let count = self.meet_children(lanes, one, (level, first), descent);
            descent.nodes.clear();
            unfold(lanes, &descent.children, count, &mut descent.nodes);
        }
        let count = self.meet_children(lanes, one, (floor, first), descent);
        unfold(lanes, &descent.children, count, found);
    }

    /// Finds which children of the current nodes, on some level, meet a box, none before `first`; returns how many.
    #[inline(always)]
    fn meet_children<L: Lanes>(
        &self,
        lanes: L,
        one: &[f32; 6],
        (level, first): (usize, u32),
        descent: &mut Descent,
    ) -> usize {
        let Descent { nodes, children } = descent;
        // A copy, which no list can alias: it stays in registers.
        let one = *one;
        children.clear();
        children.resize(nodes.len(), (0, 0));
        let (level, mut kept, mut count) = (&self.levels[level], 0, 0);
        for node in nodes.iter() {
            let early = first.saturating_sub(node * LANES);
            let after = u16::MAX.checked_shl(early).unwrap_or(0);
            let hits = lanes.meets(&level[*node as usize], &one) & after;
            children[kept] = (node * LANES, hits);
            kept += usize::from(hits != 0);
            count += hits.count_ones() as usize;
        }
        children.truncate(kept);
        count
    }

    /// Finds the lowest nodes from `node` on that it meets, and which of its blocks meet each, for
    /// [`Tree::query_among`] of these blocks: sixteen blocks share one walk down the tree.
    #[inline(always)]
    pub(super) fn query_nodes<L: Lanes>(&self, lanes: L, node: usize, walk: &mut Walk) {
        let Walk {
            descent,
            nodes,
            askers,
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
            self.query_from(lanes, &bound, (1, node as u32), descent, nodes);
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

    /// The blocks whose bound meets that of a block of the last queried node, from the block itself on, ascending.
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
            descent,
            nodes,
            askers,
        } = walk;
        // Which nodes are met is unpredictable: there is no branch on it.
        let met = &mut descent.nodes;
        met.clear();
        met.resize(nodes.len(), 0);
        let mut kept = 0;
        for (node, askers) in nodes.iter().zip(askers.iter()) {
            met[kept] = *node;
            kept += usize::from(askers >> (block % LANES) & 1);
        }
        met.truncate(kept);
        let count = self.meet_children(lanes, bound, (0, block), descent);
        found.clear();
        unfold(lanes, &descent.children, count, found);
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

/// Appends `count` children: all in a list whose items are the first child of a node and a bit mask.
#[inline(always)]
fn unfold<L: Lanes>(lanes: L, children: &[(u32, u16)], count: usize, found: &mut Vec<u32>) {
    let mut at = found.len();
    let end = at + count;
    // The number of children per node is unpredictable: all sixteen places are written, and unused ones are
    // overwritten.
    found.resize(end + WIDTH, 0);
    for (first, met) in children {
        if let Some(place) = found[at..].first_chunk_mut() {
            lanes.number(*met, *first, place);
        }
        at += met.count_ones() as usize;
    }
    found.truncate(end);
}

/// Returns whether two bounds are equal; without a branch per face.
#[inline(always)]
fn is_same(one: &[f32; 6], other: &[f32; 6]) -> bool {
    let faces = one.iter().zip(other);
    faces.fold(true, |same, (one, other)| {
        same & (one.to_bits() == other.to_bits())
    })
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

    /// Sets bounds along a line, some of them empty; `turn` shifts, stretches and empties other ones.
    fn set_some(tree: &mut Tree, blocks: usize, turn: usize) {
        for block in 0..blocks {
            let places = [block / 4 + (block + turn) * 7 % 11, (block + turn) % 4];
            let [low, wide] = places.map(|at| f32::from(u16::try_from(at).unwrap()));
            let bound = [low, low, 0.0, low + wide, low + wide, 1.0];
            let there = (block + turn) % 5 != 2;
            tree.set(block, if there { bound } else { NO_BOUND });
        }
        tree.refit(Portable);
    }

    #[test]
    fn a_block_is_told_every_block_that_it_meets() {
        for (blocks, step) in [(1, 1), (16, 1), (17, 1), (300, 1), (4200, 41)] {
            let mut tree = Tree::default();
            tree.reset(blocks);
            let (mut walk, mut found) = (Walk::default(), Vec::new());
            for turn in [0, 1, 1, 4] {
                set_some(&mut tree, blocks, turn);
                for block in (0..blocks).step_by(step) {
                    let one = *tree.bound(block);
                    let meets = |other: &usize| {
                        let other = tree.bound(*other);
                        (0..3).all(|k| one[k] <= other[k + 3] && other[k] <= one[k + 3])
                    };
                    let all: Vec<u32> = (0..blocks).filter(meets).map(small).collect();
                    let from = all.partition_point(|other| *other < small(block));
                    tree.query_nodes(Portable, block / WIDTH, &mut walk);
                    tree.query_among(Portable, small(block), &mut walk, &mut found);
                    assert_eq!(found, all[from..], "from block {block} of {blocks}");
                    found.clear();
                    tree.query(Portable, &one, &mut found);
                    assert_eq!(found, all, "block {block} of {blocks}");
                }
            }
        }
    }
}
