//! The motion of a body from one pose to the next.
//!
//! In: two poses, and the turn between them that the sender gives. Out: a pivot that moves straight and a turn about a
//! fixed axis at a constant rate; and a box that contains the motion.

use crate::limits::LEG_TURNS_MAX;
use crate::math::{Aabb, Point, Pose, Quat, ROUND, Vec3};

/// A smaller turn has no axis that is distinguishable from rounding (32-bit senders: 1e-7), radians.
const AXIS_MIN_RAD: f64 = 1e-3;

/// The motion from one pose to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Where it begins.
    pub from: Pose,
    /// Where it ends.
    pub to: Pose,
    /// The pivot at the start, scene frame.
    pub pivot: Point,
    /// Translation of the pivot, scene frame, metres.
    pub travel: Vec3,
    /// The turn, scene frame: axis times angle, radians.
    pub spin: Vec3,
    /// Additional whole turns about a separate axis: only if the turn itself has no distinguishable axis.
    pub extra: Vec3,
    /// A step beyond the body's `teleport_m`, or over a reset: not swept.
    pub jump: bool,
    /// A step over a reset.
    pub lapse: bool,
    /// Number, from 1, of the frame that it ends at, among those with poses that its source sent in this tick.
    pub frame: u32,
}

impl Leg {
    /// The pose at a share of the leg.
    #[must_use]
    pub fn at(&self, share: f64, pivot: &Point) -> Pose {
        // Both ends exactly, to the last bit: certificates were made there.
        if share >= 1.0 {
            return self.to;
        } else if share <= 0.0 {
            return self.from;
        }
        let turned = Quat::from_scaled_axis(self.spin * share) * self.from.rotation;
        let turned = if self.extra == Vec3::zeros() {
            turned
        } else {
            Quat::from_scaled_axis(self.extra * share) * turned
        };
        let at = self.pivot + self.travel * share - turned * pivot.coords;
        Pose::from_parts(at.coords.into(), turned)
    }

    /// The total angle of the turn, radians.
    #[must_use]
    pub fn angle(&self) -> f64 {
        self.spin.norm() + self.extra.norm()
    }

    /// Returns whether it does not move.
    #[must_use]
    pub fn is_still(&self) -> bool {
        self.travel == Vec3::zeros() && self.angle() == 0.0 && self.from == self.to
    }
}

/// A box that contains a body along a leg, from the boxes at its ends.
///
/// A point at distance `r` from the pivot leaves the straight line between its two ends by at most `angle^2 r / 8`; and
/// it never leaves the ball around the pivot. Both bounds hold, so their intersection does.
pub(super) fn swept_box(
    leg: &Leg,
    pivot: &Point,
    reach: f64,
    (begin, end): (&Aabb, &Aabb),
) -> Aabb {
    let angle = leg.angle() * (1.0 + 8.0 * ROUND);
    let far = leg.from.translation.vector.amax() + leg.to.translation.vector.amax();
    // Poses between are products of rounded numbers of this size.
    let rounding = 64.0 * ROUND * (far + pivot.coords.amax() + (1.0 + angle) * reach);
    let straight = begin
        .merged(end)
        .widened(angle * angle * reach / 8.0 * (1.0 + 8.0 * ROUND) + rounding);
    let goal = leg.pivot + leg.travel;
    let ball = Aabb::of([&leg.pivot, &goal]).widened(reach + rounding);
    Aabb {
        min: straight.min.sup(&ball.min),
        max: straight.max.inf(&ball.max),
    }
}

/// The turn between two orientations: the shortest, or the one nearest to what the sender gives; whole turns about the
/// sender's own axis if the turn has no distinguishable axis; and whether it can be followed.
pub(super) fn turn_of(from: &Quat, to: &Quat, declared: Option<Vec3>) -> (Vec3, Vec3, bool) {
    // Rounding must not turn an orientation that was sent unchanged.
    let is_same = from.coords == to.coords;
    let shortest = if is_same {
        Vec3::zeros()
    } else {
        (to * from.inverse()).scaled_axis()
    };
    let Some(declared) = declared.filter(|turn| *turn != Vec3::zeros()) else {
        return (shortest, Vec3::zeros(), true);
    };
    let full = std::f64::consts::TAU;
    let angle = shortest.norm();
    let has_axis = angle > AXIS_MIN_RAD;
    let axis = if has_axis {
        shortest / angle
    } else {
        declared / declared.norm()
    };
    let turns = ((declared - shortest).dot(&axis) / full).round();
    if turns.is_nan() || turns.abs() > LEG_TURNS_MAX {
        // Its box is the ball swept along its centre's path, and nothing else is known.
        return (shortest, Vec3::repeat(LEG_TURNS_MAX * full), false);
    }
    let more = axis * (turns * full);
    // An unchanged orientation has turned about the sender's axis only.
    if has_axis || is_same {
        (shortest + more, Vec3::zeros(), true)
    } else {
        (shortest, more, true)
    }
}
