//! Jolt 5: its lock-free tree of four children, as joltc-sys builds it (profiler and debug renderer compiled in).
//!
//! What is timed: removal and insertion of the churned, `NotifyBodiesAABBChanged` of the moved, the rebuilding of what
//! changed (Jolt would do it in the background), `FindCollidingPairs`. Boxes and who is active are set before.
//!
//! It keeps no pairs. `jolt` asks for those of every body, `jolt-active`, as Jolt's own step does, for those of what
//! moved: the rest stay untold.

// Brings Jolt itself, called through `jolt.cpp`.
use joltc_sys as _;

use crate::exact::Pair;
use crate::methods::{Runner, timed};
use crate::rust::real;
use crate::scenes::{Box3, Scene};

#[repr(C)]
struct Broad {
    _private: [u8; 0],
}

// In `jolt.cpp`. A `Box3` is six floats, the lower corner first, as its `Box`.
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

/// Lives as long as the process, which makes only one.
pub struct Jolt {
    broad: *mut Broad,
    everybody: bool,
}

impl Jolt {
    pub fn new(everybody: bool, scene: &Scene) -> Self {
        // SAFETY: called once, before anything else of Jolt.
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
        // SAFETY: `broad` comes from `jolt_new`, which made as many bodies as there are boxes; nothing is kept of the
        // slices.
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
            // SAFETY: every body has its box by now, and is put in before the first step.
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
        // SAFETY: the numbers stay where they are until the next step; two make a pair. None may be at null.
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
