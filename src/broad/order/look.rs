//! Compares the boxes of candidates and reports the pairs that began and parted.
//!
//! When many bodies move, candidates are scanned as a flat list, in memory order, without unpredictable branches. As
//! bodies are renewed, new entries are appended to the list, and ages mark the old ones dead. Pairs that are certain as
//! long as both bodies stay in their holds are not listed. When few move the list is dropped (`moved`).

use super::entry::{Entry, ages};
use super::fatten::outward;
use super::links::Matrix;
use super::{BodySlot, NONE, Order, Proxies, Tick, Work, is_thrifty, ones, parts, small};
use crate::ids::PairKey;
use crate::simd::boxes::{Boxes16, Down, Hold, Kernel, LANES, Lanes, WIDTH, prefetch, slack};

/// Result of comparing an entry; `at` is the entry's index.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    at: u32,
    /// Whether the boxes overlap now; `None` where rounding leaves it open.
    now: Option<bool>,
}

/// Entries ahead whose boxes are prefetched.
const AHEAD: usize = 24;

impl Order {
    /// Compares every candidate, using the flat list.
    pub(super) fn look_at_all<P: Proxies>(&mut self, tick: &mut Tick<'_, P>, done: &mut Work) {
        if !self.listed {
            let level = self.level;
            level.run(ListAll {
                order: self,
                began: tick.began,
            });
        }
        done.tests += self.entries.len() as u64;
        let mut found = std::mem::take(&mut self.found);
        found.clear();
        let stored = Stored(&self.exact);
        let world = OfWorld {
            slot_of: &self.slot_of,
            proxies: tick.proxies,
            origin: self.origin,
        };
        let (level, aged) = (self.level, &self.ages[..]);
        let (entries, found_now) = (&mut self.entries, &mut found);
        if self.lags {
            level.run(Look {
                boxes: world,
                aged,
                entries,
                found: found_now,
            });
        } else {
            level.run(Look {
                boxes: stored,
                aged,
                entries,
                found: found_now,
            });
        }
        for one in &found {
            let ranks = self.entries[one.at as usize].ranks();
            let now = one
                .now
                .unwrap_or_else(|| overlap(&self.slot_of, ranks, tick.proxies));
            let entry = &mut self.entries[one.at as usize];
            if now == entry.is_hit() {
                continue;
            }
            entry.set_hit(now);
            let [a, b] = ranks.map(|rank| small(parts(rank).0));
            let record = self.links.find(a, b);
            debug_assert!(record.is_some(), "what is listed has a record");
            // The matrix decides: a pair that changed its lanes was restored there.
            if let Some(record) = record {
                self.put_hit(record, ranks, now, tick);
            }
        }
        self.found = found;
        // The first looks after a sort have far more entries than there are once bodies have learned their cores.
        let len = self.entries.len() + self.len / 4;
        if is_thrifty(self.len) && self.entries.capacity() > 2 * len {
            self.entries.shrink_to(len);
        }
    }

    /// Sets whether a candidate overlaps, and reports a change.
    ///
    /// * `ranks` - the lower first.
    pub(super) fn put_hit<P>(
        &mut self,
        record: u32,
        ranks: [u32; 2],
        now: bool,
        tick: &mut Tick<'_, P>,
    ) {
        let [row, lane] = ranks.map(|rank| parts(rank).1);
        let hit = &mut self.links.bits_mut(record).hit[row];
        if now == (*hit >> lane & 1 == 1) {
            return;
        }
        *hit ^= 1 << lane;
        self.hits = if now { self.hits + 1 } else { self.hits - 1 };
        let [one, other] = ranks.map(|rank| BodySlot(self.slot_of[rank as usize]));
        let told = if now {
            &mut *tick.began
        } else {
            &mut *tick.parted
        };
        told.push(PairKey::new(one, other));
    }

    /// Lists some candidates of a record; certain pairs are not listed but set as overlapping, and reported if new.
    #[inline(always)]
    pub(super) fn list_bits<L: Lanes>(
        &mut self,
        lanes: L,
        record: u32,
        chosen: &Matrix,
        began: &mut Vec<PairKey>,
    ) {
        let blocks = self.links.blocks(record);
        let [a, b] = blocks.map(|block| block * LANES);
        let (one, other) = (
            &self.sure[blocks[0] as usize],
            &self.sure[blocks[1] as usize],
        );
        let hit = &mut self.links.bits_mut(record).hit;
        for (row, hits) in hit.iter_mut().enumerate() {
            if chosen[row] == 0 {
                continue;
            }
            let sure = lanes.meets(other, &one.get(row)) & chosen[row];
            let first = a + small(row);
            for lane in ones(sure & !*hits) {
                let slot = |rank: u32| BodySlot(self.slot_of[rank as usize]);
                began.push(PairKey::new(slot(first), slot(b + small(lane))));
            }
            self.hits += (sure & !*hits).count_ones() as usize;
            *hits |= sure;
            for lane in ones(chosen[row] & !sure) {
                let ranks = [first, b + small(lane)];
                let ages = ages(self.ages[ranks[0] as usize], self.ages[ranks[1] as usize]);
                let hit = *hits >> lane & 1 == 1;
                self.entries.push(Entry::new(ranks, ages, hit));
            }
        }
    }
}

