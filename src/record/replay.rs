//! Replay: runs the same engine on recorded input, with a clock that shows the recorded times.
//!
//! In: a [`Start`], then each [`TickRecord`] in order. Out: the first [`Difference`], or none. Before the first tick
//! that was limited by time everything must be equal bit by bit ([`super::differ`]). From that tick on the replay has
//! no limit, and the recording is judged by the law ([`super::law`]).

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::differ::{self, Spot};
use super::given::{Between, EditRecord, Origin, Start, TickRecord, TreeMark, copy_outbox};
use super::law::{self, Before, Judged};
use crate::config::Mode;
use crate::error::{Error, Result};
use crate::ids::{BodyId, SourceSlot};
use crate::scene::{Request, Scene};
use crate::shape::Library;
use crate::tick::build::{EditBuilder, build_shapes_in};
use crate::tick::{EditBatch, Engine, TickInput};
use crate::time::{Budget, Clock};
use crate::wire::{Outbox, TickRow, name_str};
use crate::world::{Edit, WornTree};

/// Where a replay first differs from its recording.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Difference {
    /// Number of the tick.
    pub tick: u64,
    /// The message, and its row.
    pub place: String,
    /// Bodies of that row, by name.
    pub bodies: Vec<String>,
    /// The field of the row; empty: the row itself.
    pub field: String,
    /// The recorded value.
    pub recorded: String,
    /// The replayed value.
    pub replayed: String,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "tick {}: {}", self.tick, self.place)?;
        if !self.bodies.is_empty() {
            write!(f, " ({})", self.bodies.join(", "))?;
        }
        if !self.field.is_empty() {
            write!(f, ": {}", self.field)?;
        }
        write!(
            f,
            ": recorded {}, replayed {}",
            self.recorded, self.replayed
        )
    }
}

/// Counts of what was compared so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Ticks compared bit by bit.
    pub exact: u64,
    /// Ticks judged by the law.
    pub lawful: u64,
    /// What was judged in them.
    pub judged: Judged,
}

/// The clock of a replay, which stands still within a tick.
#[derive(Debug, Default)]
struct Shown {
    boottime_ns: AtomicU64,
    monotonic_ns: AtomicU64,
}

impl Clock for Shown {
    fn boottime_ns(&self) -> u64 {
        self.boottime_ns.load(Ordering::Relaxed)
    }

    fn monotonic_ns(&self) -> u64 {
        self.monotonic_ns.load(Ordering::Relaxed)
    }

    fn thread_cpu_ns(&self) -> u64 {
        0
    }
}

/// A replay in progress.
pub struct Replay {
    engine: Engine,
    clock: Arc<Shown>,
    edits: EditBuilder,
    /// The tree that the worker got.
    worn: Option<WornTree>,
    /// Names of all bodies that ever existed.
    names: BTreeMap<u64, String>,
    /// The replay's output, only lists that had readers in the recording.
    said: Outbox,
    /// Whether a tick was limited by time: from then on the law applies.
    lawful: bool,
    /// The pairs that the replay certified in its last tick.
    before: Before,
    tally: Tally,
}

impl std::fmt::Debug for Replay {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Replay")
            .field("tally", &self.tally)
            .finish_non_exhaustive()
    }
}

