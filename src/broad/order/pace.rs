//! For how many ticks a Verlet list is made, and whether it pays.
//!
//! In: counted work, never time, so that a replay chooses alike. Out: when the list is made anew, for how long, and
//! when it is let go. The weights were measured once; they decide about cost alone.

/// Weights, in nanoseconds of the machine that they were measured on: a box compared with a block in a search, an entry
/// looked at, a body looked for alone.
const MEET: u64 = 12;
const LOOK: u64 = 4;
const STRAY: u64 = 400;
/// Boxes compared with a block in the time that laying a body anew takes.
const LAY_TESTS: u64 = 12;
/// Ticks that a list is made for, at first, at least and at most.
const TICKS: u32 = 8;
const TICKS_MIN: u32 = 2;
const TICKS_MAX: u32 = 24;
/// Lists in a row that take more than a search in each tick would, and there are none ...
const VAIN: u32 = 3;
/// ... for so many ticks; four times as many each time that they prove no better.
const REST_MIN: u32 = 64;
const REST_MAX: u32 = 2048;
/// One in so many strays in a tick, and the next one makes the list anew.
const MANY_STRAY: usize = 32;

/// What the choice is made by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    /// Ticks that boxes are swept for, and how many of them are left.
    ticks: u32,
    left: u32,
    /// Work of the list at hand and the ticks it has lasted, ...
    cost: u64,
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
            cost: 0,
            lasted: 0,
            before: 0,
            longer: true,
            plain: 0,
            usual: 0,
            excess: 0,
            last: 0,
            vain: 0,
            rest: 0,
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

    /// A list begins.
    ///
    /// * `plain` - boxes compared with a block in a search of all boxes as they are.
    pub(super) fn begin(&mut self, plain: u64) {
        self.plain = plain;
        self.note_laid();
        (self.cost, self.lasted) = (0, 0);
    }

    /// Whether the list is to be made anew in this tick.
    pub(super) fn is_due(&self) -> bool {
        self.left == 0
    }

    /// Ticks that a box made in this tick is swept for: to the one in which the list is made anew, for what has begun
    /// and parted until then is told by the old one.
    pub(super) fn left(&self, due: bool) -> u32 {
        1 + if due { self.ticks } else { self.left - 1 }
    }

    /// Whether the searches have cost more than laying anew would.
    pub(super) fn is_worn(&self, bodies: usize) -> bool {
        self.excess + self.last > LAY_TESTS * bodies as u64
    }

    /// What a tick takes in the mean, in boxes compared with a block; `None` where that is not known yet.
    pub(super) fn mean(&self) -> Option<u64> {
        (self.before > 0).then_some(self.before / MEET)
    }

    /// Bodies were laid anew.
    pub(super) fn note_laid(&mut self) {
        (self.usual, self.excess, self.last) = (0, 0, 0);
    }

    /// Takes what the list has cost, now that it is due; whether there is to be another.
    pub(super) fn pays(&mut self) -> bool {
        let mean = self.cost / self.lasted.max(1);
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
        self.ticks = TICKS;
        self.before = 0;
    }

    /// A search for a list has been.
    pub(super) fn note_search(&mut self, tests: u64) {
        if self.usual == 0 {
            self.usual = tests;
        }
        self.last = tests.saturating_sub(self.usual);
        self.excess += self.last;
        (self.cost, self.lasted) = (tests * MEET, 0);
        self.left = self.ticks;
    }

    /// A tick with the list has been.
    pub(super) fn note_tick(&mut self, entries: usize, strays: usize, bodies: usize) {
        self.lasted += 1;
        self.cost += entries as u64 * LOOK + strays as u64 * STRAY;
        self.left -= 1;
        let hopeless = entries as u64 * LOOK > self.plain * MEET;
        if hopeless {
            self.vain = VAIN - 1;
        }
        if hopeless || strays * MANY_STRAY > bodies {
            self.left = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODIES: usize = 1000;

    /// One list after another; each costs a search of `tests`, and each tick of it so many entries for each tick that
    /// it is made for. Returns how long the last ones were made for, and whether lists go on.
    fn run(pace: &mut Pace, tests: u64, entries: u64, lists: u32) -> (u32, bool) {
        for _ in 0..lists {
            pace.note_search(tests);
            while !pace.is_due() {
                let most = entries * u64::from(pace.ticks);
                pace.note_tick(usize::try_from(most).unwrap(), 0, BODIES);
            }
            if !pace.pays() {
                return (pace.ticks, false);
            }
        }
        (pace.ticks, true)
    }

    #[test]
    fn a_list_is_made_for_as_many_ticks_as_cost_least() {
        // A search of 12 000 over n ticks, and 480 n in each: least at five.
        let mut pace = Pace::default();
        pace.begin(4000);
        let (ticks, on) = run(&mut pace, 1000, 120, 40);
        assert!((3..=8).contains(&ticks) && on, "{ticks}");
        // With cheaper entries longer.
        let (ticks, on) = run(&mut pace, 1000, 10, 40);
        assert!((12..=TICKS_MAX).contains(&ticks) && on, "{ticks}");
    }

    #[test]
    fn lists_that_do_not_pay_are_tried_ever_more_seldom() {
        let mut pace = Pace::default();
        let mut rests = Vec::new();
        for _ in 0..4 {
            pace.begin(1000);
            let (_, on) = run(&mut pace, 5000, 300, 40);
            assert!(!on);
            let mut rest = 1;
            while !pace.begins(0, 1000) {
                rest += 1;
            }
            rests.push(rest);
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
        assert!(!pace.begins(10_000, 1000) && pace.begins(2000, 1000));
        // What turns out to be one is let go when it is due, which is at once.
        pace.begin(1000);
        pace.note_search(1000);
        pace.note_tick(100_000, 0, BODIES);
        assert!(pace.is_due() && !pace.pays());
    }

    #[test]
    fn many_strays_make_the_list_due() {
        let mut pace = Pace::default();
        pace.begin(1000);
        pace.note_search(1000);
        pace.note_tick(100, BODIES / 100, BODIES);
        assert!(!pace.is_due());
        pace.note_tick(100, BODIES / 10, BODIES);
        assert!(pace.is_due());
    }

    #[test]
    fn searches_that_have_cost_as_much_as_laying_anew_are_wear() {
        let mut pace = Pace::default();
        pace.note_search(1000);
        for _ in 0..11 {
            assert!(!pace.is_worn(BODIES));
            pace.note_search(2000);
        }
        pace.note_search(2000);
        assert!(pace.is_worn(BODIES));
        pace.note_laid();
        assert!(!pace.is_worn(BODIES));
    }
}
