//! Where the pair of two bodies stands: an open table from keys to places, so that a lookup does not walk lists.
//!
//! A body of a dense scene has tens of pairs; there the walks took 71 % of a tick of the broad phase. The table holds
//! places only, four bytes each; the keys are read from the set. Fixed hash, never iterated: nothing depends on its order.
//!
//! Linear probing with deletion by shifting back (Knuth, TAOCP 3, section 6.4, algorithm R).

use crate::ids::PairKey;

/// No place.
const NONE: u32 = u32::MAX;
/// Least size of the table.
const LEAST: usize = 16;

/// The table.
#[derive(Clone, Debug, Default)]
pub(super) struct Index {
    table: Vec<u32>,
    len: usize,
}

impl Index {
    /// Empties it, keeps the memory.
    pub(super) fn clear(&mut self) {
        self.table.fill(NONE);
        self.len = 0;
    }

    /// The place of a key.
    ///
    /// * `key_of` - the key at a place that is in the table.
    pub(super) fn find(&self, key: PairKey, key_of: impl Fn(u32) -> PairKey) -> Option<u32> {
        if self.table.is_empty() {
            return None;
        }
        let mut at = self.home(key);
        loop {
            let place = self.table[at];
            if place == NONE {
                return None;
            }
            if key_of(place) == key {
                return Some(place);
            }
            at = (at + 1) & (self.table.len() - 1);
        }
    }

    /// Notes the place of a key that is not in the table.
    ///
    /// * `places` - so many there is room for in the set: the table grows when the set does, at no other time.
    pub(super) fn insert(
        &mut self,
        key: PairKey,
        place: u32,
        places: usize,
        key_of: impl Fn(u32) -> PairKey,
    ) {
        // At most half full: runs stay short.
        if 2 * (self.len + 1) > self.table.len() {
            let size = (2 * places.max(self.len + 1))
                .next_power_of_two()
                .max(LEAST);
            let old = std::mem::replace(&mut self.table, vec![NONE; size]);
            for place in old.into_iter().filter(|place| *place != NONE) {
                self.put(key_of(place), place);
            }
        }
        self.put(key, place);
        self.len += 1;
    }

    /// Takes out a key that is in the table.
    pub(super) fn remove(&mut self, key: PairKey, key_of: impl Fn(u32) -> PairKey) {
        if self.table.is_empty() {
            return;
        }
        let last = self.table.len() - 1;
        let mut hole = self.home(key);
        while self.table[hole] == NONE || key_of(self.table[hole]) != key {
            if self.table[hole] == NONE {
                debug_assert!(false, "only a pair of the set is taken out");
                return;
            }
            hole = (hole + 1) & last;
        }
        // What stands behind the hole and may not be cut off from its home moves into it.
        let mut at = hole;
        loop {
            at = (at + 1) & last;
            let place = self.table[at];
            if place == NONE {
                break;
            }
            let home = self.home(key_of(place));
            let reaches = at.wrapping_sub(home) & last;
            if reaches >= (at.wrapping_sub(hole) & last) {
                self.table[hole] = place;
                hole = at;
            }
        }
        self.table[hole] = NONE;
        self.len -= 1;
    }

    /// Writes to the first free place from a key's home on.
    fn put(&mut self, key: PairKey, place: u32) {
        let mut at = self.home(key);
        while self.table[at] != NONE {
            at = (at + 1) & (self.table.len() - 1);
        }
        self.table[at] = place;
    }

    /// Where a key is looked for first: the upper bits of a product with 2^64 over the golden ratio.
    fn home(&self, key: PairKey) -> usize {
        let bits = self.table.len().trailing_zeros();
        let product = key.bits().wrapping_mul(0x9E37_79B9_7F4A_7C15);
        // Both halves count: slots are small numbers, so the product's middle would be poor.
        let mixed = (product ^ (product >> 32)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        usize::try_from(mixed >> (u64::BITS - bits)).unwrap_or(0)
    }

    /// Checks that the table knows so many keys.
    pub(super) fn validate(&self, len: usize) -> Result<(), String> {
        let used = self.table.iter().filter(|place| **place != NONE).count();
        if used == len && self.len == len {
            return Ok(());
        }
        Err(format!("the index holds {used} pairs of {len}"))
    }
}
