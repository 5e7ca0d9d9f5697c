//! From a box of the world to what is stored: rounded outward to f32 near the scene's origin, and widened by where the
//! body is about to go.
//!
//! Why widened: a body inside its fat box costs one containment test and no work on the structure. The box is swept
//! along the motion of each of its six faces (so that what turns or grows is followed too) for some ticks, and padded
//! by a margin that the body learns from its own escapes.

use crate::math::Aabb;
use crate::simd::boxes::{Down, Lanes, SLACK};

/// Ticks that a fat box is swept for. Renewing a body costs about 100 ns, each tick of sweep adds candidates that cost
/// some 3 ns a tick: in the gas of the bench 8 to 16 come out alike.
pub(super) const HORIZON: u32 = 16;
/// Most that a face is swept, in mean sides of the box: beyond it the candidates grow by the cube.
const SWEEP_MAX: f32 = 0.5;
/// Most that a margin is, in mean sides.
const MARGIN_MAX: f32 = 0.2;
/// Least margin, in mean sides: what stands still but for its sender's rounding stays in.
const MARGIN_MIN: f32 = 1e-3;
/// A margin that was enough for as long as was hoped shrinks by this factor, so that a body that has calmed is tight again.
const SHRINK: f32 = 0.9;
/// Bodies that go farther than any margin within so many ticks are wild, ...
const WILD_TICKS: u32 = 1;
/// ... when they did so often in a row: they get tight boxes, for no box holds them.
const WILD_AFTER: u8 = 2;
/// After so many tight boxes a wild body is tried with a fat one again.
const WILD_RETRY: u8 = 40;
/// What a body has learned about its motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gait {
    /// Its box when the fat one was made.
    anchor: Down,
    /// Tick of that.
    born: u32,
    /// What is added on every side, metres.
    margin: f32,
    /// Times in a row that it left at once.
    wild: u8,
}

impl Gait {
    /// Of a body that nothing is known of.
    pub(super) const NEW: Self = Self {
        anchor: Down { faces: [0.0; 8] },
        born: u32::MAX,
        margin: 0.0,
        wild: 0,
    };

    /// The fat box of a body whose box is `now`, and what is learned from how long the last one held.
    ///
    /// * `horizon` - ticks to sweep for.
    /// * `held` - the fat box it had; where it is still inside, it is renewed along with others.
    #[inline(always)]
    pub(super) fn renew(&mut self, now: &Down, tick: u32, horizon: u32, held: &Down) -> Down {
        let f = &now.faces;
        // The sum of lower faces and minus upper ones is minus three mean sides.
        let side = ((f[0] + f[4]) + (f[1] + f[5]) + (f[2] + f[6])) * (-1.0 / 3.0);
        let known = self.born != u32::MAX;
        let age = if known {
            tick.wrapping_sub(self.born)
        } else {
            0
        };
        if age > 0 {
            self.learn(now, held, age, side);
        }
        let least = side * MARGIN_MIN;
        self.margin = if self.margin > least {
            self.margin
        } else {
            least
        };
        let before = self.anchor;
        self.anchor = *now;
        self.born = tick;
        let mut fat = *now;
        // An infinite box has no finite side: it is its own fat box.
        if self.wild >= WILD_AFTER || !side.is_finite() {
            return without_spares(fat);
        }
        #[allow(
            clippy::cast_precision_loss,
            reason = "ages of ticks, small or of no meaning"
        )]
        let ahead = if age > 0 {
            horizon as f32 / age as f32
        } else {
            0.0
        };
        let most = side * SWEEP_MAX;
        for (k, face) in fat.faces.iter_mut().enumerate() {
            // Outward is down on every lane.
            let out = (before.faces[k] - *face) * ahead;
            let out = if k % 4 == SLACK || out < 0.0 {
                0.0
            } else {
                out
            };
            let out = if out < most { out } else { most };
            *face -= out + self.margin;
        }
        without_spares(fat)
    }

    /// Ticks since its fat box was made.
    #[inline(always)]
    pub(super) fn age(&self, tick: u32) -> u32 {
        tick.wrapping_sub(self.born)
    }

    /// Whether a body that goes on as it came will have left its fat box some ticks from now. One that trembles about
    /// its place will not.
    #[inline(always)]
    pub(super) fn leaves<L: Lanes>(
        &self,
        lanes: L,
        now: &Down,
        held: &Down,
        tick: u32,
        ahead: u32,
    ) -> bool {
        #[allow(clippy::cast_precision_loss, reason = "ages of ticks, small")]
        let share = ahead as f32 / self.age(tick).max(1) as f32;
        let mut then = *now;
        for (k, face) in then.faces.iter_mut().enumerate() {
            let out = (self.anchor.faces[k] - *face) * share;
            // What moves inward counts for nothing, and the spare lanes stay.
            *face -= if k % 4 != SLACK && out > 0.0 {
                out
            } else {
                0.0
            };
        }
        !lanes.holds(held, &then)
    }

    /// A body that left by a face that its box was not swept towards trembles, or turned: its margin grows. One that
    /// went on as it came was held as long as could be hoped: its margin shrinks.
    #[inline(always)]
    fn learn(&mut self, now: &Down, held: &Down, age: u32, side: f32) {
        let most = side * MARGIN_MAX;
        let (mut far, mut astray) = (false, false);
        for k in [0, 1, 2, 4, 5, 6] {
            let out = now.faces[k] < held.faces[k];
            let swept = self.anchor.faces[k] - held.faces[k] - self.margin;
            far |= self.anchor.faces[k] - now.faces[k] > most;
            astray |= out & (swept <= self.margin);
        }
        if astray {
            let twice = self.margin * 2.0;
            self.margin = if twice < most { twice } else { most };
        } else {
            self.margin *= SHRINK;
        }
        if age > WILD_TICKS {
            self.wild = 0;
        } else if far {
            self.wild = (self.wild + 1) % WILD_RETRY;
        }
    }
}

