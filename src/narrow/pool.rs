//! Reusable objects: the memory of a released one serves the next owner.

/// Reusable objects by index: a released one is handed out again with its memory.
#[derive(Debug, Default)]
pub(super) struct Pool<T> {
    items: Vec<T>,
    free: Vec<u32>,
}

/// No object of a pool.
pub(super) const NONE: u32 = u32::MAX;

impl<T> Pool<T> {
    /// An object, reused or new.
    ///
    /// If none is free, half as many more are made at once: the number in use creeps up for long where work is cut off,
    /// and each new peak would allocate.
    pub(super) fn take(&mut self, make: impl Fn() -> T) -> u32 {
        if self.free.is_empty() {
            let more = self.items.len() / 2 + 1;
            for _ in 0..more {
                let at = u32::try_from(self.items.len()).unwrap_or(NONE);
                self.items.push(make());
                self.free.push(at);
            }
            // Capacity to take every object back without growing later.
            self.free.reserve(self.items.len() - self.free.len());
        }
        self.free.pop().unwrap_or(NONE)
    }

    /// The object at an index, or a newly taken one if there is none yet.
    pub(super) fn get_or_take(&mut self, at: &mut u32) -> Option<&mut T>
    where
        T: Default,
    {
        if *at == NONE {
            *at = self.take(T::default);
        }
        self.get_mut(*at)
    }

    /// Releases an object.
    pub(super) fn give(&mut self, at: &mut u32) {
        if *at != NONE {
            self.free.push(*at);
            *at = NONE;
        }
    }

    /// All objects, including released ones.
    pub(super) fn all(&self) -> &[T] {
        &self.items
    }

    /// Structure check: each object is free or has exactly one owner.
    ///
    /// * `held` - the indices that the owners hold.
    ///
    /// # Errors
    /// The first object that violates this.
    pub(super) fn validate(
        &self,
        what: &str,
        held: impl Iterator<Item = u32>,
    ) -> Result<(), String> {
        let mut seen = vec![false; self.items.len()];
        for at in (self.free.iter().copied()).chain(held.filter(|at| *at != NONE)) {
            match seen.get_mut(at as usize) {
                Some(seen) if !*seen => *seen = true,
                Some(_) => return Err(format!("{at} is held twice, or free and held: {what}")),
                None => return Err(format!("{at} is not there: {what}")),
            }
        }
        match seen.iter().position(|seen| !seen) {
            Some(at) => Err(format!("{at} is neither free nor held: {what}")),
            None => Ok(()),
        }
    }

    pub(super) fn get(&self, at: u32) -> Option<&T> {
        self.items.get(at as usize)
    }

    pub(super) fn get_mut(&mut self, at: u32) -> Option<&mut T> {
        self.items.get_mut(at as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_broken_in_a_pool_is_found() {
        let mut pool: Pool<u8> = Pool::default();
        let mut all: Vec<u32> = (0..7).map(|_| pool.take(|| 0)).collect();
        pool.give(&mut all[3]);
        let why = |pool: &Pool<u8>, held: &[u32]| {
            let held = held.iter().copied();
            pool.validate("bytes", held).err().unwrap_or_default()
        };
        assert_eq!(why(&pool, &all), "");
        assert!(why(&pool, &all[1..]).contains("neither free nor held: bytes"));
        assert!(why(&pool, &[&all[..], &all[..1]].concat()).contains("held twice"));
        assert!(why(&pool, &[&all[..], &[99]].concat()).contains("99 is not there"));
        pool.free.push(all[0]);
        assert!(why(&pool, &all).contains("free and held"));
    }
}
