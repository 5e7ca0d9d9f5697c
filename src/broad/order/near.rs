//! The entries of a Verlet list: which are dead, and which began or ceased to overlap.
//!
//! In: boxes by rank, lanes whose entries die. Out: pairs that began and pairs that parted.

use super::links::small;
use super::verlet::Verlet;
use super::{BodySlot, NONE, Order, Proxies, Tick};
use crate::ids::PairKey;
use crate::simd::boxes::{Down, Lanes, WIDTH, Work, prefetch};

/// Entries ahead whose boxes are asked for.
const AHEAD: usize = 16;

/// Two bodies near one another, by rank; with [`HIT`] on the first where their boxes overlap.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near {
    one: u32,
    other: u32,
}

/// The bit of [`Near::one`] that says whether the boxes overlap: no rank is that great.
const HIT: u32 = 1 << 31;

impl Near {
    /// Two ranks that have not been looked at.
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
}

/// What a look at an entry found: its place in the list, and whether the boxes overlap; `None` where rounding leaves it
/// open.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    at: u32,
    now: Option<bool>,
}

/// Whether a rank's lane is among some.
#[inline(always)]
pub(super) fn is_among(lanes: &[u16], rank: usize) -> bool {
    lanes[rank / WIDTH] >> (rank % WIDTH) & 1 == 1
}

impl Order {
    /// Looks at the entries from one on; tells what began and parted.
    ///
    /// * `old` - whether they were listed in an earlier tick: the others are told only where a body is new in its lane.
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
            ..
        } = &mut self.afresh.verlet;
        found.clear();
        let (exact, slot_of) = (&self.exact[..], &self.slot_of[..]);
        let lost = self.level.run(Look {
            exact,
            out,
            slot_of,
            entries,
            from,
            old,
            found,
            parted: tick.parted,
        });
        self.hits -= lost;
        for Found { at, now } in found.iter() {
            let entry = &mut entries[*at as usize];
            let ranks = entry.ranks();
            let slots = ranks.map(|rank| BodySlot(slot_of[rank]));
            let now = now.unwrap_or_else(|| {
                let [a, b] = slots.map(|slot| tick.proxies.aabb(slot));
                a.overlaps(b)
            });
            if now == entry.is_hit() {
                continue;
            }
            entry.one ^= HIT;
            self.hits = if now { self.hits + 1 } else { self.hits - 1 };
            let key = PairKey::new(slots[0], slots[1]);
            if !now {
                tick.parted.push(key);
            } else if old || ranks.into_iter().any(|rank| is_among(fresh, rank)) {
                tick.began.push(key);
            }
        }
    }

    /// Reports every overlap of marked lanes.
    pub(super) fn tell_listed(&self, marked: &[u16], began: &mut Vec<PairKey>) {
        for entry in &self.afresh.verlet.entries {
            let any = || entry.ranks().into_iter().any(|rank| is_among(marked, rank));
            if entry.is_hit() && any() {
                let [one, other] = entry.ranks().map(|rank| BodySlot(self.slot_of[rank]));
                began.push(PairKey::new(one, other));
            }
        }
    }
}

/// One pass over the list: drops the dead, finds what changed. Returns how many of the dead overlapped.
struct Look<'a> {
    exact: &'a [Down],
    out: &'a [u16],
    slot_of: &'a [u32],
    entries: &'a mut Vec<Near>,
    from: usize,
    old: bool,
    found: &'a mut Vec<Found>,
    parted: &'a mut Vec<PairKey>,
}

impl Work for Look<'_> {
    type Out = usize;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> usize {
        let (mut kept, mut lost) = (self.from, 0);
        for at in self.from..self.entries.len() {
            if let Some(next) = self.entries.get(at + AHEAD) {
                let [_, b] = next.ranks();
                prefetch(&self.exact[b]);
            }
            let entry = self.entries[at];
            let [a, b] = entry.ranks();
            let alive = !(self.old & (is_among(self.out, a) | is_among(self.out, b)));
            self.entries[kept] = entry;
            let (apart, sure) = lanes.parts(&self.exact[a], &self.exact[b]);
            // Without a branch on the state: it is as good as random.
            let hit = entry.is_hit();
            let as_before = (hit & sure) | (!hit & apart);
            if !as_before | !alive {
                if alive {
                    let now = if apart | sure { Some(sure) } else { None };
                    self.found.push(Found {
                        at: small(kept),
                        now,
                    });
                } else if hit {
                    lost += 1;
                    let slots = [a, b].map(|rank| BodySlot(self.slot_of[rank]));
                    if slots.iter().all(|slot| slot.0 != NONE) {
                        self.parted.push(PairKey::new(slots[0], slots[1]));
                    }
                }
            }
            kept += usize::from(alive);
        }
        self.entries.truncate(kept);
        lost
    }
}
