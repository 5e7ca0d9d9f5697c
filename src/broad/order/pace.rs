//! For how many ticks a Verlet list is made, when the next one is begun, and whether lists pay.
//!
//! In: counted work and how far bodies fly, never time, so that a replay chooses alike. Out: when the list is made
//! anew, for how long, and when it is let go. The weights were measured once; they decide about cost alone.

use super::gear::MEET;
use super::lay::LAY_TESTS;
use super::shares::RUNS_MAX;

/// Weights, as those of [`gear`](super::gear): an entry looked at, a body looked for alone.
const LOOK: u64 = 4;
const STRAY: u64 = 400;
/// Ticks that a list is in use, at first, at least and at most.
const TICKS: u32 = 8;
const TICKS_MIN: u32 = 4;
const TICKS_MAX: u32 = 24;
/// One in so many of them is one in which the next list is made, ... and so many at most.
const AHEAD_SHARE: u32 = 2;
const AHEAD_MAX: u32 = 4;
const _: () = assert!(AHEAD_MAX as usize <= RUNS_MAX, "a run of blocks in each");
/// Lists in a row that take more than a search in each tick would, and there are none ...
const VAIN: u32 = 3;
/// ... for so many ticks; four times as many each time that they prove no better.
const REST_MIN: u32 = 64;
const REST_MAX: u32 = 2048;
/// Ticks before the first: in one of them bodies are watched.
const FIRST_REST: u32 = 2;
/// One in so many strays, comes or jumps in a tick, and the next list is begun in the one that follows.
const MANY_STRAY: usize = 32;

/// What a tick is to the list in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// It lasts; the next one has not been begun.
    Lasts,
    /// All boxes are swept anew, and the next one is begun.
    Opens,
    /// The next one is being made.
    Makes,
    /// The next one takes over.
    Ends,
}

