//! Which mode a tick uses: candidates that last, or none (`afresh`).
//!
//! In: counted work (`cost`), never time, so that a replay chooses alike. Out: a choice, with hysteresis.

use super::cost::{FAR, candidates_cost, scratch_guess};
use super::probe::PROBE_TICKS;
use super::{MANY_MOVED, Work};
use crate::wire::BroadCause;

/// Ticks that the mean of the work is taken over.
const MEAN_TICKS: u64 = 16;
/// Ticks after a sort of all that are left out of that mean: bodies have yet to learn their margins. With fewer, the
/// cost of learning counts against candidates; with more, candidates that do not pay are given up later.
const SETTLE_TICKS: u64 = 16;
/// Ticks after a sort of all that count in no mean; the ticks after them suffice to give up hopeless candidates without
/// a longer measurement.
const EARLY_TICKS: u64 = 8;
/// Least ticks in the mean by which candidates are judged hopeless: with fewer one expensive tick would do, with more
/// they are kept for longer.
const EARLY_MEAN: u64 = 4;
/// Candidates are hopeless when they cost more than this many times as much as no candidates.
const HOPELESS: u64 = 2;
/// Least ticks before hopeless candidates are tried again: a trial costs several times what it could save.
const SPELL_LONG: u32 = 512;
/// With fewer bodies either mode takes almost no time.
const BODIES_MIN: u64 = 64;
/// With more than `FAR` bodies the first ticks work without candidates: until margins are learned, candidates cost
/// several times as much, and memory that is wasted if they do not pay. A short probe estimates whether they may.
const FIRST_TICKS: u32 = 24;
/// That first probe favours candidates if at most this many of 1024 bodies escape from their fat boxes per tick. With a
/// higher limit candidates are tried that do not pay; with a lower one, those that would pay wait.
const FIRST_ESCAPES: u64 = 64;
/// Ticks without candidates before they are tried again, if a probe is promising; doubled after a failure.
const SPELL_MIN: u32 = 128;
const _: () = assert!(
    SPELL_MIN >= 2 * PROBE_TICKS,
    "one probe at its begin, one at its end"
);
const SPELL_MAX: u32 = 2048;
/// So many spells may end without a trial when probes are not promising; then one is made, as probes miss some costs.
const VAIN_MAX: u32 = 64;
/// Most fat boxes renewed with candidates per escape: some are renewed along with others.
const RENEWED_PER_ESCAPE: u64 = 3;
/// A trial of candidates that lasted this many ticks was no failure.
const TRIAL_TICKS: u32 = 64;
/// After this many ticks in a row with few moved bodies, candidates are better without a trial.
const CALM_TICKS: u32 = 4;

/// The measurements that decide whether candidates pay.
#[derive(Clone, Copy, Debug)]
pub(super) struct Footing {
    /// Bodies of 1024 that escape from their fat boxes in a tick.
    pub(super) escapes: u64,
    /// Density: by the overlaps of 1024 bodies.
    pub(super) crowd: u64,
}

impl Footing {
    /// Returns whether candidates may pay now although they did not then: bodies stay longer in their fat boxes, or the
    /// density has changed.
    fn promises(&self, then: &Self) -> bool {
        let calmer = self.escapes * 4 < then.escapes * 3;
        let (few, many) = (self.crowd.min(then.crowd), self.crowd.max(then.crowd));
        calmer || many * 3 > few * 4
    }
}

/// State of the choice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gear {
    /// The choice, if it is forced.
    pub(super) forced: Option<bool>,
    /// Why the last tick had no candidates, or the first one had them again.
    pub(super) cause: BroadCause,
    /// Mean work of a tick with candidates, and the number of ticks in it.
    mean: u64,
    ticks: u64,
    /// Remaining ticks without candidates, and the length of the next such spell.
    left: u32,
    spell: u32,
    /// Ticks since the last spell began or ended.
    since: u32,
    calm: u32,
    /// Cost of a tick without candidates per 1024 bodies, from the last one; 0 before the first.
    scratch: u64,
    /// Fat boxes renewed per tick with candidates, per 1024 bodies, on average; while there are no candidates, of the
    /// last such ticks.
    renewed: u64,
    /// The measurement right after candidates were given up, and the last one since.
    first: Option<Footing>,
    last: Option<Footing>,
    /// Spells since then without a trial.
    vain: u32,
    /// Candidates have not lasted long enough yet to be judged.
    untried: bool,
}

impl Default for Gear {
    fn default() -> Self {
        Self {
            forced: None,
            cause: BroadCause::None,
            mean: 0,
            ticks: 0,
            left: 0,
            spell: SPELL_MIN,
            since: TRIAL_TICKS,
            calm: 0,
            scratch: 0,
            renewed: 0,
            first: None,
            last: None,
            vain: 0,
            untried: true,
        }
    }
}

