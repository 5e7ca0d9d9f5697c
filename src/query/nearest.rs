//! Who may be near what is asked for: pairs of boxes, the nearest of which are kept.
//!
//! In: pairs in any order, and how far apart their boxes are. Out: as many as there is room for, and how many there was
//! none for. Memory is bounded by the room, however many pairs come.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::ids::{BodyId, BodySlot};
use crate::math::Aabb;
use crate::world::Body;

/// A pair that may be near, before it is copied; the nearest is the least.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// It is no nearer, metres.
    pub(super) bound_m: f64,
    /// Place of what is asked for.
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

/// The nearest of all that came.
#[derive(Debug)]
pub(super) struct Nearest {
    room: usize,
    /// The farthest is on top: it goes first.
    kept: BinaryHeap<Hit>,
    /// Pairs there was no room for.
    pub(super) left_out: u64,
}

impl Nearest {
    /// None yet, and room for so many.
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

/// What is asked for in groups of neighbours with a box around each: who is far from a group is far from all of it, so
/// that many parts among many bodies are not held against each other one by one.
pub(super) struct Groups {
    /// The box around all.
    pub(super) whole: Aabb,
    /// Places of what is asked for, group by group.
    places: Vec<usize>,
    /// The box around each group, and where it ends in `places`.
    boxes: Vec<(Aabb, usize)>,
}

impl Groups {
    /// As many groups as each has members, along the longest side of them all.
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

    /// Places of those whose box may be as near as this, metres.
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
