//! The cost of making work on a pair interruptible: reading the clock within it, and doing it in slices.
//!
//! Each pair is solved completely from a cold start, alternately in two ways: at once without a deadline, and with a
//! deadline that never comes, in slices of as many units as in the engine. CPU time of one thread; sums over all pairs,
//! per round.

use std::sync::Arc;

use sweepd::math::{Pose, relative};
use sweepd::narrow::mesh::Goal;
use sweepd::shape::Shape;
use sweepd::time::{Clock, Meter, SystemClock};

use crate::SEED;
use crate::common::{provenance, quantile, save};
use crate::peers::{Found, Ours};
use crate::stage::{Courses, PAIRS};
use crate::table;

/// Work units of a slice.
const SLICE_UNITS: u64 = 32;
/// A deadline that no pair reaches.
const FAR_NS: u64 = 10_000_000_000;

fn ask(ours: &mut Ours, (a, b, pos12): (&Shape, &Shape, &Pose), goal: Goal, stop: bool) -> Found {
    if !stop {
        return ours.ask(a, b, pos12, goal);
    }
    let end_ns = SystemClock.monotonic_ns() + FAR_NS;
    let mut meter = Meter::new(&SystemClock, Some(end_ns), None);
    ours.ask_in_slices(a, b, pos12, goal, SLICE_UNITS, &mut meter)
}

pub fn run(shapes: &[Arc<Shape>], quick: bool) {
    let rounds = if quick { 5 } else { 31 };
    let courses = Courses::new(0.0, SEED);
    let poses: Vec<Pose> = (0..PAIRS)
        .map(|pair| {
            let [a, b] = courses.poses(pair);
            relative(&a, &b)
        })
        .collect();
    let couple = |pair: usize| {
        let [a, b] = [0, 1].map(|k| &*shapes[(pair + k) % shapes.len()]);
        (a, b, &poses[pair])
    };
    let mut ours = Ours::default();
    let touches: Vec<bool> = (0..PAIRS)
        .map(|pair| ask(&mut ours, couple(pair), Goal::Verdict, false).touches)
        .collect();
    let from = provenance();
    let mut csv = String::from(
        "machine,commit,compiler,seed,job,pairs,rounds,units,at_once_us,stoppable_us,cost_percent\n",
    );
    println!("job,pairs,rounds,units,at once us,stoppable us,cost %");
    for (job, goal, of) in [
        ("verdict", Goal::Verdict, None),
        ("distance", Goal::Gap, Some(false)),
        ("contacts", Goal::Contacts, Some(true)),
    ] {
        let pairs: Vec<usize> = (0..PAIRS)
            .filter(|&pair| of.is_none_or(|of| touches[pair] == of))
            .collect();
        let (mut times, mut ratios, mut units) = ([Vec::new(), Vec::new()], Vec::new(), 0);
        for _ in 0..rounds {
            let mut sums_ns = [0, 0];
            let mut sums_units = [0, 0];
            for &pair in &pairs {
                let first = pair % 2 == 0;
                for stop in [first, !first] {
                    let from_ns = SystemClock.thread_cpu_ns();
                    let found = ask(&mut ours, couple(pair), goal, stop);
                    let way = usize::from(stop);
                    sums_ns[way] += SystemClock.thread_cpu_ns() - from_ns;
                    sums_units[way] += found.units;
                }
            }
            assert_eq!(sums_units[0], sums_units[1], "the same work");
            units = sums_units[0];
            ratios.push(sums_ns[1] * 100_000 / sums_ns[0]);
            (0..2).for_each(|way| times[way].push(sums_ns[way]));
        }
        let us = |times: &mut [u64]| table::us(quantile(times, 0.5));
        let cost = table::us(quantile(&mut ratios, 0.5)) - 100.0;
        let line = format!(
            "{job},{},{rounds},{units},{:.1},{:.1},{cost:.1}",
            pairs.len(),
            us(&mut times[0]),
            us(&mut times[1]),
        );
        println!("{line}");
        csv += &format!("{from},{SEED},{line}\n");
    }
    save("interruptible.csv", &csv);
}
