//! The daemon: one thread owns the ports and runs the engine; shapes of scene edits are built on another.
//!
//! In: a scene, a [`Door`], a stop flag. Out: ticks, until it is stopped.

mod builder;
mod notes;
mod record;
mod refusals;
mod requests;
mod settings;
mod skipped;
#[cfg(test)]
mod tests;
mod watchdog;

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::config::{Config, Mode};
use crate::error::Result;
use crate::record::{Ask, Between, Recorder};
use crate::scene::Scene;
use crate::tick::pace::{Due, Pacer};
use crate::tick::{EditBatch, Engine, TickInput};
use crate::time::{Budget, Clock, Seldom};
use crate::transport::{Door, RequestToken, Wake};
use crate::wire::{Inbox, TickRow};
use crate::world::{SourceState, TreeOf};

use builder::{Asking, Builder, Done, TREE};
use refusals::Refusals;

pub use crate::tick::build::{Shapes, build_shapes};
pub use notes::body_note;
pub use watchdog::Watchdog;

/// While a worker builds shapes the loop checks this often whether they are ready, nanoseconds.
const BUILD_LOOK_NS: u64 = 2_000_000;
/// Longest wait, nanoseconds: a signal between the check of the stop flag and the wait is noticed after it.
const WAIT_MAX_NS: u64 = 100_000_000;

/// Time between two checks for new messages while a tick's budget is used up, nanoseconds.
const REST_SLICE_NS: u64 = 250_000;

/// A running daemon.
pub struct Daemon<'a> {
    engine: Engine,
    pacer: Pacer,
    builder: Builder,
    config: Config,
    clock: Arc<dyn Clock>,
    door: &'a mut dyn Door,
    arrived: Inbox,
    due: Inbox,
    ready: Vec<EditBatch>,
    /// Queries whose bodies are to be looked up when no tick is due.
    asking: VecDeque<(RequestToken, Box<Asking>)>,
    /// A tick was requested at once.
    tick_asked: bool,
    /// The tree that the worker is building.
    tree_asked: Option<TreeOf>,
    /// Raised each round, and each heartbeat of a long tick.
    progress: Arc<AtomicU64>,
    /// Records the engine's input and output.
    recorder: Option<Recorder>,
    unsent: Seldom,
    refusals: Refusals,
}

impl std::fmt::Debug for Daemon<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Daemon")
            .field("engine", &self.engine)
            .finish_non_exhaustive()
    }
}

impl<'a> Daemon<'a> {
    /// A daemon for a scene with its shapes, on an open door.
    ///
    /// # Errors
    /// As [`Engine::new`] and [`Pacer::new`]; `Error::Io` when the worker thread cannot be started.
    pub fn new(
        scene: &Scene,
        shapes: Shapes,
        boot_id: u64,
        clock: Arc<dyn Clock>,
        door: &'a mut dyn Door,
    ) -> Result<Self> {
        let mut daemon = Self {
            builder: Builder::start(shapes.library, scene, Arc::clone(&clock))?,
            engine: Engine::new(scene, shapes.bodies, boot_id, Arc::clone(&clock))?,
            pacer: Pacer::new(&scene.config, &scene.sources)?,
            config: scene.config.clone(),
            clock,
            door,
            arrived: Inbox::default(),
            due: Inbox::default(),
            ready: Vec::new(),
            asking: VecDeque::new(),
            tick_asked: false,
            tree_asked: None,
            progress: Arc::default(),
            recorder: None,
            unsent: Seldom::default(),
            refusals: Refusals::default(),
        };
        daemon.pacer.learn(daemon.engine.world());
        Ok(daemon)
    }

    /// From now on raises this watchdog's counter each round and each heartbeat of a long tick.
    pub fn watched_by(&mut self, watchdog: &Watchdog) {
        self.progress = watchdog.progress();
    }

    /// Runs until `stop` is raised, or for `ticks` ticks.
    ///
    /// # Errors
    /// `Error::Io` when a port breaks; the daemon must then be started again.
    pub fn run(&mut self, stop: &AtomicBool, ticks: Option<u64>) -> Result<()> {
        while !stop.load(Ordering::Relaxed) {
            if !self.work_on(stop)? {
                let wait_ns = self.wait_ns();
                self.door.wait(wait_ns, self.clock.as_ref())?;
            }
            if self.round(ticks)? {
                return Ok(());
            }
        }
        Ok(())
    }

    /// Uses the rest of the last tick's budget until there is something else to do or `stop` is raised; returns whether
    /// there is.
    fn work_on(&mut self, stop: &AtomicBool) -> Result<bool> {
        let mut news = false;
        while !news && self.wait_ns() > 0 && self.engine.work_on(REST_SLICE_NS) {
            news |= stop.load(Ordering::Relaxed);
            news |= self.door.wait(0, self.clock.as_ref())? != Wake::default();
        }
        Ok(news)
    }

    /// Takes new messages and runs the tick that is due, if any; returns whether `ticks` have been run.
    ///
    /// One tick per round: if ticks are always due (a rate that the machine cannot keep) frames, requests and the stop
    /// flag are still checked between any two.
    ///
    /// # Errors
    /// As [`Daemon::run`].
    pub fn round(&mut self, ticks: Option<u64>) -> Result<bool> {
        let woke_ns = self.clock.monotonic_ns();
        self.progress.fetch_add(1, Ordering::Relaxed);
        self.receive()?;
        self.apply_settings();
        let (now_ns, timeout_ns) = (self.clock.boottime_ns(), self.engine.world().next_timeout());
        let edits = std::mem::take(&mut self.tick_asked) || !self.ready.is_empty();
        match self.pacer.due(now_ns, edits, timeout_ns, &mut self.due) {
            Some(due) => self.tick(due, woke_ns)?,
            None => self.door.housekeeping(),
        }
        self.take_question();
        Ok(ticks.is_some_and(|most| self.engine.ticks() >= most))
    }

