//! Ours and the peers behind one trait: one timed step a frame, and the pairs it left behind.
//!
//! What is timed on each side: ours, the whole `update` with its pair set and the events in order; parry, leaves, refit,
//! optimiser, self-traversal and all pairs written; rapier, `set_aabb` of the moved boxes and `update` with its events.
//! Filling the peers' own objects is not timed.

use parry3d::bounding_volume::Aabb as PeerBox;
use parry3d::math::Vector as PeerVector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};
use rapier3d::prelude as rapier;
use sweepd::broad::{BroadPhase, Method, Proxies, Work};
use sweepd::ids::{BodyId, BodySlot};
use sweepd::math::{Aabb, Point};
use sweepd::pairs::{PairDelta, PairPolicy, PairSet};
use sweepd::time::{Clock, SystemClock};
use sweepd::wire::EndCause;
use sweepd::world::{ChangeSet, Removed};

use super::exact::{Pair, overlap};
use super::scenes::{Box3, Kind, Scene};

/// What is timed.
pub trait Runner {
    /// One frame; returns the nanoseconds of CPU that it took.
    fn step(&mut self, scene: &Scene, first: bool) -> u64;
    /// The pairs after the last frame, sorted; those whose boxes do not overlap are dropped.
    fn pairs(&self, scene: &Scene) -> Vec<Pair>;
    /// What it did, in its own words.
    fn told(&self) -> String {
        String::new()
    }
}

/// The runners of a full run; `brute` can be asked for too.
pub const NAMES: &[&str] = &["limit", "order", "sap", "parry", "rapier"];

pub fn runner(name: &str, scene: &Scene) -> Option<Box<dyn Runner>> {
    Some(match name {
        "limit" => Box::new(Limit::default()),
        "parry" => Box::new(Parry::default()),
        "rapier" => Box::new(Rapier::new(scene.boxes.len())),
        _ => Box::new(Ours::new(method(name)?, scene)),
    })
}

fn method(name: &str) -> Option<Method> {
    Some(match name {
        "order" => Method::Order,
        "sap" => Method::SweepAndPrune,
        "brute" => Method::BruteForce,
        _ => return None,
    })
}

fn timed(work: impl FnOnce()) -> u64 {
    let from = SystemClock.thread_cpu_ns();
    work();
    SystemClock.thread_cpu_ns() - from
}

/// Boxes as the world holds them.
struct Bodies(Vec<Aabb>);

impl Proxies for Bodies {
    fn aabb(&self, slot: BodySlot) -> &Aabb {
        &self.0[slot.index()]
    }
    fn unbounded(&self, _: BodySlot) -> bool {
        false
    }
    fn id(&self, slot: BodySlot) -> BodyId {
        BodyId(u64::from(slot.0) + 1)
    }
}

struct Everything;

impl PairPolicy for Everything {
    fn allows(&self, _: BodySlot, _: BodySlot) -> bool {
        true
    }
}

struct Ours {
    broad: BroadPhase,
    bodies: Bodies,
    changes: ChangeSet,
    pairs: PairSet,
    delta: PairDelta,
    offset_m: f64,
    work: Work,
}

impl Ours {
    fn new(method: Method, scene: &Scene) -> Self {
        Self {
            broad: BroadPhase::new(method),
            bodies: Bodies(vec![Aabb::empty(); scene.boxes.len()]),
            changes: ChangeSet::default(),
            pairs: PairSet::new(1 << 25),
            delta: PairDelta::default(),
            // Far from the origin we get the far boxes, the peers the same ones near: f32 would spoil theirs.
            offset_m: if scene.kind == Kind::Far { 1e7 } else { 0.0 },
            work: Work::default(),
        }
    }

