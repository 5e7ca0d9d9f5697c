//! The set itself: dense slots, and for each body the list of its pairs.

use super::index::Index;
use crate::ids::{BodySlot, PairKey, PairSlot};

mod ahead;
mod validate;

/// No pair.
const NONE: u32 = u32::MAX;
/// In place of the pair before, in the first of the two lists: no pair stands here. No slot is that high.
const DEAD: u32 = NONE - 1;
/// Least places that the set grows by, ...
const LEAST: usize = 16;
/// ... and one for so many: what the pairs of a scene come and go by. Their memory is most of that of a dense scene.
const GROWTH: usize = 8;

/// One place of the set: a pair, its neighbours in the lists of its two bodies (0: lower slot, 1: higher slot).
#[derive(Clone, Copy, Debug)]
struct Node {
    key: PairKey,
    next: [u32; 2],
    prev: [u32; 2],
}

impl Node {
    /// A pair in no list yet.
    fn new(key: PairKey) -> Self {
        Self {
            key,
            next: [NONE; 2],
            prev: [NONE; 2],
        }
    }

    /// Whether a pair stands here.
    fn is_live(&self) -> bool {
        self.prev[0] != DEAD
    }

    /// The key's two bodies.
    fn bodies(&self) -> [BodySlot; 2] {
        let (low, high) = self.key.slots();
        [low, high]
    }

    /// Which of the two lists is that of `body`.
    fn side(&self, body: BodySlot) -> usize {
        usize::from(self.key.slots().0 != body)
    }
}

/// The first pair of a body and how many it has.
#[derive(Clone, Copy, Debug)]
struct Head {
    first: u32,
    len: u32,
}

/// The pairs of overlapping boxes that the filters allow.
///
/// A slot freed in one tick is not given to another pair before the next tick, so memories keyed by slot are never
/// mixed up as long as they are dropped for each `PairDelta::ended`.
#[derive(Clone, Debug)]
pub struct PairSet {
    nodes: Vec<Node>,
    heads: Vec<Head>,
    index: Index,
    free: Vec<u32>,
    /// Freed since the last `open_tick`: not to be reused yet.
    resting: Vec<u32>,
    len: usize,
    limit: usize,
    missing: u64,
    truncated: Vec<BodySlot>,
    is_truncated: Vec<bool>,
}

impl PairSet {
    /// An empty set.
    ///
    /// * `limit` - most pairs it holds (`config::Limits::pairs`). Beyond it pairs are counted in [`PairSet::missing`]
    ///   and their bodies stand in [`PairSet::truncated`] until the pairs fit or part.
    #[must_use]
    pub fn new(limit: usize) -> Self {
        Self {
            nodes: Vec::new(),
            heads: Vec::new(),
            index: Index::default(),
            free: Vec::new(),
            resting: Vec::new(),
            len: 0,
            limit: limit.min(NONE as usize / 2),
            missing: 0,
            truncated: Vec::new(),
            is_truncated: Vec::new(),
        }
    }

    /// Pairs in the set.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no pair.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// One more than the highest slot index ever in use: the length for arrays that run parallel to the set.
    #[must_use]
    pub fn slots_len(&self) -> usize {
        self.nodes.len()
    }

    /// Most pairs it holds.
    #[must_use]
    pub fn limit(&self) -> usize {
        self.limit
    }

    /// Pairs that overlap and are allowed, but did not fit at the last update.
    #[must_use]
    pub fn missing(&self) -> u64 {
        self.missing
    }

    /// Bodies with a missing pair, in no order that means anything; their verdict is unknown.
    #[must_use]
    pub fn truncated(&self) -> &[BodySlot] {
        &self.truncated
    }

    /// Whether a pair of this body is missing.
    #[must_use]
    pub fn is_truncated(&self, body: BodySlot) -> bool {
        self.is_truncated
            .get(body.index())
            .copied()
            .unwrap_or(false)
    }

    /// The bodies of a pair; `None` where no pair is.
    #[must_use]
    pub fn get(&self, slot: PairSlot) -> Option<PairKey> {
        let node = self.nodes.get(slot.index())?;
        node.is_live().then_some(node.key)
    }

