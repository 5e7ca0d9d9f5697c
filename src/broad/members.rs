//! What the broad phase knows about its bodies: a copy of each box, the id, and what this tick changed.
//!
//! In: slots and the caller's [`Proxies`]. Out: boxes in an array by slot, for the methods that scan boxes by slot (a
//! body is some hundred bytes, a box 48); the other methods read them in place.

use super::Proxies;
use super::order::give_back;
use crate::ids::{BodyId, BodySlot, PairKey, small};
use crate::math::Aabb;

/// The body is in the broad phase.
pub(super) const IN: u8 = 1;
/// The body has no box: it is paired with every bounded body that the filters allow.
pub(super) const UNBOUNDED: u8 = 2;
/// Its box may have changed in this tick.
pub(super) const MOVED: u8 = 4;
/// All of its pairs must be searched, even if nothing moved.
pub(super) const ASKED: u8 = 8;
/// Its stored pairs must be filtered again.
pub(super) const REFILTERED: u8 = 16;
/// It left in this tick (and may have come back since).
pub(super) const LEFT: u8 = 32;
/// It came in this tick: no structure has it yet.
pub(super) const CAME: u8 = 64;

/// A box as plain arrays: lower corner, upper corner, metres. Closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    /// Lower corner.
    pub(super) min: [f64; 3],
    /// Upper corner.
    pub(super) max: [f64; 3],
}

impl Bounds {
    /// Contains nothing.
    const EMPTY: Self = Self {
        min: [f64::INFINITY; 3],
        max: [f64::NEG_INFINITY; 3],
    };

    /// From a box. NaN is rejected at the entrance of the world; if one came through, it would overlap nothing.
    fn of(aabb: &Aabb) -> Self {
        debug_assert!(
            (0..3).all(|k| aabb.min[k] <= aabb.max[k]),
            "a proxy is a box of numbers in order: {aabb:?}"
        );
        Self {
            min: aabb.min.coords.into(),
            max: aabb.max.coords.into(),
        }
    }

    /// The longest side, metres.
    pub(super) fn side(&self) -> f64 {
        let side = |k: usize| self.max[k] - self.min[k];
        side(0).max(side(1)).max(side(2))
    }

    /// Returns whether the closed intervals on one axis overlap.
    #[inline]
    pub(super) fn meets(&self, other: &Self, axis: usize) -> bool {
        // `&`, not `&&`: two loads that wait for each other cost more than one unneeded comparison.
        (self.min[axis] <= other.max[axis]) & (other.min[axis] <= self.max[axis])
    }
}

/// The bodies in the broad phase.
#[derive(Clone, Debug, Default)]
pub(super) struct Members {
    /// Whether boxes are copied; not for a method that reads them in place.
    with_bounds: bool,
    bounds: Vec<Bounds>,
    ids: Vec<BodyId>,
    flags: Vec<u8>,
    /// Index of a body in `bounded` or `unbounded`.
    place: Vec<u32>,
    bounded: Vec<BodySlot>,
    unbounded: Vec<BodySlot>,
    /// Bodies with a flag of this tick, each once.
    touched: Vec<BodySlot>,
    /// Number of slots whose id is not above that of the slot before; bodies that left are included.
    descents: usize,
    /// How often a slot got another id, or slots were added or removed.
    named: u64,
}

impl Members {
    /// Without bodies.
    pub(super) fn new(with_bounds: bool) -> Self {
        Self {
            with_bounds,
            ..Self::default()
        }
    }

    /// Begins a tick: no body is touched.
    pub(super) fn open_tick(&mut self) {
        for slot in self.touched.drain(..) {
            self.flags[slot.index()] &= IN | UNBOUNDED;
        }
        give_back(&mut self.touched, self.bounded.len());
    }

