//! Whether two ways are in step: whether it is known where one body was while the other moved.
//!
//! In: two paths. Out: yes or no, and what holds in any order for two that are not in step.
//!
//! A frame has the poses of one moment: two bodies are in step from one frame that has both to the next such frame. If
//! only one of them moves in between, any order gives the same result. Otherwise a frame with only one of them says
//! nothing of the other: it may have stood still until then, or not. Two sources share no frame except the poses of the
//! two ticks. If each sent one frame, the two ways between those poses are in step, as if from one source (law: the
//! time of impact is that of the last two poses); with several, it is unknown which belong together.
//!
//! Refused: an order by send time, since simulators that compute the same step take different time for it.

use crate::world::{Body, Leg, Path};

use super::motion::{length_apart, way};

/// Whether the two are in step on the whole way.
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

/// Whether two that are not in step stay apart in any order of their motions.
///
/// * `apart_m` - by how much they surely were apart at the start.
pub(super) fn apart_in_any_order((a, b): (&Body, &Body), apart_m: f64) -> bool {
    let (Some(one), Some(other)) = (way(a), way(b)) else {
        return false;
    };
    !one.hull().overlaps(other.hull()) || apart_m > 0.0 && apart_m > length_apart((a, b))
}

/// The motion between two frames that have both bodies.
#[derive(Clone, Copy, Debug, Default)]
struct Between {
    one_goes: bool,
    other_goes: bool,
    /// A frame has only one of them.
    alone: bool,
}

impl Between {
    /// Whether the order is unknown, and matters.
    fn is_open(self) -> bool {
        self.alone && self.one_goes && self.other_goes
    }
}

/// Takes the next leg if it ends at this frame. Returns whether it does.
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
