//! Whether a stamp is new, late, or of a clock that began anew. In: stamps of one frame, body or clock as they come.
//! Out: which of the three. Pure.
//!
//! A stamp before the newest one is late first of all: networks delay and reorder datagrams, by seconds where a link
//! was down, and an old pose must not become the newest. A clock that began anew (a simulator that was started again)
//! goes on from there, so it is known by what follows, within the age that its bodies have yet.

/// What is late by less is no sign of another clock, nor, where that is shorter, what is late by less than a time-out;
/// nanoseconds. A simulator that is started again soon has stamps within a long time-out.
const LATE_NS: u64 = 500_000_000;
/// Stamps in a row that make a clock that began anew.
const ROW: u32 = 3;

/// What a stamp is beside those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// New, or as new as the newest.
    On,
    /// Before the newest one, by so many nanoseconds.
    Late(u64),
    /// The newest of a clock that began anew.
    Anew,
}

/// The stamps of one frame or body, or the times of one clock.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Order {
    newest_ns: u64,
    low: Option<Low>,
}

/// Stamps far before the newest one, none before the one before it (a simulator that stands still repeats its own),
/// with none in between that is new.
#[derive(Clone, Copy, Debug)]
struct Low {
    stamp_ns: u64,
    count: u32,
    /// Receipt of the first, nanoseconds of `CLOCK_BOOTTIME`.
    since_ns: u64,
}

impl Order {
    /// From this stamp on.
    pub(super) fn from(stamp_ns: u64) -> Self {
        Self {
            newest_ns: stamp_ns,
            low: None,
        }
    }

    /// Takes a stamp.
    ///
    /// * `now_ns` - its receipt, nanoseconds of `CLOCK_BOOTTIME`.
    /// * `timeout_ns` - the time-out of its source. What is late comes in one burst, while a clock that began anew goes
    ///   on for half of that.
    pub(super) fn take(&mut self, stamp_ns: u64, now_ns: u64, timeout_ns: u64) -> Step {
        // A stamp of 0 says nothing, as of a sender without a clock that takes the place of one with.
        if stamp_ns == 0 || stamp_ns >= self.newest_ns {
            *self = Self::from(stamp_ns.max(self.newest_ns));
            return Step::On;
        }
        let by_ns = self.newest_ns - stamp_ns;
        if by_ns <= timeout_ns.min(LATE_NS) {
            return Step::Late(by_ns);
        }
        let low = match self.low {
            Some(low) if stamp_ns >= low.stamp_ns => Low {
                stamp_ns,
                count: low.count + 1,
                ..low
            },
            _ => Low {
                stamp_ns,
                count: 1,
                since_ns: now_ns,
            },
        };
        self.low = Some(low);
        if low.count >= ROW && now_ns.saturating_sub(low.since_ns) >= timeout_ns / 2 {
            *self = Self::from(stamp_ns);
            return Step::Anew;
        }
        Step::Late(by_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const S: u64 = 1000 * MS;
    const TIMEOUT: u64 = 500 * MS;

    #[test]
    fn bug_late_messages_are_late_however_late_they_are() {
        let mut order = Order::from(100 * S);
        assert_eq!(order.take(100 * S - MS, S, TIMEOUT), Step::Late(MS));
        assert_eq!(order.take(60 * S, S, TIMEOUT), Step::Late(40 * S));
        // A burst of what a link held back, in order, with nothing new in between.
        for n in 0..200 {
            let step = order.take(61 * S + n * MS, S + n * MS, TIMEOUT);
            assert!(matches!(step, Step::Late(_)), "{n}");
        }
        assert_eq!(order.take(101 * S, 2 * S, TIMEOUT), Step::On);
    }

    #[test]
    fn late_messages_among_new_ones_never_make_another_clock() {
        let mut order = Order::from(100 * S);
        for n in 0..500 {
            let now = n * 20 * MS;
            assert_eq!(order.take(100 * S + now, now, TIMEOUT), Step::On);
            let step = order.take(98 * S + now, now, TIMEOUT);
            assert_eq!(step, Step::Late(2 * S), "{n}");
        }
    }

    #[test]
    fn a_clock_that_began_anew_is_known_before_its_bodies_are_too_old() {
        let mut order = Order::from(100 * S);
        let steps = (0..30_u64).map(|n| order.take(MS + n * 20 * MS, n * 20 * MS, TIMEOUT));
        let steps: Vec<Step> = steps.collect();
        let anew = steps.iter().position(|step| *step == Step::Anew);
        // At 260 ms: half a time-out, where the newest pose is 280 ms old.
        assert_eq!(anew, Some(13));
        assert!(steps[14..].iter().all(|step| *step == Step::On));
    }

    #[test]
    fn bug_a_clock_that_began_anew_within_a_long_time_out_was_late_until_it_was_where_it_had_been()
    {
        let timeout = 10 * S;
        let mut order = Order::from(8 * S);
        let steps = (0..400_u64).map(|n| order.take(MS + n * 20 * MS, n * 20 * MS, timeout));
        let anew = steps.enumerate().find(|(_, step)| *step == Step::Anew);
        // At 5 s: half a time-out.
        assert_eq!(anew.map(|(n, _)| n), Some(250));
        // What was held back comes late by as much, and not for as long.
        let mut order = Order::from(8 * S);
        for n in 0..200 {
            let step = order.take(MS + n * 20 * MS, n * 20 * MS, timeout);
            assert!(matches!(step, Step::Late(_)), "{n}");
        }
        assert_eq!(order.take(9 * S, 4 * S, timeout), Step::On);
        for n in 0..200 {
            let step = order.take(5 * S + n * MS, 4 * S + n * 20 * MS, timeout);
            assert!(matches!(step, Step::Late(_)), "{n}");
        }
    }

    #[test]
    fn a_slow_sender_whose_clock_began_anew_needs_three_messages() {
        let mut order = Order::from(100 * S);
        let step = |n: u64, order: &mut Order| order.take(n * S, n * S, TIMEOUT);
        assert_eq!(step(1, &mut order), Step::Late(99 * S));
        assert_eq!(step(2, &mut order), Step::Late(98 * S));
        assert_eq!(step(3, &mut order), Step::Anew);
        // Stamps that go down are of no clock.
        let mut order = Order::from(100 * S);
        for n in 0..50 {
            assert!(matches!(
                order.take(50 * S - n * S, n * S, TIMEOUT),
                Step::Late(_)
            ));
        }
    }

    #[test]
    fn stamps_of_0_are_taken_and_a_clock_that_stands_still_is_known() {
        let mut order = Order::from(100 * S);
        assert_eq!(order.take(0, S, TIMEOUT), Step::On);
        assert_eq!(order.take(99 * S, S, TIMEOUT), Step::Late(S));
        let still = (0..30_u64).map(|n| order.take(3 * S, 2 * S + n * 20 * MS, TIMEOUT));
        assert_eq!(still.filter(|step| *step == Step::Anew).count(), 1);
    }
}
