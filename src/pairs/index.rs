//! Where what has a key stands: an open table from keys to places, so that a lookup does not walk lists.
//!
//! In: a hash of the key, and what tells the key at a place. The table holds a place and half of its mixed hash, eight
//! bytes in all; a key is read from where it stands only where that half fits: mostly once, and then it is the one.
//! For pairs: a body of a dense scene has tens of them, and there walks through lists took 71 % of a tick of the broad
//! phase. Fixed hash, never iterated: nothing depends on its order.
//!
//! How: eight entries share a bucket, a line of memory, and are compared at once. What finds its bucket full goes to
//! the next one with room, and its own counts it as away; where none is, a lookup ends in the bucket it began in, and
//! what is taken out leaves a gap that nothing has to fill. With linear probing one entry at a time the ends of runs,
//! and what shifts back into a gap, were branches that nobody guesses: a third of the time.
//!
//! The table is of any size, not only of powers of two, which would be up to twice what is needed: every place of it is
//! touched, whatever it holds.

use crate::ids::small;
use crate::simd::boxes::prefetch;
use crate::simd::words::{WORDS, same};

/// No place.
const NONE: u32 = u32::MAX;
/// Of so many places of the table so many are taken at most: then one key in some thirty is away.
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

    /// The lane of the key with this hash; and whether there is one.
    #[inline(always)]
    fn lane_of(&self, mixed: u32, is_it: impl Fn(u32) -> bool) -> Option<usize> {
        let mut lanes = same(&self.mixed, mixed);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % WORDS;
            // A lane that was given up keeps its hash.
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
    /// By bucket: how many keys that belong there stand elsewhere.
    away: Vec<u32>,
    len: usize,
}

impl Index {
    /// Empties it, keeps the memory.
    pub(crate) fn clear(&mut self) {
        self.buckets.fill(Bucket::EMPTY);
        self.away.fill(0);
        self.len = 0;
    }

    /// The place of a key.
    ///
    /// * `is_it` - whether the key at a place that is in the table is the one.
    #[inline]
    pub(crate) fn find(&self, hash: u64, is_it: impl Fn(u32) -> bool) -> Option<u32> {
        let at = self.position(mix(hash), is_it)?;
        Some(self.buckets[at / WORDS].places[at % WORDS])
    }

    /// Where in the table a key stands.
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

    /// Where a key stands that may be away: those that are, are met one after the other.
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

    /// Asks for where a key is looked for first to be brought near.
    #[inline]
    pub(crate) fn prefetch(&self, hash: u64) {
        let home = self.home(mix(hash));
        if let (Some(bucket), Some(away)) = (self.buckets.get(home), self.away.get(home)) {
            prefetch(bucket);
            prefetch(away);
        }
    }

    /// The place of what is likely the key, without asking it.
    #[inline]
    pub(crate) fn guess(&self, hash: u64) -> Option<u32> {
        let mixed = mix(hash);
        let bucket = self.buckets.get(self.home(mixed))?;
        let lane = bucket.lane_of(mixed, |_| true)?;
        Some(bucket.places[lane])
    }

    /// Notes the place of a key that is not in the table.
    ///
    /// * `places` - as for [`Index::grow`].
    pub(crate) fn insert(&mut self, hash: u64, place: u32, places: usize) {
        self.grow(places);
        let mixed = mix(hash);
        let at = self.room(self.home(mixed));
        self.put(at, mixed, place);
        self.len += 1;
    }

    /// Room for one key more.
    ///
    /// * `places` - so many there is room for in what holds the keys: the table grows when that does, at no other time.
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

    /// Where in the table a key belongs that is not in it, until the table next changes; `None` where the key is in it,
    /// or the table has no room at all.
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

    /// Notes the place of a key where [`Index::vacancy`] said.
    #[inline]
    pub(crate) fn fill(&mut self, at: usize, hash: u64, place: u32) {
        self.put(at, mix(hash), place);
        self.len += 1;
    }

    /// Takes out a key that is in the table.
    ///
    /// * `place` - where it stands.
    pub(crate) fn remove(&mut self, hash: u64, place: u32) {
        let gone = self.take(hash, |at| at == place);
        debug_assert!(gone.is_some(), "only what is in the table is taken out");
    }

    /// Takes a key out and returns its place; `None` where it is not in the table.
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

    /// The first lane without an entry from a bucket on: the table is never full.
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

    /// The bucket behind one, round the end.
    #[inline]
    fn after(&self, at: usize) -> usize {
        if at + 1 < self.buckets.len() {
            at + 1
        } else {
            0
        }
    }

    /// Where a key is looked for first: as far along the table as its mixed hash is among all. There are never 2^32
    /// buckets.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "below the table's length")]
    fn home(&self, mixed: u32) -> usize {
        ((u64::from(mixed) * self.buckets.len() as u64) >> u32::BITS) as usize
    }

    /// Checks that the table knows so many keys, and where each stands that is away.
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
    // Both halves count: keys are made of small numbers, so the product's middle would be poor.
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
        // Keys by place; few of them have one hash, as in a table of cells that some coordinates are mixed to.
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
                // Grows, shrinks, and again.
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
