//! Where what has a key stands: an open table from keys to places, so that a lookup does not walk lists.
//!
//! In: a hash of the key, and what tells the key at a place. The table holds a place and half of its mixed hash, eight
//! bytes in all; a key is read from where it stands only where that half fits: mostly once, and then it is the one.
//! For pairs: a body of a dense scene has tens of them, and there walks through lists took 71 % of a tick of the broad
//! phase. Fixed hash, never iterated: nothing depends on its order.
//!
//! The table is of any size, not only of powers of two, which would be up to twice what is needed: every place of it is
//! touched, whatever it holds.
//!
//! Linear probing with deletion by shifting back (Knuth, TAOCP 3, section 6.4, algorithm R).

use crate::simd::boxes::prefetch;

/// No place.
const NONE: u32 = u32::MAX;
/// An entry without a place.
const EMPTY: Entry = Entry {
    mixed: 0,
    place: NONE,
};
/// Least size of the table.
const LEAST: usize = 16;
/// Of so many places of the table so many are taken at most: runs then are of some places, which lie in a line of
/// memory or two.
const OF: usize = 3;
const TAKEN: usize = 2;

/// A place, and the upper half of the mixed hash of its key.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(8))]
struct Entry {
    mixed: u32,
    place: u32,
}

/// The table.
#[derive(Clone, Debug, Default)]
pub(crate) struct Index {
    table: Vec<Entry>,
    len: usize,
}

impl Index {
    /// Empties it, keeps the memory.
    pub(crate) fn clear(&mut self) {
        self.table.fill(EMPTY);
        self.len = 0;
    }

    /// The place of a key.
    ///
    /// * `is_it` - whether the key at a place that is in the table is the one.
    #[inline]
    pub(crate) fn find(&self, hash: u64, is_it: impl Fn(u32) -> bool) -> Option<u32> {
        let at = self.position(hash, is_it)?;
        Some(self.table[at].place)
    }

    /// Where in the table a key stands.
    #[inline]
    fn position(&self, hash: u64, is_it: impl Fn(u32) -> bool) -> Option<usize> {
        if self.table.is_empty() {
            return None;
        }
        self.search(mix(hash), is_it).ok()
    }

    /// Where in the table a key stands, or else the first free place on the way.
    #[inline]
    fn search(&self, mixed: u32, is_it: impl Fn(u32) -> bool) -> Result<usize, usize> {
        let mut at = self.home(mixed);
        loop {
            let entry = self.table[at];
            if entry.place == NONE {
                return Err(at);
            }
            if entry.mixed == mixed && is_it(entry.place) {
                return Ok(at);
            }
            at = self.after(at);
        }
    }

    /// Asks for where a key is looked for first to be brought near.
    #[inline]
    pub(crate) fn prefetch(&self, hash: u64) {
        if let Some(entry) = self.table.get(self.home(mix(hash))) {
            prefetch(entry);
        }
    }

    /// What stands where a key is looked for first: its place, or another's.
    #[inline]
    pub(crate) fn guess(&self, hash: u64) -> Option<u32> {
        let entry = self.table.get(self.home(mix(hash)))?;
        (entry.place != NONE).then_some(entry.place)
    }

    /// Notes the place of a key that is not in the table.
    ///
    /// * `places` - as for [`Index::grow`].
    pub(crate) fn insert(&mut self, hash: u64, place: u32, places: usize) {
        self.grow(places);
        self.put(Entry {
            mixed: mix(hash),
            place,
        });
        self.len += 1;
    }

    /// Room for one key more.
    ///
    /// * `places` - so many there is room for in what holds the keys: the table grows when that does, at no other time.
    #[inline]
    pub(crate) fn grow(&mut self, places: usize) {
        if OF * (self.len + 1) > TAKEN * self.table.len() {
            let size = (OF * places.max(self.len + 1)).div_ceil(TAKEN).max(LEAST);
            let old = std::mem::replace(&mut self.table, vec![EMPTY; size]);
            for entry in old.into_iter().filter(|entry| entry.place != NONE) {
                self.put(entry);
            }
        }
    }

