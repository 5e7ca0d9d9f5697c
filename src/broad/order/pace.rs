//! How many ticks a Verlet list is made for, when the next one is begun, and whether lists pay.
//!
//! In: counted work and how far bodies fly, never time, so that a replay chooses alike. Out: when the list is rebuilt,
//! for how long, and when it is dropped.

use super::cost::{LOOK, MEET, entries_cost};
use super::lay::LAY_TESTS;
use super::shares::RUNS_MAX;

/// Ticks that a list is in use: initial, least and most.
const TICKS: u32 = 8;
const TICKS_MIN: u32 = 4;
const TICKS_MAX: u32 = 24;
/// The next list is made during one in this many of them, and over `AHEAD_MAX` ticks at most.
const AHEAD_SHARE: u32 = 2;
const AHEAD_MAX: u32 = 4;
const _: () = assert!(AHEAD_MAX as usize <= RUNS_MAX, "a run of blocks in each");
/// After this many lists in a row that cost more than a search in each tick, there are none for a while.
const VAIN: u32 = 3;
/// Initial number of ticks without lists when these have not paid; four times as many after each further failure. With
/// fewer, more is spent on lists that do not pay; with more, it is noticed later that they would.
const REST_MIN: u32 = 64;
/// Most ticks without lists before one is tried again.
const REST_MAX: u32 = 2048;
/// Ticks without lists after a paying one was dropped because too much happened in one tick.
const REST_BROKEN: u32 = 8;
/// Ticks before the first list: in one of them bodies are watched.
const FIRST_REST: u32 = 2;
/// When one in this many bodies strays, comes or jumps in a tick, the next list is begun in the following tick.
const MANY_STRAY: usize = 32;

/// The role of a tick for the list in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// The list lasts; the next one has not been begun.
    Lasts,
    /// All boxes are swept again, and the next list is begun.
    Opens,
    /// The next list is being made.
    Makes,
    /// The next list takes over.
    Ends,
}

/// State of the choice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    /// Ticks that a list is in use, or the next one if that is being made; and ticks until the next takes over.
    ticks: u32,
    left: u32,
    /// Whether the next list is being made.
    making: bool,
    /// Work of the list in use, of its last tick, and the number of ticks it has lasted.
    cost: u64,
    tick: u64,
    lasted: u64,
    /// Mean work per tick of the last judged list, 0 if none; and whether the list after it was made for more ticks
    /// rather than fewer.
    before: u64,
    longer: bool,
    /// What entries and searches may cost per tick before a search in each is cheaper.
    worth: u64,
    /// Boxes compared with a block in the first search since the layout; the excess over that since; and the excess of
    /// the last search.
    usual: u64,
    excess: u64,
    last: u64,
    vain: u32,
    /// Ticks until a list is tried again, and how many it will be the next time.
    rest: u32,
    spell: u32,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            ticks: TICKS,
            left: 0,
            making: false,
            cost: 0,
            tick: 0,
            lasted: 0,
            before: 0,
            longer: true,
            worth: 0,
            usual: 0,
            excess: 0,
            last: 0,
            vain: 0,
            rest: FIRST_REST,
            spell: REST_MIN,
        }
    }
}

impl Pace {
    /// Returns whether to begin a list, in a tick without one.
    ///
    /// * `hits` - overlaps of the last tick: there will be more entries.
    /// * `worth` - what entries and searches may cost ([`list_worth`](super::cost::list_worth)).
    pub(super) fn begins(&mut self, hits: usize, worth: u64) -> bool {
        self.rest = self.rest.saturating_sub(1);
        self.rest == 0 && hits as u64 * LOOK < worth
    }

    /// Returns whether there may be a list in the next tick, if there is none in this.
    pub(super) fn nears(&self) -> bool {
        self.rest <= 1
    }

    /// Ticks that the first list is made for.
    pub(super) fn first_ticks(&self) -> u32 {
        self.ticks
    }

    /// Returns whether a first list could pay; if not, the next attempt is delayed.
    ///
    /// * `hits` - overlaps now.
    /// * `crowding` - factor by which more pairs will be near than overlap.
    /// * `worth` - as for [`Pace::begins`], by a search of all boxes as they are.
    pub(super) fn promises(&mut self, hits: usize, crowding: f64, worth: u64) -> bool {
        #[allow(clippy::cast_precision_loss, reason = "a cost")]
        let (looks, worth) = ((hits as u64 * LOOK) as f64, worth as f64);
        let promises = looks * crowding <= worth;
        if !promises {
            self.fail();
        }
        promises
    }

