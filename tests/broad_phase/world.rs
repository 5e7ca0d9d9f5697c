//! A world of boxes without shapes, and a bench of all methods and the oracle.

use sweepd::broad::{BroadPhase, Method, Proxies};
use sweepd::ids::{BodyId, BodySlot, PairKey};
use sweepd::math::{Aabb, Point, Vec3};
use sweepd::pairs::{PairDelta, PairPolicy, PairSet};
use sweepd::wire::EndCause;
use sweepd::world::{ChangeSet, Removed};

use crate::common::Rng;
use crate::oracle::{Oracle, Outcome};

/// One body of this world.
#[derive(Clone, Debug)]
pub struct Body {
    pub inside: bool,
    pub aabb: Aabb,
    pub unbounded: bool,
    pub id: BodyId,
    pub group: u32,
    pub mask: u32,
    pub keeps: bool,
}

/// Bodies, changes of the tick, forced pairs, and the random generator of the motion.
pub struct World {
    pub rng: Rng,
    pub bodies: Vec<Body>,
    pub changes: ChangeSet,
    pub forced: Vec<PairKey>,
    pub forced_changed: bool,
}

pub fn at(centre: [f64; 3], half: [f64; 3]) -> Aabb {
    let (c, h) = (Point::from(centre), Vec3::from(half));
    Aabb {
        min: c - h,
        max: c + h,
    }
}

impl World {
    pub fn new(seed: u64, bodies: usize) -> Self {
        let mut rng = Rng::new(seed);
        let mut ids: Vec<u64> = (1..=bodies as u64).collect();
        for i in (1..bodies).rev() {
            ids.swap(i, rng.below(i + 1));
        }
        let nowhere = at([0.0; 3], [0.0; 3]);
        let body = |id| Body {
            inside: false,
            aabb: nowhere,
            unbounded: false,
            id: BodyId(id),
            group: 1,
            mask: u32::MAX,
            keeps: false,
        };
        Self {
            rng,
            bodies: ids.into_iter().map(body).collect(),
            changes: ChangeSet::default(),
            forced: Vec::new(),
            forced_changed: false,
        }
    }

    pub fn slot(index: usize) -> BodySlot {
        BodySlot(u32::try_from(index).unwrap())
    }

    pub fn insert(&mut self, index: usize) {
        let slot = Self::slot(index);
        if !self.bodies[index].inside && !self.changes.inserted.contains(&slot) {
            self.bodies[index].inside = true;
            self.changes.inserted.push(slot);
        }
    }

    pub fn remove(&mut self, index: usize, cause: EndCause) {
        let slot = Self::slot(index);
        if self.bodies[index].inside && !self.changes.inserted.contains(&slot) {
            self.bodies[index].inside = false;
            self.changes.removed.push(Removed { slot, cause });
        }
    }

    pub fn place(&mut self, index: usize, aabb: Aabb) {
        self.bodies[index].aabb = aabb;
        let slot = Self::slot(index);
        let known = self.changes.moved.contains(&slot) || self.changes.inserted.contains(&slot);
        if self.bodies[index].inside && !known {
            self.changes.moved.push(slot);
        }
    }

    pub fn shift(&mut self, index: usize, by: [f64; 3]) {
        let (old, by) = (self.bodies[index].aabb, Vec3::from(by));
        let aabb = Aabb {
            min: old.min + by,
            max: old.max + by,
        };
        self.place(index, aabb);
    }

    pub fn requery(&mut self, index: usize) {
        let slot = Self::slot(index);
        if self.bodies[index].inside && !self.changes.requery.contains(&slot) {
            self.changes.requery.push(slot);
        }
    }

    pub fn set_keeps(&mut self, index: usize, keeps: bool) {
        let was = std::mem::replace(&mut self.bodies[index].keeps, keeps);
        if was && !keeps {
            self.requery(index);
        }
    }

    pub fn random_vec(&mut self, reach: f64) -> [f64; 3] {
        std::array::from_fn(|_| self.rng.between(-reach, reach))
    }
}

impl Proxies for World {
    fn aabb(&self, slot: BodySlot) -> &Aabb {
        &self.bodies[slot.index()].aabb
    }
    fn unbounded(&self, slot: BodySlot) -> bool {
        self.bodies[slot.index()].unbounded
    }
    fn id(&self, slot: BodySlot) -> BodyId {
        self.bodies[slot.index()].id
    }
}

impl PairPolicy for World {
    fn allows(&self, a: BodySlot, b: BodySlot) -> bool {
        let (a, b) = (&self.bodies[a.index()], &self.bodies[b.index()]);
        a.group & b.mask != 0 && b.group & a.mask != 0
    }
    fn keeps(&self, slot: BodySlot) -> bool {
        self.bodies[slot.index()].keeps
    }
}

/// One method with its own pair set.
struct Rig {
    method: Method,
    /// In which ticks the `Order` method works from scratch, repeated cyclically; empty: as the method chooses.
    gears: &'static [bool],
    /// Whether it changes to the next method every third tick.
    changing: bool,
    broad: BroadPhase,
    pairs: PairSet,
    delta: PairDelta,
}

