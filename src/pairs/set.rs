//! The set itself: dense slots, and what finds a pair by its key or by one of its bodies.

use super::index::Index;
use super::{Ended, PairKey, Spare};
use crate::ids::{BodySlot, PairSlot, small};
use crate::wire::EndCause;

mod ahead;
mod free;
mod idle;
mod lists;
mod validate;

use free::Free;
use lists::Lists;

/// No slot is that high.
const NONE: u32 = u32::MAX;
/// Least places that the set grows by beyond what it needs.
const LEAST: usize = 16;
/// The set grows by one place in so many beyond what it needs: what the pairs of a scene come and go by. With more of
/// these places it takes more memory, and that of pairs is most of what a dense scene takes.
const GROWTH: usize = 8;

/// The pairs of overlapping boxes that the filters allow.
///
/// A slot freed in one tick is not given to another pair before the next tick, so memories keyed by slot are never
/// mixed up as long as they are dropped for each `PairDelta::ended`.
#[derive(Clone, Debug)]
pub struct PairSet {
    /// By slot; where no pair stands, [`PairKey::NOBODY`].
    keys: Vec<PairKey>,
    lists: Lists,
    index: Index,
    free: Free,
    /// Freed since the last `open_tick`: not to be reused yet.
    resting: Vec<u32>,
    len: usize,
    limit: usize,
    missing: u64,
    truncated: Vec<BodySlot>,
    is_truncated: Vec<bool>,
    spare: Spare,
}

impl PairSet {
    /// An empty set.
    ///
    /// * `limit` - most pairs it holds (`config::Limits::pairs`). Beyond it pairs are counted in [`PairSet::missing`]
    ///   and their bodies stand in [`PairSet::truncated`] until the pairs fit or part.
    #[must_use]
    pub fn new(limit: usize) -> Self {
        Self {
            keys: Vec::new(),
            lists: Lists::default(),
            index: Index::default(),
            free: Free::default(),
            resting: Vec::new(),
            len: 0,
            limit: limit.min(NONE as usize / 2),
            missing: 0,
            truncated: Vec::new(),
            is_truncated: Vec::new(),
            spare: Spare::default(),
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

    /// One more than the highest slot index in use: the length for arrays that run parallel to the set.
    #[must_use]
    pub fn slots_len(&self) -> usize {
        self.keys.len()
    }

    /// Most pairs it holds.
    #[must_use]
    pub fn limit(&self) -> usize {
        self.limit
    }

    /// Pairs that overlap and are allowed, but did not fit when they were last counted, and those that came since. They
    /// are counted in each update where they are few.
    #[must_use]
    pub fn missing(&self) -> u64 {
        self.missing
    }

    /// Bodies with a missing pair, or that had one when these were last counted, in no order that means anything; their
    /// verdict is unknown.
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
        let key = self.keys.get(slot.index()).copied();
        key.filter(|key| *key != PairKey::NOBODY)
    }

    /// Where the pair of two bodies is. Cost: one probe or two.
    #[must_use]
    pub fn find(&self, key: PairKey) -> Option<PairSlot> {
        let is_it = |at: u32| self.keys[at as usize] == key;
        self.index.find(key.bits(), is_it).map(PairSlot)
    }

    /// The pairs of a body, in no order that means anything.
    ///
    /// Cost: those pairs where the engine read such lists itself of late, else a look at every pair.
    pub fn pairs_of(&self, body: BodySlot) -> impl Iterator<Item = PairSlot> + '_ {
        let listed = self.lists.is_kept().then(|| self.lists.of(body));
        let looked = (!self.lists.is_kept()).then(|| {
            self.iter().filter_map(move |(slot, key)| {
                let (low, high) = key.slots();
                (low == body || high == body).then_some(slot)
            })
        });
        listed
            .into_iter()
            .flatten()
            .chain(looked.into_iter().flatten())
    }

