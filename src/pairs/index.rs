//! Where what has a key stands: an open table from keys to places, so that a lookup does not walk lists.
//!
//! In: a hash of the key, and what tells the key or the hash at a place. The table holds places only, four bytes each;
//! the keys are read from where they stand. For pairs: a body of a dense scene has tens of them, and there the walks
//! took 71 % of a tick of the broad phase. Fixed hash, never iterated: nothing depends on its order.
//!
//! Linear probing with deletion by shifting back (Knuth, TAOCP 3, section 6.4, algorithm R).

/// No place.
const NONE: u32 = u32::MAX;
/// Least size of the table.
const LEAST: usize = 16;

/// The table.
#[derive(Clone, Debug, Default)]
pub(crate) struct Index {
    table: Vec<u32>,
    len: usize,
}

impl Index {
    /// Empties it, keeps the memory.
    pub(crate) fn clear(&mut self) {
        self.table.fill(NONE);
        self.len = 0;
    }

    /// The place of a key.
    ///
    /// * `is_it` - whether the key at a place that is in the table is the one.
    #[inline]
    pub(crate) fn find(&self, hash: u64, is_it: impl Fn(u32) -> bool) -> Option<u32> {
        if self.table.is_empty() {
            return None;
        }
        let mut at = self.home(hash);
        loop {
            let place = self.table[at];
            if place == NONE {
                return None;
            }
            if is_it(place) {
                return Some(place);
            }
            at = (at + 1) & (self.table.len() - 1);
        }
    }

    /// Notes the place of a key that is not in the table.
    ///
    /// * `places` - so many there is room for in what holds the keys: the table grows when that does, at no other time.
    /// * `hash_of` - the hash of the key at a place that is in the table.
    pub(crate) fn insert(
        &mut self,
        hash: u64,
        place: u32,
        places: usize,
        hash_of: impl Fn(u32) -> u64,
    ) {
        // At most half full: runs stay short.
        if 2 * (self.len + 1) > self.table.len() {
            let size = (2 * places.max(self.len + 1))
                .next_power_of_two()
                .max(LEAST);
            let old = std::mem::replace(&mut self.table, vec![NONE; size]);
            for place in old.into_iter().filter(|place| *place != NONE) {
                self.put(hash_of(place), place);
            }
        }
        self.put(hash, place);
        self.len += 1;
    }

    /// Takes out a key that is in the table.
    ///
    /// * `place` - where it stands.
    pub(crate) fn remove(&mut self, hash: u64, place: u32, hash_of: impl Fn(u32) -> u64) {
        if self.table.is_empty() {
            return;
        }
        let last = self.table.len() - 1;
        let mut hole = self.home(hash);
        while self.table[hole] != place {
            if self.table[hole] == NONE {
                debug_assert!(false, "only what is in the table is taken out");
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
            let home = self.home(hash_of(place));
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
    fn put(&mut self, hash: u64, place: u32) {
        let mut at = self.home(hash);
        while self.table[at] != NONE {
            at = (at + 1) & (self.table.len() - 1);
        }
        self.table[at] = place;
    }

    /// Where a key is looked for first: the upper bits of a product with 2^64 over the golden ratio.
    #[inline]
    fn home(&self, hash: u64) -> usize {
        let bits = self.table.len().trailing_zeros();
        let product = hash.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        // Both halves count: keys are made of small numbers, so the product's middle would be poor.
        let mixed = (product ^ (product >> 32)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        usize::try_from(mixed >> (u64::BITS - bits)).unwrap_or(0)
    }

    /// Checks that the table knows so many keys.
    pub(crate) fn validate(&self, len: usize) -> Result<(), String> {
        let used = self.table.iter().filter(|place| **place != NONE).count();
        if used == len && self.len == len {
            return Ok(());
        }
        Err(format!("the index holds {used} places of {len}"))
    }
}
