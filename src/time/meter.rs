//! The meter: spends a tick's budget unit by unit and reads the clock at intervals.

use super::Clock;

/// A part of a [`Meter`]'s remaining budget, so that one job leaves something for another.
#[derive(Clone, Copy, Debug)]
pub struct Share {
    /// The count of charged units at which it is used up.
    units: u64,
    end_ns: Option<u64>,
}

/// Budget that a [`Meter`] keeps back for a later job.
#[derive(Clone, Copy, Debug, Default)]
#[must_use = "what is kept back is to be released"]
pub struct Reserve {
    units: u64,
    ns: u64,
}

/// Spends a budget: counts units and reads the clock at intervals.
pub struct Meter<'a> {
    clock: &'a dyn Clock,
    deadline_ns: Option<u64>,
    units_left: u64,
    units_spent: u64,
    units_to_next_read: u64,
    /// Time of the last clock read; 0 if neither a deadline nor a beat needs it.
    read_ns: u64,
    /// The longest pause in which only charged units were done.
    longest: Pause,
    out_of_time: bool,
    beat: Option<Beat<'a>>,
}

/// A time between two reads of the clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pause {
    /// Time of the first read, monotonic nanoseconds.
    pub from_ns: u64,
    /// Nanoseconds from it to the second read.
    pub ns: u64,
}

/// A callback that is due each `period_ns` while work goes on; it is called between two units.
struct Beat<'a> {
    next_ns: u64,
    period_ns: u64,
    call: &'a mut dyn FnMut(),
}

/// Cheap units (a box against eight others, some 150 ns each with memory waits) between two reads of the clock (some
/// 25 ns): at 8 the reads cost 2 %, at 32 a deadline would be passed by some six microseconds.
const CHEAP_UNITS_PER_READ: u64 = 8;
/// Longest time that a cheap unit is expected to take, nanoseconds: if less is left for each unit between two reads,
/// there are fewer units. From cold memory a unit takes half a microsecond and more, two on a slow machine. With a
/// smaller value a deadline is passed by more; with a larger one the clock is read more often before it.
const CHEAP_UNIT_NS: u64 = 2_000;

impl std::fmt::Debug for Meter<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Meter")
            .field("deadline_ns", &self.deadline_ns)
            .field("units_left", &self.units_left)
            .field("units_spent", &self.units_spent)
            .finish_non_exhaustive()
    }
}

impl<'a> Meter<'a> {
    /// A meter that ends at `deadline_ns` (monotonic) or after `units`, whichever comes first.
    #[must_use]
    pub fn new(clock: &'a dyn Clock, deadline_ns: Option<u64>, units: Option<u64>) -> Self {
        let mut meter = Self {
            clock,
            deadline_ns,
            units_left: units.unwrap_or(u64::MAX),
            units_spent: 0,
            units_to_next_read: 0,
            read_ns: 0,
            longest: Pause::default(),
            out_of_time: false,
            beat: None,
        };
        meter.look();
        meter
    }

    /// Calls `call` whenever `period_ns` has passed since `from_ns` (monotonic) or the last call, between two units.
    #[must_use]
    pub fn with_beat(mut self, from_ns: u64, period_ns: u64, call: &'a mut dyn FnMut()) -> Self {
        // Without a deadline the clock has not been read yet.
        if self.read_ns == 0 {
            self.read_ns = self.clock.monotonic_ns();
        }
        self.beat = Some(Beat {
            next_ns: from_ns.saturating_add(period_ns),
            period_ns,
            call,
        });
        self
    }

    /// A meter that never ends; for offline queries and twins.
    #[must_use]
    pub fn unlimited(clock: &'a dyn Clock) -> Self {
        Self::new(clock, None, None)
    }

    /// Whether another unit may be spent.
    #[must_use]
    pub fn open(&self) -> bool {
        self.units_left > 0 && !self.out_of_time
    }

    /// Charges `units` of cheap work (node tests); the clock is read after some of them.
    pub fn charge(&mut self, units: u64) {
        self.charge_weighted(units, units);
    }

    /// Charges `units` that cost as much as `weight` cheap ones: the clock is read sooner by as much.
    pub fn charge_weighted(&mut self, units: u64, weight: u64) {
        self.count(units);
        self.units_to_next_read = self.units_to_next_read.saturating_sub(weight);
        if self.units_to_next_read == 0 {
            let pause = self.look();
            self.note(pause);
        }
    }

