//! Bullet 3: its pair of trees (`btDbvtBroadphase`, margin 0.05, pairs cached) and its three-axis sweep in 32 bits.
//!
//! Timed: removal and insertion of churned bodies, `setAabb` of moved ones, `calculateOverlappingPairs`. After that its
//! pair cache is current.

use crate::exact::Pair;
use crate::methods::{Runner, timed};
use crate::rust::real;
use crate::scenes::{Box3, Scene};

/// Above this number of bodies, insertion one by one into long sorted lists takes longer than the time limit of a run.
pub const SWEEP_BODIES_MAX: usize = 20_000;

#[repr(C)]
struct Broad {
    _private: [u8; 0],
}

// Defined in `bullet.cpp`. A `Box3` has the layout of its `Box`: six floats, lower corner first.
unsafe extern "C" {
    fn bullet_new(sweep: bool, bodies: u32, world: *const Box3) -> *mut Broad;
    fn bullet_put(broad: *mut Broad, boxes: *const Box3, bodies: *const u32, count: usize);
    fn bullet_step(
        broad: *mut Broad,
        boxes: *const Box3,
        churned: *const u32,
        churned_count: usize,
        moved: *const u32,
        moved_count: usize,
    );
    fn bullet_pair_count(broad: *mut Broad) -> usize;
    fn bullet_pairs(broad: *mut Broad, pairs: *mut [u32; 2]);
}

/// Never freed: each process makes only one.
pub struct Bullet(*mut Broad);

impl Bullet {
    pub fn new(sweep: bool, scene: &Scene) -> Self {
        // Twice the initial extent; boxes beyond it are clamped to its edge, which loses no pair.
        let mut world = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        for b in &scene.boxes {
            for k in 0..3 {
                world[0][k] = world[0][k].min(b[0][k]);
                world[1][k] = world[1][k].max(b[1][k]);
            }
        }
        let [low, high] = &mut world;
        for (low, high) in low.iter_mut().zip(high) {
            let more = (*high - *low) / 2.0;
            *low -= more;
            *high += more;
        }
        // SAFETY: `bullet_new` reads `world` only during the call.
        Self(unsafe { bullet_new(sweep, scene.boxes.len() as u32, &world) })
    }
}

impl Runner for Bullet {
    fn step(&mut self, scene: &Scene, first: bool) -> u64 {
        let all: Vec<u32> = if first {
            (0..scene.boxes.len() as u32).collect()
        } else {
            Vec::new()
        };
        let (boxes, churned, moved) = (scene.boxes.as_ptr(), &scene.churned, &scene.moved);
        timed(|| {
            // SAFETY: `self.0` comes from `bullet_new` and is never freed; every body index is below the number of
            // boxes, for which `bullet_new` reserved memory; each body is put before it is stepped; Bullet keeps no
            // pointer into the slices.
            unsafe {
                bullet_put(self.0, boxes, all.as_ptr(), all.len());
                bullet_step(
                    self.0,
                    boxes,
                    churned.as_ptr(),
                    churned.len(),
                    moved.as_ptr(),
                    moved.len(),
                );
            }
        })
    }

    fn pairs(&self, scene: &Scene) -> Vec<Pair> {
        // SAFETY: as above; `found` has room for `bullet_pair_count` pairs.
        let found = unsafe {
            let mut found = vec![[0; 2]; bullet_pair_count(self.0)];
            bullet_pairs(self.0, found.as_mut_ptr());
            found
        };
        real(scene, found.iter().map(|[a, b]| (*a, *b)))
    }
}
