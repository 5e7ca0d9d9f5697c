//! Continuous bodies: whether two touch on the way from the last tick's poses to this one's, and when.
//!
//! In: the paths that the world keeps, a meter. Out: for each pair with a swept body, what is known of the way
//! ([`Passage`]): free of touch, a touch within an interval of the share `s` of the motion, or not decided. The
//! verdicts at this tick's poses are not affected.
//!
//! How: if the pair's certificate at the last tick's poses exceeds the length of the way, the way is free. Otherwise
//! conservative advancement (see `advance`): from a share reached without touch, the pair stays apart for a provable
//! further share; so a touch is approached from before and never passed over. That there is a touch is certified by a
//! pose at which the two collide whatever rounding did to the way, searched just behind the share reached, by the slope
//! of the gap. A pair that comes as near as rounding, but no nearer, stays open.
//!
//! Sweeps come before the verdicts because the next tick has other poses: what is undecided at the end of this one is
//! reported as open. They get half of what the budget leaves, so that verdicts do not starve, and what verdicts leave;
//! long ones, of bodies that turn close to another, get what contacts leave.
//!
//! Refused: sampling (a wall can be arbitrarily thin); searching for the touch by bisection of the verdict (a bullet
//! that ends behind the wall is apart at both ends); keeping an undecided sweep for later (by then nothing needs it).
//!
//! Two bodies are not swept when no frame says where one was while the other moved: see `in_step`.

mod advance;
mod asked;
mod close;
mod in_step;
mod motion;
#[cfg(test)]
mod tests;
mod turns;

pub use asked::touch_on_way;

use crate::ids::{BodySlot, PairSlot};
use crate::limits::SWEEP_LOOKS_MAX;
use crate::math::Interval;
use crate::pairs::PairSet;
use crate::world::{Body, World};

use super::change::changed_since;
use super::exact::Warm;
use super::memo::Memo;
use super::{NONE, Narrow};
use advance::{Ahead, Tools, Work};
use in_step::{apart_in_any_order, are_in_step};
use motion::{Moment, length, way};
use turns::Turns;

/// Looks at a pair before the next pair has its turn.
const SLICE_LOOKS: u32 = 8;
/// Looks at a pair before contacts have their turn; longer sweeps get what contacts leave. A touch takes 5 to 40.
pub(super) const FIRST_LOOKS: u32 = 160;
/// Products of shares and times are off by a few units of roundoff.
const SHORT: f64 = 1.0 - 1e-12;

/// What is known of a pair's way from the last tick's poses to this one's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Passage {
    /// They did not touch before the end.
    Free,
    /// They touched: the first touch is within this interval of shares of the motion.
    Touched(Interval),
    /// Not decided: if they touched, then within these shares.
    Open(Interval),
}

/// A pair's sweep in this tick.
#[derive(Clone, Copy, Debug)]
pub struct Swept {
    /// The pair.
    pub slot: PairSlot,
    /// What is known of its way.
    pub passage: Passage,
    /// One of its bodies jumped: that part of the way was not tested.
    pub jumped: bool,
    /// One of its bodies jumped by a step beyond its `teleport_m`, and not over a reset.
    pub teleported: bool,
}

/// A sweep in progress.
#[derive(Debug)]
struct Sweep {
    slot: PairSlot,
    a: BodySlot,
    b: BodySlot,
    done: bool,
    jumped: bool,
    teleported: bool,
    /// Free of touch up to here.
    free: f64,
    /// A share at which they are known to touch; infinite: none known.
    hit: f64,
    /// At `free`, rounding hides whether they touch, or how long they stay apart: the sweep cannot advance.
    stuck: bool,
    /// The share tested last at which no touch was found, behind `free` and before `hit`.
    missed: f64,
    looks: u32,
    /// `free` when it was last judged whether the sweep will finish, and the looks at that time.
    judged: (f64, u32),
    probes: u32,
    /// Share and gap at the last look.
    last: (f64, f64),
    /// How fast the gap shrank between the last two looks, metres a share.
    slope: f64,
    warm: Warm,
}