    /// Charges `units` of costly work (an exact query, some microseconds) and reads the clock at once; returns the time
    /// since the previous read, nanoseconds, or 0 without a deadline or a beat.
    pub fn charge_dear(&mut self, units: u64) -> u64 {
        self.count(units);
        let pause = self.look();
        if units > 0 {
            self.note(pause);
        }
        pause.ns
    }

    /// Reads the clock after work that was not charged; returns whether another unit may be spent.
    pub fn refresh(&mut self) -> bool {
        self.look();
        self.open()
    }

    /// Whether work of about `ns` nanoseconds that cannot be stopped would end before the deadline.
    #[must_use]
    pub fn has_ns(&self, ns: u64) -> bool {
        (self.deadline_ns)
            .is_none_or(|end_ns| self.clock.monotonic_ns().saturating_add(ns) < end_ns)
    }

    /// Whether to begin costly work of about `ns` nanoseconds: it would end in time, as of the last read of the clock,
    /// or it is the first work. Otherwise the meter closes.
    pub fn begins(&mut self, ns: u64) -> bool {
        let in_time = (self.deadline_ns).is_none_or(|end_ns| self.read_ns + ns < end_ns);
        self.out_of_time |= !in_time && self.units_spent > 0;
        self.open()
    }

    /// Half of the remaining budget.
    #[must_use]
    pub fn half(&self) -> Share {
        let half_ns = |end_ns: u64| {
            let now_ns = self.clock.monotonic_ns();
            now_ns + end_ns.saturating_sub(now_ns) / 2
        };
        Share {
            units: self.units_spent.saturating_add(self.units_left / 2),
            end_ns: self.deadline_ns.map(half_ns),
        }
    }

    /// Keeps back one of `parts` parts of the remaining budget, until it is released.
    pub fn reserve(&mut self, parts: u64) -> Reserve {
        let units = self.units_left / parts;
        self.units_left -= units;
        let mut ns = 0;
        if let Some(end_ns) = self.deadline_ns.as_mut() {
            ns = end_ns.saturating_sub(self.clock.monotonic_ns()) / parts;
            *end_ns -= ns;
        }
        Reserve { units, ns }
    }

    /// Gives a reserve back to the budget, which may open the meter again.
    pub fn release(&mut self, reserve: Reserve) {
        self.units_left = self.units_left.saturating_add(reserve.units);
        self.deadline_ns = self.deadline_ns.map(|end_ns| end_ns + reserve.ns);
        self.look();
    }

    /// Whether a share is not used up yet.
    #[must_use]
    pub fn within(&self, share: Share) -> bool {
        let in_time = |end_ns: u64| self.clock.monotonic_ns() < end_ns;
        self.units_spent < share.units && share.end_ns.is_none_or(in_time)
    }

    /// Units charged so far.
    #[must_use]
    pub fn spent(&self) -> u64 {
        self.units_spent
    }

    /// The longest time so far between two reads of the clock in which only charged units were done; work that was not
    /// charged may take long by itself.
    #[must_use]
    pub fn longest_pause(&self) -> Pause {
        self.longest
    }

