//! What a recording holds: the start, and each tick with all that the engine was given for it and all that it said.

use serde::{Deserialize, Serialize};

use crate::config::Mode;
use crate::ids::BodyId;
use crate::scene::Scene;
use crate::shape::Contents;
use crate::tick::TickInput;
use crate::time::{Budget, Clock, SystemClock};
use crate::transport::Setting;
use crate::wire::{Demand, Inbox, Outbox, TickCause, WIRE_VERSION};
use crate::world::{Applied, TreeOf};

/// Number of the layout of our messages in a recording; another is not read. 2: `number` in `VertexHeader`;
/// 3: `since_ns`, `first_seq` and `cut` of frames.
pub const LAYOUT: u32 = 3;

/// How a daemon began.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Start {
    /// What fits in words and numbers.
    pub facts: Facts,
    /// The text of the scene file.
    pub scene: String,
    /// The mesh files that it names.
    pub files: Contents,
}

/// What is said of a start in JSON.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Facts {
    /// [`LAYOUT`] of the recorder.
    pub layout: u32,
    /// `WIRE_VERSION` of the recorder.
    pub wire_version: u32,
    /// sweepd's version.
    pub sweepd_version: String,
    /// Random number of this start of the daemon.
    pub boot_id: u64,
    /// When the engine was made, nanoseconds of `CLOCK_BOOTTIME`.
    pub started_ns: u64,
    /// What is to be added to a time of `CLOCK_BOOTTIME` for nanoseconds since 1970.
    pub since_1970_ns: u64,
    /// Name of the scene file, for messages.
    pub scene_file: String,
    /// What makes a tick, in the words of `--mode`; flags have been heeded.
    pub mode: String,
    /// Time a tick may take, nanoseconds; null: no limit. It can change while running: each tick has its own.
    pub budget_ns: Option<u64>,
    /// Work units a tick may take; null: no limit.
    pub budget_units: Option<u64>,
    /// Threads that a tick may work with.
    pub threads: usize,
}

impl Start {
    /// Of a daemon about to run.
    ///
    /// * `scene` - as it runs it, flags heeded.
    /// * `started_ns` - `Engine::now_ns` before the first tick.
    #[must_use]
    pub fn of(scene: &Scene, text: String, files: Contents, boot_id: u64, started_ns: u64) -> Self {
        let (clock, config) = (SystemClock, &scene.config);
        Self {
            facts: Facts {
                layout: LAYOUT,
                wire_version: WIRE_VERSION,
                sweepd_version: env!("CARGO_PKG_VERSION").to_owned(),
                boot_id,
                started_ns,
                since_1970_ns: clock.realtime_ns().saturating_sub(clock.boottime_ns()),
                scene_file: scene.origin.file.clone(),
                mode: config.mode.to_string(),
                budget_ns: config.budget.time_ns,
                budget_units: config.budget.units,
                threads: config.threads_here(),
            },
            scene: text,
            files,
        }
    }
}

/// One tick: what went in, what came out. Its memory goes round.
#[derive(Clone, Debug, Default)]
pub struct TickRecord {
    /// What was done to the engine since the tick before, in order.
    pub between: Vec<Between>,
    /// Frames, vertices and ended sessions, as they were handed over.
    pub inbox: Inbox,
    /// Edits, in order.
    pub edits: Vec<EditRecord>,
    /// Everything of the tick's input that is a number.
    pub ask: Ask,
    /// The engine's time of the tick, nanoseconds of `CLOCK_BOOTTIME`.
    pub now_ns: u64,
    /// What it published; of what nobody listened to nothing.
    pub out: Outbox,
}

/// The numbers of a tick's input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ask {
    /// Who listened.
    pub demand: Demand,
    /// What might be spent.
    pub budget: Budget,
    /// Why this tick.
    pub cause: TickCause,
    /// Place of the source whose frame caused it.
    pub cause_source: Option<usize>,
    /// When the daemon woke for it, nanoseconds of `CLOCK_MONOTONIC`.
    pub woke_ns: u64,
}

impl Ask {
    /// Of a tick's input.
    #[must_use]
    pub fn of(input: &TickInput<'_>) -> Self {
        Self {
            demand: input.demand,
            budget: input.budget,
            cause: input.cause,
            cause_source: input.cause_source,
            woke_ns: input.woke_ns,
        }
    }
}

impl Default for Ask {
    fn default() -> Self {
        Self {
            demand: Demand::default(),
            budget: Budget::UNLIMITED,
            cause: TickCause::Frame,
            cause_source: None,
            woke_ns: 0,
        }
    }
}

/// Something done to an engine between two ticks.
#[derive(Clone, Debug, PartialEq)]
pub enum Between {
    /// Frames of a source (`None`: of none of the scene) were passed over for newer ones.
    Skipped {
        /// Place of the source.
        source: Option<u32>,
        /// How many.
        frames: u64,
    },
    /// The time-out of a source was set.
    Timeout {
        /// Place of the source.
        source: u32,
        /// Nanoseconds.
        timeout_ns: u64,
    },
    /// A worker was handed a loose tree to build anew.
    TreeAsked(TreeMark),
    /// What it built was handed over, and taken or not.
    TreeBuilt(TreeMark, bool),
    /// It could not build it.
    TreeRefused(TreeMark),
    /// What makes a tick was set, in the words of `--mode`; for readers: the engine does not know it.
    Mode(String),
}

impl Between {
    /// What a setting does to the engine itself; budgets come with each tick, edits as edits.
    #[must_use]
    pub fn of(setting: &Setting) -> Option<Self> {
        match setting {
            Setting::Mode(mode) => Some(Self::Mode(Mode::to_string(mode))),
            Setting::Timeout { source, timeout_ns } => Some(Self::Timeout {
                source: u32::try_from(*source).unwrap_or(u32::MAX),
                timeout_ns: *timeout_ns,
            }),
            _ => None,
        }
    }
}

