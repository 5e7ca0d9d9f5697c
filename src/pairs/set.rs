//! The set itself: dense slots, with lookup of pairs by key or by body.

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

/// Not a slot.
const NONE: u32 = u32::MAX;
/// Least number of places that the set grows by beyond what it needs.
const LEAST: usize = 16;
/// The set grows by one extra place per `GROWTH` that it needs, to absorb the normal fluctuation of pairs. More extra
/// places take more memory, and pairs are most of the memory of a dense scene.
const GROWTH: usize = 8;

/// The pairs of overlapping boxes that the filters allow.
///
/// A slot freed in one tick is not given to another pair before the next tick, so data keyed by slot are never mixed up
/// if they are dropped for each `PairDelta::ended`.
#[derive(Clone, Debug)]
pub struct PairSet {
    /// By slot; [`PairKey::NOBODY`] where there is no pair.
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
    /// * `limit` - most pairs it holds (`config::Limits::pairs`). Further pairs are counted in [`PairSet::missing`] and
    ///   their bodies are in [`PairSet::truncated`] until the pairs fit or part.
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

    /// Returns whether there is no pair.
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

    /// Pairs that overlap and are allowed but did not fit at the last count, plus those that came since. Recounted in
    /// each update while they are few.
    #[must_use]
    pub fn missing(&self) -> u64 {
        self.missing
    }

    /// Bodies that miss a pair, or did at the last count, in arbitrary order; their verdict is unknown.
    #[must_use]
    pub fn truncated(&self) -> &[BodySlot] {
        &self.truncated
    }

    /// Returns whether a pair of this body is missing.
    #[must_use]
    pub fn is_truncated(&self, body: BodySlot) -> bool {
        self.is_truncated
            .get(body.index())
            .copied()
            .unwrap_or(false)
    }

    /// The bodies of a pair; `None` if there is no pair in the slot.
    #[must_use]
    pub fn get(&self, slot: PairSlot) -> Option<PairKey> {
        let key = self.keys.get(slot.index()).copied();
        key.filter(|key| *key != PairKey::NOBODY)
    }

    /// The slot of a pair of bodies. Cost: one or two probes.
    #[must_use]
    pub fn find(&self, key: PairKey) -> Option<PairSlot> {
        let is_it = |at: u32| self.keys[at as usize] == key;
        self.index.find(key.bits(), is_it).map(PairSlot)
    }

    /// The pairs of a body, in arbitrary order.
    ///
    /// Cost: those pairs if the engine itself read such lists recently, otherwise a scan of every pair.
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

    /// The partners of a body, with the pair's slot. Cost: as [`PairSet::pairs_of`].
    pub fn partners(&self, body: BodySlot) -> impl Iterator<Item = (PairSlot, BodySlot)> + '_ {
        self.pairs_of(body).map(move |slot| {
            let (low, high) = self.keys[slot.index()].slots();
            (slot, if low == body { high } else { low })
        })
    }

    /// Announces lookups of the pairs of `bodies` single bodies: builds the lists if that pays.
    pub(crate) fn list(&mut self, bodies: usize) {
        let Self { lists, keys, .. } = self;
        lists.ask(bodies, keys, live(keys));
    }

    /// All pairs, in the order of slots.
    pub fn iter(&self) -> impl Iterator<Item = (PairSlot, PairKey)> + '_ {
        live(&self.keys)
    }

    /// Begins a tick: slots freed in the last one may be used again, the lowest first.
    pub(crate) fn open_tick(&mut self) {
        for slot in self.resting.drain(..) {
            self.free.put(slot);
        }
        self.cut();
    }

    /// Reserves room for `more` pairs, as far as they may be stored. Pairs that begin together are passed together, so
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

    /// Adds pairs, in this order, except those that are in the set; those that do not fit are counted as missing.
    ///
    /// * `begins` - whether a pair must be added.
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

    /// Position in the index for a pair that is not in the set.
    #[inline]
    fn vacancy(&self, key: PairKey) -> Option<usize> {
        let is_it = |at: u32| self.keys[at as usize] == key;
        self.index.vacancy(key.bits(), is_it)
    }

    /// Adds a pair whose position in the index is known.
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

    /// Removes a pair; its slot rests until the next tick. `None` if there is no pair.
    pub(crate) fn remove(&mut self, slot: PairSlot) -> Option<PairKey> {
        let key = self.get(slot)?;
        self.lists.unlink(slot, key);
        self.index.remove(key.bits(), slot.0);
        self.bury(slot);
        Some(key)
    }

    /// Removes those of the given pairs that are in the set, because their boxes have parted.
    ///
    /// * `goes` - whether a pair is really removed.
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
        // Each step for all pairs before the next step: memory for the next steps is prefetched meanwhile.
        if self.lists.is_kept() {
            let ended = &ended[first..];
            for (at, Ended { slot, key, .. }) in ended.iter().enumerate() {
                self.prefetch_unlink(ended, at);
                self.lists.unlink(*slot, *key);
            }
        }
    }

    /// Frees a slot from the next tick on.
    fn bury(&mut self, slot: PairSlot) {
        self.keys[slot.index()] = PairKey::NOBODY;
        self.resting.push(slot.0);
        self.len -= 1;
    }

    /// Clears the set, keeps the memory; every slot may be reused at once.
    pub(crate) fn clear(&mut self) {
        self.keys.clear();
        self.lists.clear();
        self.index.clear();
        self.free.clear();
        self.resting.clear();
        self.len = 0;
        self.forget_missing();
    }

    /// Resets the missing pairs.
    pub(crate) fn forget_missing(&mut self) {
        self.missing = 0;
        for body in self.truncated.drain(..) {
            self.is_truncated[body.index()] = false;
        }
    }

    /// Counts a pair that did not fit.
    pub(crate) fn miss(&mut self, key: PairKey) {
        self.missing += 1;
        let (low, high) = key.slots();
        self.mark_truncated(low);
        self.mark_truncated(high);
    }

    /// Keeps at least this number of missing pairs, and these bodies as truncated, from before.
    pub(crate) fn go_on_missing(&mut self, pairs: u64, bodies: &[BodySlot]) {
        self.missing = self.missing.max(pairs);
        for body in bodies {
            self.mark_truncated(*body);
        }
    }

    /// Marks a body whose pairs are incomplete.
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

/// The pairs in an array of keys by slot.
fn live(keys: &[PairKey]) -> impl Iterator<Item = (PairSlot, PairKey)> + Clone + '_ {
    let slots = (0_u32..).map(PairSlot);
    slots
        .zip(keys.iter().copied())
        .filter(|(_, key)| *key != PairKey::NOBODY)
}

#[cfg(test)]
mod tests;