    /// Where in the table a key belongs that is not in it, until the table next changes; `None` where the key is in it,
    /// or the table has no room at all.
    ///
    /// * `is_it` - as for [`Index::find`].
    #[inline]
    pub(crate) fn vacancy(&self, hash: u64, is_it: impl Fn(u32) -> bool) -> Option<usize> {
        if self.table.is_empty() {
            return None;
        }
        self.search(mix(hash), is_it).err()
    }

    /// Notes the place of a key where [`Index::vacancy`] said.
    #[inline]
    pub(crate) fn fill(&mut self, at: usize, hash: u64, place: u32) {
        debug_assert_eq!(self.table[at].place, NONE);
        self.table[at] = Entry {
            mixed: mix(hash),
            place,
        };
        self.len += 1;
    }

    /// Takes out a key that is in the table.
    ///
    /// * `place` - where it stands.
    pub(crate) fn remove(&mut self, hash: u64, place: u32) {
        if self.table.is_empty() {
            return;
        }
        let mut at = self.home(mix(hash));
        while self.table[at].place != place {
            if self.table[at].place == NONE {
                debug_assert!(false, "only what is in the table is taken out");
                return;
            }
            at = self.after(at);
        }
        self.close(at);
    }

    /// Takes a key out and returns its place; `None` where it is not in the table.
    ///
    /// * `is_it` - as for [`Index::find`].
    #[inline]
    pub(crate) fn take(&mut self, hash: u64, is_it: impl Fn(u32) -> bool) -> Option<u32> {
        let at = self.position(hash, is_it)?;
        let place = self.table[at].place;
        self.close(at);
        Some(place)
    }

    /// Empties a place of the table: what stands behind it and may not be cut off from its home moves into it.
    #[inline]
    fn close(&mut self, mut hole: usize) {
        let mut at = hole;
        loop {
            at = self.after(at);
            let entry = self.table[at];
            if entry.place == NONE {
                break;
            }
            let home = self.home(entry.mixed);
            if self.way(home, at) >= self.way(hole, at) {
                self.table[hole] = entry;
                hole = at;
            }
        }
        self.table[hole] = EMPTY;
        self.len -= 1;
    }

    /// Writes to the first free place from a key's home on.
    fn put(&mut self, entry: Entry) {
        let mut at = self.home(entry.mixed);
        while self.table[at].place != NONE {
            at = self.after(at);
        }
        self.table[at] = entry;
    }

    /// The place behind one, round the end.
    #[inline]
    fn after(&self, at: usize) -> usize {
        if at + 1 < self.table.len() { at + 1 } else { 0 }
    }

    /// How many places on from one another is, round the end.
    #[inline]
    fn way(&self, from: usize, to: usize) -> usize {
        let round = if to < from { self.table.len() } else { 0 };
        to + round - from
    }

    /// Where a key is looked for first: as far along the table as its mixed hash is among all. There are never 2^32
    /// entries.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "below the table's length")]
    fn home(&self, mixed: u32) -> usize {
        ((u64::from(mixed) * self.table.len() as u64) >> u32::BITS) as usize
    }

    /// Checks that the table knows so many keys.
    pub(crate) fn validate(&self, len: usize) -> Result<(), String> {
        let used = self
            .table
            .iter()
            .filter(|entry| entry.place != NONE)
            .count();
        if used == len && self.len == len {
            return Ok(());
        }
        Err(format!("the index holds {used} places of {len}"))
    }
}

/// The upper half of a product with 2^64 over the golden ratio.
#[inline]
fn mix(hash: u64) -> u32 {
    let product = hash.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    // Both halves count: keys are made of small numbers, so the product's middle would be poor.
    let mixed = (product ^ (product >> 32)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    u32::try_from(mixed >> 32).unwrap_or(0)
}
