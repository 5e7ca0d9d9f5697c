//! Which way of working a tick takes: candidates that last, or none (`afresh`).
//!
//! In: counted work, never time, so that a replay chooses alike. Out: a choice, with hysteresis. The weights were
//! measured once; they decide about cost alone.

use super::probe::PROBE_TICKS;
use super::{MANY_MOVED, Work};
use crate::wire::BroadCause;

/// Weights, in nanoseconds of the machine that they were measured on: a box taken, a candidate compared (or where more
/// bodies move than the caches hold), a fat box renewed, a lane given up or taken ...
const TAKE: u64 = 10;
const TEST: u64 = 15;
const TEST_FAR: u64 = 25;
const FAR: usize = 1 << 15;
const RENEW: u64 = 200;
const LANE: u64 = 1500;
/// ... and without candidates a body, a box compared with a block.
const BODY: u64 = 25;
pub(super) const MEET: u64 = 12;
/// Boxes compared with a block without candidates, a body, where that is not known yet: so many, and one for so many
/// blocks that a block's query meets, in sixteenths.
const MEETS_LEAST: u64 = 2;
const MEETS_SHARE: u64 = 128;
/// A Verlet list (`verlet`) takes this share of them in the mean, one for each overlap, and so many for the boxes.
const LIST_SHARE: u64 = 4;
const LIST_LEAST: u64 = 3;
/// Ticks that a mean of the work is taken over ...
const MEAN_TICKS: u64 = 16;
/// ... and ticks after a sort of all that do not count: bodies have yet to learn their margins.
const SETTLE_TICKS: u64 = 16;
/// After so many ticks candidates that take twice as much as none are given up without a longer look, ...
const EARLY_TICKS: u64 = 8;
/// ... by the mean of so many ...
const EARLY_MEAN: u64 = 4;
const HOPELESS: u64 = 2;
/// ... and not tried again for so many ticks: a trial costs several times what it tries to save.
const SPELL_LONG: u32 = 512;
/// Below so many bodies either way takes next to nothing.
const BODIES_MIN: u64 = 64;
/// Ticks without candidates before these are tried again, if a probe promises anything; twice as many when in vain.
const SPELL_MIN: u32 = 128;
const _: () = assert!(
    SPELL_MIN >= 2 * PROBE_TICKS,
    "one probe at its begin, one at its end"
);
const SPELL_MAX: u32 = 2048;
/// So many spells end without a trial where probes promise nothing, for they do not see all that candidates cost.
const VAIN_MAX: u32 = 64;
/// Fat boxes that candidates renew for each one that a body escapes from, at most: some are renewed along with others.
const RENEWED_PER_ESCAPE: u64 = 3;
/// A trial of candidates that lasted so many ticks was no failure.
const TRIAL_TICKS: u32 = 64;
/// So many ticks in a row with few moved, and candidates are better without a trial.
const CALM_TICKS: u32 = 4;

/// What decides whether candidates pay.
#[derive(Clone, Copy, Debug)]
pub(super) struct Footing {
    /// Bodies that escape from their fat boxes in a tick, of 1024.
    pub(super) escapes: u64,
    /// How crowded it is, by the overlaps of 1024 bodies.
    pub(super) crowd: u64,
}

impl Footing {
    /// Whether candidates may pay now, which did not then: bodies keep longer to their fat boxes, or there is another
    /// crowd of them.
    fn promises(&self, then: &Self) -> bool {
        let calmer = self.escapes * 4 < then.escapes * 3;
        let (few, many) = (self.crowd.min(then.crowd), self.crowd.max(then.crowd));
        calmer || many * 3 > few * 4
    }
}

/// What the choice is made by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gear {
    /// The choice, where it is not left to counted work.
    pub(super) forced: Option<bool>,
    /// Why the last tick was worked without candidates, or the first one with them again.
    pub(super) cause: BroadCause,
    /// Mean work of a tick with candidates, and how many ticks it is a mean of.
    mean: u64,
    ticks: u64,
    /// Ticks left without candidates, and how many there will be the next time.
    left: u32,
    spell: u32,
    /// Ticks since the last spell began or ended.
    since: u32,
    calm: u32,
    /// Boxes compared with a block without candidates, a body, by the last such tick; 0 before the first.
    meets: u64,
    /// Fat boxes renewed in a tick with candidates, of 1024 bodies, in the mean; of the last such ticks while there are
    /// none.
    renewed: u64,
    /// The footing right after candidates were given up, and the last one since.
    first: Option<Footing>,
    last: Option<Footing>,
    /// Spells since without a trial.
    vain: u32,
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
            meets: 0,
            renewed: 0,
            first: None,
            last: None,
            vain: 0,
        }
    }
}

