//! Bullet 3: its two trees (`btDbvtBroadphase`, margin 0.05, pairs kept) and its sweep over three axes in 32 bits.
//!
//! What is timed: removal and insertion of the churned, `setAabb` of the moved, `calculateOverlappingPairs`. Its pair
//! cache is up to date then.

use crate::exact::Pair;
use crate::methods::{Runner, timed};
use crate::rust::real;
use crate::scenes::{Box3, Scene};

/// Insertion one by one into long sorted lists: above this number it takes longer than a run may.
pub const SWEEP_BODIES_MAX: usize = 20_000;

#[repr(C)]
struct Broad {
    _private: [u8; 0],
}

// In `bullet.cpp`. A `Box3` is six floats, the lower corner first, as its `Box`.
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

/// Lives as long as the process, which makes only one.
pub struct Bullet(*mut Broad);

impl Bullet {
    pub fn new(sweep: bool, scene: &Scene) -> Self {
        // Twice the extent of the beginning: what goes beyond is cut to the edge, and loses no pair.
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
        // SAFETY: `world` is read during the call only.
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
            // SAFETY: `self.0` comes from `bullet_new` and is freed nowhere; every body is below the number of boxes,
            // for which it made room; a body is put once before it is stepped; nothing is kept of the slices.
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
        // SAFETY: as above; `found` has room for as many pairs as are told.
        let found = unsafe {
            let mut found = vec![[0; 2]; bullet_pair_count(self.0)];
            bullet_pairs(self.0, found.as_mut_ptr());
            found
        };
        real(scene, found.iter().map(|[a, b]| (*a, *b)))
    }
}
