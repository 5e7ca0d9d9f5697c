//! From suggested pairs to the pair set: one place decides, for every method, which pairs end, begin or do not fit.
//!
//! In: keys that a method found (in any order; duplicates, stored pairs and forbidden pairs are allowed), of boxes that
//! overlap or only may, and pairs whose end has a cause. Out: the changed pair set and the filled delta, both in the
//! order of body ids. So pair slots depend neither on the method nor on body slots.

use super::Proxies;
use super::forced::Forced;
use super::keys::IdSort;
use super::members::{IN, Members, UNBOUNDED};
use super::order::give_back;
use crate::ids::{BodyId, BodySlot, PairKey, PairSlot};
use crate::pairs::{Ended, PairDelta, PairPolicy, PairSet};
use crate::simd::boxes::prefetch;
use crate::wire::EndCause;

/// How many pairs ahead memory is prefetched.
const AHEAD: usize = 8;

/// What an update has found so far; the memory is kept across updates.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    /// Pairs of boxes that overlap, and some that do not depend on boxes.
    pub(super) began: Vec<PairKey>,
    /// Pairs of boxes that may overlap.
    pub(super) maybe: Vec<PairKey>,
    /// Pairs taken out of the set, with the order of the delta.
    ended: Vec<((BodyId, BodyId), Ended)>,
    /// Pairs taken out of the set because their boxes parted, in the order of the delta.
    parted: Vec<Ended>,
    /// Scratch memory for passes over all stored pairs.
    pub(super) slots: Vec<PairSlot>,
    /// Stored pairs that end, with their cause.
    pub(super) doomed: Vec<(PairSlot, EndCause)>,
    /// Bodies that were truncated before this update.
    truncated: Vec<BodySlot>,
    sort: IdSort,
}

/// Everything needed to decide on a pair.
#[derive(Debug)]
pub(super) struct Judge<'a, X, P> {
    /// Bodies that are in, and their kinds.
    pub(super) members: &'a Members,
    /// Boxes.
    pub(super) proxies: &'a X,
    /// Pairs that need no overlap.
    pub(super) forced: &'a Forced,
    /// Filters.
    pub(super) policy: &'a P,
}

impl<'a, X: Proxies, P: PairPolicy> Judge<'a, X, P> {
    pub(super) fn of(
        members: &'a Members,
        forced: &'a Forced,
        proxies: &'a X,
        policy: &'a P,
    ) -> Self {
        Self {
            members,
            proxies,
            forced,
            policy,
        }
    }

    /// Returns whether a rule, or a body without a box, keeps the pair a candidate whatever the boxes say.
    fn is_unconditional(&self, key: PairKey) -> bool {
        let (low, high) = key.slots();
        let one = self.members.has(low, UNBOUNDED);
        let other = self.members.has(high, UNBOUNDED);
        one || other || self.forced.has(key)
    }

    /// Returns whether two bodies are worth a suggestion. Most that have no boxes are half-spaces and nothing else, and
    /// make no pairs: of many, these would fill the lists.
    pub(super) fn may_be(&self, key: PairKey) -> bool {
        let (low, high) = key.slots();
        let without = self.members.has(low, UNBOUNDED) && self.members.has(high, UNBOUNDED);
        !without || self.policy.allows(low, high)
    }

    /// Returns whether both bodies are in.
    fn is_inside(&self, key: PairKey) -> bool {
        let (low, high) = key.slots();
        self.members.has(low, IN) && self.members.has(high, IN)
    }

    /// Returns whether both bodies have boxes and these overlap.
    fn overlaps(&self, key: PairKey) -> bool {
        let (low, high) = key.slots();
        self.members.is_bounded(low)
            && self.members.is_bounded(high)
            && self.proxies.aabb(low).overlaps(self.proxies.aabb(high))
    }

    /// Prefetches the boxes of a pair.
    #[inline]
    fn prefetch(&self, key: PairKey) {
        let (low, high) = key.slots();
        for slot in [low, high] {
            if self.members.is_bounded(slot) {
                prefetch(self.proxies.aabb(slot));
            }
        }
    }

    /// Returns whether a pair that is not stored must be, given that it is one of [`Found::began`].
    fn begins(&self, key: PairKey) -> bool {
        let (low, high) = key.slots();
        let inside = self.is_inside(key);
        debug_assert!(
            !inside || self.is_unconditional(key) || self.overlaps(key),
            "{key:?} was told to overlap"
        );
        inside
            && (self.is_unconditional(key) || (!self.policy.bars(low) && !self.policy.bars(high)))
            && self.policy.allows(low, high)
    }

    /// Returns whether a stored pair whose boxes have parted ends.
    fn lets_go(&self, key: PairKey) -> bool {
        debug_assert!(!self.overlaps(key), "{key:?} was told to have parted");
        let (low, high) = key.slots();
        !self.is_unconditional(key) && !self.policy.keeps(low) && !self.policy.keeps(high)
    }

