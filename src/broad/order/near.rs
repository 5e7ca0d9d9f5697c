//! The entries of a Verlet list: which are dead, and which began or ended to overlap.
//!
//! In: boxes by rank, lanes whose entries die. Out: pairs that began and pairs that parted.

use super::idle::give_back;
use super::look::{is_as_before, overlap, verdict};
use super::verlet::Verlet;
use super::{BodySlot, NONE, Order, Proxies, Tick, ones};
use crate::ids::{PairKey, small};
use crate::simd::boxes::{Down, Kernel, Lanes, WIDTH, prefetch};

/// Entries ahead whose boxes are prefetched.
const AHEAD: usize = 16;

/// Two bodies near each other, by rank; [`HIT`] is set on the first if their boxes overlap.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near {
    one: u32,
    other: u32,
}

/// The bit of [`Near::one`] that says whether the boxes overlap: no rank is that large.
const HIT: u32 = 1 << 31;

impl Near {
    /// Two ranks that have not been compared.
    #[inline(always)]
    pub(super) fn new(one: u32, other: u32) -> Self {
        Self { one, other }
    }

    #[inline(always)]
    pub(super) fn ranks(self) -> [usize; 2] {
        [(self.one & !HIT) as usize, self.other as usize]
    }

    #[inline(always)]
    pub(super) fn is_hit(self) -> bool {
        self.one & HIT != 0
    }

    /// The pair of body slots at the two ranks.
    #[inline(always)]
    pub(super) fn key(self, slot_of: &[u32]) -> PairKey {
        let [one, other] = self.ranks().map(|rank| BodySlot(slot_of[rank]));
        PairKey::new(one, other)
    }

    /// Maps both numbers by a table: ranks to body slots, or body slots to ranks.
    #[inline(always)]
    pub(super) fn by(self, table: &[u32]) -> Self {
        let [one, other] = self.ranks().map(|at| table[at]);
        Self {
            one: one | self.one & HIT,
            other,
        }
    }

    /// Returns whether either lane is in `lanes`.
    #[inline(always)]
    pub(super) fn any_among(self, lanes: &[u16]) -> bool {
        let [one, other] = self.ranks();
        is_among(lanes, one) | is_among(lanes, other)
    }
}

/// Result of comparing an entry: its index in the list, and whether the boxes overlap; `None` where rounding leaves it
/// open.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    at: u32,
    now: Option<bool>,
}

/// The ranks of some lanes; `lanes` is by block.
fn ranks(lanes: &[u16]) -> impl Iterator<Item = usize> {
    let blocks = lanes.iter().enumerate();
    blocks.flat_map(|(block, lanes)| ones(*lanes).map(move |lane| block * WIDTH + lane))
}

/// Returns whether the lane of a rank is in `lanes`.
#[inline(always)]
pub(super) fn is_among(lanes: &[u16], rank: usize) -> bool {
    lanes[rank / WIDTH] >> (rank % WIDTH) & 1 == 1
}

impl Order {
    /// Compares the entries from `from` on; reports what began and parted.
    ///
    /// * `old` - whether they were listed in an earlier tick: new ones are reported only if a body is new in its lane.
    pub(super) fn look_listed<P: Proxies>(
        &mut self,
        from: usize,
        old: bool,
        tick: &mut Tick<'_, P>,
    ) {
        let Verlet {
            entries,
            found,
            out,
            fresh,
            aside,
            ..
        } = &mut self.afresh.verlet;
        found.clear();
        let (exact, slot_of) = (&mut self.exact[..], &self.slot_of[..]);
        let (told, proxies) = (tick.parted.len(), tick.proxies);
        // Entries that die are found by their boxes, which are empty during this look, so no other entry is tested for
        // it.
        let dying = old.then_some(&out[..]);
        debug_assert!(aside.is_empty(), "nobody's box is aside");
        for rank in ranks(dying.unwrap_or_default()) {
            aside.push(std::mem::replace(&mut exact[rank], Down::EMPTY));
        }
        let lost = self.level.run(Look {
            exact,
            out: dying,
            slot_of,
            entries,
            from,
            found,
            parted: tick.parted,
        });
        for (rank, own) in ranks(dying.unwrap_or_default()).zip(&*aside) {
            exact[rank] = *own;
        }
        give_back(aside, self.len);
        self.hits -= lost;
        // Pairs that still overlap are found again and reported as begun, which has no effect on stored pairs.
        let mut kept = told;
        for at in told..tick.parted.len() {
            let key = tick.parted[at];
            let (one, other) = key.slots();
            tick.parted[kept] = key;
            kept += usize::from(!proxies.aabb(one).overlaps(proxies.aabb(other)));
        }
        tick.parted.truncate(kept);
        for Found { at, now } in found.iter() {
            let entry = &mut entries[*at as usize];
            let ranks = entry.ranks().map(small);
            let now = now.unwrap_or_else(|| overlap(slot_of, ranks, proxies));
            if now == entry.is_hit() {
                continue;
            }
            entry.one ^= HIT;
            self.hits = if now { self.hits + 1 } else { self.hits - 1 };
            let key = entry.key(slot_of);
            if !now {
                tick.parted.push(key);
            } else if old || entry.any_among(fresh) {
                tick.began.push(key);
            }
        }
    }

