//! Transports: how frames and requests come in and results go out. In: samples of other processes, copied once and
//! unchecked. Out: an [`Inbox`] for the engine, and the engine's [`Outbox`] for readers.
//!
//! Doors with one surface, the trait [`Door`]: [`iceoryx`] for other processes, [`memory`] for threads of this one
//! (tests, the embedded feed), `ros2` for a ROS 2 graph, and [`Both`] of two. [`client`] is the other side of the first
//! two. A door belongs to the thread that opened it.

mod both;
pub mod client;
mod hello;
pub mod iceoryx;
pub mod memory;
pub mod open_files;
mod patience;
mod request;
#[cfg(feature = "ros2")]
pub mod ros2;

pub use both::Both;
pub use hello::ICEORYX2_VERSION;

use crate::config::Mode;
use crate::error::Result;
use crate::time::Clock;
use crate::wire::{Demand, Inbox, Outbox, RequestHeader, TickRow, Undelivered};

/// How long a wait looks before it sleeps where nothing else is said, nanoseconds: on a single core it would only keep
/// the other side from its work.
pub(crate) fn spin_default_ns() -> u64 {
    match std::thread::available_parallelism() {
        Ok(cores) if cores.get() > 1 => crate::limits::SPIN_US_DEFAULT * 1000,
        _ => 0,
    }
}

/// Why [`Door::wait`] came back. Nothing set: the time was up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wake {
    /// A client said that it sent a frame or a request. May be said once more than there is something to receive.
    pub notified: bool,
    /// A client came, left or died.
    pub peers_changed: bool,
    /// A signal cut the wait.
    pub interrupted: bool,
}

/// A request that waits for its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RequestToken(pub u64);

/// What an operator set while the daemon runs; applied between two ticks.
#[derive(Clone, Debug, PartialEq)]
pub enum Setting {
    /// Time a tick may take, nanoseconds; `None`: no limit.
    BudgetTime(Option<u64>),
    /// Work units a tick may take; `None`: no limit.
    BudgetUnits(Option<u64>),
    /// What makes a tick.
    Mode(Mode),
    /// Time-out of a source, by its place.
    Timeout {
        /// Place of the source in the scene.
        source: usize,
        /// Nanoseconds.
        timeout_ns: u64,
    },
    /// How near pairs of the bodies that are there must come to be told as near, metres; `None`: as each was put.
    Margin(Option<f64>),
    /// A tick at once.
    TickNow,
    /// Time went back for all: every pair ends, bodies that move are not received again.
    Reset,
}

/// What a door needs to know of a body to take its poses from elsewhere, and to show it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyNote {
    /// Its id.
    pub id: u64,
    /// Its name.
    pub name: String,
    /// Place of its source in the scene.
    pub source: Option<usize>,
    /// Its frame in `/tf`.
    pub frame: String,
    /// Its topic; empty: none.
    pub topic: String,
    /// Whether each of its poses is a part of its way.
    pub continuous: bool,
    /// Whether it hangs on another body, which moves it in the place of its source.
    pub attached: bool,
    /// Centre and half extents of its box in its own frame, metres; `None`: it has no end.
    pub bounds: Option<([f64; 3], [f64; 3])>,
}

/// What an edit did to a body.
#[derive(Clone, Debug, PartialEq)]
pub enum BodyChange {
    /// It came, or is another now.
    Put(BodyNote),
    /// It left: its name.
    Removed(String),
    /// It was hung on another body, or let go.
    Hung {
        /// Its name.
        name: String,
        /// Whether it hangs on another one now.
        attached: bool,
    },
}

impl BodyChange {
    /// The body's name.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Put(BodyNote { name, .. }) | Self::Removed(name) | Self::Hung { name, .. } => {
                name
            }
        }
    }
}

/// The daemon's side of a transport.
///
/// One round: `wait`, `receive`, `requests`, then `demand`, the engine's tick, `publish`. A round without a tick ends
/// in `housekeeping` instead of `publish`.
pub trait Door {
    /// Waits until a client has sent something, a signal came, or `timeout_ns` have passed.
    ///
    /// # Errors
    /// `Error::Io` when the wake-up port itself is broken; the daemon must then restart.
    fn wait(&mut self, timeout_ns: u64, clock: &dyn Clock) -> Result<Wake>;

    /// Copies what came since into the inbox, per source at most its queue (4 frames), so that no flooder starves
    /// the others; what is beyond limits comes as a frame without rows that says why.
    fn receive(&mut self, inbox: &mut Inbox, clock: &dyn Clock);

    /// What is listened to now. `publish` sends what was in demand at the last call, nothing else, so an outbox
    /// that was not filled is never sent as "nothing touches".
    fn demand(&mut self) -> Demand;

    /// Sends contacts, regions, pairs, changes, bodies, body verdicts, names and plan (where new), then the tick, then
    /// one `ready` event; never waits for a reader.
    ///
    /// * returns - what could not be handed over; the engine is to hear of it before its next tick.
    ///
    /// # Errors
    /// `Error::Io` when the tick itself could not be sent: readers would hear nothing.
    fn publish(&mut self, outbox: &Outbox) -> Result<Undelivered>;

    /// Sends a tick alone, between the slices of a long one.
    ///
    /// # Errors
    /// As [`Door::publish`].
    fn publish_tick(&mut self, tick: &TickRow) -> Result<()>;

    /// Hands over each new request that is whole: its token, header and payload (`json_len` bytes of JSON, then blobs;
    /// checked to fit). It stays open until it is answered. A request that cannot be read is answered here.
    ///
    /// A large one is copied by so much a call that no call takes long; while there is more, `wait` comes back at once.
    fn requests(&mut self, take: &mut dyn FnMut(RequestToken, RequestHeader, Vec<u8>));

    /// Answers a request with JSON; a client that has left is no error.
    ///
    /// # Errors
    /// `Error::Io` when the answer could not be handed over.
    fn answer(&mut self, token: RequestToken, ok: bool, json: &str) -> Result<()>;

    /// Hands over what was set since the last call; a door without an operator has nothing.
    fn settings(&mut self, _take: &mut dyn FnMut(Setting)) {}

    /// Whether it is to be told what edits do to bodies; a door whose frames name bodies has no use for it.
    fn follows_bodies(&self) -> bool {
        false
    }

    /// Says what edits did to bodies, after the tick that applied them.
    fn bodies(&mut self, _changes: &[BodyChange]) {}

    /// Says what the log says; for those who do not see it.
    fn tell(&mut self, _words: &str) {}

    /// Lets late joiners have the newest state, forgets requests of clients that left. Cheap; each idle round.
    fn housekeeping(&mut self);
}