    /// Lists begin; the first one is made at once.
    ///
    /// * `worth` - as for [`Pace::promises`].
    pub(super) fn begin(&mut self, worth: u64) {
        (self.worth, self.left, self.making) = (worth, 0, false);
        self.note_laid();
    }

    /// The role of this tick for the list in use.
    pub(super) fn phase(&self) -> Phase {
        match (self.making, self.left) {
            (true, 0) => Phase::Ends,
            (true, _) => Phase::Makes,
            (false, left) if left <= self.ahead() => Phase::Opens,
            (false, _) => Phase::Lasts,
        }
    }

    /// Ticks before a list takes over in which it is made.
    fn ahead(&self) -> u32 {
        (self.ticks / AHEAD_SHARE).clamp(1, AHEAD_MAX)
    }

    /// Ticks, including this one, before the next list is begun.
    pub(super) fn spare(&self) -> u32 {
        self.left.saturating_sub(self.ahead())
    }

    /// Begins the next list in this tick; returns in how many ticks it is made, including this one.
    pub(super) fn open(&mut self) -> u32 {
        self.making = true;
        self.left
    }

    /// Ticks that a box made in this tick is swept for: to the end of the list that it is made for, including the tick
    /// in which the next takes over, since the old list still reports begins and ends up to then.
    ///
    /// * `first` - whether it is for the first list, which is in use from this tick on.
    pub(super) fn span(&self, first: bool) -> u32 {
        if first || self.making {
            self.left + self.ticks
        } else {
            self.left
        }
    }

    /// Returns whether the excess of the searches has cost more than a new layout would.
    pub(super) fn is_worn(&self, bodies: usize) -> bool {
        self.excess + self.last > u64::from(LAY_TESTS) * bodies as u64
    }

    /// Mean cost per tick of entries and searches; `None` while unknown.
    pub(super) fn mean(&self) -> Option<u64> {
        (self.before > 0).then_some(self.before)
    }

    /// Bodies were laid out again.
    pub(super) fn note_laid(&mut self) {
        (self.usual, self.excess, self.last) = (0, 0, 0);
    }

    /// Adds up the cost of the list until the next one takes over; returns whether there is to be a next one.
    pub(super) fn pays(&mut self) -> bool {
        let left = u64::from(self.left);
        let mean = (self.cost + left * self.tick) / (self.lasted + left).max(1);
        let pays = mean * 10 < self.worth * 9;
        if pays && self.vain == 0 && self.before > 0 {
            // Two paying lists in a row.
            self.spell = REST_MIN;
        }
        self.vain = if pays { 0 } else { self.vain + 1 };
        // Hill climbing: continue in the direction that was better.
        if mean > self.before {
            self.longer = !self.longer;
        }
        self.before = mean;
        let step = (self.ticks / 4).max(1);
        self.ticks = if self.longer {
            (self.ticks + step).min(TICKS_MAX)
        } else {
            (self.ticks - step).max(TICKS_MIN)
        };
        let pays = self.vain < VAIN;
        if !pays {
            self.fail();
        }
        pays
    }

    /// Drops the list; the next attempt is delayed.
    pub(super) fn fail(&mut self) {
        self.rest = self.spell;
        self.spell = (self.spell * 4).min(REST_MAX);
        self.vain = 0;
        (self.ticks, self.left) = (TICKS, 0);
        self.making = false;
        self.before = 0;
    }

    /// Drops the list because too much happened in one tick. If it had paid until then, the next attempt comes soon.
    pub(super) fn break_off(&mut self) {
        let paid = self.before > 0 && self.vain == 0;
        self.fail();
        if paid {
            self.rest = REST_BROKEN;
        }
    }

    /// A list takes over.
    ///
    /// * `tests` - boxes compared with a block in the search for it.
    pub(super) fn note_list(&mut self, tests: u64) {
        if self.usual == 0 {
            self.usual = tests;
        }
        self.last = tests.saturating_sub(self.usual);
        self.excess += self.last;
        (self.cost, self.tick, self.lasted) = (tests * MEET, 0, 0);
        self.left = self.ticks;
        self.making = false;
    }

    /// A tick with a list is over.
    pub(super) fn note_tick(&mut self, entries: usize, strays: usize, bodies: usize) {
        self.tick = entries_cost(bodies, entries, strays);
        self.lasted += 1;
        self.cost += self.tick;
        self.left -= 1;
        let hopeless = entries as u64 * LOOK > self.worth;
        if hopeless {
            self.vain = VAIN - 1;
        }
        // In the tick in which a list takes over, bodies strayed from the one before.
        let stray = strays * MANY_STRAY > bodies && self.lasted > 1;
        if !self.making && (hopeless || stray) {
            self.left = self.left.min(self.ahead());
        }
    }
}

#[cfg(test)]
mod tests;