/// A fat box holds whatever stands in the spare lanes.
#[inline(always)]
fn without_spares(mut fat: Down) -> Down {
    fat.faces[SLACK] = f32::NEG_INFINITY;
    fat.faces[SLACK + 4] = f32::NEG_INFINITY;
    fat
}

/// A box of the world as it is stored.
#[inline(always)]
pub(super) fn outward<L: Lanes>(lanes: L, aabb: &Aabb, origin: &[f64; 3]) -> Down {
    lanes.outward(aabb.min.coords.as_ref(), aabb.max.coords.as_ref(), origin)
}

#[cfg(test)]
#[allow(
    clippy::cast_precision_loss,
    clippy::float_cmp,
    reason = "small counts, and boxes that must be the same"
)]
mod tests {
    use super::*;
    use crate::simd::boxes::Portable;

    /// A unit cube at a place.
    fn shifted(by: f32) -> Down {
        let top = -1.0 - by;
        Down {
            faces: [by, by, by, 0.0, top, top, top, 0.0],
        }
    }

    fn holds(outer: &Down, inner: &Down) -> bool {
        Portable.holds(outer, inner)
    }

    #[test]
    fn a_body_that_flies_straight_stays_in_its_box_for_the_horizon() {
        let mut gait = Gait::NEW;
        let fat = gait.renew(&shifted(0.0), 0, HORIZON, &Down::EMPTY);
        let fat = gait.renew(&shifted(0.02), 1, HORIZON, &fat);
        let after = |ticks: f32| shifted(0.02 * (1.0 + HORIZON as f32 + ticks));
        assert!(holds(&fat, &after(-0.1)) && !holds(&fat, &after(1.0)));
        assert!(
            !holds(&fat, &shifted(0.0)),
            "it is not widened to where it came from"
        );
    }

    #[test]
    fn a_body_that_trembles_learns_a_margin_that_holds_it() {
        let (mut gait, mut fat, mut renewals) = (Gait::NEW, Down::EMPTY, 0);
        for tick in 0..1000_u32 {
            let now = shifted(if tick % 2 == 0 { 0.004 } else { -0.004 });
            if tick == 0 || !holds(&fat, &now) {
                fat = gait.renew(&now, tick, HORIZON, &fat);
                renewals += 1;
                assert!(holds(&fat, &now));
            }
        }
        assert!(renewals < 12, "{renewals}");
    }

    #[test]
    fn a_wild_body_gets_its_own_box() {
        let (mut gait, mut fat) = (Gait::NEW, Down::EMPTY);
        for tick in 0..4 {
            fat = gait.renew(&shifted(tick as f32 * 5.0), tick, HORIZON, &fat);
        }
        let fat = gait.renew(&shifted(77.0), 4, HORIZON, &fat);
        assert_eq!(fat.corners(), shifted(77.0).corners());
    }

    #[test]
    fn infinite_boxes_are_their_own() {
        let mut all = shifted(0.0);
        (all.faces[0], all.faces[4]) = (f32::NEG_INFINITY, f32::NEG_INFINITY);
        let mut gait = Gait::NEW;
        let fat = gait.renew(&all, 0, HORIZON, &Down::EMPTY);
        assert_eq!(gait.renew(&all, 3, HORIZON, &fat).corners(), all.corners());
    }
}