/// The sweeps of a tick, and the working memory for them.
#[derive(Debug, Default)]
pub(super) struct Sweeps {
    list: Vec<Sweep>,
    /// Index in `list` by `PairSlot`; as long as the highest slot that was ever swept.
    places: Vec<u32>,
    tools: Tools,
    turns: Turns,
    /// This tick's sweeps have been published: no more work on them.
    told: bool,
}

impl Narrow {
    /// The pairs with a body that was swept in this tick, in no particular order.
    pub fn swept(&self) -> impl Iterator<Item = Swept> + '_ {
        self.sweeps.list.iter().map(Sweep::outcome)
    }

    /// What is known of a pair's way; `None`: it was not swept.
    #[must_use]
    pub fn passage(&self, slot: PairSlot) -> Option<Swept> {
        let at = *self.sweeps.places.get(slot.index())?;
        self.sweeps.list.get(at as usize).map(Sweep::outcome)
    }

    /// Whether this tick has any sweeps.
    pub(super) fn has_sweeps(&self) -> bool {
        !self.sweeps.list.is_empty()
    }

    /// Forgets the sweeps of the last tick.
    pub(super) fn clear_sweeps(&mut self) {
        let Sweeps {
            list,
            places,
            turns,
            told,
            ..
        } = &mut self.sweeps;
        turns.begin();
        for sweep in list.drain(..) {
            places[sweep.slot.index()] = NONE;
            self.stirred.set(sweep.slot);
        }
        *told = false;
    }

    /// Lists the pairs of the swept bodies, with what is known of them without a test.
    pub(super) fn enlist_sweeps(&mut self, world: &World, pairs: &PairSet) {
        for &slot in world.travelled() {
            let body = world.body(slot).filter(|body| body.in_broad);
            if body.is_none_or(|body| way(body).is_none()) {
                continue;
            }
            for pair in pairs.pairs_of(slot) {
                self.stirred.set(pair);
                let hot = self.hot[pair.index()];
                let memo = &self.memos[pair.index()];
                let (Some(a), Some(b)) = (world.body(hot.a), world.body(hot.b)) else {
                    continue;
                };
                let Sweeps { list, places, .. } = &mut self.sweeps;
                if places.len() <= pair.index() {
                    places.resize(self.hot.len(), NONE);
                }
                if hot.live && places[pair.index()] == NONE {
                    places[pair.index()] = u32::try_from(list.len()).unwrap_or(NONE);
                    list.push(Sweep::begin((pair, hot.a, hot.b), (a, b), memo));
                }
            }
        }
    }

    /// Widens swept pairs to this tick's poses: a row shows that gap next to the touch on the way.
    pub(super) fn bring_up_swept(&mut self, world: &World) {
        for at in 0..self.sweeps.list.len() {
            let sweep = self.sweeps.list[at].outcome();
            if sweep.passage != Passage::Free {
                self.widen_pair(sweep.slot, world);
            }
        }
    }

    /// The sweeps are published.
    pub(super) fn close_sweeps(&mut self) {
        self.sweeps.told = true;
    }
}

impl Sweeps {
    /// Structure check: each sweep stands where its pair's index says, and its working memory is its own.
    ///
    /// # Errors
    /// The first violation, in words.
    pub(super) fn validate(&self) -> Result<(), String> {
        for (at, sweep) in (0..).zip(&self.list) {
            if self.places.get(sweep.slot.index()) != Some(&at) {
                let slot = sweep.slot;
                return Err(format!("the sweep of {slot:?} is not where its pair says"));
            }
        }
        let placed = self.places.iter().filter(|at| **at != NONE).count();
        if placed != self.list.len() {
            let listed = self.list.len();
            return Err(format!("{listed} sweeps, and {placed} pairs with one"));
        }
        self.tools.validate()
    }
}

