//! The gap of two bodies on demand, regardless of filters, boxes and certificates: a query outside the pair set.
//!
//! In: two bodies at their present poses, a [`Meter`]. Out: a sound interval of their gap from the first unit on, a
//! verdict, a witness. Nothing is stored, so the answer does not depend on earlier queries.

use crate::math::{Interval, relative};
use crate::time::Meter;
use crate::wire::Verdict;
use crate::world::{Body, PlacedShape};

use super::Counters;
use super::around::whole_bounds;
use super::bent::Bent;
use super::carry::Told;
use super::compound::{CompoundFront, Tools};
use super::contacts::Contact;
use super::cursor::{Cursor, Room, Turn};
use super::memo::Witness;
use super::mesh::{Goal, Search};
use super::shelves::Shelves;

/// What is known of two bodies after a query on demand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// Sound interval of the gap, metres.
    pub gap: Interval,
    /// By law 3.4; `Possible` only if the meter closed, or the gap could not be distinguished from zero.
    pub verdict: Verdict,
    /// Finished, and the gap cannot be distinguished from 0.
    pub touching: bool,
    /// Nothing was cut off.
    pub finished: bool,
    /// Nearest or deepest place.
    pub witness: Option<Witness>,
}

/// The gap of two bodies at their present poses.
///
/// * `report_m` - pairs nearer than this are `near`, metres.
/// * `meter` - if it closes, the answer is what is known by then.
///
/// Two half-spaces have no gap (law 3.2): the interval of two bodies of nothing else stays unknown, and of others it is
/// that of their other pairs of shapes.
#[must_use]
pub fn gap_between(a: &Body, b: &Body, report_m: f64, meter: &mut Meter<'_>) -> Asked {
    let found = match (&*a.shapes, &*b.shapes) {
        _ if a.only_half_spaces && b.only_half_spaces => Told::NOTHING,
        ([one], [other]) => of_shapes((a, b), (one, other), report_m, meter),
        _ => of_parts((a, b), report_m, meter),
    };
    let Told {
        done: finished,
        certain,
        witness,
        ..
    } = found;
    let gap = if finished {
        found.gap
    } else {
        let wholes = whole_bounds(a, b);
        let max = wholes.max.min(found.gap.max);
        Interval {
            min: wholes.min.max(found.gap.min).min(max),
            max,
        }
    };
    // A proved overlap is not touching, however near 0 its upper end: that of meshes is a bound, not a depth.
    let touching = finished && certain && gap.contains(0.0) && gap.max > 0.0;
    Asked {
        gap,
        verdict: if gap.max <= 0.0 || touching {
            Verdict::Colliding
        } else if gap.min <= 0.0 {
            Verdict::Possible
        } else if gap.min < report_m {
            Verdict::Near
        } else {
            Verdict::Apart
        },
        touching,
        finished,
        witness,
    }
}

/// The gap of two bodies of one shape each.
fn of_shapes(
    (a, b): (&Body, &Body),
    shapes: (&PlacedShape, &PlacedShape),
    report_m: f64,
    meter: &mut Meter<'_>,
) -> Told {
    let (mut bench, mut cursor) = (Bench::default(), Cursor::default());
    let rel = relative(&a.pose, &b.pose);
    cursor.start((0, 0), (rel, Bent::of_bodies(a, b)), 0.0, 0, Goal::Gap);
    let Shelves {
        store, contacts, ..
    } = &mut bench.shelves;
    let mut room = Room {
        fronts: store,
        contacts,
        search: Search::default(),
    };
    // No other pair waits for a turn.
    let asked = (report_m, u64::MAX);
    let turn = cursor.turn(&mut room, shapes, asked, meter, &mut bench.counters);
    Told {
        gap: cursor.known(shapes),
        done: turn == Turn::Finished,
        certain: cursor.certain,
        witness: cursor.witness,
    }
}

/// The gap of two bodies of which at least one has several shapes.
fn of_parts((a, b): (&Body, &Body), report_m: f64, meter: &mut Meter<'_>) -> Told {
    let (mut bench, mut front) = (Bench::default(), CompoundFront::default());
    let mut tools = bench.tools();
    front.move_to(&mut tools, (a, b), &relative(&a.pose, &b.pose));
    let asked = (Goal::Gap, report_m);
    let done = front.advance(&mut tools, (a, b), asked, u64::MAX, meter);
    Told {
        gap: front.interval(),
        done,
        certain: front.is_certain(),
        witness: front.witness(),
    }
}

/// Memory for one query on demand.
#[derive(Default)]
pub(super) struct Bench {
    pub(super) shelves: Shelves,
    found: Vec<Contact>,
    counters: Counters,
}

impl Bench {
    pub(super) fn tools(&mut self) -> Tools<'_> {
        Tools {
            shelves: &mut self.shelves,
            found: &mut self.found,
            counters: &mut self.counters,
            search: Search::default(),
            tick: 0,
        }
    }
}
