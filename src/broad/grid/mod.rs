//! Grids: each body is linked to the cells that its box covers, kept across ticks.
//!
//! In: bodies that left, came, moved. Out: pairs that may have begun. Three methods that differ in two ways:
//!
//! | method | size of a cell | where cells are kept |
//! | --- | --- | --- |
//! | uniform grid | one for all: the largest box, so that a box covers up to 8 cells | an array over the scene |
//! | spatial hash | the same | a table of the cells in use: unbounded space, an empty cell takes no memory |
//! | hierarchical grid | levels by size, a factor of two apart: a box covers up to 8 cells of its level | a table |
//!
//! A body is linked again only when its cells changed. A moved body queries the cells that its box covers, on each
//! level that has any body; a level with fewer bodies than cells to query is scanned body by body, so that a floor does
//! not query a million cells for a few pebbles. A pair is reported in only one cell, that of the lower corner of the
//! intersection of the two boxes. Infinite boxes cover no cells: they are compared with all.
//!
//! Sources: RTR3 section 17.5.2 (uniform grids, spatial hashing); Mirtich 1996, Ericson 2005 section 7.2 (levels by
//! size).

use super::Work;
use super::members::{ASKED, CAME, MOVED, Members};
use crate::ids::{BodySlot, PairKey, small};

mod cells;
mod lattice;
mod validate;

use cells::{Cells, NONE};
use lattice::{Lattice, Range, level_of};

/// Which of the three grids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// One size of cells, in an array.
    Uniform,
    /// One size of cells, in a table.
    Hash,
    /// Sizes by powers of two, in a table.
    Levels,
}

/// Most cells that a box is linked to; a box with more is compared with all. It covers 8, and rounding may add some.
const COVERED_MAX: u64 = 64;
/// When one in `STRAYED` bodies was placed at the edge of the array because it lies beyond, the array is laid out
/// again.
const STRAYED: usize = 8;
/// The array is laid out again when there are `GROWN` times as many bodies as it was laid out for.
const GROWN: usize = 2;
/// Cells are laid out again when this much larger than the largest box needs; checked after one placement per body.
const SHRINK: f64 = 2.0;

/// Where a body is linked.
#[derive(Clone, Copy, Debug)]
struct Stand {
    /// Its cells; empty when it is linked to none.
    range: Range,
    /// Index of its level in `levels`, or `NONE`: it is compared with all, or not in.
    level: u32,
    /// Its index in the list of its level, or among those compared with all.
    place: u32,
    /// The first of its links.
    link: u32,
}

const NOWHERE: Stand = Stand {
    range: Range::EMPTY,
    level: NONE,
    place: NONE,
    link: NONE,
};

/// Bodies of one size of cells.
#[derive(Clone, Debug)]
struct Level {
    /// Power of two of the cell's side; 0 when all cells have one size.
    power: i32,
    lattice: Lattice,
    bodies: Vec<BodySlot>,
}

/// The structure.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    kind: Kind,
    levels: Vec<Level>,
    cells: Cells,
    /// By body.
    stands: Vec<Stand>,
    /// Bodies compared with all.
    endless: Vec<BodySlot>,
    /// Largest box side that the single cell size was laid out for, metres.
    largest_m: f64,
    /// Boxes placed since then, and how many of them beyond the edge.
    placed: usize,
    strayed: usize,
    /// Number of bodies that the cells were laid out for.
    laid: usize,
}

impl Grid {
    /// Which of the three grids this is.
    pub(super) fn kind(&self) -> Kind {
        self.kind
    }

    /// Without bodies.
    pub(super) fn new(kind: Kind) -> Self {
        Self {
            kind,
            levels: Vec::new(),
            cells: Cells::default(),
            stands: Vec::new(),
            endless: Vec::new(),
            largest_m: 0.0,
            placed: 0,
            strayed: 0,
            laid: 0,
        }
    }