impl Gear {
    /// Returns whether this tick works without candidates.
    ///
    /// * `on` - whether the last one did.
    /// * `usual`, `hits` - blocks met by a block's query, in sixteenths; and overlaps.
    pub(super) fn choose(
        &mut self,
        on: bool,
        moved: usize,
        bodies: usize,
        (usual, hits): (u64, usize),
    ) -> bool {
        if let Some(forced) = self.forced {
            self.cause = BroadCause::Forced;
            return forced;
        }
        self.since = self.since.saturating_add(1);
        self.calm = if moved * MANY_MOVED > bodies {
            0
        } else {
            self.calm.saturating_add(1)
        };
        let mut hopeless = false;
        let chosen = if on {
            self.left = self.left.saturating_sub(1);
            let calm = self.calm >= if self.untried { 1 } else { CALM_TICKS };
            if calm {
                self.spell = SPELL_MIN;
            }
            let over = self.left == 0;
            let in_vain = over && self.vain < VAIN_MAX && self.is_as_it_was();
            self.untried &= !(calm || over);
            if in_vain {
                self.left = SPELL_MIN;
                self.vain += 1;
            }
            self.cause = match (calm, over && !in_vain) {
                (true, _) => BroadCause::Calm,
                (false, true) => BroadCause::Trial,
                (false, false) => BroadCause::Spell,
            };
            self.cause == BroadCause::Spell
        } else if self.untried && bodies > FAR {
            // Bodies that came are not listed as moved.
            self.calm = 0;
            self.cause = BroadCause::Spell;
            true
        } else {
            let scratch = if self.scratch > 0 {
                self.scratch * bodies as u64 / 1024
            } else {
                scratch_guess(bodies, usual, hits)
            };
            let seen = self.ticks.saturating_sub(self.counted_from());
            hopeless = seen >= EARLY_MEAN && self.mean > scratch * HOPELESS;
            // A margin of one fifth: a change costs as much as some ticks.
            let settled = self.ticks >= SETTLE_TICKS + MEAN_TICKS;
            self.cause = BroadCause::Cost;
            bodies as u64 >= BODIES_MIN && (hopeless || (settled && self.mean * 5 > scratch * 6))
        };
        if chosen != on {
            if chosen {
                let failed = self.since < TRIAL_TICKS;
                self.spell = if failed {
                    (self.spell * 2).min(SPELL_MAX)
                } else {
                    SPELL_MIN
                };
                if hopeless {
                    self.spell = self.spell.max(SPELL_LONG);
                }
                self.left = if self.untried {
                    FIRST_TICKS
                } else {
                    self.spell
                };
            }
            (self.since, self.ticks, self.mean) = (0, 0, 0);
            (self.first, self.last, self.vain) = (None, None, 0);
        }
        chosen
    }

    /// Returns whether, according to probes, candidates would do as badly as when they were given up. The first probe
    /// came a little later: what had calmed by then is judged by the renewals that candidates really had. Before any
    /// trial: whether more bodies would escape than candidates are worth.
    fn is_as_it_was(&self) -> bool {
        match (self.first, self.last) {
            (Some(now), _) if self.untried => now.escapes > FIRST_ESCAPES,
            (Some(then), Some(now)) => {
                !now.promises(&then) && now.escapes * RENEWED_PER_ESCAPE >= self.renewed
            }
            _ => false,
        }
    }

    /// Returns `Some` if a tick without candidates belongs to a probe, with whether it is the first of it. There is a
    /// probe after candidates were given up, and one before they may be tried again.
    pub(super) fn probes(&self) -> Option<bool> {
        let first = self.since < PROBE_TICKS;
        if self.forced.is_some() || !(first || self.left <= PROBE_TICKS) {
            return None;
        }
        Some(if first {
            self.since == 0
        } else {
            self.left == PROBE_TICKS
        })
    }

    /// Returns whether a probe of this many ticks is to be evaluated.
    pub(super) fn asks_probe(&self, ticks: u32) -> bool {
        ticks == PROBE_TICKS || (self.untried && ticks == FIRST_TICKS)
    }

    /// Takes the result of a probe.
    pub(super) fn note_probe(&mut self, footing: Footing) {
        if self.since < PROBE_TICKS {
            self.first = Some(footing);
        } else {
            self.last = Some(footing);
        }
    }

    /// The tick after which the mean begins: early ticks count until bodies have settled.
    fn counted_from(&self) -> u64 {
        if self.ticks > SETTLE_TICKS {
            SETTLE_TICKS
        } else {
            EARLY_TICKS
        }
    }

    /// Takes the cost of a tick without candidates; if nearly all bodies left, it does not predict the next ones.
    pub(super) fn note_scratch(&mut self, bodies: usize, cost: u64) {
        let bodies = bodies as u64;
        self.scratch = if bodies < BODIES_MIN {
            0
        } else {
            cost * 1024 / bodies + 1
        };
    }

    /// Takes the work of a tick with candidates.
    ///
    /// * `lanes` - lanes given up or taken.
    pub(super) fn note(&mut self, moved: usize, lanes: u64, work: &Work) {
        if work.rebuilds > 0 {
            // A sort of all does not predict the ticks after it.
            (self.ticks, self.mean) = (0, 0);
            return;
        }
        let cost = candidates_cost(moved, lanes, work);
        self.ticks += 1;
        if self.ticks <= EARLY_TICKS {
            return;
        }
        self.untried = false;
        let share = (self.ticks - self.counted_from()).min(MEAN_TICKS);
        self.mean = (self.mean * (share - 1) + cost) / share;
        let renewed = work.renewed * 1024 / (moved as u64).max(1);
        self.renewed = (self.renewed * (share - 1) + renewed) / share;
    }
}

#[cfg(test)]
mod tests;