    /// The bodies that a body is paired with, with the pair's slot. Cost: as [`PairSet::pairs_of`].
    pub fn partners(&self, body: BodySlot) -> impl Iterator<Item = (PairSlot, BodySlot)> + '_ {
        self.pairs_of(body).map(move |slot| {
            let (low, high) = self.keys[slot.index()].slots();
            (slot, if low == body { high } else { low })
        })
    }

    /// The pairs of so many single bodies are about to be asked for: where that pays, it will cost those pairs alone.
    pub(crate) fn list(&mut self, bodies: usize) {
        let Self { lists, keys, .. } = self;
        lists.ask(bodies, keys, live(keys));
    }

    /// All pairs, in the order of slots.
    pub fn iter(&self) -> impl Iterator<Item = (PairSlot, PairKey)> + '_ {
        live(&self.keys)
    }

    /// Begins a tick: slots freed in the one before may be used again, the lowest first.
    pub(crate) fn open_tick(&mut self) {
        for slot in self.resting.drain(..) {
            self.free.put(slot);
        }
        self.cut();
    }

    /// Makes room for so many pairs more, as far as they may be stored. Pairs that begin together are told together, so
    /// that memory grows once by what they need and not by doubling.
    fn reserve(&mut self, more: usize) {
        let more = more.min(self.limit - self.len);
        let len = self.keys.len() + more.saturating_sub(self.free.len());
        if len > self.keys.capacity() {
            let len = len + (len / GROWTH).max(LEAST);
            self.keys.reserve_exact(len - self.keys.len());
            self.free.cover(self.keys.capacity());
            self.lists.cover(self.keys.capacity());
        }
    }

    /// Adds a pair; `None` when it is in the set already, or the set is full.
    pub(crate) fn insert(&mut self, key: PairKey) -> Option<PairSlot> {
        self.reserve(1);
        self.index.grow(self.keys.capacity());
        let at = self.vacancy(key)?;
        self.insert_at(at, key)
    }

    /// Adds pairs, in this order, but for those that are in the set, as far as there is room for them; the others are
    /// missed.
    ///
    /// * `begins` - whether one must be added.
    pub(crate) fn insert_all(
        &mut self,
        keys: &[PairKey],
        begins: impl Fn(PairKey) -> bool,
        began: &mut Vec<PairSlot>,
    ) {
        let unused = self.keys.capacity() - self.keys.len();
        if self.len < self.limit && keys.len() > self.free.len() + unused {
            let new = keys.iter().filter(|key| self.find(**key).is_none());
            let new = new.filter(|key| begins(**key));
            self.reserve(new.take(self.limit - self.len).count());
        }
        for (at, key) in keys.iter().enumerate() {
            self.prefetch_insert(keys, at);
            self.reserve(1);
            self.index.grow(self.keys.capacity());
            if let Some(at) = self.vacancy(*key)
                && begins(*key)
            {
                match self.insert_at(at, *key) {
                    Some(slot) => began.push(slot),
                    None => self.miss(*key),
                }
            }
        }
        self.lists.weigh(0, self.len);
    }

    /// Where in the index a pair that is not in the set is to be noted.
    #[inline]
    fn vacancy(&self, key: PairKey) -> Option<usize> {
        let is_it = |at: u32| self.keys[at as usize] == key;
        self.index.vacancy(key.bits(), is_it)
    }

    /// Adds a pair whose place in the index is known.
    #[inline]
    fn insert_at(&mut self, place: usize, key: PairKey) -> Option<PairSlot> {
        if self.len >= self.limit {
            return None;
        }
        let at = if let Some(at) = self.free.take() {
            self.keys[at as usize] = key;
            at
        } else {
            self.keys.push(key);
            small(self.keys.len() - 1)
        };
        self.lists.link(PairSlot(at), key);
        self.index.fill(place, key.bits(), at);
        self.len += 1;
        Some(PairSlot(at))
    }

    /// Takes a pair out; its slot rests until the next tick. `None` where no pair is.
    pub(crate) fn remove(&mut self, slot: PairSlot) -> Option<PairKey> {
        let key = self.get(slot)?;
        self.lists.unlink(slot, key);
        self.index.remove(key.bits(), slot.0);
        self.bury(slot);
        Some(key)
    }

    /// Takes pairs out that may be in the set, because their boxes have parted.
    ///
    /// * `goes` - whether one does go.
    pub(crate) fn part(
        &mut self,
        keys: &[PairKey],
        goes: impl Fn(PairKey) -> bool,
        ended: &mut Vec<Ended>,
    ) {
        self.lists.weigh(keys.len(), self.len);
        let (first, cause) = (ended.len(), EndCause::Separated);
        for (at, key) in keys.iter().enumerate() {
            self.prefetch_find(keys, at);
            let slots = &self.keys;
            let is_it = |at: u32| slots[at as usize] == *key && goes(*key);
            if let Some(slot) = self.index.take(key.bits(), is_it).map(PairSlot) {
                let key = *key;
                ended.push(Ended { slot, key, cause });
                self.bury(slot);
            }
        }
        // Each step for all pairs before the next one: memory for the steps to come is asked for meanwhile.
        if self.lists.is_kept() {
            let ended = &ended[first..];
            for (at, Ended { slot, key, .. }) in ended.iter().enumerate() {
                self.prefetch_unlink(ended, at);
                self.lists.unlink(*slot, *key);
            }
        }
    }

    /// Lets a slot rest.
    fn bury(&mut self, slot: PairSlot) {
        self.keys[slot.index()] = PairKey::NOBODY;
        self.resting.push(slot.0);
        self.len -= 1;
    }

    /// Empties the set, keeps the memory; every slot may be used again at once.
    pub(crate) fn clear(&mut self) {
        self.keys.clear();
        self.lists.clear();
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

    /// What was missing before may be missing still: so many pairs, of these bodies.
    pub(crate) fn go_on_missing(&mut self, pairs: u64, bodies: &[BodySlot]) {
        self.missing = self.missing.max(pairs);
        for body in bodies {
            self.mark_truncated(*body);
        }
    }

    /// A body's pairs are not all there.
    fn mark_truncated(&mut self, body: BodySlot) {
        if self.is_truncated.len() <= body.index() {
            self.is_truncated.resize(body.index() + 1, false);
        }
        if !self.is_truncated[body.index()] {
            self.is_truncated[body.index()] = true;
            self.truncated.push(body);
        }
    }
}

/// The pairs among the keys by slot.
fn live(keys: &[PairKey]) -> impl Iterator<Item = (PairSlot, PairKey)> + Clone + '_ {
    let slots = (0_u32..).map(PairSlot);
    slots
        .zip(keys.iter().copied())
        .filter(|(_, key)| *key != PairKey::NOBODY)
}

#[cfg(test)]
mod tests;
