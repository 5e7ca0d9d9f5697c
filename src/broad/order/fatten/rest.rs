//! Bodies at rest: their hold is where they have been, or were observed.
//!
//! A hold grows when its body leaves it, by a share of the known span. It does not shrink by itself, since which of its
//! places were visited, and when, is not recorded: one that has lasted for long is narrowed, and grows again if that
//! was in vain.

use super::{Gait, MARGIN_MAX, MARGIN_MIN, NO_CORE, REST_AFTER, thin};
use crate::simd::boxes::{Down, Hold, SPARE};

/// The places of a body at rest are widened by this share of their span: enough for most of what follows after some ten
/// ticks, and little compared with the distance to its neighbours.
const REST_SHARE: f32 = 0.25;
/// A body at rest that stayed in its hold for this many ticks gets a narrower one: it may have been pushed once.
const REST_TICKS: u32 = 256;
/// A hold is narrowed to this share of itself on either side of the body's place: with less it is left again sooner,
/// with more it takes longer to become tight.
const NARROW: f32 = 0.125;
/// How often [`REST_TICKS`] is doubled at most, once for each narrowing in vain.
const VAIN_MAX: u8 = 5;
/// The observed places of a body at rest are widened on every side by this share of their span: after a dozen ticks few
/// of its faces go beyond.
const SEEN_SHARE: f32 = 0.2;
/// A body observed over this many times the usual span is not at rest.
const FAR_SPANS: f32 = 2.0;

impl Gait {
    /// Ticks that it must stay in its hold before that is narrowed.
    pub(super) fn patience(&self) -> u32 {
        REST_TICKS << self.vain
    }

    /// The hold of a body at rest, narrowed around its place if it has stayed inside for long. If it is left again, it
    /// grows again, and the time before the next try is doubled.
    #[inline(always)]
    pub(super) fn narrow(&mut self, held: &Hold, age: u32) -> Hold {
        let mut narrow = *held;
        if !self.is_at_rest() || held.is_lost() || age < self.patience() {
            self.narrowed = false;
            return narrow;
        }
        self.vain = if self.narrowed {
            0
        } else {
            (self.vain + 1).min(VAIN_MAX)
        };
        self.narrowed = true;
        let anchor = self.anchor();
        for k in [0, 1, 2, 4, 5, 6] {
            let (low, high) = (held.fat.faces[k], held.core.faces[k]);
            let side = (high - low) * NARROW;
            narrow.fat.faces[k] = low.max(anchor.faces[k] - side);
            narrow.core.faces[k] = high.min(anchor.faces[k] + side);
        }
        narrow
    }

    /// The hold of a body at rest: where it has been, and a little more where it went beyond; `None` if that spans too
    /// much.
    #[inline(always)]
    pub(super) fn stay(&mut self, before: &Down, held: &Hold, side: f32) -> Option<Hold> {
        // The first time, and after the hold was lost, only the last two places are known.
        let knows = self.is_at_rest() && !held.is_lost();
        let place = self.anchor();
        let (mut fat, mut core) = (place, NO_CORE);
        let thin = thin(&fat, side);
        for k in [0, 1, 2, 4, 5, 6] {
            let (was, now) = (before.faces[k], place.faces[k]);
            let (low, high) = if knows {
                (held.fat.faces[k], held.core.faces[k])
            } else {
                (f32::INFINITY, f32::NEG_INFINITY)
            };
            let was = if knows { now } else { was };
            let (least, most) = if was < now { (was, now) } else { (now, was) };
            let from = if least < low { least } else { low };
            let to = if most > high { most } else { high };
            let span = to - from;
            if span > side * MARGIN_MAX {
                return None;
            }
            let more = span * REST_SHARE + thin * MARGIN_MIN;
            fat.faces[k] = if least < low { from - more } else { from };
            core.faces[k] = if most > high { to + more } else { to };
        }
        self.rest = self.rest.max(REST_AFTER + 1);
        Some(Hold {
            fat: fat.open(),
            core,
        })
    }
}

/// The hold of a body at rest from the places observed in some ticks, whose origin is offset by `by` from the present
/// one; [`Hold::EMPTY`] if it was not observed, or goes farther than others.
///
/// * `span` - typical span of the motion of a body at rest, in its mean sides.
pub(in crate::broad::order) fn hold_of_seen(seen: &Hold, by: [f32; 3], span: f32) -> Hold {
    let mut hold = *seen;
    let most_span = seen.fat.mean_side() * span * FAR_SPANS;
    for k in [0, 1, 2, 4, 5, 6] {
        // Outward is down: upper faces are stored negated.
        let by = if k < 3 { by[k] } else { -by[k - 4] };
        let (least, most) = (seen.fat.faces[k], seen.core.faces[k]);
        let rounding = (least.abs() + most.abs() + by.abs()) * 4.0 * f32::EPSILON;
        let more = (most - least) * SEEN_SHARE + rounding;
        hold.fat.faces[k] = least + by - more;
        hold.core.faces[k] = most + by + more;
        // For a body that was not observed it is not a number.
        let rests = (0.0..=most_span).contains(&(most - least));
        if !rests {
            return Hold::EMPTY;
        }
    }
    hold.fat = hold.fat.open();
    hold.core.faces[SPARE] = f32::INFINITY;
    hold.core.faces[SPARE + 4] = f32::INFINITY;
    hold
}
