//! Hash index: an open-addressing table from keys to places, so that a lookup does not walk lists.
//!
//! In: a hash of the key, and a test of the key at a place. The table holds a place and half of its mixed hash, eight
//! bytes in all; a key is read from its place only if that half matches: mostly once, and then it is the right one.
//! Needed for pairs: a body of a dense scene has tens of them, and walking lists there took 71 % of a tick of the broad
//! phase. Fixed hash, never iterated: nothing depends on its order.
//!
//! How: eight entries share a bucket, one cache line, and are compared at once. A key whose bucket is full goes to the
//! next one with room, and its own bucket counts it as away; without such keys a lookup ends in the bucket it began in,
//! and a removal leaves a gap that need not be filled. Linear probing of single entries had unpredictable branches at
//! the ends of runs and when shifting entries back into a gap: a third of the time.
//!
//! The table may have any size, not only powers of two, which would be up to twice what is needed: every place of it is
//! touched, whatever it holds.

use crate::ids::small;
use crate::simd::boxes::prefetch;
use crate::simd::words::{WORDS, same};

/// No place.
const NONE: u32 = u32::MAX;
/// Load limit: at most `TAKEN` of `OF` places are used; then about one key in thirty is outside its own bucket.
const OF: usize = 3;
const TAKEN: usize = 2;

/// Eight entries: a place each, and the mixed hash of its key.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Bucket {
    mixed: [u32; WORDS],
    places: [u32; WORDS],
}

impl Bucket {
    const EMPTY: Self = Self {
        mixed: [0; WORDS],
        places: [NONE; WORDS],
    };

    /// The lane of the key with this hash, if there is one.
    #[inline(always)]
    fn lane_of(&self, mixed: u32, is_it: impl Fn(u32) -> bool) -> Option<usize> {
        let mut lanes = same(&self.mixed, mixed);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % WORDS;
            // A freed lane keeps its hash.
            if self.places[lane] != NONE && is_it(self.places[lane]) {
                return Some(lane);
            }
            lanes &= lanes - 1;
        }
        None
    }

    /// The first lane without an entry.
    #[inline(always)]
    fn free_lane(&self) -> Option<usize> {
        let free = same(&self.places, NONE);
        (free != 0).then_some(free.trailing_zeros() as usize)
    }
}

/// The table.
#[derive(Clone, Debug, Default)]
pub(crate) struct Index {
    buckets: Vec<Bucket>,
    /// By bucket: number of keys that belong there but are stored elsewhere.
    away: Vec<u32>,
    len: usize,
}

impl Index {
    /// Clears it, keeps the memory.
    pub(crate) fn clear(&mut self) {
        self.buckets.fill(Bucket::EMPTY);
        self.away.fill(0);
        self.len = 0;
    }

    /// Looks up the place of a key.
    ///
    /// * `is_it` - whether the key at a place is the wanted one.
    #[inline]
    pub(crate) fn find(&self, hash: u64, is_it: impl Fn(u32) -> bool) -> Option<u32> {
        let at = self.position(mix(hash), is_it)?;
        Some(self.buckets[at / WORDS].places[at % WORDS])
    }

    /// Position of a key in the table.
    #[inline]
    fn position(&self, mixed: u32, is_it: impl Fn(u32) -> bool) -> Option<usize> {
        if self.buckets.is_empty() {
            return None;
        }
        let home = self.home(mixed);
        match self.buckets[home].lane_of(mixed, &is_it) {
            Some(lane) => Some(home * WORDS + lane),
            None if self.away[home] == 0 => None,
            None => self.position_away(home, mixed, is_it),
        }
    }

    /// Position of a key that may be away: scans buckets until all away keys were met.
    #[cold]
    fn position_away(&self, home: usize, mixed: u32, is_it: impl Fn(u32) -> bool) -> Option<usize> {
        let (mut at, mut left) = (home, self.away[home]);
        while left > 0 {
            at = self.after(at);
            let bucket = &self.buckets[at];
            if let Some(lane) = bucket.lane_of(mixed, &is_it) {
                return Some(at * WORDS + lane);
            }
            let used = (bucket.places.iter().zip(&bucket.mixed)).filter(|(p, _)| **p != NONE);
            let theirs = used.filter(|(_, mixed)| self.home(**mixed) == home).count();
            left = left.saturating_sub(small(theirs));
            if at == home {
                debug_assert!(false, "who is away stands somewhere");
                break;
            }
        }
        None
    }

