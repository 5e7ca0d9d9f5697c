//! One axis: the ends of all boxes in order, kept across ticks.
//!
//! In: boxes that moved, came or left. Out: the list sorted again, and each pair whose lower end passed an upper one,
//! that is, which began to overlap on this axis. Ends of overlaps are not reported: the pairs of a moved body are few
//! and are tested directly, while passing ends are many.
//!
//! Ends are compared by value, at equal values lower before upper, so that touching counts as overlap. The order among
//! lower ends (or among upper ends) of equal value does not matter and is arbitrary; results are sorted by id later.

use crate::broad::members::{Bounds, LEFT, Members};
use crate::ids::{BodySlot, small};

/// Tag of an end whose body left.
const DEAD: u32 = u32::MAX;
/// Ends gathered at once: a few cache lines.
const GATHER: usize = 32;
/// Position of an end that is not in the list.
const NOWHERE: u32 = u32::MAX;

/// A value as an integer with the same order; minus zero equals zero, NaN comes after the infinities.
pub(super) fn rank(value: f64) -> u64 {
    let bits = (value + 0.0).to_bits();
    if bits >> 63 == 1 {
        !bits
    } else {
        bits | 1 << 63
    }
}

/// One end of one box: 16 bytes, so that four share a cache line.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    key: u64,
    /// Body slot times two, plus one for the upper end.
    tag: u32,
}

impl End {
    /// The lower or upper end of a box on an axis.
    pub(super) fn new(slot: BodySlot, upper: bool, bounds: &Bounds, axis: usize) -> Self {
        let corner = if upper { &bounds.max } else { &bounds.min };
        Self {
            key: rank(corner[axis]),
            tag: slot.0 << 1 | u32::from(upper),
        }
    }

    /// Its body.
    #[inline]
    pub(super) fn slot(self) -> BodySlot {
        BodySlot(self.tag >> 1)
    }

    /// Returns whether it is the upper end.
    #[inline]
    pub(super) fn upper(self) -> bool {
        self.tag & 1 == 1
    }

    /// Returns whether its body left.
    #[inline]
    fn dead(self) -> bool {
        self.tag == DEAD
    }

    /// Returns whether it must come before `other`.
    #[inline]
    fn before(self, other: Self) -> bool {
        self.key < other.key || (self.key == other.key && !self.upper() & other.upper())
    }
}

/// Which passings an axis reports, and how many it may make.
pub(super) struct Passing<'a, T> {
    /// Boxes by slot, those of this tick.
    pub(super) bounds: &'a [Bounds],
    /// Whether a pair that begins to overlap on this axis is worth reporting.
    pub(super) test: T,
    /// Takes the pair.
    pub(super) met: &'a mut Vec<(BodySlot, BodySlot)>,
    /// Swaps left before sorting from scratch is cheaper.
    pub(super) allowance: u64,
    /// Boxes compared.
    pub(super) tests: u64,
}

impl<T: Fn(&Bounds, &Bounds) -> bool> Passing<'_, T> {
    /// A lower end of `one` passed an upper end of `other`.
    #[inline]
    fn meet(&mut self, one: BodySlot, other: BodySlot) {
        self.tests += 1;
        if (self.test)(&self.bounds[one.index()], &self.bounds[other.index()]) {
            self.met.push((one, other));
        }
    }

    /// The lower end of `one` passed all `ends` except the first, which is its own position.
    #[inline]
    fn meet_all(&mut self, one: BodySlot, ends: &[End]) {
        // Which ends are upper ones is unpredictable, so they are gathered without a branch.
        for chunk in ends.get(1..).unwrap_or_default().chunks(GATHER) {
            let mut uppers = [0_u32; GATHER];
            let mut len = 0;
            for end in chunk {
                uppers[len] = end.tag >> 1;
                len += usize::from(end.upper() & !end.dead());
            }
            for other in &uppers[..len] {
                self.meet(one, BodySlot(*other));
            }
        }
    }
}

/// The ends on one axis.
#[derive(Clone, Debug, Default)]
pub(super) struct Axis {
    ends: Vec<End>,
    /// By slot: positions of the lower and the upper end; valid only while `placed`.
    places: Vec<[u32; 2]>,
    placed: bool,
    dead: usize,
    /// New ends, while the list makes room for them.
    waiting: Vec<End>,
}

