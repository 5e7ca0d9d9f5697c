//! Broad phase: which pairs of boxes overlap, kept across ticks.
//!
//! In: a [`ChangeSet`] (bodies that left, came, moved or must be queried again), the boxes ([`Proxies`]), the filters
//! ([`PairPolicy`]). Out: the [`PairSet`], of which this room is the only writer, and a [`PairDelta`].
//!
//! Six methods behind one interface. [`Method::BruteForce`] tests every pair and stays as the reference for the others.
//! [`Method::Order`] keeps blocks of fat boxes and their candidates (see `order`). [`Method::SweepAndPrune`] keeps
//! sorted lists of box ends (see `sap`). [`Method::UniformGrid`], [`Method::SpatialHash`] and
//! [`Method::HierarchicalGrid`] keep bodies in cells (see `grid`). A method only reports which boxes overlap, or may;
//! what is stored is decided in one place (`commit`), so all give the same pairs in the same slots, and the same delta.
//!
//! The pairs are those of the f64 boxes, at any offset: a method that rounds boxes to f32 tests the f64 boxes wherever
//! rounding could change the answer.

use crate::ids::{BodyId, BodySlot, PairKey};
use crate::math::Aabb;
use crate::pairs::{PairDelta, PairPolicy, PairSet, Spare};
use crate::simd::boxes::Level;
use crate::wire::{BroadCause, BroadMode, EndCause};
use crate::world::ChangeSet;

mod brute;
mod commit;
mod engine;
mod forced;
mod grid;
mod keys;
mod members;
mod of_world;
mod order;
mod sap;
mod short;
mod touched;

pub use crate::config::BroadMethod as Method;

use commit::{Found, Judge};
use engine::Engine;
use forced::Forced;
use members::{ASKED, IN, Members, REFILTERED};
use order::{Tick, give_back, is_thrifty};
use short::Short;

/// The boxes, as the world has them.
pub trait Proxies {
    /// Box of a body, world frame, metres; each end finite or infinite, never NaN. Not called for unbounded bodies.
    fn aabb(&self, slot: BodySlot) -> &Aabb;
    /// Returns whether the body has no box (a half-space). Fixed while it is in the broad phase.
    fn unbounded(&self, slot: BodySlot) -> bool;
    /// Id of a body; results are ordered by it.
    fn id(&self, slot: BodySlot) -> BodyId;
}

/// What the last update did. All values are counts; nothing is timed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Box ends that passed one another.
    pub swaps: u64,
    /// Boxes compared with one another.
    pub tests: u64,
    /// Pairs reported as beginning, or that may begin; includes pairs already stored, and some duplicates.
    pub told: u64,
    /// Times the lists were sorted from scratch instead of repaired.
    pub rebuilds: u64,
    /// Pairs of boxes that overlap on the sorted axes; the axis left out was not tested.
    pub partial: u64,
    /// Axes kept sorted: x, y, z.
    pub axes: [bool; 3],
    /// Bodies that got a new fat box.
    pub renewed: u64,
    /// Cells that bodies were put into.
    pub cells: u64,
    /// Mode that was chosen, and why; `None`: the method has only one.
    pub way: Option<(BroadMode, BroadCause)>,
}

/// Memory is given back when the number of bodies has fallen by this factor: showing the rest to a fresh structure then
/// costs less than one tick with all of them did.
const FALLEN: usize = 16;

/// The broad phase.
#[derive(Clone, Debug)]
pub struct BroadPhase {
    engine: Engine,
    /// The method has not yet seen the bodies that are in.
    is_new: bool,
    members: Members,
    forced: Forced,
    found: Found,
    short: Short,
    /// Highest number of bodies since memory was last given back.
    most: usize,
    /// Pairs that the last update found; `spare` counts how long that has been few.
    used: usize,
    spare: Spare,
    /// By body: cause of its removal in this update.
    causes: Vec<EndCause>,
    /// Bodies with a box that left in this update.
    left: Vec<BodySlot>,
    /// Pairs whose boxes parted in this update.
    parted: Vec<PairKey>,
    work: Work,
}

impl BroadPhase {
    /// A broad phase without bodies.
    #[must_use]
    pub fn new(method: Method) -> Self {
        let engine = Engine::new(method);
        Self {
            members: Members::new(engine.copies_boxes()),
            engine,
            is_new: false,
            forced: Forced::default(),
            found: Found::default(),
            short: Short::default(),
            most: 0,
            used: 0,
            spare: Spare::default(),
            causes: Vec::new(),
            left: Vec::new(),
            parted: Vec::new(),
            work: Work::default(),
        }
    }

    /// Switches to another method, with the settings of a new one: the next update shows it all bodies as if they had
    /// just come. Stored pairs continue, and pairs that begin or end by then are reported as usual.
    pub fn change_to(&mut self, method: Method) {
        self.engine = Engine::new(method);
        self.is_new = true;
    }