    /// Bodies with a box left (and may be about to come again).
    pub(super) fn leave(&mut self, left: &[BodySlot]) {
        for slot in left {
            self.take_out(*slot);
        }
    }

    /// Links bodies that came or moved, and suggests their pairs and those of bodies that are queried again.
    ///
    /// Cost: the cells that changed, and the bodies in the cells of moved bodies.
    pub(super) fn update(&mut self, members: &Members, began: &mut Vec<PairKey>, work: &mut Work) {
        let changed = |slot: &&BodySlot| {
            members.is_bounded(**slot) && members.has(**slot, MOVED | ASKED | CAME)
        };
        if self.kind != Kind::Levels && self.is_to_be_laid_out(members) {
            self.lay_out(members, work);
        } else {
            for slot in members.touched().iter().filter(changed) {
                self.put(*slot, members, work);
            }
        }
        for slot in members.touched().iter().filter(changed) {
            self.ask(*slot, members, began, work);
        }
    }

    /// Returns whether the cells no longer fit the boxes.
    fn is_to_be_laid_out(&mut self, members: &Members) -> bool {
        let bodies = members.bounded();
        let moved = || {
            let touched = members.touched().iter().copied();
            touched.filter(|slot| members.is_bounded(*slot))
        };
        let largest_m = |slots: &mut dyn Iterator<Item = BodySlot>| {
            let sides = slots.map(|slot| members.bounds(slot).side());
            sides.filter(|side| side.is_finite()).fold(0.0, f64::max)
        };
        if largest_m(&mut moved()) > self.largest_m || self.levels.is_empty() {
            return true;
        }
        if self.strayed * STRAYED > bodies.len() {
            return true;
        }
        // Before bodies stray: those in the cells at the rim are all compared with one another.
        if self.kind == Kind::Uniform && bodies.len() > GROWN * self.laid {
            return true;
        }
        if self.placed <= bodies.len() {
            return false;
        }
        self.placed = 0;
        largest_m(&mut bodies.iter().copied()) * SHRINK < self.largest_m
    }

    /// Lays out one cell size for all, from the largest box, and links every body again.
    fn lay_out(&mut self, members: &Members, work: &mut Work) {
        work.rebuilds += 1;
        let bodies = members.bounded();
        let boxes = || bodies.iter().map(|slot| members.bounds(*slot));
        let in_array = self.kind == Kind::Uniform;
        let lattice = Lattice::around(boxes(), in_array.then_some(bodies.len()));
        self.largest_m = boxes()
            .map(|bounds| bounds.side())
            .filter(|side| side.is_finite())
            .fold(0.0, f64::max);
        self.cells.clear(in_array.then(|| lattice.shape()));
        self.stands.fill(NOWHERE);
        self.endless.clear();
        self.levels.truncate(1);
        if let Some(level) = self.levels.first_mut() {
            level.lattice = lattice;
            level.bodies.clear();
        } else {
            let bodies = Vec::new();
            self.levels.push(Level {
                power: 0,
                lattice,
                bodies,
            });
        }
        for slot in bodies {
            self.put(*slot, members, work);
        }
        (self.placed, self.strayed, self.laid) = (0, 0, bodies.len());
    }

    /// Level and cells of a box; `None` for one that is compared with all.
    fn stand_of(&mut self, slot: BodySlot, members: &Members) -> Option<(u32, Range)> {
        let bounds = members.bounds(slot);
        let side = bounds.side();
        if !side.is_finite() {
            return None;
        }
        let level = if self.kind == Kind::Levels {
            let power = level_of(side);
            let known = self.levels.iter().position(|level| level.power == power);
            known.unwrap_or_else(|| {
                self.levels.push(Level {
                    power,
                    lattice: Lattice::of_power(power),
                    bodies: Vec::new(),
                });
                self.levels.len() - 1
            })
        } else {
            0
        };
        let lattice = &self.levels[level].lattice;
        let range = self.clamped(lattice.range(bounds), lattice);
        (range.len() <= COVERED_MAX).then_some((small(level), range))
    }

