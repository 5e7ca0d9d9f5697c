//! From a box of the world to the stored box: rounded outward to f32 near the scene's origin, and widened along the
//! expected motion of the body.
//!
//! Why widened: a body inside its fat box costs one containment test and no work on the structure. The box is swept
//! along the motion of each of its six faces for some ticks (so that rotation and growth are covered too), and padded
//! by a margin that adapts to the body's own escapes.
//!
//! For a body that vibrates around its place the union and the intersection of all its boxes so far are kept, plus a
//! little: its fat box and its core cover its whole motion, as tight as they can be and stay valid.
//!
//! The same motion inward leaves a core that the box keeps containing meanwhile. Two bodies whose cores overlap are
//! certainly a pair: as long as each box stays between its core and its fat box (its hold), their boxes are not
//! compared. In a pile at rest, or in a heap, that is nearly every pair.

mod rest;

pub(super) use rest::hold_of_seen;

use crate::math::Aabb;
use crate::simd::boxes::{Down, Hold, Lanes, SPARE};

/// Ticks that a fat box is swept for. Few ticks mean many renewals, many mean many candidates: in the bench's gas scene
/// 8 to 16 perform alike.
pub(super) const HORIZON: u32 = 16;
/// Most that a face is swept, in mean sides of the box: beyond it the number of candidates grows by the cube.
const SWEEP_MAX: f32 = 0.75;
/// Largest margin, in mean sides.
const MARGIN_MAX: f32 = 0.2;
/// Least margin, in shortest sides: a body that moves only by its sender's rounding stays inside.
const MARGIN_MIN: f32 = 1e-3;
/// A side shorter than the mean side divided by this counts as that: a wide floor is thin, and bodies on it shall be
/// certain pairs with it.
const THIN: f32 = 64.0;
/// A margin that was enough for the whole horizon shrinks by this factor, so that a body that has calmed becomes tight
/// again.
const SHRINK: f32 = 0.9;
/// Ticks that a fat box lasts before its body counts as calmed: it gets another box, since otherwise it would keep its
/// old margin for ever.
const CALMED_TICKS: u32 = 4 * HORIZON;
/// The margin of a calmed body shrinks by this factor in addition to [`SHRINK`].
const CALMED_SHRINK: f32 = 0.25;
/// A body that exceeds every possible margin within this many ticks may be wild.
const WILD_TICKS: u32 = 1;
/// Bodies that exceeded every possible margin within [`WILD_TICKS`] this often in a row are wild: they get tight boxes,
/// for no fat box holds them.
const WILD_AFTER: u8 = 2;
/// After this many tight boxes a wild body gets a fat one again, as a trial.
const WILD_RETRY: u8 = 40;
/// Bodies that left their fat boxes this often in a row, by little and by faces that were not swept, are at rest.
const REST_AFTER: u8 = 2;
/// A body at rest loses that status when it leaves its hold within a tick this often in a row, or its motion spans more
/// than [`MARGIN_MAX`].
const REST_TRIES: u8 = 12;
/// Margin on every side of a new body among others at rest, as a share of the span of their motion. Measured in the
/// bench's pile scene: with less, more bodies leave in the ticks after; with more, fewer pairs are certain for ever.
const GUESS_SHARE: f32 = 0.6;

/// What was learned about a body's motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gait {
    /// Its box when the fat one was made: the faces of a [`Down`] without the spare ones.
    anchor: [f32; 6],
    /// The order's beat at that time, minus the body's own moves between beats; see [`Gait::note_move`].
    born: u32,
    /// Padding on every side, metres.
    margin: f32,
    /// Times in a row that it left at once.
    wild: u8,
    /// Times in a row that it left as a body at rest does; above `REST_AFTER` it is at rest.
    rest: u8,
    /// Times that its hold was narrowed without success, and whether narrowing was the last thing that happened to it
    /// (`rest`).
    vain: u8,
    narrowed: bool,
}