    /// Sets which vector instructions `Order` uses; all give the same bits. Default: the best available.
    pub fn use_level(&mut self, level: Level) {
        if let Engine::Order(order) = &mut self.engine {
            order.use_level(level);
        }
    }

    /// Forces `Order` to work every tick without candidates (`true`) or with them (`false`); by default counted work
    /// decides. Both give the same pairs and events.
    pub fn use_afresh(&mut self, afresh: bool) {
        if let Engine::Order(order) = &mut self.engine {
            order.use_afresh(Some(afresh));
        }
    }

    /// Sets how many threads `Order` may use, including the caller's, in ticks with enough comparisons; default: one.
    /// Any number gives the same pairs, in the same order.
    ///
    /// * `least` - comparisons in a tick from which other threads are used; 36,000 take about half a millisecond.
    pub fn use_threads(&mut self, most: usize, least: u64) {
        if let Engine::Order(order) = &mut self.engine {
            order.use_threads(most, least);
        }
    }

    /// Sets how many pairs, stored and missing, are recounted in each tick while the set is too small for all; default
    /// 65,536. If there are k times as many, they are recounted every k ticks if anything about them changed, or once
    /// an eighth of the set is free. Until then a body that missed a pair stays truncated, and new pairs of two such
    /// bodies are missed.
    pub fn use_recount(&mut self, most: u64) {
        self.short.use_most(most);
    }

    /// Bodies in the broad phase.
    #[must_use]
    pub fn len(&self) -> usize {
        self.members.bounded().len() + self.members.unbounded().len()
    }

    /// Returns whether there is no body.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What the last update did.
    #[must_use]
    pub fn work(&self) -> Work {
        self.work
    }

    /// Replaces the pairs that are candidates whatever the boxes say, while both bodies are in; the next update applies
    /// it. A pair that is no longer forced and does not overlap ends as `Separated`.
    ///
    /// * `keys` - the whole list, in any order. Pass it again when a rule changes or a slot gets another body.
    pub fn force(&mut self, keys: &[PairKey]) {
        self.forced.replace(keys);
        self.short.stir();
    }

    /// Brings the pair set up to date with one tick's changes.
    ///
    /// Order: bodies that left (their pairs end with the given cause), bodies that came, boxes that moved, bodies to
    /// query again (`requery`: their pairs end as `Filtered` or `Separated`, or begin). A stored pair ends as
    /// `Separated` when the boxes part, unless it is forced, a body is unbounded, or the policy keeps one of the two.
    /// Slots in the lists that do not fit (a move of a body that is not in) are skipped.
    pub fn update(
        &mut self,
        changes: &ChangeSet,
        proxies: &impl Proxies,
        policy: &impl PairPolicy,
        pairs: &mut PairSet,
        delta: &mut PairDelta,
    ) {
        pairs.open_tick();
        give_back(&mut delta.began, self.len());
        give_back(&mut delta.ended, self.len());
        self.members.open_tick();
        self.give_back(pairs, delta);
        self.work = Work::default();
        self.leave(changes, pairs);
        self.enter(changes, proxies);
        if self.is_new {
            self.members.come_anew(self.engine.copies_boxes(), proxies);
        }
        self.mark(changes, proxies, pairs);
        let is_brute = matches!(self.engine, Engine::Brute);
        if !is_brute {
            let judge = Judge::of(&self.members, &self.forced, proxies, policy);
            touched::end(&judge, pairs, &mut self.found);
            // Bodies that came have their new box already.
            let moved = if self.is_new { &[][..] } else { &changes.moved };
            self.search(moved, proxies);
        }
        let judge = Judge::of(&self.members, &self.forced, proxies, policy);
        if is_brute {
            brute::update(&judge, pairs, &mut self.found);
        } else {
            self.found.part(&mut self.parted, &judge, pairs);
            touched::begin(&judge, &mut self.found);
        }
        self.work.told = self.found.told();
        self.found.commit(&judge, self.short.waits(), pairs, delta);
        self.short.close_tick(pairs);
        self.is_new = false;
        self.forced.settle();
        let bodies = self.len();
        self.used = self.found.used();
        self.found.close_tick(bodies);
        give_back(&mut self.parted, bodies);
    }

    /// Gives memory back when few bodies, or few pairs that come and go, are left of very many.
    fn give_back(&mut self, pairs: &mut PairSet, delta: &mut PairDelta) {
        let bodies = self.len();
        self.most = self.most.max(bodies);
        if self.spare.is_over(self.found.room(), self.used.max(bodies)) {
            self.found = Found::default();
            self.parted = Vec::new();
            *delta = PairDelta::default();
            if let Engine::Order(order) = &mut self.engine {
                order.give_back_crowd();
            }
        }
        if !is_thrifty(self.most) || self.most / FALLEN < bodies {
            return;
        }
        self.most = bodies;
        self.engine = self.engine.anew();
        self.is_new = true;
        self.members.give_back();
        self.found = Found::default();
        (self.causes, self.left, self.parted) = (Vec::new(), Vec::new(), Vec::new());
        pairs.give_back();
        *delta = PairDelta::default();
    }

