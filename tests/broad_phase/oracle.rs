//! An oracle that is independent of the methods: it tests every pair in every tick.

use std::collections::{BTreeMap, BTreeSet};

use sweepd::ids::{BodyId, PairKey};
use sweepd::pairs::PairPolicy;
use sweepd::wire::EndCause;

use crate::world::World;

type Ids = (BodyId, BodyId);
/// Two bodies by their indices in the world.
type Pair = (usize, usize);

/// The required result of a tick, by ids.
#[derive(Debug, Default, PartialEq)]
pub struct Outcome {
    pub began: Vec<Ids>,
    pub ended: Vec<(Ids, EndCause)>,
    pub stored: BTreeSet<Ids>,
    pub truncated: BTreeSet<BodyId>,
    pub missing: u64,
}

/// The specification of the broad phase in its simplest form.
#[derive(Default)]
pub struct Oracle {
    stored: BTreeSet<Pair>,
    truncated: BTreeSet<usize>,
    pub missing: u64,
    /// Up to this number of pairs, stored and missing, all are recounted in each tick.
    recount: u64,
    /// The number of stored and missing pairs at the last count, and the ticks since then.
    counted: (u64, u64),
    /// Since the last count a body with missing pairs moved, left or was edited, or the forced pairs changed.
    stirred: bool,
    /// Number of ticks in which missing pairs were not counted, and of ticks with a count after such ticks.
    pub waited: (u64, u64),
}

fn ids(world: &World, (a, b): Pair) -> Ids {
    let (a, b) = (world.bodies[a].id, world.bodies[b].id);
    (a.min(b), a.max(b))
}

/// Whether a pair is stored regardless of its boxes.
fn always(world: &World, (a, b): Pair) -> bool {
    let key = PairKey::new(World::slot(a), World::slot(b));
    world.bodies[a].unbounded || world.bodies[b].unbounded || world.forced.contains(&key)
}

fn overlap(world: &World, (a, b): Pair) -> bool {
    let (a, b) = (&world.bodies[a], &world.bodies[b]);
    let both = !a.unbounded && !b.unbounded;
    both && (0..3).all(|k| a.aabb.min[k] <= b.aabb.max[k] && b.aabb.min[k] <= a.aabb.max[k])
}

fn allows(world: &World, (a, b): Pair) -> bool {
    world.allows(World::slot(a), World::slot(b))
}

fn keeps(world: &World, (a, b): Pair) -> bool {
    world.bodies[a].keeps || world.bodies[b].keeps
}

/// Pairs that must be stored.
fn wanted(world: &World) -> impl Iterator<Item = Pair> + '_ {
    let n = world.bodies.len();
    (0..n)
        .flat_map(move |a| (a + 1..n).map(move |b| (a, b)))
        .filter(|(a, b)| world.bodies[*a].inside && world.bodies[*b].inside)
        .filter(|p| always(world, *p) || (overlap(world, *p) && !keeps(world, *p)))
        .filter(|p| allows(world, *p))
}

impl Oracle {
    pub fn new(recount: u64) -> Self {
        Self {
            recount,
            ..Self::default()
        }
    }

    pub fn tick(&mut self, world: &World, limit: usize) -> Outcome {
        let left: BTreeMap<usize, EndCause> = world
            .changes
            .removed
            .iter()
            .map(|r| (r.slot.index(), r.cause))
            .collect();
        let old = std::mem::take(&mut self.stored);
        let stays = |p: &&Pair| !left.contains_key(&p.0) && !left.contains_key(&p.1);
        let waits = self.waits(world, limit, limit - old.iter().filter(stays).count());
        let mut outcome = Outcome::default();
        for pair in old {
            let gone = [pair.0, pair.1].map(|b| left.get(&b).copied());
            let cause = match gone {
                [Some(one), Some(other)] => Some(one.min(other)),
                [Some(cause), None] | [None, Some(cause)] => Some(cause),
                [None, None] if !allows(world, pair) => Some(EndCause::Filtered),
                [None, None] => {
                    let stays = overlap(world, pair) || always(world, pair) || keeps(world, pair);
                    (!stays).then_some(EndCause::Separated)
                }
            };
            match cause {
                Some(cause) => outcome.ended.push((ids(world, pair), cause)),
                None => _ = self.stored.insert(pair),
            }
        }
        let mut begin: Vec<Pair> = wanted(world)
            .filter(|p| !self.stored.contains(p))
            // Missing pairs of two such bodies are not found before the next count.
            .filter(|p| !(waits && self.misses(*p)))
            .collect();
        begin.sort_by_key(|p| ids(world, *p));
        let room = limit - self.stored.len();
        let (fit, rest) = begin.split_at(room.min(begin.len()));
        self.stored.extend(fit);
        self.miss(world, rest, waits);
        // Whenever pairs are counted: each pair that is not stored belongs to two bodies marked as truncated.
        assert!(wanted(world).all(|p| self.stored.contains(&p) || self.misses(p)));
        outcome.began = fit.iter().map(|p| ids(world, *p)).collect();
        outcome.ended.sort_by_key(|(ids, _)| *ids);
        outcome.stored = self.stored.iter().map(|p| ids(world, *p)).collect();
        outcome.truncated = self.truncated.iter().map(|b| world.bodies[*b].id).collect();
        outcome.missing = self.missing;
        outcome
    }

    /// Whether both bodies of a pair are marked as truncated.
    fn misses(&self, (a, b): Pair) -> bool {
        self.truncated.contains(&a) && self.truncated.contains(&b)
    }

    /// Whether missing pairs are not counted in this tick.
    fn waits(&mut self, world: &World, limit: usize, room: usize) -> bool {
        self.counted.1 += 1;
        let told = world.changes.moved.iter().chain(&world.changes.requery);
        let mut told = told.chain(world.changes.removed.iter().map(|r| &r.slot));
        let stirs = told.any(|slot| self.truncated.contains(&slot.index()));
        self.stirred |= stirs || world.forced_changed;
        let is_due = self.counted.1 * self.recount >= self.counted.0;
        let counts = self.counted.0 <= self.recount
            || room * 8 >= limit
            || is_due && (self.stirred || room > 0);
        !counts && self.truncated.iter().any(|b| world.bodies[*b].inside)
    }

    /// Marks the bodies of the pairs for which there was no room, and updates the counts.
    fn miss(&mut self, world: &World, rest: &[Pair], waits: bool) {
        let was = std::mem::take(&mut self.truncated);
        self.truncated
            .extend(rest.iter().flat_map(|(a, b)| [*a, *b]));
        let inside: Vec<usize> = was
            .into_iter()
            .filter(|b| world.bodies[*b].inside)
            .collect();
        let mut missing = rest.len() as u64;
        if waits {
            missing += self.missing;
            self.truncated.extend(&inside);
        }
        let counts = !waits && self.counted.1 > 1 && !inside.is_empty();
        self.waited.0 += u64::from(waits);
        self.waited.1 += u64::from(counts);
        if inside.iter().any(|b| world.bodies[*b].keeps) {
            missing = missing.max(self.missing);
            self.truncated.extend(inside);
        }
        self.missing = missing;
        if !waits {
            self.counted = (self.stored.len() as u64 + missing, 0);
            self.stirred = false;
        }
    }
}
