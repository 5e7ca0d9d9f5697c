//! The end of a sweep: a pose at which the two surely touch, just behind the share that they reach without a touch.
//!
//! In: a sweep that advances very slowly, or that rounding has stopped. Out: a share at which they touch, or none up to
//! the end of the way.

use crate::world::Body;

use super::Sweep;
use super::advance::{Ahead, Work};
use super::motion::Moment;

/// A touch is bracketed by shares this close together: a thousandth of what is promised.
const CLOSE_ENOUGH: f64 = 1e-9;
/// If rounding hides the touch, the share where it is certain is searched to within this part of its distance ahead.
const PLAIN_ENOUGH: f64 = 0.1;
/// A sweep is probed for a touch ahead of it each time it has taken this many looks.
const PATIENCE_LOOKS: u32 = 8;
/// After this many probes without a touch before a known one, the known one may not be the first.
const PROBES_IN_VAIN: u32 = 4;
/// An advance by less than this has almost reached the touch.
const CREEP: f64 = 1e-10;

impl Sweep {
    /// Looks for a pose behind the share reached at which they surely touch, or for one nearer than the known one.
    pub(super) fn close_in(&mut self, bodies: (&Body, &Body), step: f64, work: &mut Work<'_, '_>) {
        let (known, left) = (self.hit.is_finite(), self.hit - self.free);
        let plain = self.stuck && self.hit - self.missed <= PLAIN_ENOUGH * left;
        let in_vain = self.stuck && !known && self.missed >= 1.0;
        if known && (left <= CLOSE_ENOUGH || plain) || in_vain {
            self.done = true;
            return;
        }
        let creeps = step < CREEP || self.looks.is_multiple_of(PATIENCE_LOOKS);
        let near = known && (self.stuck || step < 0.1 * left);
        if !(creeps && !known || near) || self.free >= 1.0 || !work.meter.open() {
            return;
        }
        let at = match (known, self.stuck) {
            (true, true) => f64::midpoint(self.missed, self.hit),
            (true, false) => self.free + 0.3 * self.span(step),
            (false, _) => self.free + self.behind(step),
        };
        let at = at.min(1.0);
        let moment = Moment::of(bodies, at);
        self.probes += 1;
        self.looks += 1;
        let mut warm = self.warm;
        if moment.jumps() {
            self.missed = at;
            return;
        }
        match work.look(bodies, &moment, 0.0, &mut warm) {
            Ahead::Touch => (self.hit, self.probes) = (at, 0),
            // Tested again when there is more budget.
            Ahead::Cut => {}
            Ahead::Free { .. } | Ahead::Unsure => self.missed = at,
        }
    }

    /// The part of the way to the known touch in which to look for an earlier one. Two bodies may meet several times:
    /// if probes in between found no touch again and again, the first touch more likely lies before them.
    fn span(&self, step: f64) -> f64 {
        let before = self.missed - self.free;
        if self.probes >= PROBES_IN_VAIN && self.missed < self.hit && 0.3 * before > step {
            before
        } else {
            self.hit - self.free
        }
    }

    /// How far behind the share reached to look for a touch if none is known: each look that finds nothing goes
    /// farther, to the end of the way if necessary.
    fn behind(&self, step: f64) -> f64 {
        let gap_m = self.last.1.max(0.0);
        let ahead = if self.stuck {
            // So near that rounding hides it: the slope would be rounding, too.
            0.0
        } else if self.slope > 0.0 {
            gap_m / self.slope
        } else {
            step
        };
        let missing = if ahead.is_finite() { ahead } else { 0.0 };
        let most = if self.stuck { 18 } else { 12 };
        let factor = 4.0_f64.powi(i32::try_from(self.probes.min(most)).unwrap_or(12));
        1.05 * (missing - step).max(0.0) + factor * 0.4 * CREEP
    }
}