impl Replay {
    /// Builds the engine as it was before the first tick.
    ///
    /// # Errors
    /// `Error::Scene` if the recorded scene cannot be built again; `Error::Refused` if the recorded mode is invalid.
    pub fn new(start: &Start) -> Result<Self> {
        let facts = &start.facts;
        let mut scene = Scene::parse_kept(&start.scene, &facts.scene_file)?;
        scene.config.mode = Mode::parse(&facts.mode)
            .map_err(|e| Error::Refused(format!("the recorded mode `{}`: {e}", facts.mode)))?;
        scene.config.budget = Budget {
            time_ns: facts.budget_ns,
            units: facts.budget_units,
        };
        scene.config.threads = Some(facts.threads);
        let shapes = build_shapes_in(&scene, Library::of_kept(start.files.clone()), |_, _| {})?;
        let clock = Arc::new(Shown::default());
        clock.boottime_ns.store(facts.started_ns, Ordering::Relaxed);
        let shown = Arc::clone(&clock) as Arc<dyn Clock>;
        let engine = Engine::new(&scene, shapes.bodies, facts.boot_id, shown)?;
        Ok(Self {
            edits: EditBuilder::of_kept(&scene, shapes.library),
            engine,
            clock,
            worn: None,
            names: BTreeMap::new(),
            said: Outbox::default(),
            lawful: false,
            before: Before::default(),
            tally: Tally::default(),
        })
    }

    /// Counts of what was compared so far.
    #[must_use]
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// The engine, to inspect its state.
    #[must_use]
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Runs the next tick and compares it.
    ///
    /// * `record` - the tick after the last one, as a [`Reader`](super::file::Reader) yields it. It is changed: files
    ///   of edits are moved out, and by the law deadlines are taken out of its frames.
    /// * `compared` - whether the tick is compared; each tick must be run.
    /// * returns - the first difference, after which the replay is over.
    ///
    /// # Errors
    /// `Error::Refused` if a recorded edit cannot be built again.
    pub fn tick(&mut self, record: &mut TickRecord, compared: bool) -> Result<Option<Difference>> {
        let tick = record.out.tick.header.tick;
        self.lawful |= is_timed(&record.out.tick);
        for between in &record.between {
            if let Some(spot) = self.do_between(between)
                && compared
            {
                return Ok(Some(self.difference(tick, spot)));
            }
        }
        let edits = self.read_edits(&mut record.edits)?;
        self.run(record, &edits);
        for row in &self.engine.outbox().names {
            if let Some(name) = name_str(&row.name) {
                self.names.insert(row.body, name.to_owned());
            }
        }
        let spot = if compared { self.compare(record) } else { None };
        if self.lawful {
            self.before.take(self.engine.outbox());
        }
        self.engine.note_sent(0);
        Ok(spot.map(|spot| self.difference(tick, spot)))
    }

    /// Runs the tick.
    fn run(&mut self, record: &mut TickRecord, edits: &[EditBatch]) {
        let mut ask = record.ask;
        if self.lawful {
            ask.budget = Budget::UNLIMITED;
            ask.demand.pairs = true;
            ask.woke_ns = 0;
            for frame in record.inbox.frames_mut() {
                (frame.header.deadline_ns, frame.header.time_left_ns) = (0, 0);
            }
        }
        let (boottime_ns, monotonic_ns) = (&self.clock.boottime_ns, &self.clock.monotonic_ns);
        boottime_ns.store(record.now_ns, Ordering::Relaxed);
        monotonic_ns.store(ask.woke_ns, Ordering::Relaxed);
        self.engine.tick(TickInput {
            inbox: &record.inbox,
            edits,
            demand: ask.demand,
            budget: ask.budget,
            cause: ask.cause,
            cause_source: ask.cause_source,
            woke_ns: ask.woke_ns,
            pulse: None,
        });
    }

    fn compare(&mut self, record: &TickRecord) -> Option<Spot> {
        let demand = record.ask.demand;
        let edits = record.edits.iter().zip(self.engine.outcomes());
        let edit = edits.zip(1..).find_map(|((edit, outcome), nth)| {
            let place = || format!("edit {nth}");
            let show = |result: &std::result::Result<_, String>| format!("{result:?}");
            (edit.outcome != outcome.result)
                .then(|| Spot::whole(&place(), &show(&edit.outcome), &show(&outcome.result)))
        });
        if self.lawful {
            self.tally.lawful += 1;
            let replayed = self.engine.outbox();
            let (before, judged) = (&self.before, &mut self.tally.judged);
            return edit.or_else(|| law::judge(&record.out, replayed, demand, before, judged));
        }
        self.tally.exact += 1;
        copy_outbox(self.engine.outbox(), demand, &mut self.said);
        edit.or_else(|| differ::first(&record.out, &self.said, demand))
    }