    /// The clock this meter watches.
    #[must_use]
    pub fn clock(&self) -> &'a dyn Clock {
        self.clock
    }

    fn count(&mut self, units: u64) {
        self.units_spent += units;
        self.units_left = self.units_left.saturating_sub(units);
    }

    /// Notes a pause in which only charged units were done.
    fn note(&mut self, pause: Pause) {
        if pause.ns > self.longest.ns {
            self.longest = pause;
        }
    }

    /// Reads the clock, and calls the beat if it is due; returns the time since the previous read, or nothing if
    /// neither a deadline nor a beat needs it.
    fn look(&mut self) -> Pause {
        self.units_to_next_read = CHEAP_UNITS_PER_READ;
        if self.deadline_ns.is_none() && self.beat.is_none() {
            return Pause::default();
        }
        let from_ns = self.read_ns;
        let now_ns = self.clock.monotonic_ns().max(from_ns);
        self.read_ns = now_ns;
        if let Some(deadline_ns) = self.deadline_ns {
            self.out_of_time = now_ns >= deadline_ns;
            let left_ns = deadline_ns.saturating_sub(now_ns);
            self.units_to_next_read = (left_ns / CHEAP_UNIT_NS).clamp(1, CHEAP_UNITS_PER_READ);
        }
        if let Some(beat) = self.beat.as_mut().filter(|beat| now_ns >= beat.next_ns) {
            beat.next_ns = now_ns.saturating_add(beat.period_ns);
            (beat.call)();
            // The time of the call is not work.
            self.read_ns = self.clock.monotonic_ns().max(now_ns);
        }
        let ns = now_ns - from_ns;
        Pause { from_ns, ns }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::ManualClock;

    #[test]
    fn bug_without_a_deadline_the_time_since_boot_was_the_first_pause() {
        let clock = ManualClock::new(5_000_000_000);
        let mut beats = || {};
        let mut meter =
            Meter::new(&clock, None, Some(9)).with_beat(5_000_000_000, 1_000_000, &mut beats);
        assert_eq!(meter.charge_dear(1), 0);
        clock.advance(700);
        assert_eq!(meter.charge_dear(1), 700);
    }

    #[test]
    fn a_meter_closes_after_its_units() {
        let clock = ManualClock::new(0);
        let mut meter = Meter::new(&clock, None, Some(3));
        meter.charge(2);
        assert!(meter.open());
        meter.charge(1);
        assert!(!meter.open());
        assert_eq!(meter.spent(), 3);
    }

    #[test]
    fn a_meter_closes_at_its_deadline_within_one_dear_unit() {
        let clock = ManualClock::new(0);
        let mut meter = Meter::new(&clock, Some(100), None);
        meter.charge_dear(1);
        assert!(meter.open());
        clock.advance(100);
        assert!(meter.open(), "the clock is read when work is charged");
        meter.charge_dear(1);
        assert!(!meter.open());
    }

    #[test]
    fn dear_work_that_would_not_end_in_time_is_not_begun_unless_it_is_the_first() {
        let clock = ManualClock::new(1_000);
        let mut meter = Meter::new(&clock, Some(1_100), None);
        assert!(meter.begins(500));
        clock.advance(30);
        assert_eq!(meter.charge_dear(1), 30);
        assert!(meter.begins(60));
        assert!(!meter.begins(70));
        assert!(!meter.open());
        let mut unlimited = Meter::unlimited(&clock);
        assert_eq!(unlimited.charge_dear(1), 0);
        assert!(unlimited.begins(u64::MAX / 2));
    }

    #[test]
    fn what_a_meter_keeps_back_is_there_when_it_is_released() {
        let clock = ManualClock::new(0);
        let mut meter = Meter::new(&clock, Some(800), Some(16));
        let kept = meter.reserve(8);
        meter.charge_dear(14);
        assert!(!meter.open());
        meter.release(kept);
        assert!(meter.open());
        let kept = meter.reserve(2);
        clock.advance(400);
        meter.charge_dear(0);
        assert!(!meter.open(), "half of the time is kept back");
        meter.release(kept);
        assert!(meter.open());
        clock.advance(400);
        meter.charge_dear(1);
        assert!(!meter.open());
    }

    #[test]
    fn a_meter_beats_while_work_goes_on() {
        let clock = ManualClock::new(0);
        let mut beats = 0;
        let mut count = || beats += 1;
        let mut meter = Meter::new(&clock, None, None).with_beat(0, 10, &mut count);
        for _ in 0..30 {
            clock.advance(1);
            meter.charge_dear(1);
        }
        assert_eq!(beats, 3);
    }

    #[test]
    fn a_meter_knows_its_longest_pause_in_units_of_work() {
        let clock = ManualClock::new(500);
        let mut meter = Meter::new(&clock, Some(u64::MAX), None);
        for (units, ns) in [(1, 3), (0, 90), (1, 40), (1, 20)] {
            clock.advance(ns);
            meter.charge_dear(units);
        }
        clock.advance(70);
        meter.refresh();
        let pause = Pause {
            from_ns: 593,
            ns: 40,
        };
        assert_eq!(meter.longest_pause(), pause);
    }

    #[test]
    fn what_is_done_at_a_beat_is_no_pause_in_work() {
        let clock = ManualClock::new(500);
        let mut long = || clock.advance(1_000);
        let mut meter = Meter::new(&clock, Some(u64::MAX), None).with_beat(500, 10, &mut long);
        for _ in 0..4 {
            clock.advance(7);
            meter.charge_dear(1);
        }
        assert_eq!(meter.longest_pause().ns, 7);
    }

    #[test]
    fn a_meter_with_no_units_is_closed_from_the_start() {
        let clock = ManualClock::new(0);
        assert!(!Meter::new(&clock, None, Some(0)).open());
    }
}
