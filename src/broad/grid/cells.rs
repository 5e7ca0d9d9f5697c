//! The cells and the bodies in each: one list per cell, with all links in one pool.
//!
//! Cells are stored in an array, or, for unbounded space, in a pool that a table indexes by their coordinates; there a
//! cell without a body is freed at once.

use crate::ids::{BodySlot, small};
use crate::pairs::Index;

/// No index.
pub(super) const NONE: u32 = u32::MAX;

/// A body in a cell.
#[derive(Clone, Copy, Debug)]
struct Link {
    body: BodySlot,
    cell: u32,
    /// Neighbours in the cell's list.
    next: u32,
    prev: u32,
    /// The body's next link; in a free link, the next free one.
    sibling: u32,
}

/// A cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// Power of two of its side, and its coordinates.
    pub(super) power: i32,
    pub(super) at: [i64; 3],
    pub(super) first: u32,
}

/// All cells.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    /// Cells of the array on each axis; `None`: cells are found by the table.
    shape: Option<[i64; 3]>,
    cells: Vec<Cell>,
    free_cells: Vec<u32>,
    table: Index,
    links: Vec<Link>,
    free: u32,
}

impl Default for Cells {
    fn default() -> Self {
        Self {
            shape: None,
            cells: Vec::new(),
            free_cells: Vec::new(),
            table: Index::default(),
            links: Vec::new(),
            free: NONE,
        }
    }
}

/// Mixes power and coordinates with odd constants, one per coordinate (Teschner et al. 2003 use primes).
fn hash(power: i32, at: [i64; 3]) -> u64 {
    let mut mixed = u64::from(power.unsigned_abs());
    for (part, by) in at.into_iter().zip([
        0x9E37_79B9_7F4A_7C15_u64,
        0xC2B2_AE3D_27D4_EB4F,
        0x1656_67B1_9E37_79F9,
    ]) {
        mixed = (mixed ^ part.cast_unsigned().wrapping_mul(by)).rotate_left(29);
    }
    mixed
}

impl Cells {
    /// Drops everything; from now on in an array of this shape, or in a table.
    pub(super) fn clear(&mut self, shape: Option<[i64; 3]>) {
        self.shape = shape;
        self.links.clear();
        self.free = NONE;
        self.cells.clear();
        self.free_cells.clear();
        self.table.clear();
        if let Some([x, y, z]) = shape {
            let empty = Cell {
                power: 0,
                at: [0; 3],
                first: NONE,
            };
            let count = usize::try_from(x * y * z).unwrap_or(0);
            self.cells.resize(count, empty);
        }
    }

    /// Index of a cell.
    fn find(&self, power: i32, at: [i64; 3]) -> Option<u32> {
        if let Some([x, y, _]) = self.shape {
            return u32::try_from(at[0] + x * (at[1] + y * at[2])).ok();
        }
        self.table.find(hash(power, at), |place| {
            let cell = &self.cells[place as usize];
            cell.at == at && cell.power == power
        })
    }

    /// Puts a body into a cell.
    ///
    /// * `sibling` - the body's last link, or `NONE`.
    /// * returns - the new link.
    pub(super) fn link(&mut self, power: i32, at: [i64; 3], body: BodySlot, sibling: u32) -> u32 {
        let cell = self.find(power, at).unwrap_or_else(|| self.open(power, at));
        let next = self.cells[cell as usize].first;
        let link = Link {
            body,
            cell,
            next,
            prev: NONE,
            sibling,
        };
        let place = if let Some(free) = self.links.get_mut(self.free as usize) {
            let place = self.free;
            self.free = std::mem::replace(free, link).sibling;
            place
        } else {
            self.links.push(link);
            small(self.links.len() - 1)
        };
        if let Some(second) = self.links.get_mut(next as usize) {
            second.prev = place;
        }
        self.cells[cell as usize].first = place;
        place
    }

    /// Adds a cell to the table.
    fn open(&mut self, power: i32, at: [i64; 3]) -> u32 {
        let first = NONE;
        let cell = Cell { power, at, first };
        let place = if let Some(place) = self.free_cells.pop() {
            self.cells[place as usize] = cell;
            place
        } else {
            self.cells.push(cell);
            small(self.cells.len() - 1)
        };
        let room = self.cells.capacity();
        self.table.insert(hash(power, at), place, room);
        place
    }

    /// Removes a body from all its cells.
    ///
    /// * `link` - its last link, or `NONE`.
    pub(super) fn unlink(&mut self, link: u32) {
        let mut at = link;
        while let Some(link) = self.links.get_mut(at as usize) {
            let Link {
                cell,
                next,
                prev,
                sibling,
                ..
            } = *link;
            link.sibling = self.free;
            link.cell = NONE;
            self.free = at;
            at = sibling;
            if let Some(after) = self.links.get_mut(next as usize) {
                after.prev = prev;
            }
            if let Some(before) = self.links.get_mut(prev as usize) {
                before.next = next;
                continue;
            }
            self.cells[cell as usize].first = next;
            if next == NONE && self.shape.is_none() {
                let Cell { power, at, .. } = self.cells[cell as usize];
                self.table.remove(hash(power, at), cell);
                self.free_cells.push(cell);
            }
        }
    }

    /// The bodies in a cell.
    pub(super) fn bodies(&self, power: i32, at: [i64; 3]) -> impl Iterator<Item = BodySlot> + '_ {
        let cell = self.find(power, at);
        let first = cell.and_then(|cell| self.cells.get(cell as usize));
        let mut link = first.map_or(NONE, |cell| cell.first);
        std::iter::from_fn(move || {
            let here = self.links.get(link as usize)?;
            link = here.next;
            Some(here.body)
        })
    }

    /// Checks lists, free links, and that the table holds no empty cell.
    ///
    /// * returns - number of links between bodies and cells, counted by cell.
    pub(super) fn validate(&self) -> Result<usize, String> {
        let mut seen = 0;
        for (place, cell) in self.cells.iter().enumerate() {
            let (mut link, mut before) = (cell.first, NONE);
            if self.free_cells.contains(&small(place)) {
                continue;
            }
            if self.shape.is_none() && link == NONE {
                return Err(format!("{cell:?} is kept without a body"));
            }
            if self.shape.is_none() && self.find(cell.power, cell.at) != Some(small(place)) {
                return Err(format!("{cell:?} is not found by its place"));
            }
            while let Some(here) = self.links.get(link as usize) {
                if here.cell as usize != place || here.prev != before || seen > self.links.len() {
                    return Err(format!("the list of {cell:?} is broken at {here:?}"));
                }
                seen += 1;
                (before, link) = (link, here.next);
            }
        }
        let (mut free, mut link) = (0, self.free);
        while let Some(here) = self
            .links
            .get(link as usize)
            .filter(|_| free <= self.links.len())
        {
            free += 1;
            link = here.sibling;
        }
        if seen + free != self.links.len() {
            return Err(format!(
                "{seen} links used, {free} free, {} in all",
                self.links.len()
            ));
        }
        if self.shape.is_none() {
            self.table
                .validate(self.cells.len() - self.free_cells.len())?;
        }
        Ok(seen)
    }
}