    /// Where the pair of two bodies is. Cost: one probe or two.
    #[must_use]
    pub fn find(&self, key: PairKey) -> Option<PairSlot> {
        let is_it = |at: u32| self.nodes[at as usize].key == key;
        self.index.find(key.bits(), is_it).map(PairSlot)
    }

    /// How many pairs a body has.
    #[must_use]
    pub fn pairs_len(&self, body: BodySlot) -> usize {
        self.heads.get(body.index()).map_or(0, |h| h.len as usize)
    }

    /// The pairs of a body, the youngest first.
    pub fn pairs_of(&self, body: BodySlot) -> impl Iterator<Item = PairSlot> + '_ {
        let mut at = self.heads.get(body.index()).map_or(NONE, |h| h.first);
        std::iter::from_fn(move || {
            let node = self.nodes.get(at as usize)?;
            let here = PairSlot(at);
            at = node.next[node.side(body)];
            Some(here)
        })
    }

    /// The bodies that a body is paired with, with the pair's slot.
    pub fn partners(&self, body: BodySlot) -> impl Iterator<Item = (PairSlot, BodySlot)> + '_ {
        self.pairs_of(body).map(move |slot| {
            let node = &self.nodes[slot.index()];
            (slot, node.bodies()[1 - node.side(body)])
        })
    }

    /// All pairs, in the order of slots.
    pub fn iter(&self) -> impl Iterator<Item = (PairSlot, PairKey)> + '_ {
        (0_u32..)
            .zip(&self.nodes)
            .filter_map(|(at, node)| node.is_live().then_some((PairSlot(at), node.key)))
    }

    /// Begins a tick: slots freed in the one before may be used again, the lowest first.
    pub(crate) fn open_tick(&mut self) {
        self.resting.sort_unstable_by(|a, b| b.cmp(a));
        self.free.append(&mut self.resting);
    }

    /// Makes room for so many pairs more, as far as they may be stored. Pairs that begin together are told together, so
    /// that memory grows once by what they need and not by doubling.
    pub(crate) fn reserve(&mut self, more: usize) {
        let more = more.min(self.limit - self.len);
        let len = self.nodes.len() + more.saturating_sub(self.free.len());
        if len > self.nodes.capacity() {
            let len = len + (len / GROWTH).max(LEAST);
            self.nodes.reserve_exact(len - self.nodes.len());
        }
    }

    /// Adds a pair that is not in the set; `None` when the set is full.
    pub(crate) fn insert(&mut self, key: PairKey) -> Option<PairSlot> {
        if self.len >= self.limit {
            return None;
        }
        let mut node = Node::new(key);
        let at = if let Some(at) = self.free.pop() {
            at
        } else {
            self.reserve(1);
            self.nodes.push(node);
            small(self.nodes.len() - 1)
        };
        for (side, body) in node.bodies().into_iter().enumerate() {
            let empty = Head {
                first: NONE,
                len: 0,
            };
            if self.heads.len() <= body.index() {
                self.heads.resize(body.index() + 1, empty);
            }
            let head = &mut self.heads[body.index()];
            node.next[side] = head.first;
            let second = head.first;
            *head = Head {
                first: at,
                len: head.len + 1,
            };
            if let Some(second) = self.nodes.get_mut(second as usize) {
                let its_side = second.side(body);
                second.prev[its_side] = at;
            }
        }
        self.nodes[at as usize] = node;
        self.index.insert(key.bits(), at, self.nodes.capacity());
        self.len += 1;
        Some(PairSlot(at))
    }

    /// Takes a pair out; its slot rests until the next tick. `None` where no pair is.
    pub(crate) fn remove(&mut self, slot: PairSlot) -> Option<PairKey> {
        let node = *self.nodes.get(slot.index()).filter(|n| n.is_live())?;
        for (side, body) in node.bodies().into_iter().enumerate() {
            let (prev, next) = (node.prev[side], node.next[side]);
            let head = &mut self.heads[body.index()];
            head.len -= 1;
            if prev == NONE {
                head.first = next;
            } else {
                let before = &mut self.nodes[prev as usize];
                let its_side = before.side(body);
                before.next[its_side] = next;
            }
            if let Some(after) = self.nodes.get_mut(next as usize) {
                let its_side = after.side(body);
                after.prev[its_side] = prev;
            }
        }
        self.index.remove(node.key.bits(), slot.0);
        self.nodes[slot.index()].prev[0] = DEAD;
        self.resting.push(slot.0);
        self.len -= 1;
        Some(node.key)
    }

    /// The youngest pair of a body.
    pub(crate) fn first_of(&self, body: BodySlot) -> Option<PairSlot> {
        let first = self.heads.get(body.index())?.first;
        (first != NONE).then_some(PairSlot(first))
    }

    /// Empties the set, keeps the memory; every slot may be used again at once.
    pub(crate) fn clear(&mut self) {
        self.nodes.clear();
        self.heads.clear();
        self.index.clear();
        self.free.clear();
        self.resting.clear();
        self.len = 0;
        self.forget_missing();
    }

    /// Nothing is missing.
    pub(crate) fn forget_missing(&mut self) {
        self.missing = 0;
        for body in self.truncated.drain(..) {
            self.is_truncated[body.index()] = false;
        }
    }

    /// A pair of two bodies did not fit.
    pub(crate) fn miss(&mut self, key: PairKey) {
        self.missing += 1;
        let (low, high) = key.slots();
        self.mark_truncated(low);
        self.mark_truncated(high);
    }

    /// A body's pairs are not all there.
    pub(crate) fn mark_truncated(&mut self, body: BodySlot) {
        if self.is_truncated.len() <= body.index() {
            self.is_truncated.resize(body.index() + 1, false);
        }
        if !self.is_truncated[body.index()] {
            self.is_truncated[body.index()] = true;
            self.truncated.push(body);
        }
    }
}

