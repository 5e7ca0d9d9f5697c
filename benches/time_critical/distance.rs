//! The exact distance of one pair, cold, as a function of its gap: ours and parry3d-f64 in one run.
//!
//! Pairs that are apart, moved along the line between their nearest points until the gap is 0.5, 2 and 5 % of the
//! diameter. CPU time of one thread around each call; the calls rotate through the pairs, so that no call finds its
//! data in the innermost caches.

use std::sync::Arc;

use parry3d_f64::shape::TriMesh;
use sweepd::math::{Pose, relative};
use sweepd::narrow::mesh::Goal;
use sweepd::shape::Shape;
use sweepd::time::{Clock, SystemClock};

use crate::SEED;
use crate::common::{provenance, quantile, save};
use crate::peers::{Ours, ask_parry, theirs};
use crate::stage::{Courses, DIAMETER_M, PAIRS};
use crate::table::us;

/// Gaps, percent of the diameter.
const GAPS: [f64; 3] = [0.5, 2.0, 5.0];
/// Pairs measured with parry, which takes 0.1 s or more for each.
const PARRY_PAIRS: usize = 8;
/// Repetitions of each of our queries.
const ROUNDS: usize = 7;

/// A pair, and the pose of one body in the frame of the other.
struct Couple<'a> {
    shapes: [&'a Shape; 2],
    kinds: [usize; 2],
    pos12: Pose,
}

impl Couple<'_> {
    /// Moves the two along the line of their nearest points until the gap is `gap_m`; returns whether that succeeded.
    fn part(&mut self, ours: &mut Ours, gap_m: f64) -> bool {
        let [a, b] = self.shapes;
        for _ in 0..50 {
            let found = ours.ask(a, b, &self.pos12, Goal::Gap);
            let excess_m = found.gap_m[0] - gap_m;
            let Some(normal) = ours.normal().filter(|_| !found.touches) else {
                return false;
            };
            if excess_m.abs() <= 1e-6 * gap_m {
                return true;
            }
            self.pos12.translation.vector -= normal * excess_m;
        }
        false
    }
}

pub fn run(shapes: &[Arc<Shape>]) {
    let courses = Courses::new(0.0, SEED);
    let meshes: Vec<TriMesh> = shapes.iter().map(|shape| theirs(shape)).collect();
    let mut ours = Ours::default();
    let from = provenance();
    let mut csv = String::from(
        "machine,commit,compiler,seed,library,gap_percent,pairs,calls,cpu_p50_us,cpu_p99_us,units_p50\n",
    );
    let mut add = |line: String| {
        println!("{line}");
        csv += &format!("{from},{SEED},{line}\n");
    };
    println!("library,gap %,pairs,calls,cpu p50 us,p99 us,units p50");
    for percent in GAPS {
        let gap_m = percent / 100.0 * DIAMETER_M;
        let mut couples: Vec<Couple<'_>> = Vec::new();
        for pair in 0..PAIRS {
            let [a, b] = courses.poses(pair);
            let kinds = [0, 1].map(|k| (pair + k) % shapes.len());
            let mut couple = Couple {
                shapes: kinds.map(|kind| &*shapes[kind]),
                kinds,
                pos12: relative(&a, &b),
            };
            if couple.part(&mut ours, gap_m) {
                couples.push(couple);
            }
        }
        let (mut times, mut units) = (Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            for couple in &couples {
                let ([a, b], from_ns) = (couple.shapes, SystemClock.thread_cpu_ns());
                let found = ours.ask(a, b, &couple.pos12, Goal::Gap);
                times.push(SystemClock.thread_cpu_ns() - from_ns);
                units.push(found.units);
            }
        }
        add(row(
            "sweepd",
            percent,
            couples.len(),
            &mut times,
            &mut units,
        ));
        let mut times = Vec::new();
        for couple in couples.iter().take(PARRY_PAIRS) {
            let ([a, b], from_ns) = (couple.kinds, SystemClock.thread_cpu_ns());
            let found = ask_parry(&meshes[a], &meshes[b], &couple.pos12, Goal::Gap);
            times.push(SystemClock.thread_cpu_ns() - from_ns);
            assert!((found.gap_m[0] - gap_m).abs() < 1e-6, "of the same pair");
        }
        let pairs = times.len();
        add(row("parry3d-f64", percent, pairs, &mut times, &mut []));
    }
    save("mesh_distance.csv", &csv);
}

fn row(library: &str, percent: f64, pairs: usize, times: &mut [u64], units: &mut [u64]) -> String {
    let counted = if units.is_empty() {
        String::new()
    } else {
        quantile(units, 0.5).to_string()
    };
    format!(
        "{library},{percent},{pairs},{},{:.1},{:.1},{counted}",
        times.len(),
        us(quantile(times, 0.5)),
        us(quantile(times, 0.99)),
    )
}
