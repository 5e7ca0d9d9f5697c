//! Certificate fronts of the couples' meshes in addition to the engines, one for each pair of their parts, at the same
//! poses in each tick, deforming with an engine's bodies, and interrupted at random: their cover, leaf pair by leaf
//! pair, and their results are compared with the same truth.
//!
//! The engines' own fronts are not moved while a cheap test suffices; these are moved in each tick. Pairs of convex
//! shapes and pairs with a half-space have no leaf pairs and no fronts.

use std::collections::BTreeMap;

use sweepd::ids::BodyId;
use sweepd::math::relative;
use sweepd::narrow::mesh::{CarriedFront, FrontStore, Goal, Search, has_front};
use sweepd::shape::{Geometry, Shape};
use sweepd::time::{ManualClock, Meter};
use sweepd::world::World;

use crate::couples::Couple;
use crate::oracle::rng::Rng;
use crate::tally::{Fault, Tally};
use crate::truth::Bounds;

/// Counts of what was checked.
#[derive(Clone, Copy, Debug, Default)]
pub struct Checked {
    /// Pair-ticks with at least one front, each checked at every interruption.
    pub pair_ticks: u64,
    /// Number of checks of a front's cover.
    pub covers: u64,
    /// Number of leaf pairs that had to be covered exactly once.
    pub leaf_pairs: u64,
}

/// The fronts of a scene.
pub struct Fronts {
    rng: Rng,
    clock: ManualClock,
    store: FrontStore,
    /// By couple, and by pair of parts.
    fronts: BTreeMap<(usize, usize), CarriedFront>,
}

/// A pair of shapes at a pose, and its truth.
struct Pair<'a> {
    a: &'a Shape,
    b: &'a Shape,
    truth: Bounds,
    /// The size of the larger body, metres.
    size: f64,
    /// Greatest error of the truth, metres.
    missed: f64,
    what: String,
}

impl Fronts {
    pub fn new(seed: u64) -> Self {
        Self {
            rng: Rng::new(seed ^ 0xf407),
            clock: ManualClock::new(0),
            store: FrontStore::default(),
            fronts: BTreeMap::new(),
        }
    }

    /// One tick of the fronts of the couple at this index of the scene.
    ///
    /// * `world` - the couple's current state, from the same engine in each tick.
    pub fn tick(
        &mut self,
        place: usize,
        couple: &Couple,
        world: &World,
        (checked, tally): (&mut Checked, &mut Tally),
        what: &str,
    ) {
        let body = |id: u64| {
            let slot = world.slot_of(BodyId(id));
            slot.and_then(|slot| world.body(slot)).unwrap()
        };
        let first = 2 * place as u64 + 1;
        let (a, b) = (body(first), body(first + 1));
        let rel = relative(&a.pose, &b.pose);
        let before = checked.covers;
        let parts = (a.shapes.iter()).flat_map(|one| b.shapes.iter().map(move |two| (one, two)));
        for (at, ((one, two), truth)) in parts.zip(&couple.gaps).enumerate() {
            if !has_front(&one.shape, &two.shape) {
                continue;
            }
            let pair = Pair {
                a: &one.shape,
                b: &two.shape,
                truth: *truth,
                size: couple.large(),
                missed: couple.missed(),
                what: format!("{what}, fronts of {} {at}", couple.names()),
            };
            let pos12 = relative(&one.pose, &(rel * two.pose));
            let (store, front) = (&mut self.store, self.fronts.entry((place, at)).or_default());
            if front.is_started() {
                front.move_to(store, pair.a, pair.b, &pos12);
            } else {
                front.start(store, pair.a, pair.b, &pos12, Search::Carried);
            }
            look(front, store, &pair, checked, tally);
            let goal = [Goal::Verdict, Goal::Verdict, Goal::Gap, Goal::Contacts][self.rng.below(4)];
            for _ in 0..self.rng.below(4) {
                let units = [Some(0), Some(1), Some(self.rng.bits() % 60), None][self.rng.below(4)];
                let mut meter = Meter::new(&self.clock, None, units);
                let done = front.advance(store, pair.a, pair.b, goal, u64::MAX, &mut meter);
                look(front, store, &pair, checked, tally);
                if done {
                    look_at_end(front, &pair, goal, tally);
                }
            }
        }
        checked.pair_ticks += u64::from(checked.covers > before);
    }
}

/// Checks that an interrupted front contains the truth, and covers every leaf pair exactly once.
fn look(
    front: &CarriedFront,
    store: &FrontStore,
    pair: &Pair<'_>,
    checked: &mut Checked,
    tally: &mut Tally,
) {
    let (now, truth) = (front.interval(), pair.truth);
    let holds = now.min <= truth.high + pair.missed && now.max >= truth.low - pair.missed;
    tally.note(Fault::Interval, u64::from(!holds), || {
        format!("{}: {now:?}, truth {truth:?}", pair.what)
    });
    let Some(covered) = front.covered(store, pair.a, pair.b) else {
        return;
    };
    let (of_a, of_b) = (leaves(pair.a), leaves(pair.b));
    checked.covers += 1;
    checked.leaf_pairs += u64::from(of_a) * u64::from(of_b);
    tally.note(Fault::Cover, off(&covered, of_a, of_b), || {
        format!("{}: {} of {of_a} x {of_b}", pair.what, covered.len())
    });
}

/// Checks that a front that reached its goal has the right verdict, and the gap if that was the goal.
fn look_at_end(front: &CarriedFront, pair: &Pair<'_>, goal: Goal, tally: &mut Tally) {
    let (end, truth) = (front.interval(), pair.truth);
    let least = pair.missed.max(1e-9 * pair.size);
    let (apart, overlaps) = (truth.low > least, truth.high < -least);
    let decided = !(apart && end.min <= 0.0 || overlaps && end.max > 1e-12 * pair.size);
    tally.note(Fault::Verdict, u64::from(!decided), || {
        format!("{}: ended with {end:?}, truth {truth:?}", pair.what)
    });
    let wide = apart && goal != Goal::Verdict && end.width() > least;
    tally.note(Fault::Interval, u64::from(wide), || {
        format!("{}: ended with {end:?}, truth {truth:?}", pair.what)
    });
}

/// The number of leaves of a shape: its triangles; 1 for a convex shape.
fn leaves(shape: &Shape) -> u32 {
    match &shape.geometry {
        Geometry::Mesh(mesh) => u32::try_from(mesh.faces().len()).unwrap(),
        Geometry::Convex(_) | Geometry::HalfSpace { .. } => 1,
    }
}

/// The number of leaf pairs missing from a sorted list, repeated in it, or invalid.
fn off(covered: &[(u32, u32)], of_a: u32, of_b: u32) -> u64 {
    let all = (0..of_a).flat_map(|i| (0..of_b).map(move |j| (i, j)));
    if all.clone().eq(covered.iter().copied()) {
        return 0;
    }
    let there = |pair: &(u32, u32)| covered.binary_search(pair).is_ok();
    let (found, missing): (Vec<_>, Vec<_>) = all.partition(there);
    (missing.len() + covered.len().abs_diff(found.len())) as u64
}
