//! Laws 4.4, 4.5: a round waits for no source longer than the frames in it allow.

use sweepd::config::Mode;
use sweepd::wire::Frame;

use crate::support::{MS, frame, row};
use crate::{Daemon, LATE_NS, ns, robot, sim};

const FLOOR_NS: u64 = MS;
/// Offset of `CLOCK_BOOTTIME` from `CLOCK_MONOTONIC`.
const AHEAD_NS: u64 = 7_000 * MS;

/// The end of a round that waits for the robot from 10 ms on; its frame of the simulator is changed by `make`.
fn round_ends_ms(make: impl Fn(&mut Frame)) -> f64 {
    let mut daemon = Daemon::of(Mode::OnAll);
    daemon.pacer.know(FLOOR_NS, AHEAD_NS);
    daemon.run(5.0, vec![(1.0, sim(1)), (1.0, robot(1))]);
    let mut urgent = sim(2);
    make(&mut urgent);
    let first = daemon.ticks.len();
    daemon.run(30.0, vec![(10.0, urgent)]);
    let tick = &daemon.ticks[first];
    assert_eq!(tick.frames, [("sim".to_owned(), 2)]);
    tick.at_ms
}

#[test]
fn law_4_5_bug_a_round_waited_beyond_the_deadline_that_its_own_frame_carries() {
    let late_ms = LATE_NS as f64 / MS as f64;
    assert_eq!(round_ends_ms(|_| {}), 10.0 + late_ms);
    // It waits for half of the time left above the floor.
    let left = |left_ms: u64| round_ends_ms(move |frame| frame.header.time_left_ns = left_ms * MS);
    assert_eq!(left(4), 11.5);
    assert_eq!(left(1), 10.0);
    assert_eq!(left(1000), 10.0 + late_ms);
    let until =
        |at_ms: f64| round_ends_ms(move |frame| frame.header.deadline_ns = ns(at_ms) - AHEAD_NS);
    assert_eq!(until(16.0), 12.5);
    assert_eq!(until(9.0), 10.0);
    assert_eq!(until(1000.0), 10.0 + late_ms);
}

#[test]
fn law_4_5_of_several_frames_the_newest_says_how_long_a_round_can_wait() {
    for (older, newer, at_ms) in [(2, 0, 15.0), (0, 4, 12.0), (2, 20, 15.0)] {
        let mut daemon = Daemon::of(Mode::OnAll);
        daemon.pacer.know(0, AHEAD_NS);
        daemon.run(5.0, vec![(1.0, sim(1)), (1.0, robot(1))]);
        let timed = |seq, left_ms: u64| {
            let mut frame = frame("sim", seq, 0, &[row(1, 0.0)]);
            frame.header.time_left_ns = left_ms * MS;
            frame
        };
        let first = daemon.ticks.len();
        daemon.run(30.0, vec![(10.0, timed(2, older)), (10.0, timed(3, newer))]);
        assert_eq!(daemon.ticks[first].at_ms, at_ms, "{older} ms, {newer} ms");
    }
}