/// Returns whether the f64 boxes of the bodies at two ranks overlap.
pub(super) fn overlap<P: Proxies>(slot_of: &[u32], ranks: [u32; 2], proxies: &P) -> bool {
    let [a, b] = ranks.map(|rank| proxies.aabb(BodySlot(slot_of[rank as usize])));
    a.overlaps(b)
}

/// Returns whether a pair is certainly unchanged; no branch on its former state, which is unpredictable.
///
/// * `apart`, `sure` - results of [`Lanes::parts`].
#[inline(always)]
pub(super) fn is_as_before(hit: bool, (apart, sure): (bool, bool)) -> bool {
    (hit & sure) | (!hit & apart)
}

/// Whether two boxes overlap; `None` where rounding leaves it open.
#[inline(always)]
pub(super) fn verdict((apart, sure): (bool, bool)) -> Option<bool> {
    if apart | sure { Some(sure) } else { None }
}

/// The region that the f64 box of a body inside its hold certainly contains: the core, less what rounding may have
/// added.
#[inline(always)]
pub(super) fn sure(hold: &Hold) -> [f32; 6] {
    let (fat, core) = (hold.fat.corners(), hold.core.corners());
    let largest = fat.iter().fold(
        0.0,
        |most: f32, face| {
            if face.abs() > most { face.abs() } else { most }
        },
    );
    let slack = slack(largest);
    std::array::from_fn(|k| {
        if k < 3 {
            core[k] + slack
        } else {
            core[k] - slack
        }
    })
}

/// Lists every candidate.
struct ListAll<'a> {
    order: &'a mut Order,
    began: &'a mut Vec<PairKey>,
}

impl Kernel for ListAll<'_> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let order = self.order;
        order.listed = true;
        order.entries.clear();
        order.sure.clear();
        order.sure.resize(order.live.len(), Boxes16::EMPTY);
        for (block, live) in order.live.iter().enumerate() {
            for lane in ones(*live) {
                order.sure[block].set(
                    lane,
                    &sure(&order.held[order.slot_of[block * WIDTH + lane] as usize].hold()),
                );
            }
        }
        for record in 0..order.links.len() {
            if order.links.blocks(record)[0] != NONE {
                let chosen = order.links.bits(record).cand;
                order.list_bits(lanes, record, &chosen, self.began);
            }
        }
    }
}

/// Where the boxes of entries are read from.
trait Source {
    /// The box at a rank.
    fn get<L: Lanes>(&self, lanes: L, rank: u32) -> Down;

    /// Prefetches a box.
    fn prefetch(&self, rank: u32);
}

/// Stored boxes, by rank.
struct Stored<'a>(&'a [Down]);

impl Source for Stored<'_> {
    #[inline(always)]
    fn get<L: Lanes>(&self, _: L, rank: u32) -> Down {
        self.0[rank as usize]
    }

    #[inline(always)]
    fn prefetch(&self, rank: u32) {
        prefetch(&self.0[rank as usize]);
    }
}

/// The world itself: used while stored boxes lag (`stand`).
struct OfWorld<'a, P> {
    slot_of: &'a [u32],
    proxies: &'a P,
    origin: [f64; 3],
}

impl<P: Proxies> Source for OfWorld<'_, P> {
    #[inline(always)]
    fn get<L: Lanes>(&self, lanes: L, rank: u32) -> Down {
        match self.slot_of[rank as usize] {
            // A dead entry.
            NONE => Down::EMPTY,
            slot => outward(lanes, self.proxies.aabb(BodySlot(slot)), &self.origin),
        }
    }

    #[inline(always)]
    fn prefetch(&self, rank: u32) {
        let slot = self.slot_of[rank as usize];
        if slot != NONE {
            prefetch(self.proxies.aabb(BodySlot(slot)));
        }
    }
}

/// One pass over the list: drops dead entries, finds changes.
struct Look<'a, S> {
    boxes: S,
    /// By rank.
    aged: &'a [u8],
    entries: &'a mut Vec<Entry>,
    found: &'a mut Vec<Found>,
}

impl<S: Source> Kernel for Look<'_, S> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self {
            boxes,
            aged,
            entries,
            found,
        } = self;
        let mut kept = 0;
        for at in 0..entries.len() {
            if let Some(next) = entries.get(at + AHEAD) {
                let [one, other] = next.ranks();
                boxes.prefetch(one);
                boxes.prefetch(other);
            }
            let entry = entries[at];
            let [a, b] = entry.ranks();
            let alive = ages(aged[a as usize], aged[b as usize]) == entry.ages();
            entries[kept] = entry;
            // No closure: it would be compiled without the instructions of the level.
            let (a, b) = (boxes.get(lanes, a), boxes.get(lanes, b));
            let parts = lanes.parts(&a, &b);
            if alive & !is_as_before(entry.is_hit(), parts) {
                let now = verdict(parts);
                found.push(Found {
                    at: small(kept),
                    now,
                });
            }
            kept += usize::from(alive);
        }
        entries.truncate(kept);
    }
}
