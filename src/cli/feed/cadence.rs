//! A source with its own work and a fixed frame time: the daemon gets the time that the work leaves of each frame.
//!
//! In: bodies, a client, the range of work times. Out: a table of the work, the time left and the time to the result.
//!
//! Source: RTR3 section 17.6.1: collision detection gets the time that the frame has left, because a late hit spoils
//! the perceived causality.

use std::sync::atomic::{AtomicBool, Ordering};

use super::{Bodies, moment, sleep_until};
use crate::builtin::Random;
use crate::cli::args::FeedArgs;
use crate::cli::out::Out;
use crate::error::{Error, Result};
use crate::time::{Clock, SystemClock};
use crate::transport::client::{Client, FrameInfo, Rows, StepError};
use crate::wire::Reason;

/// Time kept back in each frame for the messages to and from the daemon, nanoseconds: two wake-ups on a busy machine at
/// worst.
const WAY_NS: u64 = 300_000;
/// Longest wait for a result, nanoseconds.
const WAIT_NS: u64 = 1_000_000_000;

/// Times of frames, nanoseconds, each list in the order of frames; and counts of frames.
#[derive(Debug, Default)]
struct Times {
    work_ns: Vec<u64>,
    /// Time that the frame announced as left for the tick.
    left_ns: Vec<u64>,
    /// Time from the start of the frame to its result.
    whole_ns: Vec<u64>,
    undecided: usize,
    lost: usize,
}

/// Sends frames in lockstep until stopped or until the requested number is sent; then prints how well the frame time
/// was kept.
///
/// * `work_ns` - shortest and longest work of the source before it sends a frame.
pub(super) fn keep(
    args: &FeedArgs,
    work_ns: (u64, u64),
    bodies: &mut Bodies,
    client: &mut Client,
    (out, stop): (&mut Out, &AtomicBool),
) -> Result<()> {
    let clock = SystemClock;
    let frame_ns = moment(1, args.course.rate).1;
    let (mut times, mut random) = (Times::default(), Random::new(args.course.seed));
    let mut begin_ns = clock.monotonic_ns();
    let mut frame = 0_u64;
    while !stop.load(Ordering::Relaxed) && args.frames.is_none_or(|most| frame < most) {
        let Some(met) = bodies.same.meet(client, args, stop)? else {
            break;
        };
        if met.is_another {
            tracing::warn!("the daemon restarted");
        }
        begin_ns = begin_ns.saturating_add(met.waited_ns);
        let end_ns = begin_ns.saturating_add(frame_ns);
        let own_ns = work_ns.0 + random.bits() % (work_ns.1 - work_ns.0 + 1);
        let (time_s, stamp_ns) = moment(frame, args.course.rate);
        bodies.move_to(time_s);
        // Busy work instead of sleep, so that the daemon runs on a loaded machine.
        while clock.monotonic_ns() < begin_ns + own_ns {
            std::hint::spin_loop();
        }
        let left_ns = end_ns.saturating_sub(clock.monotonic_ns() + WAY_NS);
        let info = FrameInfo {
            stamp_ns,
            // 0 would mean "not given": the frame would not limit the tick.
            time_left_ns: left_ns.max(1),
            ..FrameInfo::default()
        };
        match client.step(&info, Rows::Poses(&bodies.rows), WAIT_NS) {
            Ok(_) => {
                times.work_ns.push(own_ns);
                times.left_ns.push(left_ns);
                times.whole_ns.push(clock.monotonic_ns() - begin_ns);
                let reasons = client.view().tick().reasons;
                times.undecided += usize::from(reasons & Reason::Undecided.bit() != 0);
            }
            Err(StepError::Other(e)) => return Err(e),
            Err(e) => {
                times.lost += 1;
                tracing::warn!("frame {}: {e}", frame + 1);
            }
        }
        frame += 1;
        sleep_until(&clock, end_ns, stop);
        begin_ns = clock.monotonic_ns();
    }
    times.tell(frame_ns, out)?;
    let is_whole = args.frames == Some(frame) && frame > 0;
    if is_whole && times.whole_ns.is_empty() {
        return Err(Error::Refused(format!(
            "none of {frame} frames had a result: the warnings say why"
        )));
    }
    Ok(())
}

impl Times {
    fn tell(&mut self, frame_ns: u64, out: &mut Out) -> Result<()> {
        let late = self.whole_ns.iter().filter(|ns| **ns > frame_ns).count();
        let frames = self.whole_ns.len();
        let own = spread(&mut self.work_ns);
        let left = spread(&mut self.left_ns);
        let whole = spread(&mut self.whole_ns);
        out.line(&format!("{:>28}  least  median   p99  longest", "ms"))?;
        out.line(&format!("{:>28}  {own}", "the source's own work"))?;
        out.line(&format!("{:>28}  {left}", "left for the tick"))?;
        out.line(&format!("{:>28}  {whole}", "until the result was there"))?;
        out.line(&format!(
            "{late} of {frames} frames over {:.1} ms; {} stopped with pairs undecided; {} without a result",
            ms(frame_ns),
            self.undecided,
            self.lost
        ))?;
        out.flush()
    }
}

/// Least, median, 99th percentile and greatest time, milliseconds.
fn spread(times_ns: &mut [u64]) -> String {
    times_ns.sort_unstable();
    let at = |share: usize| {
        let place = times_ns.len().saturating_sub(1) * share / 100;
        ms(times_ns.get(place).copied().unwrap_or(0))
    };
    format!(
        "{:5.2}  {:6.2}  {:5.2}  {:7.2}",
        at(0),
        at(50),
        at(99),
        at(100)
    )
}

#[allow(clippy::cast_precision_loss, reason = "times far below 2^53 ns")]
fn ms(ns: u64) -> f64 {
    ns as f64 * 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_names_the_least_the_middle_and_the_greatest() {
        let mut times_ns: Vec<u64> = (1..=101).rev().map(|ms| ms * 1_000_000).collect();
        assert_eq!(spread(&mut times_ns), " 1.00   51.00  100.00   101.00");
        assert_eq!(spread(&mut []), " 0.00    0.00   0.00     0.00");
    }
}
