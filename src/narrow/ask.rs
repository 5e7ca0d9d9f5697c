//! The gap of two bodies on demand, whatever filters, boxes and certificates say: a query beside the pair set.
//!
//! In: two bodies as they stand, a [`Meter`]. Out: a sound interval of their gap from the first unit on, a verdict, a
//! witness. Nothing is remembered, so the answer is the same whoever asked before.

use crate::math::{Interval, relative};
use crate::time::Meter;
use crate::wire::Verdict;
use crate::world::Body;

use super::Counters;
use super::arena::Arena;
use super::cursor::{Cursor, Room, Turn};
use super::memo::{Witness, bent};
use super::mesh::{FrontStore, Goal, Search};

/// What is known of two bodies after a query of their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// Sound interval of the gap, metres.
    pub gap: Interval,
    /// As law 3.4 says; `Possible` only where the meter closed, or zero could not be told from the gap.
    pub verdict: Verdict,
    /// Finished, and 0 cannot be told from the gap.
    pub touching: bool,
    /// Nothing was cut off.
    pub finished: bool,
    /// Nearest or deepest place.
    pub witness: Option<Witness>,
}

/// The gap of two bodies at the poses they have.
///
/// * `report_m` - nearer than this is `near`, metres.
/// * `meter` - where it closes, what is known by then is the answer.
///
/// Two bodies that have half-spaces have no gap (law 3.2): their interval stays unknown.
#[must_use]
pub fn gap_between(a: &Body, b: &Body, report_m: f64, meter: &mut Meter<'_>) -> Asked {
    let mut cursor = Cursor::default();
    let rel = relative(&a.pose, &b.pose);
    cursor.start((rel, bent(a, b)), 0.0, 0, Goal::Gap);
    let (mut counters, mut fronts) = (Counters::default(), FrontStore::default());
    let (mut contacts, mut found) = (Arena::default(), Vec::new());
    let mut room = Room {
        search: Search::default(),
        fronts: &mut fronts,
        contacts: &mut contacts,
        found: &mut found,
    };
    let finished = !(a.unbounded && b.unbounded)
        && loop {
            match cursor.turn(&mut room, (a, b), report_m, meter, &mut counters) {
                Turn::Finished => break true,
                Turn::Open if !meter.open() => break false,
                Turn::Open => {}
            }
        };
    let gap = if finished {
        cursor.gap
    } else {
        let wholes = whole_bounds(a, b);
        let max = wholes.max.min(cursor.upper());
        Interval {
            min: wholes.min.min(max),
            max,
        }
    };
    // An overlap that is proved is no touch, however near 0 its upper end: that of meshes is a bound, not a depth.
    let touching = finished && cursor.certain && gap.contains(0.0) && gap.max > 0.0;
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
        witness: cursor.witness,
    }
}

/// Bounds on the gap from the balls around the two bodies: what holds before any work is done.
///
/// The lower end holds for overlapping bodies, too: a translation by the balls' overlap separates convex pieces, and no
/// point of the one lies deeper under the surface of the other.
fn whole_bounds(a: &Body, b: &Body) -> Interval {
    if a.unbounded || b.unbounded {
        return Interval::UNKNOWN;
    }
    let (from, to) = (a.pose * a.centre, b.pose * b.centre);
    let (between, radii) = ((to - from).norm(), a.radius + b.radius);
    let rounding = 16.0 * f64::EPSILON * (from.coords.amax() + to.coords.amax() + radii);
    Interval {
        min: (between - radii - rounding).next_down(),
        max: (between + radii + rounding).next_up(),
    }
}