    /// Why a stored pair ends; `None` when it stays. Filters are checked only if `refiltered`.
    pub(super) fn ends(&self, key: PairKey, refiltered: bool) -> Option<EndCause> {
        let (low, high) = key.slots();
        if refiltered && !self.policy.allows(low, high) {
            return Some(EndCause::Filtered);
        }
        let stays = self.overlaps(key)
            || self.is_unconditional(key)
            || self.policy.keeps(low)
            || self.policy.keeps(high);
        (!stays).then_some(EndCause::Separated)
    }
}

impl Found {
    /// Number of pairs reported as beginning, or that may begin.
    pub(super) fn told(&self) -> u64 {
        (self.began.len() + self.maybe.len()) as u64
    }

    /// Number of pairs that this update found.
    pub(super) fn used(&self) -> usize {
        self.began.len() + self.maybe.len() + self.ended.len() + self.parted.len()
    }

    /// Capacity for found pairs.
    pub(super) fn room(&self) -> usize {
        let lists = [self.began.capacity(), self.maybe.capacity()];
        let ended = [self.ended.capacity(), self.parted.capacity()];
        lists.into_iter().chain(ended).sum::<usize>() + self.sort.capacity()
    }

    /// Ends an update: gives back memory that it needed beyond what most updates do.
    pub(super) fn close_tick(&mut self, bodies: usize) {
        give_back(&mut self.began, bodies);
        give_back(&mut self.maybe, bodies);
        give_back(&mut self.ended, bodies);
        give_back(&mut self.parted, bodies);
        give_back(&mut self.slots, bodies);
        give_back(&mut self.doomed, bodies);
        self.sort.close_tick(bodies);
    }

    /// Removes a stored pair.
    pub(super) fn end(
        &mut self,
        slot: PairSlot,
        cause: EndCause,
        members: &Members,
        pairs: &mut PairSet,
    ) {
        if let Some(key) = pairs.remove(slot) {
            let ended = Ended { slot, key, cause };
            self.ended.push((members.rank(key), ended));
        }
    }

    /// Removes the stored pairs of boxes that parted, unless something else keeps them.
    pub(super) fn part(
        &mut self,
        parted: &mut [PairKey],
        judge: &Judge<'_, impl Proxies, impl PairPolicy>,
        pairs: &mut PairSet,
    ) {
        // In the order of the delta, and of memory.
        self.sort.sort(parted, judge.members);
        pairs.part(parted, |key| judge.lets_go(key), &mut self.parted);
    }

    /// Stores what begins and fills the delta.
    ///
    /// * `waits` - pairs are missing that are not counted in this tick. Until they are, a pair of two bodies that both
    ///   miss some may be one of them.
    pub(super) fn commit(
        &mut self,
        judge: &Judge<'_, impl Proxies, impl PairPolicy>,
        waits: bool,
        pairs: &mut PairSet,
        delta: &mut PairDelta,
    ) {
        self.tell_ended(judge.members, &mut delta.ended);
        if waits {
            let is_open = |key: &PairKey| {
                let (low, high) = key.slots();
                !(pairs.is_truncated(low) && pairs.is_truncated(high))
            };
            self.began.retain(is_open);
            self.maybe.retain(is_open);
        }
        self.gather(judge, pairs.limit());
        self.truncated.clear();
        self.truncated.extend_from_slice(pairs.truncated());
        self.truncated.retain(|slot| judge.members.has(*slot, IN));
        let missing = pairs.missing();
        pairs.forget_missing();
        if waits {
            pairs.go_on_missing(missing, &self.truncated);
        }
        pairs.insert_all(&self.began, |key| judge.begins(key), &mut delta.began);
        // The missing pairs of a body of unknown place cannot be found again by boxes: its partners are not known any
        // more. So all bodies that missed a pair stay marked, and the old number of missing pairs is kept.
        if self.truncated.iter().any(|slot| judge.policy.keeps(*slot)) {
            pairs.go_on_missing(missing, &self.truncated);
        }
    }

    /// Reports all removed pairs. `parted` is in order; the others are few.
    fn tell_ended(&mut self, members: &Members, told: &mut Vec<Ended>) {
        self.ended.sort_unstable_by_key(|(rank, _)| *rank);
        let mut parted = &self.parted[..];
        for (rank, ended) in &self.ended {
            let before = parted.partition_point(|parted| members.rank(parted.key) < *rank);
            let (first, rest) = parted.split_at(before);
            told.extend_from_slice(first);
            told.push(*ended);
            parted = rest;
        }
        told.extend_from_slice(parted);
    }

    /// Collects the pairs that may have to be stored, in the order of ids, without duplicates.
    fn gather(&mut self, judge: &Judge<'_, impl Proxies, impl PairPolicy>, limit: usize) {
        for (at, key) in self.maybe.iter().enumerate() {
            if let Some(ahead) = self.maybe.get(at + AHEAD) {
                judge.prefetch(*ahead);
            }
            let meet = judge.overlaps(*key) || judge.is_unconditional(*key);
            if judge.is_inside(*key) && meet {
                self.began.push(*key);
            }
        }
        // If there are more than the set can hold, pairs that filters forbid are dropped before the sort.
        if self.began.len() > limit {
            self.began.retain(|key| judge.begins(*key));
        }
        self.sort.sort(&mut self.began, judge.members);
        self.began.dedup();
    }
}
