//! PhysX 5: its automatic box pruning (`PxBroadPhaseType::eABP`), standalone, on one thread.
//!
//! Timed: `update` and `fetchResults`, which report new and lost pairs. PhysX keeps no list of pairs for its caller;
//! this file keeps one as for rapier, which is not timed but counts towards the reported memory.

use std::collections::BTreeSet;

use physx_sys as px;

use crate::exact::Pair;
use crate::methods::{Runner, timed};
use crate::rust::real;
use crate::scenes::{Kind, Scene};

/// Never freed: each process makes only one.
pub struct PhysX {
    broad: *mut px::PxBroadPhase,
    bounds: Vec<px::PxBounds3>,
    groups: Vec<u32>,
    distances: Vec<f32>,
    bodies: u32,
    /// The handle of each body: its index, or its index plus `bodies`. A handle that is removed cannot be created again
    /// in the same update, so a churned body switches between its two handles.
    handles: Vec<u32>,
    /// Current pairs, by handle.
    found: BTreeSet<Pair>,
}

impl PhysX {
    pub fn new(scene: &Scene) -> Self {
        let bodies = scene.boxes.len();
        let handles = if scene.kind == Kind::Churn {
            2 * bodies
        } else {
            bodies
        };
        // SAFETY: none of these calls keeps its arguments; the foundation is made before everything that needs it, and
        // is never released.
        let (broad, groups) = unsafe {
            assert!(!px::physx_create_foundation().is_null());
            let desc = px::PxBroadPhaseDesc_new(px::PxBroadPhaseType::Abp);
            let group = |handle| px::phys_PxGetBroadPhaseDynamicFilterGroup(handle);
            let groups = (0..handles as u32).map(group).collect();
            (px::phys_PxCreateBroadPhase(&desc), groups)
        };
        assert!(!broad.is_null());
        let zero = px::PxVec3 {
            x: 0.0,
            y: 0.0,
            z: 0.0,
        };
        let none = px::PxBounds3 {
            minimum: zero,
            maximum: zero,
        };
        Self {
            broad,
            // One more than there are handles: PhysX loads four bytes past the last box.
            bounds: vec![none; handles + 1],
            groups,
            distances: vec![0.0; handles],
            bodies: bodies as u32,
            handles: (0..bodies as u32).collect(),
            found: BTreeSet::new(),
        }
    }

    /// Copies the box of a body; returns its handle.
    fn take(&mut self, body: u32, scene: &Scene) -> u32 {
        let handle = self.handles[body as usize];
        let vector = |[x, y, z]: [f32; 3]| px::PxVec3 { x, y, z };
        let [low, high] = scene.boxes[body as usize];
        self.bounds[handle as usize] = px::PxBounds3 {
            minimum: vector(low),
            maximum: vector(high),
        };
        handle
    }
}

impl Runner for PhysX {
    fn step(&mut self, scene: &Scene, first: bool) -> u64 {
        let (mut created, mut removed) = (Vec::new(), Vec::new());
        if first {
            created.extend((0..self.bodies).map(|body| self.take(body, scene)));
        }
        for &body in &scene.churned {
            let handle = &mut self.handles[body as usize];
            removed.push(*handle);
            *handle = (*handle + self.bodies) % (2 * self.bodies);
            created.push(self.take(body, scene));
        }
        let moved = scene.moved.iter();
        let mut updated: Vec<u32> = moved.map(|body| self.take(*body, scene)).collect();
        // PhysX requires sorted lists; it misses pairs otherwise.
        for list in [&mut created, &mut removed, &mut updated] {
            list.sort_unstable();
        }
        let mut found: &[px::PxBroadPhasePair] = &[];
        let mut lost: &[px::PxBroadPhasePair] = &[];
        let ns = timed(|| {
            // SAFETY: the lists have the given lengths, below the capacity, and their memory outlives the update; the
            // results stay valid until the next update.
            unsafe {
                let update = px::PxBroadPhaseUpdateData_new(
                    created.as_ptr(),
                    created.len() as u32,
                    updated.as_ptr(),
                    updated.len() as u32,
                    removed.as_ptr(),
                    removed.len() as u32,
                    self.bounds.as_ptr(),
                    self.groups.as_ptr(),
                    self.distances.as_ptr(),
                    self.groups.len() as u32,
                );
                let mut results = px::PxBroadPhaseResults_new();
                px::PxBroadPhase_update_mut_1(self.broad, &mut results, &update);
                // With no pairs the pointer may be null, of which no slice may be made.
                if results.mNbCreatedPairs > 0 {
                    let count = results.mNbCreatedPairs as usize;
                    found = std::slice::from_raw_parts(results.mCreatedPairs, count);
                }
                if results.mNbDeletedPairs > 0 {
                    let count = results.mNbDeletedPairs as usize;
                    lost = std::slice::from_raw_parts(results.mDeletedPairs, count);
                }
            }
        });
        let key =
            |pair: &px::PxBroadPhasePair| (pair.mID0.min(pair.mID1), pair.mID0.max(pair.mID1));
        for pair in lost {
            self.found.remove(&key(pair));
        }
        // PhysX does not report the lost pairs of removed handles.
        if !removed.is_empty() {
            let gone = |handle: &u32| removed.binary_search(handle).is_ok();
            self.found.retain(|(a, b)| !gone(a) && !gone(b));
        }
        self.found.extend(found.iter().map(key));
        ns
    }

    fn pairs(&self, scene: &Scene) -> Vec<Pair> {
        let found = self.found.iter();
        real(
            scene,
            found.map(|(a, b)| (a % self.bodies, b % self.bodies)),
        )
    }
}
