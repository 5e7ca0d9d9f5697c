//! The first of many by some order, kept up as they come and go.
//!
//! In: what comes and goes. Out: the greatest of what is there. Some of the greatest are kept, and a floor that none of
//! the others is above: while any of them is left the greatest of all is among them, and only when all have gone must
//! everything be gone through again.

use super::events::Ids;

/// So many are kept after what is least of twice as many was let go.
const KEPT: usize = 32;

/// What may be first.
pub(super) trait Standing: Copy + Default {
    /// Whether it is greater than another.
    fn is_above(&self, other: &Self) -> bool;

    /// Whose it is.
    fn ids(&self) -> Ids;
}

/// Some of the greatest.
#[derive(Clone, Debug)]
pub(super) struct Leaders<T> {
    /// In no order; none is below the floor.
    kept: Vec<T>,
    /// Nobody who is not kept is above it; `None`: all are kept.
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
    /// Nobody is there.
    pub(super) fn clear(&mut self) {
        self.kept.clear();
        self.floor = None;
    }

    /// One comes.
    pub(super) fn take(&mut self, one: T) {
        let above = match &self.floor {
            None => true,
            // Of many that are equal some are kept too: else all would be gone through for each.
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

    /// Lets the lower half go.
    fn raise(&mut self) {
        let greatest_first = |x: &T, y: &T| y.is_above(x).cmp(&x.is_above(y));
        let (_, floor, _) = self.kept.select_nth_unstable_by(KEPT, greatest_first);
        self.floor = Some(*floor);
        self.kept.truncate(KEPT);
    }

    /// One that came goes.
    pub(super) fn leave(&mut self, one: &T) {
        if self.floor.as_ref().is_some_and(|floor| floor.is_above(one)) {
            return;
        }
        if let Some(at) = self.kept.iter().position(|kept| kept.ids() == one.ids()) {
            self.kept.swap_remove(at);
        }
    }

    /// Whether the greatest is not known: everything is to be taken again, after [`Leaders::clear`].
    pub(super) fn are_gone(&self) -> bool {
        self.kept.is_empty() && self.floor.is_some()
    }

    /// The greatest; what is default where nobody is there.
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
                    // Mostly one of the greatest.
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
