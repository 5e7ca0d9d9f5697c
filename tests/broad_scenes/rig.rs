//! One broad phase with its pair set, fed with the boxes of a scene, and checked in each frame.

use std::collections::BTreeSet;

use sweepd::broad::{BroadPhase, Method, Work};
use sweepd::ids::{BodySlot, PairKey};
use sweepd::math::{Aabb, Point};
use sweepd::pairs::{PairDelta, PairSet};
use sweepd::simd::boxes::Level;
use sweepd::wire::EndCause;
use sweepd::world::{ChangeSet, Removed};

use crate::common::Rng;
use crate::common::boxes::{Boxes, Everything};
use crate::exact::Pair;
use crate::scenes::{Box3, Scene};

pub fn at(place: [f32; 3], half: f32) -> Box3 {
    [place.map(|x| x - half), place.map(|x| x + half)]
}

pub struct Rig {
    pub name: String,
    /// In which ticks the method works from scratch, repeated cyclically; empty: as the method chooses.
    gears: &'static [bool],
    ticks: usize,
    broad: BroadPhase,
    bodies: Boxes,
    offset_m: f64,
    changes: ChangeSet,
    pairs: PairSet,
    pub delta: PairDelta,
    /// The current pairs according to the events.
    told: BTreeSet<Pair>,
}

impl Rig {
    /// The main method with an instruction level.
    pub fn new(level: Level, bodies: usize, far: bool) -> Self {
        let mut rig = Self::of(Method::Order, bodies, far);
        rig.broad.use_level(level);
        rig.name = format!("{level:?}");
        rig
    }

    /// The main method, which works from scratch in the ticks that `gears` selects, repeated cyclically.
    pub fn geared(name: &str, gears: &'static [bool], bodies: usize, far: bool) -> Self {
        Self {
            name: name.into(),
            gears,
            ..Self::of(Method::Order, bodies, far)
        }
    }

    /// The main method from scratch in each tick, with several threads.
    pub fn shared(threads: usize, bodies: usize, far: bool) -> Self {
        let mut rig = Self::geared(&format!("{threads} threads"), &[true], bodies, far);
        rig.use_threads(threads);
        rig
    }

    /// Any method.
    pub fn of(method: Method, bodies: usize, far: bool) -> Self {
        let mut rng = Rng::new(bodies as u64);
        let mut boxes = Boxes::new(bodies);
        // Shuffled, so that no result depends on slots being in the order of ids.
        for i in (1..bodies).rev() {
            boxes.ids.swap(i, rng.below(i + 1));
        }
        Self {
            name: format!("{method:?}"),
            gears: &[],
            ticks: 0,
            broad: BroadPhase::new(method),
            bodies: boxes,
            offset_m: if far { 1e7 } else { 0.0 },
            changes: ChangeSet::default(),
            pairs: PairSet::new(1 << 24),
            delta: PairDelta::default(),
            told: BTreeSet::new(),
        }
    }

    /// Shares all work that can be shared among threads, even small amounts.
    pub fn use_threads(&mut self, threads: usize) {
        self.broad.use_threads(threads, 0);
    }

    /// Inserts all bodies.
    pub fn start(&mut self, boxes: &[Box3]) {
        let all: Vec<u32> = (0..boxes.len() as u32).collect();
        self.change(boxes, &[], &[], &all);
        self.tick(&crate::exact::pairs(boxes), "start");
    }

    /// Applies the changes of a scene.
    pub fn take(&mut self, scene: &Scene) {
        self.put(&scene.boxes, &scene.moved, &scene.churned);
    }

    /// Applies bodies that moved, and bodies that left while another took their slot.
    pub fn put(&mut self, boxes: &[Box3], moved: &[u32], churned: &[u32]) {
        self.change(boxes, moved, churned, churned);
    }

    pub fn change(&mut self, boxes: &[Box3], moved: &[u32], left: &[u32], came: &[u32]) {
        self.changes.clear();
        let cause = EndCause::Removed;
        let slots = left.iter().map(|body| BodySlot(*body));
        self.changes
            .removed
            .extend(slots.map(|slot| Removed { slot, cause }));
        for body in moved.iter().chain(came) {
            let offset_m = self.offset_m;
            let point = |p: [f32; 3]| Point::from(p.map(|v| f64::from(v) + offset_m));
            let [min, max] = boxes[*body as usize];
            self.bodies.all[*body as usize] = Aabb {
                min: point(min),
                max: point(max),
            };
        }
        self.changes
            .moved
            .extend(moved.iter().map(|body| BodySlot(*body)));
        self.changes
            .inserted
            .extend(came.iter().map(|body| BodySlot(*body)));
    }

    /// Runs one update; pairs and events must be those of the exact set.
    pub fn tick(&mut self, wanted: &[Pair], what: &str) {
        if let Some(afresh) = self.gears.get(self.ticks % self.gears.len().max(1)) {
            self.broad.use_afresh(*afresh);
        }
        self.ticks += 1;
        self.broad.update(
            &self.changes,
            &self.bodies,
            &Everything,
            &mut self.pairs,
            &mut self.delta,
        );
        let pair = |key: PairKey| {
            let (a, b) = key.slots();
            (a.0, b.0)
        };
        for ended in &self.delta.ended {
            assert!(
                self.told.remove(&pair(ended.key)),
                "{what}, {}: {ended:?}",
                self.name
            );
        }
        // A pair can end and begin in one update only if a slot was taken over by another body.
        let anew = |body: u32| self.changes.removed.iter().any(|r| r.slot.0 == body);
        for began in &self.delta.began {
            let key = pair(self.pairs.get(*began).unwrap());
            let ended = self.delta.ended.iter().any(|ended| pair(ended.key) == key);
            assert!(
                !ended || anew(key.0) || anew(key.1),
                "{what}, {}: {key:?} ended and began",
                self.name
            );
            assert!(
                self.told.insert(key),
                "{what}, {}: {key:?} began twice",
                self.name
            );
        }
        let mut held: Vec<Pair> = self.pairs.iter().map(|(_, key)| pair(key)).collect();
        held.sort_unstable();
        assert!(held == wanted, "{what}, {}: pairs differ", self.name);
        assert!(
            self.told.iter().eq(wanted),
            "{what}, {}: events differ",
            self.name
        );
    }

    pub fn work(&self) -> Work {
        self.broad.work()
    }

    pub fn validate(&self) {
        let valid = self.broad.validate(&self.bodies, &Everything, &self.pairs);
        assert_eq!(valid, Ok(()), "{}", self.name);
    }
}
