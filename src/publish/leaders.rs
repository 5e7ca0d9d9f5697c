//! The greatest of a changing set.
//!
//! In: elements that come and go. Out: the greatest of the set. Some of the greatest are kept, with a floor that no
//! other element exceeds. While any kept one is left, the greatest is among them; only when all are gone must the whole
//! set be scanned.

use super::events::Ids;

/// Number of elements kept after the lower half of twice as many was dropped.
const KEPT: usize = 32;

/// An element of the set.
pub(super) trait Standing: Copy + Default {
    /// Returns whether it is greater than another.
    fn is_above(&self, other: &Self) -> bool;

    /// The pair that it belongs to.
    fn ids(&self) -> Ids;
}

/// Some of the greatest.
#[derive(Clone, Debug)]
pub(super) struct Leaders<T> {
    /// Unordered; none is below the floor.
    kept: Vec<T>,
    /// No other element is above it; `None`: all are kept.
    floor: Option<T>,
}

impl<T> Default for Leaders<T> {
    fn default() -> Self {
        Self {
            kept: Vec::new(),
            floor: None,
        }
    }
}

impl<T: Standing> Leaders<T> {
    /// Removes all.
    pub(super) fn clear(&mut self) {
        self.kept.clear();
        self.floor = None;
    }

    /// Adds one.
    pub(super) fn take(&mut self, one: T) {
        let above = match &self.floor {
            None => true,
            // Some equal ones are kept too: otherwise the set would be scanned for each.
            Some(floor) => one.is_above(floor) || (self.kept.len() < KEPT && !floor.is_above(&one)),
        };
        if !above {
            return;
        }
        if self.kept.len() == 2 * KEPT {
            self.raise();
            // It may be below the new floor.
            self.take(one);
            return;
        }
        self.kept.reserve_exact(2 * KEPT - self.kept.len());
        self.kept.push(one);
    }

    /// Drops the lower half.
    fn raise(&mut self) {
        let greatest_first = |x: &T, y: &T| y.is_above(x).cmp(&x.is_above(y));
        let (_, floor, _) = self.kept.select_nth_unstable_by(KEPT, greatest_first);
        self.floor = Some(*floor);
        self.kept.truncate(KEPT);
    }

    /// Removes one that was added.
    pub(super) fn leave(&mut self, one: &T) {
        if self.floor.as_ref().is_some_and(|floor| floor.is_above(one)) {
            return;
        }
        if let Some(at) = self.kept.iter().position(|kept| kept.ids() == one.ids()) {
            self.kept.swap_remove(at);
        }
    }

    /// Returns whether the greatest is unknown: all must be added again, after [`Leaders::clear`].
    pub(super) fn are_gone(&self) -> bool {
        self.kept.is_empty() && self.floor.is_some()
    }

    /// The greatest; the default if there is none.
    pub(super) fn first(&self) -> T {
        let mut first = None;
        for one in &self.kept {
            if first.is_none_or(|first| one.is_above(first)) {
                first = Some(one);
            }
        }
        first.copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small numbers by chance"
    )]

    use super::*;
    use crate::builtin::Random;
    use crate::ids::BodyId;

    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    struct Number {
        value: u64,
        ids: Ids,
    }

    impl Standing for Number {
        fn is_above(&self, other: &Self) -> bool {
            self.value > other.value
        }

        fn ids(&self) -> Ids {
            self.ids
        }
    }

    #[test]
    fn the_first_is_that_of_all_whoever_comes_and_goes() {
        let mut random = Random::new(5);
        for values in [3.0, 50.0, 1e6] {
            let (mut leaders, mut all) = (Leaders::default(), Vec::<Number>::new());
            let (mut looks, mut id) = (0, 0);
            for step in 0..4000 {
                let leaving = random.unit() < if step / 1000 % 2 == 0 { 0.4 } else { 0.6 };
                if leaving && !all.is_empty() {
                    // Usually one of the greatest.
                    let greatest = (0..all.len()).max_by_key(|at| all[*at].value).unwrap();
                    let any = (random.unit() * all.len() as f64) as usize;
                    let one = all.swap_remove(if random.unit() < 0.7 { greatest } else { any });
                    leaders.leave(&one);
                } else {
                    id += 1;
                    let value = (random.unit() * values) as u64;
                    let ids = (BodyId(id), BodyId(id + 1));
                    all.push(Number { value, ids });
                    leaders.take(Number { value, ids });
                }
                if leaders.are_gone() {
                    looks += 1;
                    leaders.clear();
                    all.iter().for_each(|one| leaders.take(*one));
                }
                let wanted = all.iter().map(|one| one.value).max().unwrap_or_default();
                assert_eq!(leaders.first().value, wanted, "step {step}");
            }
            assert!(looks < 150, "{looks} times all were gone through");
        }
    }
}