    /// Gives back the memory of slots beyond the last body that is in; called before any body is touched.
    pub(super) fn give_back(&mut self) {
        let last = self.flags.iter().rposition(|flags| flags & IN != 0);
        let len = last.map_or(0, |last| last + 1);
        shorten(&mut self.bounds, len);
        shorten(&mut self.ids, len);
        shorten(&mut self.flags, len);
        shorten(&mut self.place, len);
        self.descents = descents(&self.ids);
        self.named += 1;
        for list in [&mut self.bounded, &mut self.unbounded, &mut self.touched] {
            list.shrink_to_fit();
        }
    }

    /// Removes a body; `false` when it is not in.
    pub(super) fn leave(&mut self, slot: BodySlot) -> bool {
        if !self.has(slot, IN) {
            return false;
        }
        let list = if self.has(slot, UNBOUNDED) {
            &mut self.unbounded
        } else {
            &mut self.bounded
        };
        let place = self.place[slot.index()] as usize;
        list.swap_remove(place);
        if let Some(shifted) = list.get(place) {
            self.place[shifted.index()] = small(place);
        }
        self.flags[slot.index()] &= !(IN | UNBOUNDED);
        self.touch(slot, LEFT);
        true
    }

    /// Adds a body; `false` when it is in already.
    pub(super) fn enter(&mut self, slot: BodySlot, proxies: &impl Proxies) -> bool {
        if self.has(slot, IN) {
            return false;
        }
        let at = slot.index();
        if self.flags.len() <= at {
            if self.with_bounds {
                self.bounds.resize(at + 1, Bounds::EMPTY);
            }
            let last = self.ids.len().saturating_sub(1);
            self.ids.resize(at + 1, BodyId(0));
            self.descents += descents(&self.ids[last..]);
            self.flags.resize(at + 1, 0);
            self.place.resize(at + 1, 0);
        }
        self.name(at, proxies.id(slot));
        let list = if proxies.unbounded(slot) {
            self.flags[at] |= IN | UNBOUNDED;
            &mut self.unbounded
        } else {
            self.flags[at] |= IN;
            &mut self.bounded
        };
        self.place[at] = small(list.len());
        list.push(slot);
        if self.with_bounds {
            self.bounds[at] = if self.is_bounded(slot) {
                Bounds::of(proxies.aabb(slot))
            } else {
                Bounds::EMPTY
            };
        }
        self.touch(slot, ASKED | CAME);
        true
    }

    /// Marks all bodies that are in as coming in this tick: no structure has them.
    ///
    /// * `with_bounds` - whether boxes are copied from now on.
    pub(super) fn come_anew(&mut self, with_bounds: bool, proxies: &impl Proxies) {
        self.with_bounds = with_bounds;
        self.bounds.clear();
        if with_bounds {
            self.bounds.resize(self.flags.len(), Bounds::EMPTY);
            for slot in &self.bounded {
                self.bounds[slot.index()] = Bounds::of(proxies.aabb(*slot));
            }
        }
        for at in 0..self.flags.len() {
            let slot = BodySlot(small(at));
            if self.has(slot, IN) {
                self.touch(slot, ASKED | CAME);
            }
        }
    }

    /// Sets the id of a slot.
    fn name(&mut self, at: usize, id: BodyId) {
        if self.ids[at] == id {
            return;
        }
        self.named += 1;
        let around = at.saturating_sub(1)..self.ids.len().min(at + 2);
        self.descents -= descents(&self.ids[around.clone()]);
        self.ids[at] = id;
        self.descents += descents(&self.ids[around]);
    }

    /// Returns whether ids ascend with slots: then keys sort in the order of ids as they are.
    pub(super) fn ids_ascend(&self) -> bool {
        self.descents == 0
    }

    /// Ids by slot; bodies that left are included.
    pub(super) fn ids(&self) -> &[BodyId] {
        &self.ids
    }

    /// Changes whenever [`Members::ids`] change; never 0 when there are any.
    pub(super) fn named(&self) -> u64 {
        self.named
    }