    /// The engine, for read access to its state.
    #[must_use]
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    fn wait_ns(&self) -> u64 {
        let now_ns = self.clock.boottime_ns();
        let next_ns = self
            .pacer
            .wake_ns(now_ns, self.engine.world().next_timeout());
        let wait_ns = next_ns.saturating_sub(now_ns).min(WAIT_MAX_NS);
        if !self.asking.is_empty() {
            0
        } else if self.builder.busy() {
            wait_ns.min(BUILD_LOOK_NS)
        } else {
            wait_ns
        }
    }

    /// Takes frames and requests; passes requests to the worker and takes built edits from it.
    fn receive(&mut self) -> Result<()> {
        self.door.receive(&mut self.arrived, self.clock.as_ref());
        let now_ns = self.clock.boottime_ns();
        let ahead_ns = now_ns.saturating_sub(self.clock.monotonic_ns());
        self.pacer
            .know(self.engine.outbox().tick.floor_ns, ahead_ns);
        self.pacer
            .take(&mut self.arrived, self.engine.world(), now_ns);
        let builder = &mut self.builder;
        self.door.requests(&mut |token, header, payload| {
            let json_len = usize::try_from(header.json_len).unwrap_or(usize::MAX);
            builder.ask(token, json_len, payload);
        });
        if self.tree_asked.is_none()
            && let Some(worn) = self.engine.worn_tree()
        {
            let of = worn.of();
            self.tree_asked = Some(of);
            self.note(Between::TreeAsked(of.into()));
            self.builder.build_tree(worn);
        }
        while let Some((token, built)) = self.builder.finished() {
            if token == TREE {
                self.settle_tree(built);
            } else if let Some(answer) = self.take_built(token, built) {
                self.answer(token, &answer);
            }
        }
        Ok(())
    }

    /// Takes the tree that the worker has built, or logs once that it could not.
    fn settle_tree(&mut self, built: std::result::Result<Done, String>) {
        let asked = self.tree_asked.take();
        if let Ok(Done::Tree(tree)) = built {
            let of = tree.of();
            let taken = self.engine.take_tree(*tree);
            self.note(Between::TreeBuilt(of.into(), taken));
            return;
        }
        let Some(of) = asked else { return };
        self.note(Between::TreeRefused(of.into()));
        if let Some(name) = self.engine.refuse_tree(of) {
            tracing::error!(
                "the tree of body \"{name}\" could not be built anew: its boxes are refitted as before, and its next \
                 vertices are tried; see the panic above"
            );
        }
    }

    /// Returns whether these edits, or the end of another wait, release a waiting frame of the leading source, so that
    /// this tick is that frame's tick too; or a frame that moves a continuous body, whose motion no later tick sweeps.
    ///
    /// * `now_ns` - time of the tick, nanoseconds of `CLOCK_BOOTTIME`.
    fn takes_a_frame_that_waited(&self, now_ns: u64) -> bool {
        let Mode::OnFrame(lead) = &self.config.mode else {
            return false;
        };
        let world = self.engine.world();
        let takes = |s: &SourceState| !self.ready.is_empty() && s.waits() || s.lets_go(now_ns);
        let mut sources = world.sources().iter().enumerate();
        sources.any(|(at, s)| (s.name == *lead || world.is_followed(at)) && takes(s))
    }

    /// Runs one tick and sends its results.
    fn tick(&mut self, due: Due, woke_ns: u64) -> Result<()> {
        self.tell_passed();
        let taken = self.taken_of_lead();
        let mut demand = self.door.demand();
        if let Some(recorder) = &mut self.recorder {
            demand = recorder.listen(demand, self.clock.boottime_ns());
        }
        let now_ns = self.clock.boottime_ns();
        let budget = if due.ages_only && !self.takes_a_frame_that_waited(now_ns) {
            Budget {
                units: Some(0),
                ..self.config.budget
            }
        } else {
            self.config.budget
        };
        let mut broken = None;
        let (door, progress) = (&mut *self.door, &self.progress);
        let mut pulse = |row: &TickRow| {
            progress.fetch_add(1, Ordering::Relaxed);
            if let Err(error) = door.publish_tick(row) {
                broken = Some(error);
            }
        };
        let input = TickInput {
            inbox: &self.due,
            edits: &self.ready,
            demand,
            budget,
            cause: due.cause,
            cause_source: due.source.map(crate::ids::SourceSlot::index),
            woke_ns,
            pulse: Some(&mut pulse),
        };
        let ask = Ask::of(&input);
        let outbox = self.engine.tick_at(now_ns, input);
        if let Some(error) = broken {
            return Err(error);
        }
        let start_ns = self.clock.monotonic_ns();
        let unsent = self.door.publish(outbox)?;
        self.engine.note_undelivered(unsent);
        if let Some(recorder) = &mut self.recorder {
            recorder.tick(&self.due, ask, &self.engine);
        }
        self.tell_used_up(taken);
        let send_ns = self.clock.monotonic_ns().saturating_sub(start_ns);
        if let Some(lost) = self.unsent.note(unsent.messages, start_ns) {
            tracing::warn!(
                "{lost} messages up to tick {} could not be handed over: shared memory may be full, see \
                 `sweepd doctor`",
                self.engine.ticks()
            );
        }
        if let Some(words) = self.refusals.words(self.engine.world(), start_ns) {
            tracing::warn!("{words}");
            self.door.tell(&words);
        }
        self.engine.note_sent(send_ns);
        self.pacer.learn(self.engine.world());
        self.settle_edits();
        Ok(())
    }
}