/// What the choice is made by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    /// Ticks that a list is in use, or the next one where that is being made; and ticks until the next takes over.
    ticks: u32,
    left: u32,
    /// Whether the next one is being made.
    making: bool,
    /// Work of the list in use, of its last tick, and the ticks it has lasted; ...
    cost: u64,
    tick: u64,
    lasted: u64,
    /// ... of the one before in the mean, and whether its ticks were more than those of the one before it.
    before: u64,
    longer: bool,
    /// What a tick would take without: boxes compared with a block.
    plain: u64,
    /// Boxes compared with a block in the first search since bodies were laid, and those beyond that since; and in the
    /// last one.
    usual: u64,
    excess: u64,
    last: u64,
    vain: u32,
    /// Ticks until a list is tried again, and how many there will be the next time.
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
            plain: 0,
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
    /// Whether a list is to be begun in a tick without.
    ///
    /// * `hits` - overlaps of the last tick: there will be more entries.
    /// * `plain` - boxes compared with a block in its search.
    pub(super) fn begins(&mut self, hits: usize, plain: u64) -> bool {
        self.rest = self.rest.saturating_sub(1);
        self.rest == 0 && hits as u64 * LOOK < plain * MEET
    }

    /// Whether one may be in the next tick, if none is in this.
    pub(super) fn nears(&self) -> bool {
        self.rest <= 1
    }

    /// Ticks that the first list is made for.
    pub(super) fn first_ticks(&self) -> u32 {
        self.ticks
    }

    /// Whether a first list would not be hopeless; where it would, it is not soon asked again.
    ///
    /// * `hits` - overlaps now.
    /// * `crowding` - times more that will be near.
    /// * `plain` - boxes compared with a block in a search of all boxes as they are.
    pub(super) fn promises(&mut self, hits: usize, crowding: f64, plain: u64) -> bool {
        #[allow(clippy::cast_precision_loss, reason = "a cost")]
        let (looks, search) = ((hits as u64 * LOOK) as f64, (plain * MEET) as f64);
        let promises = looks * crowding <= search;
        if !promises {
            self.fail();
        }
        promises
    }

    /// Lists begin, all at once.
    ///
    /// * `plain` - boxes compared with a block in a search of all boxes as they are.
    pub(super) fn begin(&mut self, plain: u64) {
        (self.plain, self.left, self.making) = (plain, 0, false);
        self.note_laid();
    }

    /// What this tick is to the list in use.
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

    /// Ticks in which nothing of the next list is made yet, this one among them.
    pub(super) fn spare(&self) -> u32 {
        self.left.saturating_sub(self.ahead())
    }

    /// The next list is begun in this tick; in how many it is made, this one among them.
    pub(super) fn open(&mut self) -> u32 {
        self.making = true;
        self.left
    }

    /// Ticks that a box made in this tick is swept for: to the end of the list that it is made for, the one in which
    /// another takes over; for what has begun and parted until then is told by the old one.
    ///
    /// * `first` - whether it is for the first list, which is in use from this tick on.
    pub(super) fn span(&self, first: bool) -> u32 {
        if first || self.making {
            self.left + self.ticks
        } else {
            self.left
        }
    }

    /// Whether the searches have cost more than laying anew would.
    pub(super) fn is_worn(&self, bodies: usize) -> bool {
        self.excess + self.last > u64::from(LAY_TESTS) * bodies as u64
    }

    /// What a tick takes in the mean, in boxes compared with a block; `None` where that is not known yet.
    pub(super) fn mean(&self) -> Option<u64> {
        (self.before > 0).then_some(self.before / MEET)
    }

    /// Bodies were laid anew.
    pub(super) fn note_laid(&mut self) {
        (self.usual, self.excess, self.last) = (0, 0, 0);
    }

    /// Takes what the list has cost, and will have when the next one takes over; whether there is to be one.
    pub(super) fn pays(&mut self) -> bool {
        let left = u64::from(self.left);
        let mean = (self.cost + left * self.tick) / (self.lasted + left).max(1);
        let pays = mean * 10 < self.plain * MEET * 9;
        self.vain = if pays { 0 } else { self.vain + 1 };
        if pays {
            self.spell = REST_MIN;
        }
        // Uphill: on in the direction that was better.
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

    /// The list is let go, and not soon tried again.
    pub(super) fn fail(&mut self) {
        self.rest = self.spell;
        self.spell = (self.spell * 4).min(REST_MAX);
        self.vain = 0;
        (self.ticks, self.left) = (TICKS, 0);
        self.making = false;
        self.before = 0;
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
        self.tick = entries as u64 * LOOK + strays as u64 * STRAY;
        self.lasted += 1;
        self.cost += self.tick;
        self.left -= 1;
        let hopeless = entries as u64 * LOOK > self.plain * MEET;
        if hopeless {
            self.vain = VAIN - 1;
        }
        // In the tick in which a list takes over it is the one before that bodies strayed from.
        let stray = strays * MANY_STRAY > bodies && self.lasted > 1;
        if !self.making && (hopeless || stray) {
            self.left = self.left.min(self.ahead());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODIES: usize = 1000;

    /// Lists in turn; a search costs `tests`, and a tick so many entries for each tick that boxes are swept for.
    /// Returns how long the last ones were in use, and whether lists go on.
    fn run(pace: &mut Pace, tests: u64, entries: u64, lists: u32) -> (u32, bool) {
        pace.note_list(tests);
        for _ in 0..lists {
            let most = usize::try_from(entries * u64::from(pace.ticks)).unwrap();
            while pace.phase() == Phase::Lasts {
                pace.note_tick(most, 0, BODIES);
            }
            if !pace.pays() {
                return (pace.ticks, false);
            }
            pace.open();
            while pace.phase() == Phase::Makes {
                pace.note_tick(most, 0, BODIES);
            }
            assert_eq!(pace.phase(), Phase::Ends);
            pace.note_list(tests);
            pace.note_tick(most, 0, BODIES);
        }
        (pace.ticks, true)
    }

    #[test]
    fn a_list_is_in_use_for_as_many_ticks_as_cost_least() {
        // A search of 12 000 over n ticks, and 480 n in each: least at five.
        let mut pace = Pace::default();
        pace.begin(4000);
        let (ticks, on) = run(&mut pace, 1000, 120, 40);
        assert!((4..=8).contains(&ticks) && on, "{ticks}");
        // With cheaper entries longer.
        let (ticks, on) = run(&mut pace, 1000, 10, 40);
        assert!((12..=TICKS_MAX).contains(&ticks) && on, "{ticks}");
    }

    #[test]
    fn the_next_list_is_made_in_the_last_ticks_of_the_one_in_use() {
        let mut pace = Pace::default();
        pace.begin(1000);
        assert_eq!(pace.span(true), TICKS);
        pace.note_list(1000);
        pace.note_tick(10, 0, BODIES);
        let mut seen = Vec::new();
        loop {
            let phase = pace.phase();
            if phase == Phase::Opens {
                assert!(pace.pays());
                assert_eq!(pace.open(), pace.left);
            }
            seen.push((phase, pace.span(false)));
            if phase == Phase::Ends {
                break;
            }
            pace.note_tick(10, 0, BODIES);
        }
        let (lasts, makes) = seen.split_at(3);
        assert_eq!(
            pace.ticks,
            TICKS - 2,
            "one way is as good as the other at first"
        );
        let spans: Vec<u32> = lasts.iter().map(|(_, span)| *span).collect();
        assert!(lasts.iter().all(|(phase, _)| *phase == Phase::Lasts));
        assert_eq!(spans, [7, 6, 5]);
        let made = [9, 8, 7].map(|span| (Phase::Makes, span));
        assert_eq!(makes[0], (Phase::Opens, 10));
        assert_eq!(makes[1..4], made);
        assert_eq!(makes[4..], [(Phase::Ends, 6)]);
        // Its boxes hold to the end of the list that takes over now.
        pace.note_list(1000);
        pace.note_tick(10, 0, BODIES);
        assert_eq!((pace.phase(), pace.span(false)), (Phase::Lasts, 5));
    }

    #[test]
    fn lists_that_do_not_pay_are_tried_ever_more_seldom() {
        let mut pace = Pace::default();
        let mut rests = Vec::new();
        for _ in 0..4 {
            pace.begin(1000);
            let (_, on) = run(&mut pace, 8000, 300, 40);
            assert!(!on);
            rests.push(1 + (0..).take_while(|_| !pace.begins(0, 1000)).count());
        }
        assert_eq!(rests, [64, 256, 1024, 2048]);
        // One that pays again starts from the beginning.
        pace.begin(4000);
        assert!(run(&mut pace, 1000, 10, 4).1);
        pace.fail();
        assert_eq!(pace.rest, REST_MIN);
    }

    #[test]
    fn a_crowd_of_overlaps_is_not_listed() {
        let mut pace = Pace::default();
        assert!(!pace.begins(2000, 1000) && pace.nears());
        assert!(!pace.begins(10_000, 1000) && pace.begins(2000, 1000));
        // What turns out to be one is let go in the next tick.
        pace.begin(1000);
        pace.note_list(1000);
        pace.note_tick(100_000, 0, BODIES);
        assert!(pace.phase() == Phase::Opens && !pace.pays());
    }

    #[test]
    fn what_flies_far_beside_its_size_is_not_listed_to_begin_with() {
        let mut pace = Pace::default();
        assert!(pace.promises(1000, 2.5, 1000));
        assert!(!pace.promises(1000, 4.0, 1000));
        assert!((0..REST_MIN - 1).all(|_| !pace.begins(0, 1000)) && pace.begins(0, 1000));
    }

    #[test]
    fn where_many_stray_the_next_list_is_begun() {
        let mut pace = Pace::default();
        pace.begin(1000);
        pace.note_list(1000);
        pace.note_tick(100, BODIES / 100, BODIES);
        assert_eq!(pace.phase(), Phase::Lasts);
        pace.note_tick(100, BODIES / 10, BODIES);
        assert_eq!(pace.phase(), Phase::Opens);
    }

    #[test]
    fn searches_that_have_cost_as_much_as_laying_anew_are_wear() {
        let mut pace = Pace::default();
        pace.note_list(1000);
        for _ in 0..12 {
            assert!(!pace.is_worn(BODIES));
            pace.note_list(2000);
        }
        assert!(pace.is_worn(BODIES));
        pace.note_laid();
        assert!(!pace.is_worn(BODIES));
    }
}
