//! Transports: how frames and requests come in and results go out. In: samples from other processes, copied once and
//! unchecked. Out: an [`Inbox`] for the engine, and the engine's [`Outbox`] for readers.
//!
//! All transports implement the trait [`Door`]: [`iceoryx`] for other processes, [`memory`] for threads of this one
//! (tests, and programs that embed the daemon), `ros2` for a ROS 2 graph, and [`Both`] for two at once. [`client`] is
//! the other side of the first two. A door belongs to the thread that opened it.

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

/// Default time that a wait spins before it sleeps, nanoseconds: on a single core spinning would only keep the other
/// side from its work.
pub(crate) fn spin_default_ns() -> u64 {
    match std::thread::available_parallelism() {
        Ok(cores) if cores.get() > 1 => crate::limits::SPIN_US_DEFAULT * 1000,
        _ => 0,
    }
}

/// Why [`Door::wait`] returned. Nothing set: the time was up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wake {
    /// A client signalled that it sent a frame or a request. May be set once although nothing is left to receive.
    pub notified: bool,
    /// A client came, left or died.
    pub peers_changed: bool,
    /// A signal interrupted the wait.
    pub interrupted: bool,
}

/// A request that waits for its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RequestToken(pub u64);

/// A setting that an operator changed while the daemon runs; applied between two ticks.
#[derive(Clone, Debug, PartialEq)]
pub enum Setting {
    /// Time a tick may take, nanoseconds; `None`: no limit.
    BudgetTime(Option<u64>),
    /// Work units a tick may take; `None`: no limit.
    BudgetUnits(Option<u64>),
    /// What makes a tick.
    Mode(Mode),
    /// Time-out of a source, by its index.
    Timeout {
        /// Index of the source in the scene.
        source: usize,
        /// Nanoseconds.
        timeout_ns: u64,
    },
    /// Pairs of the present bodies with a smaller gap are reported as near, metres; `None`: as each body was put.
    Margin(Option<f64>),
    /// A tick at once.
    TickNow,
    /// Time went back for all sources: every pair ends, bodies that move are not received again.
    Reset,
}

/// What a door needs to know about a body to take its poses from elsewhere, and to display it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyNote {
    /// Its id.
    pub id: u64,
    /// Its name.
    pub name: String,
    /// Index of its source in the scene.
    pub source: Option<usize>,
    /// Its frame in `/tf`.
    pub frame: String,
    /// Its topic; empty: none.
    pub topic: String,
    /// Whether it is continuous: each of its poses is part of its path.
    pub continuous: bool,
    /// Whether it hangs on another body, which moves it in the place of its source.
    pub attached: bool,
    /// Centre and half extents of its box in its own frame, metres; `None`: it is infinite.
    pub bounds: Option<([f64; 3], [f64; 3])>,
}

/// What an edit did to a body.
#[derive(Clone, Debug, PartialEq)]
pub enum BodyChange {
    /// It came, or was replaced.
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
/// with `housekeeping` instead of `publish`.
pub trait Door {
    /// Waits until a client has sent something, a signal came, or `timeout_ns` have passed.
    ///
    /// # Errors
    /// `Error::Io` when the wake-up port itself is broken; the daemon must then restart.
    fn wait(&mut self, timeout_ns: u64, clock: &dyn Clock) -> Result<Wake>;

    /// Copies new frames into the inbox, per source at most its queue (4 frames), so that a flooding client does not
    /// starve the others; a frame beyond limits comes without rows and with the reason.
    fn receive(&mut self, inbox: &mut Inbox, clock: &dyn Clock);

    /// The messages that have readers now. `publish` sends only what was in demand at the last call, so an outbox that
    /// was not filled is never sent as "nothing touches".
    fn demand(&mut self) -> Demand;

    /// Sends contacts, regions, pairs, changes, bodies, body verdicts, names and plan (where new), then the tick, then
    /// one `ready` event; never waits for a reader.
    ///
    /// * returns - what could not be delivered; the engine must be informed before its next tick.
    ///
    /// # Errors
    /// `Error::Io` when the tick itself could not be sent: readers would receive nothing.
    fn publish(&mut self, outbox: &Outbox) -> Result<Undelivered>;

    /// Sends a tick alone, between the slices of a long one.
    ///
    /// # Errors
    /// As [`Door::publish`].
    fn publish_tick(&mut self, tick: &TickRow) -> Result<()>;

    /// Passes on each new complete request: its token, header and payload (`json_len` bytes of JSON, then blobs;
    /// checked to fit). It stays open until it is answered. A request that cannot be read is answered here.
    ///
    /// A large one is copied in parts so that no call takes long; while there is more, `wait` returns at once.
    fn requests(&mut self, take: &mut dyn FnMut(RequestToken, RequestHeader, Vec<u8>));

    /// Answers a request with JSON; a client that has left is no error.
    ///
    /// # Errors
    /// `Error::Io` when the answer could not be delivered.
    fn answer(&mut self, token: RequestToken, ok: bool, json: &str) -> Result<()>;

    /// Passes on settings changed since the last call; a door without an operator has none.
    fn settings(&mut self, _take: &mut dyn FnMut(Setting)) {}

    /// Returns whether it must be informed of what edits do to bodies; not needed if its frames name bodies.
    fn follows_bodies(&self) -> bool {
        false
    }

    /// Reports what edits did to bodies, after the tick that applied them.
    fn bodies(&mut self, _changes: &[BodyChange]) {}

    /// Repeats a log message, for users who do not see the log.
    fn tell(&mut self, _words: &str) {}

    /// Gives late joiners the newest state, and drops requests of clients that left. Cheap; called in each idle round.
    fn housekeeping(&mut self);
}
