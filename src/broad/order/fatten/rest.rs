//! Bodies at rest: they are held to where they have been, or were seen.
//!
//! A hold grows where its body leaves it, by a share of what is known. It does not shrink by itself, for nobody knows
//! which of its places were visited, and lately: one that has lasted for long is made narrower, and grows again if that
//! was in vain.

use super::{Gait, MARGIN_MAX, MARGIN_MIN, NO_CORE, REST_AFTER, thin};
use crate::simd::boxes::{Down, Hold, SPARE};

/// What the places of a body at rest are widened by, as a share of what they span: enough for most of what is to come
/// after some ten ticks, and little beside what the body's neighbours have.
const REST_SHARE: f32 = 0.25;
/// A body at rest that kept to its hold for so many ticks is held to a narrower one: it may have been pushed, once.
const REST_TICKS: u32 = 256;
/// A hold is narrowed to this share of itself on either side of the body's place: with less it is left again sooner,
/// with more it takes longer to become as tight as it can be.
const NARROW: f32 = 0.125;
/// Times that the ticks before a narrower hold ([`REST_TICKS`]) are doubled, at most, once for each that was in vain.
const VAIN_MAX: u8 = 5;
/// What is added on every side to where a body at rest was seen, as a share of it: after a dozen ticks few of its faces
/// come beyond.
const SEEN_SHARE: f32 = 0.2;
/// Who was seen over so many times what others span does not rest.
const FAR_SPANS: f32 = 2.0;

impl Gait {
    /// Ticks that it keeps to its hold before that is made narrower.
    pub(super) fn patience(&self) -> u32 {
        REST_TICKS << self.vain
    }

    /// The hold of a body at rest, narrower about its place where it has kept to it for long. Left again, it grows
    /// again, and is kept for twice as long before the next try.
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

    /// The hold of a body at rest: where it has been, and a little more where it came beyond; `None` where that spans
    /// too much.
    #[inline(always)]
    pub(super) fn stay(&mut self, before: &Down, held: &Hold, side: f32) -> Option<Hold> {
        // The first time, and where the hold is lost, the last two places are all that is known.
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

/// What a body at rest is held to, by where it was seen for some ticks, measured from a place that is so far from the
/// present origin; [`Hold::EMPTY`] where it was not, or goes farther than others.
///
/// * `span` - what a body at rest spans, in its mean sides.
pub(in crate::broad::order) fn hold_of_seen(seen: &Hold, by: [f32; 3], span: f32) -> Hold {
    let mut hold = *seen;
    let most_span = seen.fat.mean_side() * span * FAR_SPANS;
    for k in [0, 1, 2, 4, 5, 6] {
        // Outward is down: upper faces are negative.
        let by = if k < 3 { by[k] } else { -by[k - 4] };
        let (least, most) = (seen.fat.faces[k], seen.core.faces[k]);
        let rounding = (least.abs() + most.abs() + by.abs()) * 4.0 * f32::EPSILON;
        let more = (most - least) * SEEN_SHARE + rounding;
        hold.fat.faces[k] = least + by - more;
        hold.core.faces[k] = most + by + more;
        // Of who was not seen it is not a number.
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
