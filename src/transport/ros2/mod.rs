//! The ROS 2 node: the one door to ros2-client and rustdds. In: topics of anybody in the DDS domain. Out: frames for
//! the tick thread, and its ticks as topics.
//!
//! Threads, none of which the tick thread waits for: `ros-rx` (`inlet`: subscriptions, decoding, chains of frames,
//! services, parameters), `ros-words` (`services/scribe`: requests as JSON), `ros-tx` (`outlet`: messages, publishing),
//! and those of DDS itself.
//!
//! Between them and the tick stand a shelf of frames (`shelf`) and a queue of two parcels (`parcel`):
//! the newest wins, and what gave way is counted. The tick thread never calls into DDS, which may block.
//!
//! Order at the end is a promise: the sending and receiving threads first, with them the node, which takes its name out
//! of the graph, then the context; in any other order the name stays in the graph for 50 s.

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

/// Takes a lock. One whose holder panicked has whole values still, because each change is one move; the panic is told.
fn open<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What the node needs to know of a scene.
#[derive(Clone, Debug, Default)]
pub struct RosScene {
    /// The scene's frame.
    pub frame_id: String,
    /// How the daemon runs at the start.
    pub config: Config,
    /// Its sources, in its order.
    pub sources: Vec<RosSourceSpec>,
    /// Its bodies.
    pub bodies: Vec<BodyNote>,
    /// Parameters set while a node of it ran.
    pub kept: Kept,
    /// Whether a node of it has run before in this daemon.
    pub again: bool,
}

/// A source of the scene.
#[derive(Clone, Debug)]
pub struct RosSourceSpec {
    /// Its name.
    pub name: String,
    /// Its time-out, nanoseconds.
    pub timeout_ns: u64,
    /// Its topics; `None`: it sends whole frames.
    pub ros2: Option<RosSource>,
}

impl RosScene {
    /// Follows an edit.
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
