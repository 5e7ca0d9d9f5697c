//! Jolt 5: its lock-free quad tree, as joltc-sys builds it (profiler and debug renderer compiled in).
//!
//! Timed: removal and insertion of churned bodies, `NotifyBodiesAABBChanged` of moved ones, rebuilding of changed parts
//! (which Jolt would do in the background), `FindCollidingPairs`. Boxes and the list of active bodies are set before.
//!
//! Jolt keeps no pairs. `jolt` queries the pairs of every body; `jolt-active` queries those of moved bodies only, as
//! Jolt's own step does, and reports no others.

// Links Jolt itself, which `jolt.cpp` calls.
use joltc_sys as _;

use crate::exact::Pair;
use crate::methods::{Runner, timed};
use crate::rust::real;
use crate::scenes::{Box3, Scene};

#[repr(C)]
struct Broad {
    _private: [u8; 0],
}

// Defined in `jolt.cpp`. A `Box3` has the layout of its `Box`: six floats, lower corner first.
unsafe extern "C" {
    fn jolt_new(bodies: u32) -> *mut Broad;
    fn jolt_take(
        broad: *mut Broad,
        boxes: *const Box3,
        churned: *const u32,
        churned_count: usize,
        moved: *const u32,
        moved_count: usize,
        everybody: bool,
    );
    fn jolt_insert(broad: *mut Broad);
    fn jolt_step(broad: *mut Broad);
    fn jolt_pairs(broad: *mut Broad, count: *mut usize) -> *const [u32; 2];
}

/// Never freed: each process makes only one.
pub struct Jolt {
    broad: *mut Broad,
    everybody: bool,
}

impl Jolt {
    pub fn new(everybody: bool, scene: &Scene) -> Self {
        // SAFETY: called once, before any other call to Jolt.
        let broad = unsafe { jolt_new(scene.boxes.len() as u32) };
        assert!(
            !broad.is_null(),
            "jolt.cpp was compiled with other options than Jolt: see build.rs"
        );
        Self { broad, everybody }
    }
}

impl Runner for Jolt {
    fn step(&mut self, scene: &Scene, first: bool) -> u64 {
        let all: Vec<u32> = (0..scene.boxes.len() as u32).collect();
        let (churned, moved) = if first {
            (&[][..], &all[..])
        } else {
            (&scene.churned[..], &scene.moved[..])
        };
        // SAFETY: `broad` comes from `jolt_new`, which made as many bodies as there are boxes; Jolt keeps no pointer
        // into the slices.
        unsafe {
            jolt_take(
                self.broad,
                scene.boxes.as_ptr(),
                churned.as_ptr(),
                churned.len(),
                moved.as_ptr(),
                moved.len(),
                self.everybody,
            );
        }
        timed(|| {
            // SAFETY: every body has a box by now, and is inserted before the first step.
            unsafe {
                if first {
                    jolt_insert(self.broad);
                }
                jolt_step(self.broad);
            }
        })
    }

    fn pairs(&self, scene: &Scene) -> Vec<Pair> {
        let mut count = 0;
        // SAFETY: the array stays valid until the next step; two numbers make a pair. Its pointer may be null if there
        // are no pairs, so the slice is not made from it then.
        let found = unsafe {
            let pairs = jolt_pairs(self.broad, &mut count);
            match count / 2 {
                0 => &[],
                count => std::slice::from_raw_parts(pairs, count),
            }
        };
        real(scene, found.iter().map(|[a, b]| (*a, *b)))
    }

    fn whole(&self) -> bool {
        self.everybody
    }

    fn told(&self) -> String {
        match self.everybody {
            true => String::new(),
            false => "pairs of what moved only".to_owned(),
        }
    }
}
