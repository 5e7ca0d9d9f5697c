//! Which bodies may be near the queried ones: pairs of boxes, of which the nearest are kept.
//!
//! In: pairs in any order, and the distance of their boxes. Out: as many as there is room for, and how many found none.
//! Memory is bounded by the room, however many pairs come.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::ids::{BodyId, BodySlot};
use crate::math::Aabb;
use crate::world::Body;

/// A pair that may be near, before it is copied; the nearest compares least.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Lower bound on its distance, metres.
    pub(super) bound_m: f64,
    /// Index of the queried body.
    pub(super) asked: usize,
    pub(super) id: BodyId,
    pub(super) slot: BodySlot,
}

impl Ord for Hit {
    fn cmp(&self, other: &Self) -> Ordering {
        let tie = || (self.id, self.asked).cmp(&(other.id, other.asked));
        self.bound_m.total_cmp(&other.bound_m).then_with(tie)
    }
}

impl PartialOrd for Hit {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Hit {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Hit {}

/// The nearest of all pairs so far.
#[derive(Debug)]
pub(super) struct Nearest {
    room: usize,
    /// The farthest is on top: it is dropped first.
    kept: BinaryHeap<Hit>,
    /// Pairs that found no room.
    pub(super) left_out: u64,
}

impl Nearest {
    /// Empty, with room for this many.
    pub(super) fn new(room: usize) -> Self {
        Self {
            room,
            kept: BinaryHeap::new(),
            left_out: 0,
        }
    }

    pub(super) fn take(&mut self, hit: Hit) {
        if self.kept.len() < self.room {
            self.kept.push(hit);
            return;
        }
        self.left_out += 1;
        if let Some(mut farthest) = self.kept.peek_mut().filter(|farthest| hit < **farthest) {
            *farthest = hit;
        }
    }

    /// Those that were kept, the nearest first.
    pub(super) fn sorted(self) -> Vec<Hit> {
        self.kept.into_sorted_vec()
    }
}

/// The queried bodies in groups of neighbours with a box around each: a body far from a group is far from all of it, so
/// that many parts among many bodies are not compared one by one.
pub(super) struct Groups {
    /// The box around all.
    pub(super) whole: Aabb,
    /// Indices of the queried bodies, group by group.
    places: Vec<usize>,
    /// The box around each group, and its end in `places`.
    boxes: Vec<(Aabb, usize)>,
}

impl Groups {
    /// As many groups as each has members, along the longest side of their common box.
    pub(super) fn of(asked: &[Body]) -> Self {
        let whole = around(asked.iter());
        let axis = whole.half_extents().imax();
        let mut places: Vec<usize> = (0..asked.len()).collect();
        let least = |place: &usize| asked[*place].proxy.min[axis];
        places.sort_by(|one, other| least(one).total_cmp(&least(other)));
        let size = asked.len().isqrt().max(1);
        let mut end = 0;
        let group = |members: &[usize]| {
            end += members.len();
            (around(members.iter().map(|place| &asked[*place])), end)
        };
        let boxes = places.chunks(size).map(group).collect();
        Self {
            whole,
            places,
            boxes,
        }
    }

    /// Indices of those whose box may be this near, metres.
    pub(super) fn near(&self, other: &Aabb, within_m: f64) -> impl Iterator<Item = usize> {
        let mut begin = 0;
        let near = self.boxes.iter().map(move |(group, end)| {
            let members = begin..*end;
            begin = *end;
            if group.distance(other) > within_m {
                0..0
            } else {
                members
            }
        });
        near.flatten().map(|at| self.places[at])
    }
}

fn around<'a>(bodies: impl Iterator<Item = &'a Body>) -> Aabb {
    bodies.fold(Aabb::empty(), |all, body| all.merged(&body.proxy))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(bound_m: f64, id: u32) -> Hit {
        Hit {
            bound_m,
            asked: 0,
            id: BodyId(u64::from(id)),
            slot: BodySlot(u32::MAX - id),
        }
    }

    #[test]
    fn bug_memory_is_bounded_by_the_room_and_the_nearest_are_kept_in_any_order() {
        let mut nearest = Nearest::new(10);
        for at in 0..1_000_u32 {
            // Each number below 1,000 once.
            nearest.take(hit(f64::from(at * 37 % 1_000), at));
            assert!(nearest.kept.capacity() < 32);
        }
        assert_eq!(nearest.left_out, 990);
        let kept: Vec<f64> = nearest.sorted().iter().map(|hit| hit.bound_m).collect();
        assert_eq!(kept, (0..10).map(f64::from).collect::<Vec<_>>());
    }

    #[test]
    fn of_pairs_as_near_as_each_other_those_of_the_first_bodies_are_kept() {
        let mut nearest = Nearest::new(2);
        for id in [5, 3, 9, 1] {
            nearest.take(hit(0.0, id));
        }
        let ids: Vec<u64> = nearest.sorted().iter().map(|hit| hit.id.0).collect();
        assert_eq!(ids, [1, 3]);
    }
}
