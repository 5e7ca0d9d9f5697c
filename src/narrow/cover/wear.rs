//! When to discard a cover and start over: entries only ever split, and expired ones are retested one by one.

use super::{Cover, Entries};

/// A cover starts over when it has split into this many times its fresh size, plus [`STALE_MORE`].
const STALE_TIMES: usize = 3;
const STALE_MORE: usize = 128;
/// A cover starts over when its expired groups, times this, exceed the steps that a fresh start took. Measured on
/// meshes at 0.5 % of the diameter a tick: 2,000 units instead of 2,130 (2), 2,270 (1) and 2,230 (8); at 2 % 4,070
/// instead of 4,110; at 0.1 % no difference (`benches/time_critical`).
const WORN_TIMES: usize = 3;
/// Path length, in sizes of the two, after which expiries are measured from zero again: few digits are left of them.
const PATH_MAX: f64 = 64.0;
/// Beyond this share of the smaller one's radius between two poses, few certificates would survive.
const LEAP: f64 = 0.1;

/// What was counted since the last fresh start.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::narrow) struct Wear {
    /// Entries when the pair was first settled, 0: not yet; and the steps until then.
    fresh_len: usize,
    fresh_steps: usize,
    steps: usize,
}

impl Wear {
    /// Counts a step of work.
    pub(in crate::narrow) fn note_step(&mut self) {
        self.steps += 1;
    }

    /// The pair is settled: the first time after a fresh start records the cost of a fresh start.
    pub(in crate::narrow) fn note_settled(&mut self, cover: &Cover) {
        if self.fresh_len == 0 {
            (self.fresh_len, self.fresh_steps) = (cover.len(), self.steps);
        }
    }

    /// Whether starting over from the roots is cheaper at the new pose: large boxes prove more than many small ones.
    ///
    /// * `radii_m` - of the two.
    pub(in crate::narrow) fn is_worn_out(
        &self,
        cover: &Cover,
        entries: &Entries,
        radii_m: [f64; 2],
    ) -> bool {
        let (drift, [a, b]) = (&cover.drift, radii_m);
        // One of the two may be unbounded.
        let size_m = if (a + b).is_finite() { a + b } else { a.min(b) };
        let settled = self.fresh_len > 0;
        cover.is_lost()
            || drift.path_m > PATH_MAX * size_m
            || drift.last_m > LEAP * a.min(b)
            || settled && cover.len() > STALE_TIMES * self.fresh_len + STALE_MORE
            || settled && cover.has_more_expired_than(entries, self.fresh_steps / WORN_TIMES)
    }
}

impl Cover {
    /// Whether more than `most` groups are no longer proved apart.
    ///
    /// Cost: one look at each expired group and at the two below it, up to `most`: few of 100,000 expire in a tick.
    fn has_more_expired_than(&self, entries: &Entries, most: usize) -> bool {
        let heap = entries.groups.all(&self.proved.heap);
        let (mut at, mut count) = (0, 0);
        loop {
            if (heap.get(at)).is_some_and(|group| self.drift.left_m(group.expiry_m) <= 0.0) {
                count += 1;
                if count > most {
                    return true;
                }
                at = 2 * at + 1;
                continue;
            }
            // Everything below it expires later: go on with its sibling, or the sibling of an ancestor.
            while at % 2 == 0 {
                if at == 0 {
                    return false;
                }
                at = at / 2 - 1;
            }
            at += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::Random;
    use crate::narrow::cover::Group;
    use crate::shape::BoxId;

    #[test]
    fn a_long_way_wears_out_what_is_proved_also_beside_what_has_no_end() {
        let (mut cover, entries, wear) =
            (Cover::default(), Entries::with_room(0, 0), Wear::default());
        let radii_m = [f64::INFINITY, 1.0];
        assert!(!wear.is_worn_out(&cover, &entries, radii_m));
        cover.drift.path_m = PATH_MAX + 1.0;
        assert!(wear.is_worn_out(&cover, &entries, radii_m));
    }
    #[test]
    fn expired_groups_are_counted_without_a_look_at_those_that_hold() {
        let mut random = Random::new(3);
        for len in [0, 1, 2, 3, 100, 1000] {
            let (mut cover, mut entries) = (Cover::default(), Entries::with_room(1 << 16, 0));
            for place in 0..len {
                let mut group = Group::of_leaves(BoxId(place), BoxId(place));
                group.expiry_m = random.unit();
                assert!(cover.proved.push(&mut entries.groups, group));
                if random.unit() < 0.3 {
                    cover.proved.pop(&mut entries.groups);
                }
            }
            for path_m in [0.0, 0.01, 0.5, 2.0] {
                cover.drift.path_m = path_m;
                let groups = entries.groups.all(&cover.proved.heap).iter();
                let gone = groups.filter(|group| cover.drift.left_m(group.expiry_m) <= 0.0);
                let count = gone.count();
                assert!(!cover.has_more_expired_than(&entries, count));
                assert!(count == 0 || cover.has_more_expired_than(&entries, count - 1));
            }
        }
    }
}