    /// Prefetches the first bucket of a lookup.
    #[inline]
    pub(crate) fn prefetch(&self, hash: u64) {
        let home = self.home(mix(hash));
        if let (Some(bucket), Some(away)) = (self.buckets.get(home), self.away.get(home)) {
            prefetch(bucket);
            prefetch(away);
        }
    }

    /// The place that probably has the key, without comparing keys.
    #[inline]
    pub(crate) fn guess(&self, hash: u64) -> Option<u32> {
        let mixed = mix(hash);
        let bucket = self.buckets.get(self.home(mixed))?;
        let lane = bucket.lane_of(mixed, |_| true)?;
        Some(bucket.places[lane])
    }

    /// Inserts the place of a key that is not in the table.
    ///
    /// * `places` - as for [`Index::grow`].
    pub(crate) fn insert(&mut self, hash: u64, place: u32, places: usize) {
        self.grow(places);
        let mixed = mix(hash);
        let at = self.room(self.home(mixed));
        self.put(at, mixed, place);
        self.len += 1;
    }

    /// Makes room for one more key.
    ///
    /// * `places` - capacity of what holds the keys: the table grows with it, at no other time.
    #[inline]
    pub(crate) fn grow(&mut self, places: usize) {
        if OF * (self.len + 1) > TAKEN * WORDS * self.buckets.len() {
            let size = (OF * places.max(self.len + 1)).div_ceil(TAKEN * WORDS);
            let old = std::mem::replace(&mut self.buckets, vec![Bucket::EMPTY; size]);
            self.away = vec![0; size];
            for bucket in old {
                let used = bucket.mixed.into_iter().zip(bucket.places);
                for (mixed, place) in used.filter(|(_, place)| *place != NONE) {
                    let at = self.room(self.home(mixed));
                    self.put(at, mixed, place);
                }
            }
        }
    }

    /// Position at which to insert a key that is not in the table, valid until the table changes; `None` if the key is
    /// in it, or the table has no room at all.
    ///
    /// * `is_it` - as for [`Index::find`].
    #[inline]
    pub(crate) fn vacancy(&self, hash: u64, is_it: impl Fn(u32) -> bool) -> Option<usize> {
        let mixed = mix(hash);
        if self.buckets.is_empty() || self.position(mixed, is_it).is_some() {
            return None;
        }
        Some(self.room(self.home(mixed)))
    }

    /// Inserts a key at the position that [`Index::vacancy`] returned.
    #[inline]
    pub(crate) fn fill(&mut self, at: usize, hash: u64, place: u32) {
        self.put(at, mix(hash), place);
        self.len += 1;
    }

    /// Removes a key that is in the table.
    ///
    /// * `place` - its place.
    pub(crate) fn remove(&mut self, hash: u64, place: u32) {
        let gone = self.take(hash, |at| at == place);
        debug_assert!(gone.is_some(), "only what is in the table is taken out");
    }

    /// Removes a key and returns its place; `None` if it is not in the table.
    ///
    /// * `is_it` - as for [`Index::find`].
    #[inline]
    pub(crate) fn take(&mut self, hash: u64, is_it: impl Fn(u32) -> bool) -> Option<u32> {
        let mixed = mix(hash);
        let at = self.position(mixed, is_it)?;
        let home = self.home(mixed);
        self.away[home] -= u32::from(at / WORDS != home);
        self.len -= 1;
        let place = &mut self.buckets[at / WORDS].places[at % WORDS];
        Some(std::mem::replace(place, NONE))
    }

    /// The first free lane from a bucket on: the table is never full.
    #[inline]
    fn room(&self, home: usize) -> usize {
        let mut at = home;
        loop {
            if let Some(lane) = self.buckets[at].free_lane() {
                return at * WORDS + lane;
            }
            at = self.after(at);
        }
    }

    /// Writes an entry to a free lane.
    #[inline]
    fn put(&mut self, at: usize, mixed: u32, place: u32) {
        let (bucket, lane) = (at / WORDS, at % WORDS);
        let home = self.home(mixed);
        self.away[home] += u32::from(bucket != home);
        let bucket = &mut self.buckets[bucket];
        debug_assert_eq!(bucket.places[lane], NONE);
        (bucket.mixed[lane], bucket.places[lane]) = (mixed, place);
    }