impl Gear {
    /// Whether this tick is to be worked without candidates.
    ///
    /// * `on` - whether the last one was.
    /// * `usual`, `hits` - blocks that a block's query meets, in sixteenths; and overlaps.
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
            let calm = self.calm >= CALM_TICKS;
            if calm {
                self.spell = SPELL_MIN;
            }
            let over = self.left == 0;
            let in_vain = over && self.vain < VAIN_MAX && self.is_as_it_was();
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
        } else {
            let bodies = bodies as u64;
            let meets = if self.meets > 0 {
                self.meets
            } else {
                let plain = MEETS_LEAST + usual / MEETS_SHARE;
                let hits = hits as u64 / bodies.max(1);
                plain.min(plain / LIST_SHARE + hits + LIST_LEAST)
            };
            let scratch = bodies * (BODY + meets * MEET);
            let seen = self.ticks.saturating_sub(self.counted_from());
            hopeless = seen >= EARLY_MEAN && self.mean > scratch * HOPELESS;
            // A fifth more: a change costs as much as some ticks.
            let settled = self.ticks >= SETTLE_TICKS + MEAN_TICKS;
            self.cause = BroadCause::Cost;
            bodies >= BODIES_MIN && (hopeless || (settled && self.mean * 5 > scratch * 6))
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
                self.left = self.spell;
            }
            (self.since, self.ticks, self.mean) = (0, 0, 0);
            (self.first, self.last, self.vain) = (None, None, 0);
        }
        chosen
    }

    /// Whether candidates would fare as they did when they were given up, as far as probes tell. The first came a
    /// little later: what had calmed by then is seen by what candidates themselves had to renew.
    fn is_as_it_was(&self) -> bool {
        match (self.first, self.last) {
            (Some(then), Some(now)) => {
                !now.promises(&then) && now.escapes * RENEWED_PER_ESCAPE >= self.renewed
            }
            _ => false,
        }
    }

    /// Whether a tick without candidates is one of a probe, and the first: there is one after candidates were given up,
    /// and one before they may be tried again.
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

    /// Takes what a probe has come to.
    pub(super) fn note_probe(&mut self, footing: Footing) {
        if self.since < PROBE_TICKS {
            self.first = Some(footing);
        } else {
            self.last = Some(footing);
        }
    }

    /// The tick after which the mean begins: early ones count until bodies have settled.
    fn counted_from(&self) -> u64 {
        if self.ticks > SETTLE_TICKS {
            SETTLE_TICKS
        } else {
            EARLY_TICKS
        }
    }

    /// Takes the work of a tick without candidates: boxes compared with a block.
    pub(super) fn note_scratch(&mut self, bodies: usize, tests: u64) {
        self.meets = tests / (bodies as u64).max(1) + 1;
    }

    /// Takes the work of a tick with candidates.
    ///
    /// * `lanes` - how many were given up or taken.
    pub(super) fn note(&mut self, moved: usize, lanes: u64, work: &Work) {
        if work.rebuilds > 0 {
            // A sort of all says nothing of the ticks after it.
            (self.ticks, self.mean) = (0, 0);
            return;
        }
        let test = if moved > FAR { TEST_FAR } else { TEST };
        let cost = moved as u64 * TAKE + work.tests * test + work.renewed * RENEW + lanes * LANE;
        self.ticks += 1;
        if self.ticks <= EARLY_TICKS {
            return;
        }
        let share = (self.ticks - self.counted_from()).min(MEAN_TICKS);
        self.mean = (self.mean * (share - 1) + cost) / share;
        let renewed = work.renewed * 1024 / (moved as u64).max(1);
        self.renewed = (self.renewed * (share - 1) + renewed) / share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn work(tests: u64, renewed: u64) -> Work {
        Work {
            tests,
            renewed,
            ..Work::default()
        }
    }

    /// Runs ticks in which all of 1,000 bodies move; returns how many were worked without candidates.
    fn run(gear: &mut Gear, on: &mut bool, ticks: u32, work: &Work) -> u32 {
        let mut scratch = 0;
        for _ in 0..ticks {
            *on = gear.choose(*on, 1000, 1000, (300, 0));
            if *on {
                scratch += 1;
            } else {
                gear.note(1000, 0, work);
            }
        }
        scratch
    }

    #[test]
    fn motion_that_no_box_holds_is_worked_from_scratch_but_for_ever_rarer_trials() {
        let (mut gear, mut on) = (Gear::default(), false);
        let wild = work(10_000, 900);
        assert!(run(&mut gear, &mut on, 40, &wild) >= 1);
        assert_eq!(gear.cause, BroadCause::Spell);
        assert!(run(&mut gear, &mut on, 10_000, &wild) > 9_700);
        // It has calmed: a trial finds that out and stays.
        let calm = work(2_000, 60);
        run(&mut gear, &mut on, SPELL_MAX + 1, &calm);
        assert_eq!(run(&mut gear, &mut on, 1000, &calm), 0);
    }

    /// Gives up candidates that renewed 900 boxes a tick of 1,000 bodies.
    fn given_up() -> Gear {
        let (mut gear, wild) = (Gear::default(), work(10_000, 900));
        while !gear.choose(false, 1000, 1000, (300, 0)) {
            gear.note(1000, 0, &wild);
        }
        assert_eq!((gear.left, gear.probes()), (SPELL_LONG, Some(true)));
        gear
    }

    /// Ticks without candidates, as many as asked for or until a trial; what probes come to is told. Returns how many
    /// began, their ticks, and whether a trial came.
    fn spell(gear: &mut Gear, most: u32, escapes: u64, crowd: u64) -> (u32, u32, bool) {
        let (mut begun, mut ticks) = (0, 0);
        for _ in 0..most {
            if let Some(begins) = gear.probes() {
                begun += u32::from(begins);
                ticks += 1;
                if ticks % PROBE_TICKS == 0 {
                    gear.note_probe(Footing { escapes, crowd });
                }
            }
            if !gear.choose(true, 1000, 1000, (300, 0)) {
                assert_eq!(gear.cause, BroadCause::Trial);
                return (begun, ticks, true);
            }
        }
        (begun, ticks, false)
    }

    #[test]
    fn candidates_are_not_tried_again_on_the_footing_that_they_were_given_up_on() {
        let mut gear = given_up();
        let two = (2, 2 * PROBE_TICKS, false);
        assert_eq!(spell(&mut gear, SPELL_LONG, 400, 2000), two);
        let ten = (10, 10 * PROBE_TICKS, false);
        assert_eq!(spell(&mut gear, 10 * SPELL_MIN, 350, 2500), ten);
        // Calmer, or another crowd.
        for (escapes, crowd) in [(290, 2000), (400, 1400), (400, 2700)] {
            let mut other = gear;
            assert!(
                spell(&mut other, SPELL_MIN, escapes, crowd).2,
                "{escapes} {crowd}"
            );
        }
        // Nor are they given up for ever.
        let rest = (VAIN_MAX - 11) * SPELL_MIN;
        assert!(!spell(&mut gear, rest, 400, 2000).2);
        assert!(spell(&mut gear, SPELL_MIN, 400, 2000).2);
    }

    #[test]
    fn a_burst_that_has_calmed_before_the_first_probe_is_no_footing() {
        let mut gear = given_up();
        assert!(spell(&mut gear, SPELL_LONG, 50, 2000).2);
    }

    #[test]
    fn candidates_that_take_twice_as_much_are_given_up_early() {
        let (mut gear, mut on) = (Gear::default(), false);
        let wild = work(10_000, 900);
        assert_eq!(run(&mut gear, &mut on, 12, &wild), 0);
        assert_eq!(run(&mut gear, &mut on, 1, &wild), 1);
        assert_eq!(gear.cause, BroadCause::Cost);
        let left = SPELL_LONG - 1;
        assert_eq!(run(&mut gear, &mut on, left, &wild), left);
        assert_eq!(gear.cause, BroadCause::Spell);
        assert_eq!(run(&mut gear, &mut on, 1, &wild), 0);
        assert_eq!(gear.cause, BroadCause::Trial);
    }

    #[test]
    fn a_world_that_comes_to_rest_is_left_to_candidates_at_once() {
        let (mut gear, mut on) = (Gear::default(), false);
        run(&mut gear, &mut on, 40, &work(10_000, 900));
        assert!(on);
        for _ in 0..CALM_TICKS {
            on = gear.choose(on, 10, 1000, (300, 0));
        }
        assert_eq!((on, gear.cause), (false, BroadCause::Calm));
        gear.forced = Some(true);
        assert!(gear.choose(on, 10, 1000, (300, 0)));
        assert_eq!(gear.cause, BroadCause::Forced);
    }

    #[test]
    fn motion_that_boxes_hold_is_never_worked_from_scratch() {
        let (mut gear, mut on) = (Gear::default(), false);
        assert_eq!(run(&mut gear, &mut on, 5_000, &work(2_500, 80)), 0);
    }
}
