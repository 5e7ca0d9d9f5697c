//! The work allowed for the regions of one pair: boxes that are read, and tests that split them.

use crate::limits::{REGION_LOOKS_MAX, REGION_TESTS_PER_PAIR};
use crate::time::Meter;

/// Longest time for enclosing the spots of a pair in spheres, nanoseconds: it is done regardless of the clock, so no
/// test starts when less than this is left.
pub(super) const CLOSING_NS: u64 = 40_000;
/// Looks, some 0.5 us each, between two reads of the clock.
const LOOKS_PER_READ: usize = 16;
/// Cost of a test in cheap units: the clock is read every four tests.
const TEST_COST: u64 = 8;

/// The allowance of one pair, used up while its regions are made.
pub(super) struct Pace<'p, 'm> {
    /// `None`: no tests allowed.
    meter: Option<&'p mut Meter<'m>>,
    /// Most pairs of boxes of one shape pair that may be read.
    looks_max: usize,
    looks: usize,
    /// Tests done.
    pub(super) tests: u32,
    /// The meter closed before the pair's allowance was used up.
    pub(super) stopped: bool,
    /// It closed while boxes were read: the list of them is incomplete.
    pub(super) cut: bool,
}

impl<'p, 'm> Pace<'p, 'm> {
    /// No tests, and at most `looks_max` looks.
    pub(super) fn coarse(looks_max: usize) -> Self {
        Self {
            meter: None,
            looks_max,
            looks: 0,
            tests: 0,
            stopped: false,
            cut: false,
        }
    }

    /// The full allowance of a pair, while the meter is open.
    pub(super) fn metered(meter: &'p mut Meter<'m>) -> Self {
        Self {
            meter: Some(meter),
            ..Self::coarse(REGION_LOOKS_MAX)
        }
    }

    /// Whether this many pairs of boxes may be read.
    pub(super) fn allows(&self, looks: usize) -> bool {
        looks <= self.looks_max
    }

    /// Whether the next pair of boxes is to be read. Looks cost only time: the data they read is already known.
    pub(super) fn look(&mut self) -> bool {
        self.looks += 1;
        if let Some(meter) = self.meter.as_mut()
            && self.looks.is_multiple_of(LOOKS_PER_READ)
            && !meter.has_ns(CLOSING_NS)
        {
            (self.cut, self.stopped) = (true, true);
        }
        !self.cut
    }

    /// Whether another test may be done; if so, charges it.
    pub(super) fn test(&mut self) -> bool {
        let Some(meter) = self.meter.as_mut() else {
            return false;
        };
        if self.tests >= REGION_TESTS_PER_PAIR {
            return false;
        }
        if !meter.open() || !meter.has_ns(CLOSING_NS) {
            self.stopped = true;
            return false;
        }
        meter.charge_weighted(1, TEST_COST);
        self.tests += 1;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::ManualClock;

    #[test]
    fn no_test_is_begun_when_less_is_left_than_the_spheres_take() {
        let clock = ManualClock::new(0);
        let mut meter = Meter::new(&clock, Some(10 * CLOSING_NS), None);
        let mut pace = Pace::metered(&mut meter);
        let mut tests = 0;
        while pace.test() {
            clock.advance(CLOSING_NS);
            tests += 1;
        }
        assert_eq!((tests, pace.tests), (9, 9));
        assert!(pace.stopped && !pace.cut);
    }

    #[test]
    fn tests_end_with_the_units_or_with_what_a_pair_may_have() {
        let clock = ManualClock::new(0);
        for units in [0, 1, 9, 1_000] {
            let mut meter = Meter::new(&clock, None, Some(units));
            let mut pace = Pace::metered(&mut meter);
            while pace.test() {}
            let most = u64::from(REGION_TESTS_PER_PAIR);
            assert_eq!(u64::from(pace.tests), units.min(most));
            assert_eq!(pace.stopped, units < most);
            assert_eq!(meter.spent(), units.min(most));
        }
        let mut free = Pace::coarse(3);
        assert!(free.look() && !free.test() && free.allows(3) && !free.allows(4));
    }

    #[test]
    fn looks_end_when_the_time_does() {
        let clock = ManualClock::new(0);
        let mut meter = Meter::new(&clock, Some(CLOSING_NS), None);
        let mut pace = Pace::metered(&mut meter);
        let looks = (0..100).take_while(|_| pace.look()).count();
        assert_eq!(looks + 1, LOOKS_PER_READ);
        assert!(pace.cut && pace.stopped);
    }
}
