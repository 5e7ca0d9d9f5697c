//! Our broad phases behind the trait that the peers also implement: one timed step per frame, then the resulting pairs.
//! The timed part is the whole `update`, including its pair set and the sorted events.

use sweepd::broad::{BroadPhase, Method, Work};
use sweepd::ids::BodySlot;
use sweepd::limits;
use sweepd::math::{Aabb, Point};
use sweepd::pairs::{PairDelta, PairSet};
use sweepd::time::{Clock, SystemClock};
use sweepd::wire::EndCause;
use sweepd::world::{ChangeSet, Removed};

use super::common::boxes::{Boxes, Everything};
use super::exact::Pair;
use super::scenes::{Box3, Kind, Scene};

/// A broad phase that is timed.
pub trait Runner {
    /// Runs one frame; returns the CPU time it took, nanoseconds.
    fn step(&mut self, scene: &Scene, first: bool) -> u64;
    /// The pairs after the last frame, sorted; a method may drop pairs whose boxes do not overlap.
    fn pairs(&self, scene: &Scene) -> Vec<Pair>;
    /// Whether it reports every pair, not only those of bodies that moved in the frame.
    fn whole(&self) -> bool {
        true
    }
    /// Counters of its work, as text for the CSV.
    fn told(&self) -> String {
        String::new()
    }
}

/// The methods of a full run. `--method` also accepts `brute`, and `lasting` and `afresh` (the two modes of `order`,
/// fixed).
pub const NAMES: &[&str] = &["limit", "order", "sap", "grid", "hash", "hgrid"];

pub fn runner(name: &str, scene: &Scene) -> Option<Box<dyn Runner>> {
    Some(match name {
        "limit" => Box::new(Limit::default()),
        // The two modes of `order`, regardless of the scene.
        "lasting" | "afresh" => {
            let mut ours = Ours::new(Method::Order, scene);
            ours.broad.use_afresh(name == "afresh");
            Box::new(ours)
        }
        // The same with a second thread, used where it pays off.
        "order2" | "afresh2" => {
            let mut ours = Ours::new(Method::Order, scene);
            ours.broad.use_threads(2, limits::SHARED_TESTS_MIN);
            ours.by_wall = true;
            if name == "afresh2" {
                ours.broad.use_afresh(true);
            }
            Box::new(ours)
        }
        _ => Box::new(Ours::new(Method::named(name)?, scene)),
    })
}

pub fn timed(work: impl FnOnce()) -> u64 {
    let from = SystemClock.thread_cpu_ns();
    work();
    SystemClock.thread_cpu_ns() - from
}

struct Ours {
    broad: BroadPhase,
    bodies: Boxes,
    changes: ChangeSet,
    pairs: PairSet,
    delta: PairDelta,
    offset_m: f64,
    /// Whether wall time is measured instead of this thread's CPU time, which misses the work of other threads.
    by_wall: bool,
    /// Work counters, summed over all frames.
    work: [u64; 6],
    frames: u64,
}

impl Ours {
    fn new(method: Method, scene: &Scene) -> Self {
        Self {
            broad: BroadPhase::new(method),
            bodies: Boxes::new(scene.boxes.len()),
            changes: ChangeSet::default(),
            pairs: PairSet::new(1 << 25),
            delta: PairDelta::default(),
            // In the `Far` scene our boxes are at the offset; the peers get the same boxes near the origin, since f32
            // would round them.
            offset_m: if scene.kind == Kind::Far { 1e7 } else { 0.0 },
            by_wall: false,
            work: [0; 6],
            frames: 0,
        }
    }

    fn take(&mut self, body: u32, b: &Box3) {
        // Adding the offset to an f32 coordinate in f64 is exact: 1e7 leaves 29 bits for the fraction.
        let point = |p: [f32; 3]| Point::from(p.map(|v| f64::from(v) + self.offset_m));
        self.bodies.all[body as usize] = Aabb {
            min: point(b[0]),
            max: point(b[1]),
        };
    }
}

impl Runner for Ours {
    fn step(&mut self, scene: &Scene, first: bool) -> u64 {
        self.changes.clear();
        if first {
            for (i, b) in scene.boxes.iter().enumerate() {
                self.take(i as u32, b);
                self.changes.inserted.push(BodySlot(i as u32));
            }
        }
        for &body in &scene.churned {
            self.take(body, &scene.boxes[body as usize]);
            let (slot, cause) = (BodySlot(body), EndCause::Removed);
            self.changes.removed.push(Removed { slot, cause });
            self.changes.inserted.push(slot);
        }
        for &body in &scene.moved {
            self.take(body, &scene.boxes[body as usize]);
            self.changes.moved.push(BodySlot(body));
        }
        let from_ns = SystemClock.monotonic_ns();
        let ns = timed(|| {
            self.broad.update(
                &self.changes,
                &self.bodies,
                &Everything,
                &mut self.pairs,
                &mut self.delta,
            );
        });
        let wall_ns = SystemClock.monotonic_ns() - from_ns;
        let Work {
            swaps,
            tests,
            renewed,
            cells,
            rebuilds,
            ..
        } = self.broad.work();
        let events = self.delta.began.len() + self.delta.ended.len();
        let done = [swaps, tests, renewed, cells, events as u64, rebuilds];
        for (sum, done) in self.work.iter_mut().zip(done) {
            *sum += done;
        }
        self.frames += 1;
        if self.by_wall { wall_ns } else { ns }
    }

    fn pairs(&self, _: &Scene) -> Vec<Pair> {
        // Pairs are not filtered: our set must be exact.
        let keys = self.pairs.iter().map(|(_, key)| key.slots());
        let mut pairs: Vec<Pair> = keys.map(|(a, b)| (a.0, b.0)).collect();
        pairs.sort_unstable();
        pairs
    }

    fn told(&self) -> String {
        let [swaps, tests, renewed, cells, events, rebuilds] = self.work;
        let mean = |sum: u64| sum / self.frames.max(1);
        format!(
            "a frame: swaps {}; tests {}; renewed {}; cells {}; events {}; in all: rebuilds {rebuilds}",
            mean(swaps),
            mean(tests),
            mean(renewed),
            mean(cells),
            mean(events)
        )
    }
}

/// Lower bound of the cost: reads every box once and writes every pair once.
#[derive(Default)]
struct Limit {
    sink: Vec<u64>,
    sum: u32,
    pairs: usize,
}

impl Runner for Limit {
    fn step(&mut self, scene: &Scene, first: bool) -> u64 {
        if first {
            self.pairs = super::exact::pairs(&scene.boxes).len();
            self.sink.reserve(self.pairs);
        }
        timed(|| {
            // Integer sums are associative, so the compiler can vectorize this loop and read at full bandwidth.
            let bits = scene.boxes.iter().flatten().flatten();
            self.sum = bits.fold(self.sum, |sum, v| sum.wrapping_add(v.to_bits()));
            self.sink.clear();
            self.sink.extend((0..self.pairs as u64).map(|k| k << 9));
            std::hint::black_box((&self.sink, self.sum));
        })
    }

    fn pairs(&self, scene: &Scene) -> Vec<Pair> {
        super::exact::pairs(&scene.boxes)
    }
}
