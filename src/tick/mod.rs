//! The engine: one tick, in order. A library type with no transport in it; the daemon, tests and benches use the same
//! one.
//!
//! In: [`TickInput`] (frames, edits, demand, budget, and why this tick). Out: a filled [`Outbox`].

mod admit;
mod audience;
pub mod build;
mod end;
mod floor;
mod input;
mod interrupts;
mod look;
pub mod pace;
mod repair;
mod rest;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use crate::broad::{BroadPhase, Method};
use crate::config::Config;
use crate::error::Result;
use crate::ids::{PairKey, SourceSlot};
use crate::limits;
use crate::narrow::{Narrow, Wanted};
use crate::pairs::{PairDelta, PairSet};
use crate::plan::{Kinds, Plan, Seen};
use crate::publish::{Publisher, View};
use crate::scene::Scene;
use crate::time::{Clock, Meter};
use crate::wire::{
    BroadCause, BroadMode, Demand, MessageHeader, Outbox, Reason, RejectReason, Stage, State,
    TickRow, WIRE_VERSION,
};
use crate::world::{ChangeSet, Parts, World};

use audience::Audience;
use end::End;
use floor::{Began, Floor, Laps};
use rest::Rest;

pub use input::{EditBatch, EditOutcome, TickInput};

/// The engine.
pub struct Engine {
    world: World,
    broad: BroadPhase,
    /// The method of `broad`.
    method: Method,
    /// Rebuild the broad phase in this tick.
    renew: bool,
    /// Pairs carried over a rebuild: those of bodies whose place is unknown (their boxes prove nothing), and the pairs
    /// that were forced in that tick.
    carried: Vec<PairKey>,
    /// Last tick whose structures passed a full check; 0: never.
    checked: u64,
    /// A change set that inserts every body; the input of a rebuild.
    whole: ChangeSet,
    pairs: PairSet,
    delta: PairDelta,
    narrow: Narrow,
    publisher: Publisher,
    plan: Plan,
    /// The counts that the plan is based on, kept from edit to edit.
    kinds: Kinds,
    audience: Audience,
    /// What the plan in force was made for, in addition to the scene.
    seen: Seen,
    out: Outbox,
    outcomes: Vec<EditOutcome>,
    clock: Arc<dyn Clock>,
    config: Config,
    floor: Floor,
    rest: Rest,
    boot_id: u64,
    tick: u64,
    /// Time of this tick, nanoseconds of `CLOCK_BOOTTIME`.
    now_ns: u64,
    end: End,
    missed: u64,
    rebuilds: u64,
}

impl std::fmt::Debug for Engine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Engine")
            .field("tick", &self.tick)
            .field("pairs", &self.pairs.len())
            .finish_non_exhaustive()
    }
}

impl Engine {
    /// An engine for a checked scene and its built shapes.
    ///
    /// * `shapes` - one list per body, in the scene's order.
    /// * `boot_id` - random number of this start.
    ///
    /// # Errors
    /// `Error::Scene` when the scene holds more than its limits allow.
    pub fn new(
        scene: &Scene,
        shapes: Vec<Parts>,
        boot_id: u64,
        clock: Arc<dyn Clock>,
    ) -> Result<Self> {
        let limits = scene.config.limits;
        let now_ns = clock.boottime_ns();
        let mut world = World::new(scene, shapes, now_ns)?;
        world.set_boot(boot_id);
        let config = Config {
            threads: Some(scene.config.threads_here()),
            ..scene.config.clone()
        };
        let kinds = Kinds::of(&world);
        let plan = Plan::of(&world, &kinds, &config);
        let mut broad = BroadPhase::new(plan.method());
        share(&mut broad, &config);
        let mut narrow = Narrow::new(limits.contacts_per_pair);
        narrow.set_search(scene.config.mesh_search.unwrap_or_default());
        Ok(Self {
            broad,
            method: plan.method(),
            renew: false,
            carried: Vec::new(),
            checked: 0,
            whole: ChangeSet::default(),
            pairs: PairSet::new(limits.pairs),
            delta: PairDelta::default(),
            narrow,
            publisher: Publisher::new(limits),
            out: Outbox {
                plan: plan.to_json(),
                plan_changed: true,
                ..Outbox::default()
            },
            outcomes: Vec::new(),
            config,
            floor: Floor::default(),
            rest: Rest::default(),
            tick: 0,
            now_ns,
            end: End::default(),
            missed: 0,
            rebuilds: 0,
            world,
            plan,
            kinds,
            audience: Audience::default(),
            seen: Seen::default(),
            clock,
            boot_id,
        })
    }

    /// Runs one tick.
    pub fn tick(&mut self, input: TickInput<'_>) -> &Outbox {
        let now_ns = self.clock.boottime_ns();
        self.tick_at(now_ns, input)
    }

