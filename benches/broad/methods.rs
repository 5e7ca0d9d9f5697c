//! Ours behind the trait that the peers share: one timed step a frame, and the pairs it left behind. What is timed is
//! the whole `update` with its pair set and the events in order.

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

/// What is timed.
pub trait Runner {
    /// One frame; returns the nanoseconds of CPU that it took.
    fn step(&mut self, scene: &Scene, first: bool) -> u64;
    /// The pairs after the last frame, sorted; those whose boxes do not overlap are dropped.
    fn pairs(&self, scene: &Scene) -> Vec<Pair>;
    /// Whether it tells every pair, and not only those of a body that moved in the frame.
    fn whole(&self) -> bool {
        true
    }
    /// What it did, in its own words.
    fn told(&self) -> String {
        String::new()
    }
}

/// The runners of a full run; `brute`, and the two ways of the order by name (`lasting`, `afresh`), can be asked for too.
pub const NAMES: &[&str] = &["limit", "order", "sap", "grid", "hash", "hgrid"];

pub fn runner(name: &str, scene: &Scene) -> Option<Box<dyn Runner>> {
    Some(match name {
        "limit" => Box::new(Limit::default()),
        // The two ways of the order, whatever the scene.
        "lasting" | "afresh" => {
            let mut ours = Ours::new(Method::Order, scene);
            ours.broad.use_afresh(name == "afresh");
            Box::new(ours)
        }
        // ... with another thread beside, where that pays.
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
    /// Whether time is that of the wall: where threads work, not all of it is this one's.
    by_wall: bool,
    /// What all frames did, summed.
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
            // Far from the origin we get the far boxes, the peers the same ones near: f32 would spoil theirs.
            offset_m: if scene.kind == Kind::Far { 1e7 } else { 0.0 },
            by_wall: false,
            work: [0; 6],
            frames: 0,
        }
    }

    fn take(&mut self, body: u32, b: &Box3) {
        // Boxes in f64 that are those of f32 moved: exact, for 1e7 leaves 29 bits behind the point.
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
        // Not filtered: ours must be exact.
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

/// Reads every box once and writes every pair once.
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
            // Whole numbers: their sum may be taken in any order, so that it is read at full width.
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