impl Sweep {
    /// A pair's sweep, with what is known of it before any look.
    fn begin(
        (slot, at_a, at_b): (PairSlot, BodySlot, BodySlot),
        (a, b): (&Body, &Body),
        memo: &Memo,
    ) -> Self {
        let paths = || [a, b].into_iter().filter_map(way);
        let jumped = paths().any(crate::world::Path::has_jumped);
        let mut sweep = Self {
            jumped,
            teleported: paths().any(crate::world::Path::has_teleported),
            ..Self::fresh((slot, at_a, at_b), memo.warm)
        };
        let start = Moment::of((a, b), 0.0);
        let change = changed_since(a, b, (&memo.rel, memo.bent), &start.rel);
        let touching = change == 0.0 && memo.finished && memo.gap.contains(0.0);
        if start.told && (touching || memo.gap.max + change <= 0.0) {
            (sweep.hit, sweep.done) = (0.0, true);
        } else if paths().any(crate::world::Path::is_blurred) {
            sweep.done = true;
        } else {
            let low_m = if jumped {
                f64::NEG_INFINITY
            } else {
                (memo.gap.min - change - start.slop).next_down()
            };
            let is_free = if are_in_step((a, b)) {
                low_m > 0.0 && low_m > length((a, b))
            } else {
                sweep.done = true;
                apart_in_any_order((a, b), low_m)
            };
            if is_free {
                (sweep.free, sweep.done) = (1.0, true);
            }
        }
        sweep
    }

    /// A sweep of which nothing is known.
    fn fresh((slot, a, b): (PairSlot, BodySlot, BodySlot), warm: Warm) -> Self {
        Self {
            slot,
            a,
            b,
            done: false,
            jumped: false,
            teleported: false,
            free: 0.0,
            hit: f64::INFINITY,
            stuck: false,
            missed: 0.0,
            looks: 0,
            judged: (0.0, 0),
            probes: 0,
            last: (f64::NAN, f64::NAN),
            slope: 0.0,
            warm,
        }
    }

    fn outcome(&self) -> Swept {
        let until = |end: f64| Interval {
            min: self.free.min(end),
            max: end,
        };
        let passage = if self.hit.is_finite() {
            Passage::Touched(until(self.hit))
        } else if self.free >= 1.0 {
            Passage::Free
        } else {
            Passage::Open(until(1.0))
        };
        Swept {
            slot: self.slot,
            passage,
            jumped: self.jumped,
            teleported: self.teleported,
        }
    }

    /// Some looks; ends early when the sweep is decided or given up, or the meter closes.
    fn turn(&mut self, bodies: (&Body, &Body), work: &mut Work<'_, '_>) {
        let stop = self.looks + SLICE_LOOKS;
        while !self.done && self.looks < stop && work.meter.open() {
            if self.free >= 1.0 || self.is_in_vain() {
                self.done = true;
                return;
            }
            if self.stuck {
                self.close_in(bodies, 0.0, work);
                continue;
            }
            let moment = Moment::of(bodies, self.free);
            if moment.jumps() {
                self.free = moment.until;
                self.last = (f64::NAN, f64::NAN);
                continue;
            }
            self.looks += 1;
            let ahead = work.look(bodies, &moment, f64::INFINITY, &mut self.warm);
            let step = match ahead {
                Ahead::Cut => return,
                Ahead::Touch => {
                    self.hit = self.hit.min(self.free);
                    self.done = true;
                    return;
                }
                Ahead::Unsure => 0.0,
                Ahead::Free { time, gap_m } => self.go_on(&moment, time, gap_m),
            };
            if step <= 0.0 {
                // It would repeat the same test; the probes ahead start over.
                (self.stuck, self.missed, self.probes) = (true, self.free, 0);
            }
            self.close_in(bodies, step, work);
        }
    }

    /// Whether it cannot finish within the looks it may have: a grazing pair slows down for good.
    fn is_in_vain(&mut self) -> bool {
        let (free, looks) = self.judged;
        if self.looks < looks + FIRST_LOOKS {
            return false;
        }
        self.judged = (self.free, self.looks);
        let left = SWEEP_LOOKS_MAX.saturating_sub(self.looks);
        (self.free - free) * f64::from(left) < (1.0 - self.free) * f64::from(FIRST_LOOKS)
    }

    /// Advances; returns by how much.
    fn go_on(&mut self, moment: &Moment, time: f64, gap_m: f64) -> f64 {
        let here = self.free;
        let (last_s, last_m) = self.last;
        // Changes within the rounding of the way say nothing about the slope.
        if here > last_s && gap_m < last_m - moment.slop {
            self.slope = (last_m - gap_m) / (here - last_s);
        }
        self.last = (here, gap_m);
        self.free = (here + time * SHORT).min(moment.until).max(here);
        self.free - here
    }
}