    /// Lets the method find pairs that began, or may have, and pairs that parted.
    fn search(&mut self, moved: &[BodySlot], proxies: &impl Proxies) {
        match &mut self.engine {
            Engine::Brute => {}
            Engine::Sap(sap) => sap.update(&self.members, &mut self.found.maybe, &mut self.work),
            Engine::Grid(grid) => {
                grid.update(&self.members, &mut self.found.maybe, &mut self.work);
            }
            Engine::Order(order) => {
                let tick = Tick {
                    members: &self.members,
                    proxies,
                    moved,
                    began: &mut self.found.began,
                    parted: &mut self.parted,
                };
                order.update(tick, &mut self.work);
            }
        }
    }

    /// Removes the bodies that left; their pairs end. If both bodies of a pair left, the lower cause code wins, so that
    /// the result does not depend on the order of slots.
    fn leave(&mut self, changes: &ChangeSet, pairs: &mut PairSet) {
        self.left.clear();
        for removed in &changes.removed {
            let bounded = self.members.is_bounded(removed.slot);
            if self.members.leave(removed.slot) {
                self.left.extend(bounded.then_some(removed.slot));
                let at = removed.slot.index();
                if self.causes.len() <= at {
                    self.causes.resize(at + 1, EndCause::None);
                }
                self.causes[at] = removed.cause;
            }
        }
        pairs.list(changes.removed.len());
        let mut doomed = std::mem::take(&mut self.found.doomed);
        for removed in &changes.removed {
            // All pairs of a body at once: without lists each lookup scans every pair.
            doomed.extend(pairs.partners(removed.slot).map(|(slot, other)| {
                let theirs = self.causes.get(other.index()).copied();
                let theirs = theirs.filter(|cause| *cause != EndCause::None);
                (slot, theirs.map_or(removed.cause, |c| c.min(removed.cause)))
            }));
            for (slot, cause) in doomed.drain(..) {
                self.found.end(slot, cause, &self.members, pairs);
            }
        }
        self.found.doomed = doomed;
        for removed in &changes.removed {
            if let Some(cause) = self.causes.get_mut(removed.slot.index()) {
                *cause = EndCause::None;
            }
        }
        match &mut self.engine {
            _ if self.is_new => {}
            Engine::Brute => {}
            Engine::Sap(sap) => sap.leave(&self.left, &self.members),
            Engine::Order(order) => order.leave(&self.left),
            Engine::Grid(grid) => grid.leave(&self.left),
        }
    }

    /// Adds the bodies that came.
    fn enter(&mut self, changes: &ChangeSet, proxies: &impl Proxies) {
        for slot in &changes.inserted {
            self.members.enter(*slot, proxies);
        }
    }

    /// Takes the new boxes and marks the bodies to query again.
    fn mark(&mut self, changes: &ChangeSet, proxies: &impl Proxies, pairs: &PairSet) {
        // `Order` finds differences itself: it reads the list of moved bodies and needs no marks.
        if self.is_new || !matches!(self.engine, Engine::Order(_)) {
            for slot in &changes.moved {
                self.members.moved(*slot, proxies);
            }
        }
        for slot in &changes.requery {
            if self.members.has(*slot, IN) {
                self.members.touch(*slot, ASKED | REFILTERED);
            }
        }
        self.ask_missing(changes, pairs);
    }

    /// Checks the whole structure, the boxes against the caller's, and each stored pair against filters and boxes.
    ///
    /// # Errors
    /// One sentence on the first check that fails.
    pub fn validate(
        &self,
        proxies: &impl Proxies,
        policy: &impl PairPolicy,
        pairs: &PairSet,
    ) -> Result<(), String> {
        pairs.validate()?;
        self.members.validate(proxies)?;
        match &self.engine {
            Engine::Brute => {}
            Engine::Sap(sap) => sap.validate(&self.members)?,
            Engine::Order(order) => order.check(&self.members, proxies)?,
            Engine::Grid(grid) => grid.validate(&self.members)?,
        }
        let judge = Judge {
            members: &self.members,
            proxies,
            forced: &self.forced,
            policy,
        };
        for (slot, key) in pairs.iter() {
            let (low, high) = key.slots();
            if !self.members.has(low, IN) || !self.members.has(high, IN) {
                return Err(format!("{slot:?} holds a body that is not in: {key:?}"));
            }
            if let Some(cause) = judge.ends(key, true) {
                return Err(format!("{slot:?} should have ended, {cause}: {key:?}"));
            }
        }
        Ok(())
    }
}
