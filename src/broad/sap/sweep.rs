//! One sweep over one axis: all pairs of boxes at once, for a list that was just sorted or for many new bodies.
//!
//! In: bodies in order of their lower ends. Out: pairs that overlap on the axes asked for. The boxes are copied into
//! that order first, so that the inner loop reads memory in a line.

use super::axis::Axis;
use crate::broad::members::{Bounds, Members};
use crate::ids::BodySlot;

/// A body in the order of the sweep.
#[derive(Clone, Copy, Debug)]
struct Item {
    bounds: Bounds,
    slot: BodySlot,
    asked: bool,
}

/// Memory of the sweep, kept over updates.
#[derive(Clone, Debug, Default)]
pub(super) struct Sweep {
    items: Vec<Item>,
    /// Lower ends on the axis swept, beside the boxes: a shorter line to read when looking for the last candidate.
    lowers: Vec<f64>,
}

/// Where a sweep goes.
#[derive(Debug)]
pub(super) struct Course<'a> {
    /// The sorted axis.
    pub(super) axis: &'a Axis,
    /// Its number.
    pub(super) along: usize,
    /// The axes that are compared.
    pub(super) beside: [usize; 2],
    /// Most pairs to report.
    pub(super) most: usize,
}

impl Sweep {
    /// Reports pairs that overlap on all axes of the course, of which at least one body is `asked`; `false` when they
    /// are too many. Counts comparisons.
    pub(super) fn run(
        &mut self,
        course: &Course<'_>,
        members: &Members,
        asked: impl Fn(BodySlot) -> bool,
        met: &mut Vec<(BodySlot, BodySlot)>,
    ) -> (bool, u64) {
        let Course { along, beside, .. } = *course;
        self.fill(course.axis, along, members, asked);
        let mut tests = 0;
        for (at, item) in self.items.iter().enumerate() {
            let reach = item.bounds.max[along];
            let rest = &self.lowers[at + 1..];
            // Bodies that start beyond the upper end cannot overlap, nor can any after them.
            let count = rest.partition_point(|low| *low <= reach);
            tests += count as u64;
            for other in &self.items[at + 1..at + 1 + count] {
                let both = item.bounds.meets(&other.bounds, beside[0])
                    & item.bounds.meets(&other.bounds, beside[1])
                    & (item.asked | other.asked);
                if both {
                    met.push((item.slot, other.slot));
                }
            }
            if met.len() > course.most {
                return (false, tests);
            }
        }
        (true, tests)
    }

    /// Copies the boxes in order.
    fn fill(
        &mut self,
        axis: &Axis,
        along: usize,
        members: &Members,
        asked: impl Fn(BodySlot) -> bool,
    ) {
        self.items.clear();
        self.lowers.clear();
        for slot in axis.lowers() {
            let bounds = *members.bounds(slot);
            self.lowers.push(bounds.min[along]);
            let asked = asked(slot);
            self.items.push(Item {
                bounds,
                slot,
                asked,
            });
        }
    }
}