    /// Takes the new box of a body that is in and has one.
    pub(super) fn moved(&mut self, slot: BodySlot, proxies: &impl Proxies) {
        if self.is_bounded(slot) {
            if self.with_bounds {
                self.bounds[slot.index()] = Bounds::of(proxies.aabb(slot));
            }
            self.touch(slot, MOVED);
        }
    }

    /// Sets flags of this tick.
    pub(super) fn touch(&mut self, slot: BodySlot, flags: u8) {
        let all = &mut self.flags[slot.index()];
        if *all & !(IN | UNBOUNDED) == 0 {
            self.touched.push(slot);
        }
        *all |= flags;
    }

    /// Returns whether any of these flags is set.
    #[inline]
    pub(super) fn has(&self, slot: BodySlot, flags: u8) -> bool {
        self.flags
            .get(slot.index())
            .is_some_and(|all| all & flags != 0)
    }

    /// Returns whether the body is in and has a box.
    #[inline]
    pub(super) fn is_bounded(&self, slot: BodySlot) -> bool {
        self.flags
            .get(slot.index())
            .is_some_and(|all| all & (IN | UNBOUNDED) == IN)
    }

    /// The box of a body that is, or was, in.
    #[inline]
    pub(super) fn bounds(&self, slot: BodySlot) -> &Bounds {
        &self.bounds[slot.index()]
    }

    /// The boxes by slot.
    pub(super) fn all_bounds(&self) -> &[Bounds] {
        &self.bounds
    }

    /// Flags by slot.
    pub(super) fn all_flags(&self) -> &[u8] {
        &self.flags
    }

    /// Bodies with a box, in arbitrary order.
    pub(super) fn bounded(&self) -> &[BodySlot] {
        &self.bounded
    }

    /// Bodies without one.
    pub(super) fn unbounded(&self) -> &[BodySlot] {
        &self.unbounded
    }

    /// Bodies touched in this tick, without duplicates.
    pub(super) fn touched(&self) -> &[BodySlot] {
        &self.touched
    }

    /// The ids of a pair, the smaller first: the sort order of every result.
    pub(super) fn rank(&self, key: PairKey) -> (BodyId, BodyId) {
        let (low, high) = key.slots();
        let (a, b) = (self.ids[low.index()], self.ids[high.index()]);
        (a.min(b), a.max(b))
    }

    /// Checks lists, flags and boxes against the caller's.
    pub(super) fn validate(&self, proxies: &impl Proxies) -> Result<(), String> {
        let inside = self.flags.iter().filter(|f| **f & IN != 0).count();
        if inside != self.bounded.len() + self.unbounded.len() {
            return Err(format!("{inside} bodies are in, the lists hold others"));
        }
        if self.descents != descents(&self.ids) {
            return Err(format!("{} descents of ids are counted", self.descents));
        }
        for (list, flags) in [(&self.bounded, IN), (&self.unbounded, IN | UNBOUNDED)] {
            for (place, slot) in list.iter().enumerate() {
                let at = slot.index();
                if self.flags[at] & (IN | UNBOUNDED) != flags || self.place[at] as usize != place {
                    return Err(format!("{slot:?} stands in a list it does not belong to"));
                }
                if self.ids[at] != proxies.id(*slot) {
                    return Err(format!("{slot:?} has another id than its body"));
                }
                let copied = flags == IN && self.with_bounds;
                if copied && self.bounds[at] != Bounds::of(proxies.aabb(*slot)) {
                    return Err(format!("the box of {slot:?} is not that of its body"));
                }
            }
        }
        Ok(())
    }
}

/// Truncates a list and gives the rest of its memory back.
fn shorten<T>(list: &mut Vec<T>, len: usize) {
    list.truncate(len);
    list.shrink_to_fit();
}

/// Number of ids that are not above the one before.
fn descents(ids: &[BodyId]) -> usize {
    ids.windows(2).filter(|two| two[0] >= two[1]).count()
}
