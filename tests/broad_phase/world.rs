//! A world of boxes without bodies, and an oracle that knows no method: it looks at every pair in every tick.

use std::collections::{BTreeMap, BTreeSet};

use sweepd::broad::{BroadPhase, Method, Proxies};
use sweepd::ids::{BodyId, BodySlot, PairKey};
use sweepd::math::{Aabb, Point, Vec3};
use sweepd::pairs::{PairDelta, PairPolicy, PairSet};
use sweepd::wire::EndCause;
use sweepd::world::{ChangeSet, Removed};

use crate::common::Rng;

/// One body of the double.
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

/// Bodies, changes of the tick, forced pairs, and the generator that moves them.
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

type Ids = (BodyId, BodyId);

/// What a tick must have done, by ids.
#[derive(Debug, Default, PartialEq)]
pub struct Outcome {
    pub began: Vec<Ids>,
    pub ended: Vec<(Ids, EndCause)>,
    pub stored: BTreeSet<Ids>,
    pub truncated: BTreeSet<BodyId>,
    pub missing: u64,
}

/// The law of the broad phase in its plainest words.
#[derive(Default)]
struct Oracle {
    stored: BTreeSet<(usize, usize)>,
    truncated: BTreeSet<usize>,
    missing: u64,
}

impl Oracle {
    fn tick(&mut self, world: &World, limit: usize) -> Outcome {
        let ids = |(a, b): (usize, usize)| {
            let (a, b) = (world.bodies[a].id, world.bodies[b].id);
            (a.min(b), a.max(b))
        };
        let left: BTreeMap<usize, EndCause> = world
            .changes
            .removed
            .iter()
            .map(|r| (r.slot.index(), r.cause))
            .collect();
        let always = |(a, b): (usize, usize)| {
            let key = PairKey::new(World::slot(a), World::slot(b));
            match (world.bodies[a].unbounded, world.bodies[b].unbounded) {
                (true, true) => false,
                (false, false) => world.forced.contains(&key),
                _ => true,
            }
        };
        let overlap = |(a, b): (usize, usize)| {
            let (a, b) = (&world.bodies[a], &world.bodies[b]);
            let both = !a.unbounded && !b.unbounded;
            both && (0..3).all(|k| a.aabb.min[k] <= b.aabb.max[k] && b.aabb.min[k] <= a.aabb.max[k])
        };
        let allows = |(a, b): (usize, usize)| world.allows(World::slot(a), World::slot(b));
        let keeps = |(a, b): (usize, usize)| world.bodies[a].keeps || world.bodies[b].keeps;
        let mut outcome = Outcome::default();
        let old = std::mem::take(&mut self.stored);
        for pair in old {
            let gone = [pair.0, pair.1].map(|b| left.get(&b).copied());
            let cause = match gone {
                [Some(one), Some(other)] => Some(one.min(other)),
                [Some(cause), None] | [None, Some(cause)] => Some(cause),
                [None, None] if !allows(pair) => Some(EndCause::Filtered),
                [None, None] => {
                    let stays = overlap(pair) || always(pair) || keeps(pair);
                    (!stays).then_some(EndCause::Separated)
                }
            };
            match cause {
                Some(cause) => outcome.ended.push((ids(pair), cause)),
                None => _ = self.stored.insert(pair),
            }
        }
        let n = world.bodies.len();
        let mut wanted: Vec<(usize, usize)> = (0..n)
            .flat_map(|a| (a + 1..n).map(move |b| (a, b)))
            .filter(|(a, b)| world.bodies[*a].inside && world.bodies[*b].inside)
            .filter(|p| always(*p) || (overlap(*p) && !keeps(*p)))
            .filter(|p| allows(*p) && !self.stored.contains(p))
            .collect();
        wanted.sort_by_key(|p| ids(*p));
        let room = limit - self.stored.len();
        let (fit, rest) = wanted.split_at(room.min(wanted.len()));
        self.stored.extend(fit);
        let was = std::mem::take(&mut self.truncated);
        self.truncated
            .extend(rest.iter().flat_map(|(a, b)| [*a, *b]));
        let inside: Vec<usize> = was
            .into_iter()
            .filter(|b| world.bodies[*b].inside)
            .collect();
        let mut missing = rest.len() as u64;
        if inside.iter().any(|b| world.bodies[*b].keeps) {
            missing = missing.max(self.missing);
            self.truncated.extend(inside);
        }
        self.missing = missing;
        outcome.began = fit.iter().map(|p| ids(*p)).collect();
        outcome.ended.sort_by_key(|(ids, _)| *ids);
        outcome.stored = self.stored.iter().map(|p| ids(*p)).collect();
        outcome.truncated = self.truncated.iter().map(|b| world.bodies[*b].id).collect();
        outcome.missing = missing;
        outcome
    }
}

/// One method with its own set.
struct Rig {
    method: Method,
    /// Which ticks the order works from scratch, around the clock; nothing: as it chooses.
    gears: &'static [bool],
    /// Goes on with the next method every third tick.
    changing: bool,
    broad: BroadPhase,
    pairs: PairSet,
    delta: PairDelta,
}

/// What a run went through, so that a test can say which paths it took.
#[derive(Debug, Default)]
pub struct Summary {
    pub ticks: u64,
    pub pairs: usize,
    pub swaps: u64,
    pub rebuilds: u64,
    /// Ticks with an axis skipped.
    pub skipped: u64,
}

impl Summary {
    pub fn add(&mut self, other: &Self) {
        self.ticks += other.ticks;
        self.pairs += other.pairs;
        self.swaps += other.swaps;
        self.rebuilds += other.rebuilds;
        self.skipped += other.skipped;
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
    pub fn new(limit: usize) -> Self {
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
        // The ways of the order, whatever it would choose.
        rigs.push(rig(Method::Order, &[true]));
        rigs.push(rig(Method::Order, &[true, true, false, true, false]));
        rigs.push(Rig {
            changing: true,
            ..rig(Method::BruteForce, &[])
        });
        Self {
            rigs,
            oracle: Oracle::default(),
            limit,
            seen: Summary::default(),
        }
    }

    /// Runs one tick in every method and compares everything; then empties the changes.
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
