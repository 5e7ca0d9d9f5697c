//! The ROS 2 node: the only module that uses ros2-client and rustdds. In: topics of the DDS domain. Out: frames for the
//! tick thread, and ticks as topics.
//!
//! Threads: `ros-rx` (`inlet`: subscriptions, decoding, chains of frames, services, parameters), `ros-words`
//! (`services/scribe`: requests as JSON), `ros-tx` (`outlet`: messages, publishing), and those of DDS. The tick thread
//! waits for none of them.
//!
//! Frames pass through a shelf (`shelf`), ticks through a queue of two parcels (`parcel`): the newest wins, and what it
//! replaces is counted. The tick thread never calls DDS, which may block.
//!
//! Shutdown has a fixed order: the sending and receiving threads with the node, which removes its name from the graph,
//! then the context. In any other order the name stays in the graph for 50 s.

mod absent;
pub mod args;
mod diagnose;
pub mod env;
mod inlet;
mod lines;
mod markers;
mod mend;
mod misfits;
pub mod names;
mod namesakes;
mod node;
mod noise;
mod order;
mod outlet;
mod params;
pub mod params_file;
mod parcel;
mod poses;
mod readers;
mod reply;
mod said;
mod say;
mod services;
mod shared;
mod shelf;
mod sockets;
mod stamp;
mod strangers;
mod tf;
mod told;
mod topics;
mod wheel;

pub use mend::{LastingNode, Opener};
pub use node::{RosNode, RosOptions};
pub use params::Kept;

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::{BodyChange, BodyNote};
use crate::config::{Config, RosSource};

/// Takes a lock. After a panic of its holder the value is still valid, because each change is a single move; the panic
/// itself is reported.
fn open<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Data of a scene for the node.
#[derive(Clone, Debug, Default)]
pub struct RosScene {
    /// The scene's frame.
    pub frame_id: String,
    /// The daemon's settings at the start.
    pub config: Config,
    /// Its sources, in order.
    pub sources: Vec<RosSourceSpec>,
    /// Its bodies.
    pub bodies: Vec<BodyNote>,
    /// Parameters that were set while an earlier node ran.
    pub kept: Kept,
    /// Whether an earlier node has run in this daemon.
    pub again: bool,
}

/// A source of the scene.
#[derive(Clone, Debug)]
pub struct RosSourceSpec {
    /// Its name.
    pub name: String,
    /// Its time-out, nanoseconds.
    pub timeout_ns: u64,
    /// Its common topics; `None`: it sends frames on `~/transforms`.
    pub ros2: Option<RosSource>,
}

impl RosScene {
    /// Applies a change by an edit.
    fn follow(&mut self, change: &BodyChange) {
        if let BodyChange::Hung { name, attached } = change {
            let body = self.bodies.iter_mut().find(|body| body.name == *name);
            body.into_iter().for_each(|body| body.attached = *attached);
            return;
        }
        self.bodies.retain(|body| body.name != change.name());
        if let BodyChange::Put(body) = change {
            self.bodies.push(body.clone());
        }
    }
}