/// Counters of a run, so that a test can assert which code paths it took.
#[derive(Debug, Default)]
pub struct Summary {
    pub ticks: u64,
    pub pairs: usize,
    pub swaps: u64,
    pub rebuilds: u64,
    /// Ticks in which an axis was skipped.
    pub skipped: u64,
    /// Ticks in which missing pairs were not counted, and ticks with a count after such ticks; missing pairs at the
    /// end.
    pub waited: (u64, u64),
    pub missing: u64,
}

impl Summary {
    pub fn add(&mut self, other: &Self) {
        self.ticks += other.ticks;
        self.pairs += other.pairs;
        self.swaps += other.swaps;
        self.rebuilds += other.rebuilds;
        self.skipped += other.skipped;
        self.waited.0 += other.waited.0;
        self.waited.1 += other.waited.1;
        self.missing += other.missing;
    }
}

/// All methods and the oracle, side by side.
pub struct Bench {
    rigs: Vec<Rig>,
    oracle: Oracle,
    limit: usize,
    pub seen: Summary,
}

impl Bench {
    /// * `recount` - up to this number of pairs, missing ones are counted in each tick.
    pub fn new(limit: usize, recount: u64) -> Self {
        let rig = |method, gears| Rig {
            method,
            gears,
            changing: false,
            broad: BroadPhase::new(method),
            pairs: PairSet::new(limit),
            delta: PairDelta::default(),
        };
        let mut rigs: Vec<Rig> = Method::NAMED
            .iter()
            .map(|(method, _)| rig(*method, &[][..]))
            .collect();
        // The modes of `Order`, regardless of its own choice.
        rigs.push(rig(Method::Order, &[true]));
        rigs.push(rig(Method::Order, &[true, true, false, true, false]));
        rigs.push(Rig {
            changing: true,
            ..rig(Method::BruteForce, &[])
        });
        for rig in &mut rigs {
            rig.broad.use_recount(recount);
        }
        Self {
            rigs,
            oracle: Oracle::new(recount),
            limit,
            seen: Summary::default(),
        }
    }

    /// Runs one tick with every method and compares all results; then clears the changes.
    pub fn tick(&mut self, world: &mut World, what: &str) {
        let expected = self.oracle.tick(world, self.limit);
        self.seen.ticks += 1;
        self.seen.pairs += expected.stored.len();
        let mut slots: Option<Vec<(_, PairKey)>> = None;
        for rig in &mut self.rigs {
            if world.forced_changed {
                rig.broad.force(&world.forced);
            }
            let at = self.seen.ticks as usize % rig.gears.len().max(1);
            if let Some(afresh) = rig.gears.get(at) {
                rig.broad.use_afresh(*afresh);
            }
            if rig.changing && self.seen.ticks.is_multiple_of(3) {
                let next = self.seen.ticks as usize / 3 % Method::NAMED.len();
                rig.method = Method::NAMED[next].0;
                rig.broad.change_to(rig.method);
            }
            rig.broad
                .update(&world.changes, world, world, &mut rig.pairs, &mut rig.delta);
            let name = format!("{what}: {:?} {:?}", rig.method, rig.gears);
            let valid = rig.broad.validate(world, world, &rig.pairs);
            assert_eq!(valid, Ok(()), "{name}");
            let outcome = outcome(world, &rig.pairs, &rig.delta);
            assert_eq!(outcome.ended, expected.ended, "{name}: ended");
            assert_eq!(outcome.began, expected.began, "{name}: began");
            assert_eq!(outcome, expected, "{name}");
            let here: Vec<_> = rig.pairs.iter().collect();
            assert_eq!(slots.get_or_insert(here.clone()), &here, "{name}: slots");
        }
        let sap = |rig: &&Rig| rig.method == Method::SweepAndPrune;
        let work = self.rigs.iter().find(sap).unwrap().broad.work();
        self.seen.swaps += work.swaps;
        self.seen.rebuilds += work.rebuilds;
        self.seen.skipped += u64::from(work.axes.contains(&false));
        self.seen.waited = self.oracle.waited;
        self.seen.missing = self.oracle.missing;
        world.changes.clear();
        world.forced_changed = false;
    }
}

fn outcome(world: &World, pairs: &PairSet, delta: &PairDelta) -> Outcome {
    let ids = |key: PairKey| {
        let (low, high) = key.slots();
        let (a, b) = (world.id(low), world.id(high));
        (a.min(b), a.max(b))
    };
    Outcome {
        began: delta
            .began
            .iter()
            .map(|s| ids(pairs.get(*s).unwrap()))
            .collect(),
        ended: delta.ended.iter().map(|e| (ids(e.key), e.cause)).collect(),
        stored: pairs.iter().map(|(_, key)| ids(key)).collect(),
        truncated: pairs.truncated().iter().map(|b| world.id(*b)).collect(),
        missing: pairs.missing(),
    }
}