impl Gait {
    /// For a body without history.
    pub(super) const NEW: Self = Self {
        anchor: [0.0; 6],
        born: u32::MAX,
        margin: 0.0,
        wild: 0,
        rest: 0,
        vain: 0,
        narrowed: false,
    };

    /// For a body among others at rest.
    pub(super) fn at_rest(span: f32) -> Self {
        Self {
            margin: span * GUESS_SHARE,
            rest: REST_AFTER + 1,
            ..Self::NEW
        }
    }

    #[inline(always)]
    fn anchor(&self) -> Down {
        Down::of_six(self.anchor)
    }

    /// Span of the motion of a body at rest, in its mean sides; `None`: not at rest, or its hold does not show it.
    pub(super) fn span(&self, held: &Hold) -> Option<f32> {
        let side = self.anchor().mean_side();
        let widest = (0..3).fold(0.0, |widest: f32, k| {
            widest.max(held.core.faces[k] - held.fat.faces[k])
        });
        let span = widest / side;
        (self.is_at_rest() && span.is_finite()).then_some(span)
    }

    /// The hold of a body whose box is `now`, and what is learned from how long the last one held.
    ///
    /// * `beat` - the order's.
    /// * `horizon` - beats to sweep for.
    /// * `held` - the hold it had; where it still keeps to it, it is renewed along with others.
    #[inline(always)]
    pub(super) fn renew(&mut self, now: &Down, beat: u32, horizon: u32, held: &Hold) -> Hold {
        let side = now.mean_side();
        let (age, is_new) = (self.age(beat), self.born == u32::MAX);
        if age > 0 {
            self.learn(now, held, age, side);
        }
        let least = thin(now, side) * MARGIN_MIN;
        self.margin = if self.margin > least {
            self.margin
        } else {
            least
        };
        let before = self.anchor();
        self.anchor = now.six();
        self.born = beat;
        let (mut fat, mut core) = (*now, NO_CORE);
        // An infinite box has no finite side: it is its own fat box.
        if self.wild >= WILD_AFTER || !side.is_finite() {
            return Hold {
                fat: fat.open(),
                core,
            };
        }
        // Where a new, unobserved body has been is unknown: its margin is a guess.
        if self.rest >= REST_AFTER && !(is_new && held.is_lost()) {
            let narrow = self.narrow(held, age);
            if let Some(hold) = self.stay(&before, &narrow, side) {
                return hold;
            }
            (self.rest, self.margin) = (0, side * MARGIN_MAX);
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
        for (k, before) in before.faces.into_iter().enumerate() {
            // Outward is down on every lane (upper faces are stored negated).
            let out = (before - now.faces[k]) * ahead;
            let clamped = |far: f32| {
                let far = if far > 0.0 { far } else { 0.0 };
                if far < most { far } else { most }
            };
            fat.faces[k] = now.faces[k] - (clamped(out) + self.margin);
            core.faces[k] = now.faces[k] + (clamped(-out) + self.margin);
        }
        core.faces[SPARE] = f32::INFINITY;
        core.faces[SPARE + 4] = f32::INFINITY;
        Hold {
            fat: fat.open(),
            core,
        }
    }

    /// The body moves between two beats: only its own age grows. So a body that moves now and then is swept by its
    /// moves, which show how far it goes, and not by the time that it stood still.
    #[inline(always)]
    pub(super) fn note_move(&mut self) {
        self.born = self.born.wrapping_sub(1);
    }

    /// Returns whether it vibrates around its place.
    #[inline(always)]
    pub(super) fn is_at_rest(&self) -> bool {
        self.rest > REST_AFTER
    }

    /// Returns whether the body has calmed and its margin is wider than needed; or has been at rest for so long that
    /// its motion may have become smaller.
    #[inline(always)]
    pub(super) fn has_calmed(&self, now: &Down, beat: u32) -> bool {
        if self.is_at_rest() {
            return self.age(beat) >= self.patience();
        }
        let side = now.mean_side();
        let loose = self.margin > 2.0 * thin(now, side) * MARGIN_MIN;
        loose && side.is_finite() && self.age(beat) >= CALMED_TICKS
    }

    /// Number of times that it may have moved since its fat box was made; 0 without one.
    #[inline(always)]
    pub(super) fn age(&self, beat: u32) -> u32 {
        match self.born {
            u32::MAX => 0,
            born => beat.wrapping_sub(born),
        }
    }

    /// Returns whether a body that keeps its course will have left its fat box some ticks from now. One that vibrates
    /// around its place will not.
    #[inline(always)]
    pub(super) fn leaves<L: Lanes>(
        &self,
        lanes: L,
        now: &Down,
        held: &Hold,
        beat: u32,
        ahead: u32,
    ) -> bool {
        if self.is_at_rest() {
            return false;
        }
        #[allow(clippy::cast_precision_loss, reason = "ages of ticks, small")]
        let share = ahead as f32 / self.age(beat).max(1) as f32;
        let mut then = *now;
        for (face, before) in then.faces.iter_mut().zip(self.anchor().faces) {
            let out = (before - *face) * share;
            // Inward motion is ignored.
            *face -= if out > 0.0 { out } else { 0.0 };
        }
        !lanes.holds(&held.fat, &then)
    }

    /// A body that left by a face that its box was not swept towards vibrates, or turned: its margin grows. One that
    /// kept its course stayed for the whole horizon: its margin shrinks.
    #[inline(always)]
    fn learn(&mut self, now: &Down, held: &Hold, age: u32, side: f32) {
        let most = side * MARGIN_MAX;
        let (mut far, mut astray, anchor) = (false, false, self.anchor());
        for k in [0, 1, 2, 4, 5, 6] {
            let (before, face) = (anchor.faces[k], now.faces[k]);
            let swept = before - held.fat.faces[k] - self.margin;
            let shrunk = held.core.faces[k] - before - self.margin;
            far |= before - face > most;
            astray |= (face < held.fat.faces[k]) & (swept <= self.margin);
            astray |= (face > held.core.faces[k]) & (shrunk <= self.margin);
        }
        let small = self.margin * 4.0 <= most;
        if self.is_at_rest() {
            // If it left at once it may have started moving; if later, it is still at rest.
            let tries = self.rest + 1;
            self.rest = match age {
                1 if tries > REST_AFTER + REST_TRIES => 0,
                1 => tries,
                _ => REST_AFTER + 1,
            };
        } else {
            self.rest = if astray && small { self.rest + 1 } else { 0 };
        }
        if astray {
            let twice = self.margin * 2.0;
            self.margin = if twice < most { twice } else { most };
        } else {
            self.margin *= SHRINK;
            if age >= CALMED_TICKS {
                self.margin *= CALMED_SHRINK;
            }
        }
        if age > WILD_TICKS {
            self.wild = 0;
        } else if far {
            self.wild = (self.wild + 1) % WILD_RETRY;
        }
    }
}

/// The shortest side, with the lower limit used for margins.
#[inline(always)]
fn thin(now: &Down, side: f32) -> f32 {
    let mut shortest = side;
    for k in 0..3 {
        let long = -(now.faces[k] + now.faces[k + 4]);
        shortest = if long < shortest { long } else { shortest };
    }
    let least = side / THIN;
    if shortest > least { shortest } else { least }
}

/// No core: every box contains it, and it overlaps nothing.
const NO_CORE: Down = Down {
    faces: [f32::INFINITY; 8],
};

/// The fat box stored in a block when [`Lanes::keeps`] tests containment: wider by twice the outward rounding.
#[inline(always)]
pub(super) fn loose(fat: &Down) -> Down {
    let mut wide = *fat;
    for face in &mut wide.faces {
        *face -= face.abs() * (2.0 * f32::EPSILON) + 2.0 * f32::MIN_POSITIVE;
    }
    wide
}

/// A box of the world in stored form.
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
mod tests;