impl Axis {
    /// Collects and sorts all ends from scratch.
    pub(super) fn sort(&mut self, members: &Members, axis: usize) {
        self.ends.clear();
        for slot in members.bounded() {
            let bounds = members.bounds(*slot);
            let [low, high] = [false, true].map(|upper| End::new(*slot, upper, bounds, axis));
            self.ends.extend([low, high]);
        }
        self.ends.sort_unstable_by_key(|end| (end.key, end.upper()));
        self.dead = 0;
        self.placed = false;
    }

    /// Clears the list: the axis is not kept.
    pub(super) fn drop_all(&mut self) {
        *self = Self::default();
    }

    /// Bodies in order of their lower ends.
    pub(super) fn lowers(&self) -> impl Iterator<Item = BodySlot> + '_ {
        let lower = self.ends.iter().filter(|end| !end.upper());
        lower.map(|end| end.slot())
    }

    /// Number of pairs of bodies that overlap on this axis: its clumping.
    pub(super) fn crowding(&self) -> u64 {
        let (mut open, mut pairs) = (0_u64, 0_u64);
        for end in self.ends.iter().filter(|end| !end.dead()) {
            if end.upper() {
                open = open.saturating_sub(1);
            } else {
                pairs += open;
                open += 1;
            }
        }
        pairs
    }

    /// Puts the ends of all moved boxes in order, in one pass of insertion sort over the list; returns the number of
    /// swaps, or `None` when the allowance did not suffice (the list is then out of order).
    pub(super) fn settle_all<T: Fn(&Bounds, &Bounds) -> bool>(
        &mut self,
        axis: usize,
        moved: impl Fn(BodySlot) -> bool,
        passing: &mut Passing<'_, T>,
    ) -> Option<u64> {
        self.placed = false;
        let mut swaps = 0;
        for at in 0..self.ends.len() {
            let mut end = self.ends[at];
            if !end.dead() && moved(end.slot()) {
                let slot = end.slot();
                end = End::new(slot, end.upper(), &passing.bounds[slot.index()], axis);
                self.ends[at] = end;
            }
            let mut to = at;
            if end.upper() {
                // An upper end that moves down ends overlaps, which are not reported.
                while to > 0 && self.ends[to - 1].key > end.key {
                    self.ends[to] = self.ends[to - 1];
                    to -= 1;
                }
            } else {
                while to > 0 && end.before(self.ends[to - 1]) {
                    self.ends[to] = self.ends[to - 1];
                    to -= 1;
                }
                passing.meet_all(end.slot(), &self.ends[to..=at]);
            }
            if to < at {
                self.ends[to] = end;
                swaps += (at - to) as u64;
                if swaps > passing.allowance {
                    return None;
                }
            }
        }
        passing.allowance -= swaps;
        Some(swaps)
    }

    /// Puts the two ends of one moved box in order; `None` when the allowance did not suffice.
    pub(super) fn settle_one<T: Fn(&Bounds, &Bounds) -> bool>(
        &mut self,
        slot: BodySlot,
        axis: usize,
        passing: &mut Passing<'_, T>,
    ) -> Option<u64> {
        self.place_all();
        let bounds = &passing.bounds[slot.index()];
        let [low, high] = [false, true].map(|upper| End::new(slot, upper, bounds, axis));
        let at = self.places.get(slot.index())?[0];
        // The end that leads the motion goes first, so that the two do not pass each other.
        let first_low = low.key <= self.ends.get(at as usize)?.key;
        let order = if first_low { [low, high] } else { [high, low] };
        let mut swaps = 0;
        for end in order {
            let more = self.slide(end, passing)?;
            passing.allowance = passing.allowance.checked_sub(more)?;
            swaps += more;
        }
        Some(swaps)
    }

    /// Moves one end to the position of its new value.
    fn slide<T: Fn(&Bounds, &Bounds) -> bool>(
        &mut self,
        end: End,
        passing: &mut Passing<'_, T>,
    ) -> Option<u64> {
        let from = self.places[end.slot().index()][usize::from(end.upper())] as usize;
        if self.ends.get(from)?.tag != end.tag {
            debug_assert!(false, "positions are right while `placed`");
            return None;
        }
        let mut to = from;
        while to > 0 && end.before(self.ends[to - 1]) {
            let other = self.ends[to - 1];
            if !end.upper() && other.upper() && !other.dead() && other.slot() != end.slot() {
                passing.meet(end.slot(), other.slot());
            }
            self.put(to, other);
            to -= 1;
        }
        while to + 1 < self.ends.len() && self.ends[to + 1].before(end) {
            let other = self.ends[to + 1];
            if end.upper() && !other.upper() && other.slot() != end.slot() {
                passing.meet(other.slot(), end.slot());
            }
            self.put(to, other);
            to += 1;
        }
        self.put(to, end);
        Some(from.abs_diff(to) as u64)
    }

    /// Writes an end and its position.
    #[inline]
    fn put(&mut self, at: usize, end: End) {
        self.ends[at] = end;
        if !end.dead() {
            self.places[end.slot().index()][usize::from(end.upper())] = small(at);
        }
    }

    /// Updates the positions.
    pub(super) fn place_all(&mut self) {
        if self.placed {
            return;
        }
        for (at, end) in self.ends.iter().enumerate().filter(|(_, e)| !e.dead()) {
            let slot = end.slot().index();
            if self.places.len() <= slot {
                self.places.resize(slot + 1, [NOWHERE; 2]);
            }
            self.places[slot][usize::from(end.upper())] = small(at);
        }
        self.placed = true;
    }

    /// Removes the ends of bodies that left: a few are marked dead in place, many are removed in one pass.
    pub(super) fn leave(&mut self, left: &[BodySlot], members: &Members) {
        let few = left.len() * 32 < self.ends.len();
        if few {
            self.place_all();
            for slot in left {
                for at in self.places[slot.index()] {
                    if let Some(end) = self.ends.get_mut(at as usize) {
                        debug_assert_eq!(end.slot(), *slot);
                        end.tag = DEAD;
                        self.dead += 1;
                    }
                }
                self.places[slot.index()] = [NOWHERE; 2];
            }
        }
        if !few || self.dead * 8 > self.ends.len() {
            self.ends
                .retain(|end| !end.dead() && !members.has(end.slot(), LEFT));
            self.dead = 0;
            self.placed = false;
        }
    }

    /// Inserts the ends of bodies that came, all in one pass from the back.
    pub(super) fn merge(&mut self, came: &[BodySlot], members: &Members, axis: usize) {
        let old = self.ends.len();
        for slot in came {
            let bounds = members.bounds(*slot);
            let [low, high] = [false, true].map(|upper| End::new(*slot, upper, bounds, axis));
            self.ends.extend([low, high]);
        }
        self.ends[old..].sort_unstable_by_key(|end| (end.key, end.upper()));
        self.waiting.clear();
        self.waiting.extend_from_slice(&self.ends[old..]);
        let (mut from, mut to) = (old, self.ends.len());
        for end in self.waiting.drain(..).rev() {
            while from > 0 && end.before(self.ends[from - 1]) {
                from -= 1;
                to -= 1;
                self.ends[to] = self.ends[from];
            }
            to -= 1;
            self.ends[to] = end;
        }
        self.placed = false;
    }

    /// Checks order, keys and positions, and that each bounded body is listed once.
    pub(super) fn validate(&self, members: &Members, axis: usize) -> Result<(), String> {
        let all = self.ends.len() - self.dead;
        if all != 2 * members.bounded().len() {
            return Err(format!("axis {axis} holds {all} ends"));
        }
        if self.ends.iter().filter(|e| e.dead()).count() != self.dead {
            return Err(format!("axis {axis} miscounts its dead ends"));
        }
        let mut seen = vec![0_u8; members.all_bounds().len()];
        let mut last: Option<End> = None;
        for (at, end) in self.ends.iter().enumerate().filter(|(_, e)| !e.dead()) {
            let slot = end.slot();
            if !members.is_bounded(slot) {
                return Err(format!("axis {axis} holds {slot:?}, which is not in"));
            }
            if end.key != End::new(slot, end.upper(), members.bounds(slot), axis).key {
                return Err(format!("axis {axis} has an old value of {slot:?}"));
            }
            if last.is_some_and(|last| end.before(last)) {
                return Err(format!("axis {axis} is out of order at {at}"));
            }
            let side = usize::from(end.upper());
            if self.placed && self.places[slot.index()][side] as usize != at {
                return Err(format!("axis {axis} misplaces {slot:?}"));
            }
            seen[slot.index()] += if end.upper() { 16 } else { 1 };
            last = Some(*end);
        }
        let right = members.bounded().iter().all(|s| seen[s.index()] == 17);
        right
            .then_some(())
            .ok_or(format!("axis {axis} holds an end twice or not at all"))
    }
}