    /// As [`Engine::tick`], for a caller that has already read the clock and decided by it.
    ///
    /// * `now_ns` - nanoseconds of `CLOCK_BOOTTIME`.
    pub fn tick_at(&mut self, now_ns: u64, mut input: TickInput<'_>) -> &Outbox {
        self.now_ns = now_ns;
        let mut laps = self.begin(&input);
        self.admit(&mut input, &laps);
        laps.lap(Stage::World);
        self.find_candidates();
        laps.lap(Stage::Broad);
        self.widen();
        laps.lap(Stage::Widen);
        let units = self.narrow_within(&mut input, &laps);
        laps.lap(Stage::Narrow);
        self.publish(input.demand);
        laps.lap(Stage::Publish);
        self.finish(&input, &laps, units);
        &self.out
    }

    /// Sets the time-out of a source, by its index; from the next tick on every age is judged by it.
    pub fn set_timeout(&mut self, source: usize, timeout_ns: u64) {
        self.world.set_timeout(source, timeout_ns);
    }

    /// Counts frames of a source that were skipped for newer ones; `None`: of an unknown source.
    pub fn note_skipped(&mut self, source: Option<SourceSlot>, frames: u64) {
        match source {
            Some(source) => self.world.note_skipped(source, frames),
            None => {
                (0..frames).for_each(|_| self.world.note_reject(RejectReason::UnknownSource, None))
            }
        }
    }

    fn begin(&mut self, input: &TickInput<'_>) -> Laps {
        self.tick += 1;
        self.outcomes.clear();
        self.delta.clear();
        self.end = End::of(input.woke_ns, input.budget);
        Laps::start(Arc::clone(&self.clock), input.woke_ns)
    }

    /// * `is_edited` - whether the set of bodies changed; otherwise bodies are not examined.
    fn replan(&mut self, is_edited: bool) {
        let plan = if is_edited {
            self.kinds.follow(&self.world);
            (self.plan).after_edits(&self.world, &self.kinds, &self.config, self.seen)
        } else {
            self.plan.anew(&self.config, self.seen)
        };
        if plan != self.plan {
            self.out.plan = plan.to_json();
            self.out.plan_changed = true;
            self.plan = plan;
        }
    }

    fn find_candidates(&mut self) {
        let (world, filters) = (&self.world, self.world.filters());
        let method = self.plan.method();
        // Taken even if the method changes: otherwise a tick with both would be followed by a second rebuild.
        let renew = std::mem::take(&mut self.renew);
        if renew {
            self.carried.retain(|key| {
                let (low, high) = key.slots();
                filters.keeps(low) || filters.keeps(high)
            });
            self.broad = BroadPhase::new(method);
            self.whole.clear();
            let inside = world.bodies().filter(|(_, body)| body.in_broad);
            self.whole.inserted.extend(inside.map(|(slot, _)| slot));
        } else if self.method != method {
            self.broad.change_to(method);
        }
        if renew || self.method != method {
            self.method = method;
            share(&mut self.broad, &self.config);
        }
        if renew {
            self.carried.extend_from_slice(filters.forced_pairs());
            self.broad.force(&self.carried);
        } else if !self.carried.is_empty() || world.scene_changed() {
            self.carried = Vec::new();
            self.broad.force(filters.forced_pairs());
        }
        let changes = if renew { &self.whole } else { world.changes() };
        self.broad
            .update(changes, world, filters, &mut self.pairs, &mut self.delta);
    }

    fn widen(&mut self) {
        self.narrow
            .begin(self.tick, &self.world, &self.pairs, &self.delta);
        self.narrow.widen(&self.world, &mut self.pairs);
    }

    /// Spends the part of the budget above the floor; returns the units spent.
    fn narrow_within(&mut self, input: &mut TickInput<'_>, laps: &Laps) -> u64 {
        let budget = input.budget;
        let demand = input.demand;
        let wanted = Wanted {
            contacts: demand.tells_contacts() || demand.regions,
            bounds: demand.pairs || demand.changes || demand.tells_contacts() || demand.regions,
            regions: demand.regions,
            order: self.end.order(budget),
        };
        let end_ns = self.end.at_ns();
        let timed = end_ns.map(|end_ns| {
            let began = Began::now(self.clock.as_ref());
            let above_ns = began.left_ns(end_ns);
            let deadline_ns = end_ns - self.floor.reserve_ns(above_ns).min(end_ns);
            (began, above_ns, deadline_ns)
        });
        let deadline_ns = timed.map(|(_, _, deadline_ns)| deadline_ns);
        let row = self.bare_tick(input);
        let clock = Arc::clone(&self.clock);
        let mut beat = beat(&mut input.pulse, row, clock.as_ref());
        let mut meter = Meter::new(clock.as_ref(), deadline_ns, budget.units).with_beat(
            laps.woke_ns(),
            self.config.heartbeat_ns,
            &mut beat,
        );
        let done = self.narrow.spend(&mut self.world, wanted, &mut meter);
        let units = meter.spent();
        self.rest.interrupts.note(meter.longest_pause());
        if let Some((began, above_ns, deadline_ns)) = timed {
            let late_ns = began.passed_ns(deadline_ns, self.clock.as_ref());
            self.floor.note_late(late_ns);
            self.rest
                .leave(above_ns.saturating_sub(self.floor.usual_ns()));
        }
        let open = end_ns.filter(|_| !done && budget.units.is_none());
        self.rest.open = open.map(|end_ns| (wanted, end_ns));
        units
    }

