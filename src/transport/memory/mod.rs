//! The in-process counterpart of shared memory: same interface, same queues and losses, no files. For tests, and for
//! programs that embed the daemon. In: frames of [`MemoryLink`]s. Out: what a [`MemoryServer`] publishes.
//!
//! A [`Hub`] corresponds to the files of shared memory: it outlives servers and clients, and has one server at most.

mod link;
mod server;
#[cfg(test)]
pub(crate) mod trial;

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

pub use link::MemoryLink;
pub use server::MemoryServer;

use crate::transport::client::{Message, Topics};
use crate::transport::{RequestToken, Wake};
use crate::wire::{
    AnswerHeader, BodyRow, ChangesHeader, ContactRow, FrameHeader, Hello, NameRow, PairRow,
    RegionRow, RequestHeader, TickRow, TransformRow, TransformVelRow, VertexHeader, VertexRow,
};

/// Frames of one source that wait for the daemon; beyond that the oldest is dropped. As over shared memory.
const SOURCE_BUFFER: usize = 4;
/// Vertex messages of one source that wait for the daemon; beyond that the oldest is dropped. As over shared memory.
const VERTEX_BUFFER: usize = 64;
/// Messages that wait for one reader; beyond that the oldest is dropped. As over shared memory.
const RESULT_BUFFER: usize = 8;

/// Connects one server with its clients.
#[derive(Clone, Debug, Default)]
pub struct Hub {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    to_server: Condvar,
    to_clients: Condvar,
}

impl Shared {
    /// A thread that panicked while it held the lock left a consistent state: every change is one step.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[derive(Debug)]
enum Rows {
    Poses(Vec<TransformRow>),
    Moving(Vec<TransformVelRow>),
}

/// One client's queues.
#[derive(Debug, Default)]
struct Peer {
    topics: Topics,
    session: u64,
    left: bool,
    frames: VecDeque<(FrameHeader, Rows)>,
    vertices: VecDeque<(VertexHeader, Vec<VertexRow>)>,
    ready: bool,
    hello: Option<Hello>,
    tick: VecDeque<TickRow>,
    pairs: VecDeque<Message<PairRow>>,
    changes: VecDeque<Message<PairRow, ChangesHeader>>,
    contact_changes: VecDeque<Message<ContactRow, ChangesHeader>>,
    /// It subscribed to one of these two, and the server has not noticed yet.
    changes_anew: bool,
    contacts: VecDeque<Message<ContactRow>>,
    regions: VecDeque<Message<RegionRow>>,
    bodies: VecDeque<Message<BodyRow>>,
    body_verdicts: VecDeque<Message<u8>>,
    names: VecDeque<Message<NameRow>>,
    plan: VecDeque<Message<u8>>,
    answers: VecDeque<(AnswerHeader, Vec<u8>)>,
}

/// The newest of each message, for late joiners; dropped with its server.
#[derive(Debug, Default)]
struct Newest {
    hello: Option<Hello>,
    tick: Option<TickRow>,
    pairs: Option<Message<PairRow>>,
    contacts: Option<Message<ContactRow>>,
    regions: Option<Message<RegionRow>>,
    bodies: Option<Message<BodyRow>>,
    body_verdicts: Option<Message<u8>>,
    names: Option<Message<NameRow>>,
    plan: Option<Message<u8>>,
}

#[derive(Debug, Default)]
struct State {
    served: bool,
    wake: Wake,
    peers: BTreeMap<u64, Peer>,
    peers_made: u64,
    newest: Newest,
    requests: VecDeque<(u64, RequestHeader, Vec<u8>)>,
    asked: BTreeMap<RequestToken, (u64, u64)>,
}

/// Queues a message; beyond the reader's buffer the oldest is dropped.
fn queue<T>(queue: &mut VecDeque<T>, message: T) {
    if queue.len() == RESULT_BUFFER {
        queue.pop_front();
    }
    queue.push_back(message);
}

impl Hub {
    /// An empty hub.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A client's ports.
    #[must_use]
    pub fn link(&self) -> MemoryLink {
        MemoryLink::new(Arc::clone(&self.shared))
    }
}