    /// Repeats a change between two ticks; one that cannot be repeated is a difference. By the law it is none: which
    /// tree is worn, and when, follows from refits that were cut off by time.
    fn do_between(&mut self, between: &Between) -> Option<Spot> {
        let told = |done: &str| Some(Spot::whole("between ticks", &format!("{between:?}"), done));
        match between {
            Between::Skipped { source, frames } => {
                self.engine.note_skipped(source.map(SourceSlot), *frames);
                None
            }
            Between::Timeout { source, timeout_ns } => {
                let source = usize::try_from(*source).unwrap_or(usize::MAX);
                self.engine.set_timeout(source, *timeout_ns);
                None
            }
            Between::TreeAsked(of) if self.lawful => {
                self.worn = self.engine.worn_tree_of(BodyId(of.body));
                None
            }
            Between::TreeAsked(of) => {
                self.worn = self.engine.worn_tree();
                match self.worn.as_ref().map(|worn| TreeMark::from(worn.of())) {
                    Some(mine) if mine == *of => None,
                    Some(mine) => told(&format!("the worn tree is {mine:?}")),
                    None => told("no tree is worn"),
                }
            }
            Between::TreeBuilt(_, taken) => {
                let built = self.worn.take().map(WornTree::build);
                let mine = built.is_some_and(|tree| self.engine.take_tree(tree));
                (mine != *taken && !self.lawful)
                    .then(|| told(&format!("taken: {mine}")))
                    .flatten()
            }
            Between::TreeRefused(_) => {
                if let Some(worn) = self.worn.take() {
                    self.engine.refuse_tree(worn.of());
                }
                None
            }
            Between::Mode(_) => None,
        }
    }

    /// The edits as they were made, with shapes built again.
    fn read_edits(&mut self, edits: &mut [EditRecord]) -> Result<Vec<EditBatch>> {
        let read = |edit: &mut EditRecord| self.read_edit(edit);
        edits.iter_mut().map(read).collect()
    }

    fn read_edit(&mut self, edit: &mut EditRecord) -> Result<EditBatch> {
        let own = |own: Edit| EditBatch {
            token: edit.token,
            edits: vec![own],
            validate: false,
            warnings: Vec::new(),
        };
        let asked = match &mut edit.origin {
            Origin::Asked(asked) => asked,
            Origin::Reset => return Ok(own(Edit::Reset { source: None })),
            Origin::Margin(within_m) => {
                return Ok(own(Edit::Margin {
                    name: None,
                    report_within_m: *within_m,
                }));
            }
        };
        self.edits.add_kept(std::mem::take(&mut asked.files));
        let cut = asked.payload.split_at_checked(asked.json_len);
        let (json, blobs) = cut.unwrap_or_default();
        let built = match Request::parse(json, blobs) {
            Ok(Request::Edits(request)) => self.edits.build(edit.token, request),
            Ok(Request::Ask(_)) => Err("it is a question, no edit".to_owned()),
            Err(why) => Err(why),
        };
        built.map_err(|why| Error::Refused(format!("a recorded edit cannot be built again: {why}")))
    }

    fn difference(&self, tick: u64, spot: Spot) -> Difference {
        let name = |id: &u64| {
            self.names
                .get(id)
                .cloned()
                .unwrap_or_else(|| id.to_string())
        };
        Difference {
            tick,
            place: spot.place,
            bodies: spot.bodies.iter().map(name).collect(),
            field: spot.field,
            recorded: spot.recorded,
            replayed: spot.replayed,
        }
    }
}

/// Whether a tick was limited by time, of the budget or of a frame: its results then depend on the machine.
fn is_timed(row: &TickRow) -> bool {
    row.budget_ns != u64::MAX
}