    /// The tick that goes out alone while this one takes longer than a heartbeat. It has this tick's number, an earlier
    /// `sent_ns`, and no sources: it is the result of no frame. What counts up in a boot is as it was.
    fn bare_tick(&self, input: &TickInput<'_>) -> TickRow {
        TickRow {
            header: MessageHeader {
                boot_id: self.boot_id,
                tick: self.tick,
                scene_rev: self.world.scene_rev(),
                state: State::Unknown.code(),
                schema: WIRE_VERSION,
                ..MessageHeader::default()
            },
            budget_ns: self.end.budget_ns(),
            budget_units: input.budget.units.unwrap_or(u64::MAX),
            rejects: *self.world.rejects(),
            bodies: self.world.counts().bodies,
            unknown: self.world.counts().unknown,
            candidates: self.pairs.len() as u64,
            reasons: Reason::Undecided.bit(),
            cause: input.cause.code(),
            cause_source: place(input.cause_source),
            missed: self.missed,
            cancelled_events: self.out.tick.cancelled_events,
            rebuilds: self.rebuilds,
            ..TickRow::default()
        }
    }

    fn publish(&mut self, demand: Demand) {
        let mut view = View {
            world: &self.world,
            pairs: &self.pairs,
            delta: &self.delta,
            narrow: &mut self.narrow,
            demand,
            boot_id: self.boot_id,
            tick: self.tick,
            now_ns: self.now_ns,
        };
        self.publisher.fill(&mut view, &mut self.out);
    }

    /// Fills the tick's times and units, and updates the floor.
    fn finish(&mut self, input: &TickInput<'_>, laps: &Laps, units: u64) {
        let floor_ns = self.floor.learn(laps);
        let elapsed_ns = laps.elapsed_ns() + self.floor.last_send_ns();
        // A budget below the floor does not shorten the tick, which then counts as late like any other, as readers
        // expect.
        let overrun = self.end.is_over(elapsed_ns);
        self.missed += u64::from(overrun);
        let row = &mut self.out.tick;
        laps.fill(&mut row.stage_ns);
        row.stage_ns[usize::from(Stage::Send.code())] = self.floor.last_send_ns();
        row.stage_ns[usize::from(Stage::Rest.code())] = std::mem::take(&mut self.rest.spent_ns);
        row.sent_ns = self.clock.boottime_ns();
        row.elapsed_ns = elapsed_ns;
        row.budget_ns = self.end.budget_ns();
        row.budget_units = input.budget.units.unwrap_or(u64::MAX);
        row.floor_ns = floor_ns;
        row.units = units + std::mem::take(&mut self.rest.units);
        row.cause = input.cause.code();
        row.cause_source = place(input.cause_source);
        row.overrun = u8::from(overrun);
        row.missed = self.missed;
        row.rebuilds = self.rebuilds;
        let broad = self.broad.work();
        row.broad_renewed = u32::try_from(broad.renewed).unwrap_or(u32::MAX);
        let (mode, cause) = broad.way.unwrap_or((BroadMode::Whole, BroadCause::None));
        (row.broad_mode, row.broad_cause) = (mode.code(), cause.code());
    }
}

/// Sends a bare tick, now.
fn beat<'a>(
    pulse: &'a mut Option<&mut dyn FnMut(&TickRow)>,
    mut row: TickRow,
    clock: &'a dyn Clock,
) -> impl FnMut() + 'a {
    move || {
        if let Some(pulse) = pulse {
            row.sent_ns = clock.boottime_ns();
            pulse(&row);
        }
    }
}

fn place(source: Option<usize>) -> u8 {
    source
        .and_then(|source| u8::try_from(source).ok())
        .unwrap_or(u8::MAX)
}

/// Gives a broad phase of another method its threads.
fn share(broad: &mut BroadPhase, config: &Config) {
    broad.use_threads(config.threads.unwrap_or(1), limits::SHARED_TESTS_MIN);
}