    /// Finds which of the first `some` entries overlap, without reporting them.
    pub(super) fn settle_listed<P: Proxies>(&mut self, some: usize, proxies: &P) {
        let verlet = &mut self.afresh.verlet;
        verlet.found.clear();
        let (exact, slot_of) = (&self.exact[..], &self.slot_of[..]);
        self.hits += self.level.run(Settle {
            exact,
            entries: &mut verlet.entries[..some],
            found: &mut verlet.found,
        });
        for Found { at, .. } in &verlet.found {
            let entry = &mut verlet.entries[*at as usize];
            if overlap(slot_of, entry.ranks().map(small), proxies) {
                entry.one |= HIT;
                self.hits += 1;
            }
        }
    }

    /// Reports every overlap of marked lanes.
    pub(super) fn tell_listed(&self, marked: &[u16], began: &mut Vec<PairKey>) {
        for entry in &self.afresh.verlet.entries {
            if entry.is_hit() && entry.any_among(marked) {
                began.push(entry.key(&self.slot_of));
            }
        }
    }
}

/// See [`Order::settle_listed`]. Returns how many certainly overlap.
struct Settle<'a> {
    exact: &'a [Down],
    entries: &'a mut [Near],
    /// Entries that rounding leaves open.
    found: &'a mut Vec<Found>,
}

impl Kernel for Settle<'_> {
    type Out = usize;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> usize {
        let mut hits = 0;
        for at in 0..self.entries.len() {
            prefetch_ahead(self.exact, self.entries, at);
            let [a, b] = self.entries[at].ranks();
            let (apart, sure) = lanes.parts(&self.exact[a], &self.exact[b]);
            self.entries[at].one |= if sure { HIT } else { 0 };
            hits += usize::from(sure);
            if !(apart | sure) {
                let now = None;
                self.found.push(Found { at: small(at), now });
            }
        }
        hits
    }
}

/// Prefetches the boxes of an entry: either may be in the block that the search was at.
#[inline(always)]
fn prefetch_ahead(exact: &[Down], entries: &[Near], at: usize) {
    if let Some(next) = entries.get(at + AHEAD) {
        for rank in next.ranks() {
            prefetch(&exact[rank]);
        }
    }
}

/// One pass over the list: drops dead entries, finds changes. Returns how many of the dead overlapped; their pairs may
/// have parted.
struct Look<'a> {
    exact: &'a [Down],
    /// By block: lanes whose entries die, if any; their boxes are empty.
    out: Option<&'a [u16]>,
    slot_of: &'a [u32],
    entries: &'a mut Vec<Near>,
    from: usize,
    found: &'a mut Vec<Found>,
    parted: &'a mut Vec<PairKey>,
}

impl Kernel for Look<'_> {
    type Out = usize;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> usize {
        let (mut kept, mut lost) = (self.from, 0);
        let (exact, entries) = (self.exact, &mut self.entries[..]);
        for at in self.from..entries.len() {
            prefetch_ahead(exact, entries, at);
            let entry = entries[at];
            let [a, b] = entry.ranks();
            entries[kept] = entry;
            let parts = lanes.parts(&exact[a], &exact[b]);
            let hit = entry.is_hit();
            kept += 1;
            if is_as_before(hit, parts) {
                continue;
            }
            let now = verdict(parts);
            if now.is_some() || !self.out.is_some_and(|out| entry.any_among(out)) {
                let at = small(kept - 1);
                self.found.push(Found { at, now });
                continue;
            }
            kept -= 1;
            if hit {
                lost += 1;
                let slots = [a, b].map(|rank| BodySlot(self.slot_of[rank]));
                if slots.iter().all(|slot| slot.0 != NONE) {
                    self.parted.push(PairKey::new(slots[0], slots[1]));
                }
            }
        }
        self.entries.truncate(kept);
        lost
    }
}