/// An index as the 32 bits it is stored in; lengths here stay far below (see `limits`).
fn small(index: usize) -> u32 {
    debug_assert!(index < NONE as usize);
    u32::try_from(index).unwrap_or(NONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(a: u32, b: u32) -> PairKey {
        PairKey::new(BodySlot(a), BodySlot(b))
    }

    #[test]
    fn a_slot_freed_in_a_tick_is_not_reused_before_the_next() {
        let mut set = PairSet::new(10);
        let first = set.insert(key(1, 2)).unwrap();
        assert_eq!(set.remove(first), Some(key(1, 2)));
        let second = set.insert(key(1, 2)).unwrap();
        assert_ne!(first, second);
        set.open_tick();
        assert_eq!(set.insert(key(3, 2)), Some(first));
        assert_eq!(set.get(first), Some(key(2, 3)));
        set.validate().unwrap();
    }

    #[test]
    fn the_pairs_of_a_body_are_found_whatever_was_removed_between() {
        let mut set = PairSet::new(100);
        let slots: Vec<_> = (1..9).map(|b| set.insert(key(0, b)).unwrap()).collect();
        set.insert(key(5, 6)).unwrap();
        for at in [0, 3, 7, 4] {
            set.remove(slots[at]);
            set.validate().unwrap();
        }
        let left: Vec<u32> = set.partners(BodySlot(0)).map(|(_, b)| b.0).collect();
        assert_eq!(left, [7, 6, 3, 2]);
        assert!(set.find(key(6, 5)).is_some() && set.find(key(0, 5)).is_none());
        assert_eq!(set.remove(slots[0]), None);
        assert_eq!(set.get(PairSlot(99)), None);
    }

    #[test]
    fn a_full_set_takes_no_pair_and_marks_both_bodies() {
        let mut set = PairSet::new(1);
        assert!(set.insert(key(0, 1)).is_some());
        assert!(set.insert(key(0, 2)).is_none());
        set.miss(key(0, 2));
        assert!(set.is_truncated(BodySlot(0)) && set.is_truncated(BodySlot(2)));
        assert!(!set.is_truncated(BodySlot(1)) && !set.is_truncated(BodySlot(77)));
        assert_eq!((set.missing(), set.truncated().len()), (1, 2));
        set.forget_missing();
        assert_eq!((set.missing(), set.truncated().len()), (0, 0));
        set.validate().unwrap();
    }
}