    fn take(&mut self, body: u32, b: &Box3) {
        // Boxes in f64 that are those of f32 moved: exact, for 1e7 leaves 29 bits behind the point.
        let point = |p: [f32; 3]| Point::from(p.map(|v| f64::from(v) + self.offset_m));
        self.bodies.0[body as usize] = Aabb {
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
        let ns = timed(|| {
            self.broad.update(
                &self.changes,
                &self.bodies,
                &Everything,
                &mut self.pairs,
                &mut self.delta,
            );
        });
        self.work = self.broad.work();
        ns
    }

    fn pairs(&self, _: &Scene) -> Vec<Pair> {
        // Not filtered: ours must be exact.
        let keys = self.pairs.iter().map(|(_, key)| key.slots());
        let mut pairs: Vec<Pair> = keys.map(|(a, b)| (a.0, b.0)).collect();
        pairs.sort_unstable();
        pairs
    }

    fn told(&self) -> String {
        format!("{:?}", self.work).replace(',', ";")
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

fn peer_box(b: &Box3) -> PeerBox {
    let vector = |p: [f32; 3]| PeerVector::new(p[0], p[1], p[2]);
    PeerBox {
        mins: vector(b[0]),
        maxs: vector(b[1]),
    }
}

fn real(scene: &Scene, pairs: impl Iterator<Item = Pair>) -> Vec<Pair> {
    let mut all: Vec<Pair> = pairs
        .map(|(a, b)| (a.min(b), a.max(b)))
        .filter(|(a, b)| overlap(&scene.boxes[*a as usize], &scene.boxes[*b as usize]))
        .collect();
    all.sort_unstable();
    all
}

/// parry3d's tree, bare.
#[derive(Default)]
struct Parry {
    tree: Bvh,
    space: BvhWorkspace,
    found: Vec<Pair>,
}

impl Runner for Parry {
    fn step(&mut self, scene: &Scene, first: bool) -> u64 {
        let boxes: Vec<PeerBox> = scene.boxes.iter().map(peer_box).collect();
        timed(|| {
            if first {
                self.tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
            }
            for body in &scene.churned {
                self.tree.remove(*body);
                self.tree.insert(boxes[*body as usize], *body);
            }
            for body in &scene.moved {
                self.tree
                    .insert_or_update_partially(boxes[*body as usize], *body, 0.0);
            }
            self.tree.refit(&mut self.space);
            self.tree.optimize_incremental(&mut self.space);
            self.found.clear();
            let found = &mut self.found;
            self.tree
                .traverse_bvtt_single_tree::<false>(&mut self.space, &mut |a, b| {
                    found.push((a, b));
                });
        })
    }

    fn pairs(&self, scene: &Scene) -> Vec<Pair> {
        real(scene, self.found.iter().copied())
    }
}

/// rapier3d's broad phase.
struct Rapier {
    broad: rapier::BroadPhaseBvh,
    colliders: rapier::ColliderSet,
    bodies: rapier::RigidBodySet,
    handles: Vec<rapier::ColliderHandle>,
    params: rapier::IntegrationParameters,
    events: Vec<rapier::BroadPhasePairEvent>,
    found: std::collections::BTreeSet<Pair>,
}

impl Rapier {
    fn new(bodies: usize) -> Self {
        let mut colliders = rapier::ColliderSet::new();
        let builder = || {
            rapier::ColliderBuilder::cuboid(0.5, 0.5, 0.5)
                .active_collision_types(rapier::ActiveCollisionTypes::all())
        };
        Self {
            broad: rapier::BroadPhaseBvh::new(),
            handles: (0..bodies).map(|_| colliders.insert(builder())).collect(),
            colliders,
            bodies: rapier::RigidBodySet::new(),
            params: rapier::IntegrationParameters::default(),
            events: Vec::new(),
            found: std::collections::BTreeSet::new(),
        }
    }
}

impl Runner for Rapier {
    fn step(&mut self, scene: &Scene, first: bool) -> u64 {
        let all: Vec<u32> = if first {
            (0..scene.boxes.len() as u32).collect()
        } else {
            // A body put in elsewhere is one that moved: to give and drop handles is not the broad phase's work.
            scene.churned.iter().chain(&scene.moved).copied().collect()
        };
        let boxes: Vec<PeerBox> = all
            .iter()
            .map(|body| peer_box(&scene.boxes[*body as usize]))
            .collect();
        self.events.clear();
        let ns = timed(|| {
            for (body, aabb) in all.iter().zip(&boxes) {
                let handle = self.handles[*body as usize];
                self.broad.set_aabb(&self.params, handle, *aabb);
            }
            self.broad.update(
                &self.params,
                &self.colliders,
                &self.bodies,
                &[],
                &[],
                &mut self.events,
            );
        });
        let key = |pair: &rapier::ColliderPair| {
            let (a, b) = (
                pair.collider1.into_raw_parts().0,
                pair.collider2.into_raw_parts().0,
            );
            (a.min(b), a.max(b))
        };
        for event in &self.events {
            match event {
                rapier::BroadPhasePairEvent::AddPair(pair) => self.found.insert(key(pair)),
                rapier::BroadPhasePairEvent::DeletePair(pair) => self.found.remove(&key(pair)),
            };
        }
        ns
    }

    fn pairs(&self, scene: &Scene) -> Vec<Pair> {
        real(scene, self.found.iter().copied())
    }
}
