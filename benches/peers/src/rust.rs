//! The peers in Rust, in f32, their usual precision.
//!
//! Timed: for parry, updating leaves, refit, optimizer, self-traversal and writing all pairs; for rapier, `set_aabb` of
//! moved boxes and `update` with its events. Filling the peers' own objects is not timed.

use parry3d::bounding_volume::Aabb as PeerBox;
use parry3d::math::Vector as PeerVector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};
use rapier3d::prelude as rapier;

use crate::exact::{Pair, overlap};
use crate::methods::{Runner, timed};
use crate::scenes::{Box3, Scene};

fn peer_box(b: &Box3) -> PeerBox {
    let vector = |p: [f32; 3]| PeerVector::new(p[0], p[1], p[2]);
    PeerBox {
        mins: vector(b[0]),
        maxs: vector(b[1]),
    }
}

/// The pairs of a peer whose boxes really overlap, sorted.
pub fn real(scene: &Scene, pairs: impl Iterator<Item = Pair>) -> Vec<Pair> {
    let mut all: Vec<Pair> = pairs
        .map(|(a, b)| (a.min(b), a.max(b)))
        .filter(|(a, b)| overlap(&scene.boxes[*a as usize], &scene.boxes[*b as usize]))
        .collect();
    all.sort_unstable();
    all
}

/// The tree of parry3d alone.
#[derive(Default)]
pub struct Parry {
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
pub struct Rapier {
    broad: rapier::BroadPhaseBvh,
    colliders: rapier::ColliderSet,
    bodies: rapier::RigidBodySet,
    handles: Vec<rapier::ColliderHandle>,
    params: rapier::IntegrationParameters,
    events: Vec<rapier::BroadPhasePairEvent>,
    found: std::collections::BTreeSet<Pair>,
}

impl Rapier {
    pub fn new(bodies: usize) -> Self {
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
            // A churned body is treated as moved: creating and dropping handles is not the work of the broad phase.
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
