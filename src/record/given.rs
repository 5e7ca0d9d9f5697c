//! Content of a recording: the start, and for each tick all that the engine was given and all that it published.

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

/// Version of the layout of our messages in a recording; another version is not read. 2: `number` in `VertexHeader`;
/// 3: `since_ns`, `first_seq` and `cut` of frames.
pub const LAYOUT: u32 = 3;

/// The start of a daemon: its settings and its scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Start {
    /// Versions and settings.
    pub facts: Facts,
    /// The text of the scene file.
    pub scene: String,
    /// The mesh files that the scene names.
    pub files: Contents,
}

/// Versions and settings of a start, stored as JSON.
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
    /// Time at which the engine was made, nanoseconds of `CLOCK_BOOTTIME`.
    pub started_ns: u64,
    /// What to add to a time of `CLOCK_BOOTTIME` for nanoseconds since 1970.
    pub since_1970_ns: u64,
    /// Name of the scene file, for messages.
    pub scene_file: String,
    /// What triggers a tick, in the syntax of `--mode`; flags are applied.
    pub mode: String,
    /// Time budget of a tick, nanoseconds; null: no limit. It can change while running: each tick has its own.
    pub budget_ns: Option<u64>,
    /// Work budget of a tick, units; null: no limit.
    pub budget_units: Option<u64>,
    /// Number of threads that a tick may use.
    pub threads: usize,
}

impl Start {
    /// The start of a daemon that is about to run.
    ///
    /// * `scene` - as the daemon runs it, with flags applied.
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

/// One tick: its input and its output. Its memory is reused.
#[derive(Clone, Debug, Default)]
pub struct TickRecord {
    /// Changes of the engine since the previous tick, in order.
    pub between: Vec<Between>,
    /// Frames, vertices and ended sessions, as the engine got them.
    pub inbox: Inbox,
    /// Edits, in order.
    pub edits: Vec<EditRecord>,
    /// The numbers of the tick's input.
    pub ask: Ask,
    /// The engine's time of the tick, nanoseconds of `CLOCK_BOOTTIME`.
    pub now_ns: u64,
    /// What the engine published; lists without readers are empty.
    pub out: Outbox,
}

/// The numbers of a tick's input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ask {
    /// The outputs that had readers.
    pub demand: Demand,
    /// The budget of the tick.
    pub budget: Budget,
    /// The cause of the tick.
    pub cause: TickCause,
    /// Index of the source whose frame caused it.
    pub cause_source: Option<usize>,
    /// Time at which the daemon woke for it, nanoseconds of `CLOCK_MONOTONIC`.
    pub woke_ns: u64,
}

impl Ask {
    /// The numbers of a tick's input.
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

/// A change of an engine between two ticks.
#[derive(Clone, Debug, PartialEq)]
pub enum Between {
    /// Frames of a source were skipped for newer ones; `None`: of a source that the scene does not have.
    Skipped {
        /// Index of the source.
        source: Option<u32>,
        /// Number of frames.
        frames: u64,
    },
    /// The time-out of a source was set.
    Timeout {
        /// Index of the source.
        source: u32,
        /// Nanoseconds.
        timeout_ns: u64,
    },
    /// A worker got a loose tree to rebuild.
    TreeAsked(TreeMark),
    /// The worker's tree was handed to the engine, which took it or not.
    TreeBuilt(TreeMark, bool),
    /// The worker could not build the tree.
    TreeRefused(TreeMark),
    /// The trigger of ticks was set, in the syntax of `--mode`; for readers only, since the engine does not use it.
    Mode(String),
}

impl Between {
    /// The effect of a setting on the engine itself; budgets are recorded with each tick, edits as edits.
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

/// Identifies a tree by its body and the state of the body's vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TreeMark {
    /// Body id.
    pub body: u64,
    /// Its generation.
    pub generation: u32,
    /// Number of updates of its vertices until then.
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

/// One batch of edits, and its outcome.
#[derive(Clone, Debug, PartialEq)]
pub struct EditRecord {
    /// The number that the asker gave it.
    pub token: u64,
    /// Where the edits come from.
    pub origin: Origin,
    /// The scene revision from which on it holds, or the reason for its refusal.
    pub outcome: Result<Applied, String>,
}

/// Where edits come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Origin {
    /// A client's request.
    Asked(Asked),
    /// An operator's margin for all bodies, metres; `None`: each body's own as it was put.
    Margin(Option<f64>),
    /// An operator's reset.
    Reset,
}

/// A request as received, and the mesh files that were read for it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Asked {
    /// Bytes of JSON at the front of the payload.
    pub json_len: usize,
    /// JSON, then blobs.
    pub payload: Vec<u8>,
    /// Files by their names in the JSON.
    pub files: Contents,
}

impl TickRecord {
    /// Copies the engine's input, except edits and changes between ticks, which the caller sets.
    pub(super) fn take_input(&mut self, inbox: &Inbox, ask: Ask, now_ns: u64) {
        self.ask = ask;
        self.now_ns = now_ns;
        copy_inbox(inbox, &mut self.inbox);
    }

    /// Copies what was published.
    pub(super) fn take_output(&mut self, out: &Outbox) {
        copy_outbox(out, self.ask.demand, &mut self.out);
    }

    /// Memory in use, without the requests and files of its edits, bytes.
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

    /// Memory of the requests and files of its edits, bytes.
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

    /// Clears the input lists and keeps their memory.
    pub(super) fn clear(&mut self) {
        self.between.clear();
        self.edits.clear();
        self.inbox.clear();
    }
}

/// Copies an inbox into another one, whose memory is reused.
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

/// Copies the lists that have readers into another outbox, whose memory is reused; the other lists are empty there.
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