    /// The next bucket, wrapping around at the end.
    #[inline]
    fn after(&self, at: usize) -> usize {
        if at + 1 < self.buckets.len() {
            at + 1
        } else {
            0
        }
    }

    /// The bucket where a lookup begins: as far along the table as the mixed hash is in its range. There are never 2^32
    /// buckets.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "below the table's length")]
    fn home(&self, mixed: u32) -> usize {
        ((u64::from(mixed) * self.buckets.len() as u64) >> u32::BITS) as usize
    }

    /// Checks that the table holds `len` keys, and the counts of keys that are away.
    pub(crate) fn validate(&self, len: usize) -> Result<(), String> {
        let (mut used, mut away) = (0, vec![0; self.away.len()]);
        for (at, bucket) in self.buckets.iter().enumerate() {
            for (mixed, place) in bucket.mixed.iter().zip(bucket.places) {
                let home = self.home(*mixed);
                used += usize::from(place != NONE);
                away[home] += u32::from(place != NONE && home != at);
            }
        }
        if used != len || self.len != len {
            return Err(format!("the index holds {used} places of {len}"));
        }
        if away != self.away {
            return Err("the index does not know who is away".into());
        }
        Ok(())
    }
}

/// The upper half of a product with 2^64 over the golden ratio.
#[inline]
fn mix(hash: u64) -> u32 {
    let product = hash.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    // Uses both halves: keys are made of small numbers, so the product's middle would be poor.
    let mixed = (product ^ (product >> 32)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    u32::try_from(mixed >> 32).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::Random;
    use std::collections::BTreeMap;

    #[test]
    fn it_answers_as_a_plain_map_does_whatever_comes_and_goes() {
        let mut random = Random::new(1);
        // Keys by place; some cases have many keys with one hash, as in a table of cells whose coordinates collide.
        let cases = [
            (1 << 40, 1 << 41, 20_000),
            (3000, 6000, 20_000),
            (5, 400, 3000),
        ];
        for (hashes, kinds, rounds) in cases {
            let (mut index, mut places) = (Index::default(), BTreeMap::new());
            let mut keys: Vec<Option<u64>> = Vec::new();
            let mut was_away = false;
            for round in 0..rounds {
                // Grows, shrinks, and repeats.
                let grows = round / 1500 % 2 == 0;
                let key = random.bits() % kinds;
                let hash = key % hashes;
                let is_it = |place: u32| keys[place as usize] == Some(key);
                assert_eq!(index.find(hash, is_it), places.get(&key).copied());
                if let Some(place) = places.remove(&key) {
                    if round % 2 == 0 {
                        index.remove(hash, place);
                    } else {
                        assert_eq!(index.take(hash, is_it), Some(place));
                    }
                    keys[place as usize] = None;
                } else if grows || round % 4 == 0 {
                    let free = keys.iter().position(Option::is_none);
                    let place = small(free.unwrap_or(keys.len()));
                    index.grow(keys.len() + 1);
                    let at = index.vacancy(hash, is_it).unwrap();
                    index.fill(at, hash, place);
                    places.insert(key, place);
                    keys.resize(keys.len().max(place as usize + 1), None);
                    keys[place as usize] = Some(key);
                } else if let Some((key, place)) = places.pop_last() {
                    index.remove(key % hashes, place);
                    keys[place as usize] = None;
                }
                if round % 100 == 0 {
                    index.validate(places.len()).unwrap();
                    was_away |= index.away.iter().any(|away| *away > 0);
                }
            }
            assert!(was_away, "{hashes} hashes");
            if let Some((key, place)) = places.first_key_value() {
                let is_it = |at: u32| at == *place;
                assert_eq!(index.vacancy(key % hashes, is_it), None, "it is there");
            }
            index.clear();
            index.validate(0).unwrap();
            index.insert(7, 3, 1);
            assert_eq!(index.find(7, |place| place == 3), Some(3));
            assert_eq!((index.guess(7), Index::default().guess(7)), (Some(3), None));
            Index::default().prefetch(7);
        }
    }
}
