//! Whether two ways are in step: whether it is known where the one body was while the other went.
//!
//! In: two paths. Out: yes or no, and what holds of two that are not in step whatever the order was.
//!
//! A frame has the poses of one moment: two bodies are in step from one frame that has both to the next such. Where
//! only one of them goes between two of those, any order comes to the same. Else the frame that has the one says
//! nothing of the other on its way: it may have stood until then, or not. Two sources have no frame in common but the
//! poses of the two ticks: where each sent one frame, the two ways between those poses are in step, as if they were of
//! one (law: the time of impact is that of the last two poses); of several in a tick nobody says which goes with which.
//!
//! Refused: an order by when frames were sent, for simulators that go through the same step take different time over
//! it.

use crate::world::{Body, Leg, Path};

use super::motion::{length_apart, way};

/// Whether the two are in step all the way.
pub(super) fn are_in_step((a, b): (&Body, &Body)) -> bool {
    let (Some(one), Some(other)) = (way(a), way(b)) else {
        return true;
    };
    if one.source() != other.source() {
        return one.frames() <= 1 && other.frames() <= 1;
    }
    let (mut rest, mut others) = (one.legs(), other.legs());
    let mut between = Between::default();
    loop {
        let (mine, yours) = (rest.first(), others.first());
        let at = match (mine, yours) {
            (None, None) => return !between.is_open(),
            (Some(leg), None) | (None, Some(leg)) => leg.frame,
            (Some(mine), Some(yours)) => mine.frame.min(yours.frame),
        };
        let has_one = take(&mut rest, at, &mut between.one_goes);
        let has_other = take(&mut others, at, &mut between.other_goes);
        let has = |is_in: bool, path: &Path| is_in || path.has_entered_with(at);
        if !(has(has_one, one) && has(has_other, other)) {
            between.alone = true;
        } else if between.is_open() {
            return false;
        } else {
            between = Between::default();
        }
    }
}

/// Whether two that are not in step stay apart whatever the order was.
///
/// * `apart_m` - by how much they surely were apart at the begin.
pub(super) fn apart_in_any_order((a, b): (&Body, &Body), apart_m: f64) -> bool {
    let (Some(one), Some(other)) = (way(a), way(b)) else {
        return false;
    };
    !one.hull().overlaps(other.hull()) || apart_m > 0.0 && apart_m > length_apart((a, b))
}

/// What happens between two frames that have both bodies.
#[derive(Clone, Copy, Debug, Default)]
struct Between {
    one_goes: bool,
    other_goes: bool,
    /// A frame has one of them alone.
    alone: bool,
}

impl Between {
    /// Whether the order is open, and matters.
    fn is_open(self) -> bool {
        self.alone && self.one_goes && self.other_goes
    }
}

/// Takes the next leg, where it ends at this frame; whether it does.
fn take(legs: &mut &[Leg], frame: u32, goes: &mut bool) -> bool {
    match legs.split_first() {
        Some((leg, rest)) if leg.frame == frame => {
            *goes |= !leg.is_still();
            *legs = rest;
            true
        }
        _ => false,
    }
}