/// Which tree: of which body, and which of its vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TreeMark {
    /// Body id.
    pub body: u64,
    /// Its generation.
    pub generation: u32,
    /// Updates of its vertices until then.
    pub updates: u64,
}

impl From<TreeOf> for TreeMark {
    fn from(of: TreeOf) -> Self {
        let (BodyId(body), generation, updates) = of.parts();
        Self {
            body,
            generation,
            updates,
        }
    }
}

/// One batch of edits, and what became of it.
#[derive(Clone, Debug, PartialEq)]
pub struct EditRecord {
    /// The asker's number.
    pub token: u64,
    /// What it was made of.
    pub origin: Origin,
    /// Done from which scene revision on, or why not.
    pub outcome: Result<Applied, String>,
}

/// What edits were made of.
#[derive(Clone, Debug, PartialEq)]
pub enum Origin {
    /// A client's request.
    Asked(Asked),
    /// An operator's margin for all bodies, metres; `None`: as each was put.
    Margin(Option<f64>),
    /// An operator's reset.
    Reset,
}

/// A request as it came, and the mesh files that were read for it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Asked {
    /// Bytes of JSON at the front of the payload.
    pub json_len: usize,
    /// JSON, then blobs.
    pub payload: Vec<u8>,
    /// Files by the names that the JSON has.
    pub files: Contents,
}

impl TickRecord {
    /// Takes what the engine was given; edits and what was done before are handed over by others.
    pub(super) fn take_input(&mut self, inbox: &Inbox, ask: Ask, now_ns: u64) {
        self.ask = ask;
        self.now_ns = now_ns;
        copy_inbox(inbox, &mut self.inbox);
    }

    /// Takes what was published.
    pub(super) fn take_output(&mut self, out: &Outbox) {
        copy_outbox(out, self.ask.demand, &mut self.out);
    }

    /// Memory of it that is in use without what was asked for with its edits, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let (mut bytes, out) = (size_of::<Self>(), &self.out);
        for frame in self.inbox.frames() {
            bytes += size_of_val(frame) + size_of_val(&*frame.transforms);
            bytes += size_of_val(&*frame.velocities) + size_of_val(&*frame.stamps_ns);
            bytes += size_of_val(&*frame.since_ns);
        }
        for frame in self.inbox.vertices() {
            bytes += size_of_val(frame) + size_of_val(&*frame.rows);
        }
        bytes += size_of_val(&*self.edits);
        bytes += size_of_val(&*out.pairs) + size_of_val(&*out.contacts);
        bytes += size_of_val(&*out.regions) + size_of_val(&*out.bodies);
        bytes + out.body_verdicts.len() + size_of_val(&*out.names) + out.plan.len()
    }

    /// Memory of the requests and files that its edits came with, bytes.
    #[must_use]
    pub fn edit_bytes(&self) -> usize {
        let asked = self.edits.iter().map(|edit| match &edit.origin {
            Origin::Asked(asked) => {
                asked.payload.len() + asked.files.values().map(|file| file.len()).sum::<usize>()
            }
            _ => 0,
        });
        asked.sum()
    }

    /// Empties it, keeps the memory of what each tick has.
    pub(super) fn clear(&mut self) {
        self.between.clear();
        self.edits.clear();
        self.inbox.clear();
    }
}

/// Copies an inbox into another's memory.
fn copy_inbox(from: &Inbox, to: &mut Inbox) {
    to.clear();
    for frame in from.frames() {
        let copy = to.push();
        copy.header = frame.header;
        copy.received_ns = frame.received_ns;
        copy.waited = frame.waited;
        copy.refused = frame.refused;
        (copy.first_seq, copy.cut) = (frame.first_seq, frame.cut);
        copy.transforms.extend_from_slice(&frame.transforms);
        copy.velocities.extend_from_slice(&frame.velocities);
        copy.stamps_ns.extend_from_slice(&frame.stamps_ns);
        copy.since_ns.extend_from_slice(&frame.since_ns);
        copy.refused_bodies.extend_from_slice(&frame.refused_bodies);
    }
    for frame in from.vertices() {
        let copy = to.push_vertices();
        copy.header = frame.header;
        copy.received_ns = frame.received_ns;
        copy.waited = frame.waited;
        copy.refused = frame.refused;
        copy.rows.extend_from_slice(&frame.rows);
    }
    for &session in from.ended() {
        to.end_session(session);
    }
}

/// Copies what somebody listened to into another outbox's memory; the rest is empty there.
pub(super) fn copy_outbox(from: &Outbox, demand: Demand, to: &mut Outbox) {
    to.tick = from.tick;
    copy_rows(demand.pairs, &from.pairs, &mut to.pairs);
    copy_rows(demand.contacts, &from.contacts, &mut to.contacts);
    copy_rows(demand.regions, &from.regions, &mut to.regions);
    copy_rows(demand.bodies, &from.bodies, &mut to.bodies);
    copy_rows(
        demand.body_verdicts,
        &from.body_verdicts,
        &mut to.body_verdicts,
    );
    copy_rows(from.names_changed, &from.names, &mut to.names);
    to.pairs_header = from.pairs_header;
    to.contacts_header = from.contacts_header;
    to.regions_header = from.regions_header;
    to.bodies_header = from.bodies_header;
    to.names_changed = from.names_changed;
    to.plan_changed = from.plan_changed;
    to.plan.clear();
    if from.plan_changed {
        to.plan.push_str(&from.plan);
    }
}

fn copy_rows<T: Copy>(filled: bool, from: &[T], to: &mut Vec<T>) {
    to.clear();
    if filled {
        to.extend_from_slice(from);
    }
}