    /// In an array, cells beyond the edge are moved to the edge.
    fn clamped(&self, range: Range, lattice: &Lattice) -> Range {
        if self.kind == Kind::Uniform {
            range.clamped(lattice.shape())
        } else {
            range
        }
    }

    /// Links a body to the cells of its box.
    fn put(&mut self, slot: BodySlot, members: &Members, work: &mut Work) {
        let at = slot.index();
        if self.stands.len() <= at {
            self.stands.resize(at + 1, NOWHERE);
        }
        self.placed += 1;
        let now = self.stand_of(slot, members);
        let before = self.stands[at];
        let is_in = before.place != NONE;
        let same = is_in
            && match now {
                Some((level, range)) => before.level == level && before.range == range,
                None => before.level == NONE,
            };
        if same {
            return;
        }
        if is_in {
            self.take_out(slot);
        }
        let Some((level, range)) = now else {
            let place = small(self.endless.len());
            self.endless.push(slot);
            self.stands[at] = Stand { place, ..NOWHERE };
            return;
        };
        let home = &mut self.levels[level as usize];
        if self.kind == Kind::Uniform {
            let free = home.lattice.range(members.bounds(slot));
            self.strayed += usize::from(free != range);
        }
        let place = small(home.bodies.len());
        home.bodies.push(slot);
        let mut link = NONE;
        let power = home.power;
        for cell in range.cells() {
            link = self.cells.link(power, cell, slot, link);
            work.cells += 1;
        }
        self.stands[at] = Stand {
            range,
            level,
            place,
            link,
        };
    }

    /// Unlinks a body.
    fn take_out(&mut self, slot: BodySlot) {
        let Some(stand) = self.stands.get_mut(slot.index()) else {
            return;
        };
        let stand = std::mem::replace(stand, NOWHERE);
        if stand.place == NONE {
            return;
        }
        self.cells.unlink(stand.link);
        let list = match self.levels.get_mut(stand.level as usize) {
            Some(level) => &mut level.bodies,
            None => &mut self.endless,
        };
        list.swap_remove(stand.place as usize);
        if let Some(shifted) = list.get(stand.place as usize) {
            self.stands[shifted.index()].place = stand.place;
        }
    }

    /// Suggests the pairs of a body; if both bodies of a pair are queried in one tick, the lower slot reports it.
    fn ask(&self, slot: BodySlot, members: &Members, began: &mut Vec<PairKey>, work: &mut Work) {
        let bounds = members.bounds(slot);
        let mut test = |other: BodySlot| {
            let twice = other < slot && members.has(other, MOVED | ASKED | CAME);
            if other == slot || twice {
                return false;
            }
            work.tests += 1;
            let theirs = members.bounds(other);
            let meets = (0..3).all(|axis| bounds.meets(theirs, axis));
            if meets {
                began.push(PairKey::new(slot, other));
            }
            meets
        };
        for other in &self.endless {
            test(*other);
        }
        if self.stands[slot.index()].level == NONE {
            for level in &self.levels {
                level.bodies.iter().for_each(|other| _ = test(*other));
            }
            return;
        }
        for level in self.levels.iter().filter(|level| !level.bodies.is_empty()) {
            let range = self.clamped(level.lattice.range(bounds), &level.lattice);
            if range.len() > level.bodies.len() as u64 {
                level.bodies.iter().for_each(|other| _ = test(*other));
                continue;
            }
            for cell in range.cells() {
                for other in self.cells.bodies(level.power, cell) {
                    // Two boxes may share several cells; the pair is reported in one of them.
                    let shared = range.lower_shared(&self.stands[other.index()].range);
                    if shared == cell {
                        test(other);
                    }
                }
            }
        }
    }
}
