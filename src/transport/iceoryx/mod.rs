//! Shared memory between processes: the only module that uses iceoryx2. In: samples of untrusted layout but trusted
//! origin (files are 0600: same user only). Out: copies, checked for memory safety; `world` checks everything else.
//!
//! Not checked by iceoryx2, but by this room or `world`: field layout (version in type names, `schema` in headers),
//! counts beyond limits, values that change after the send (copied once, then checked).
//!
//! Leaves nothing behind: ports are dropped before services, services before the node, the node before the locks (field
//! order of [`Server`]); after a kill the next daemon, or any node, cleans up.

mod cleaner;
mod leftovers;
mod link;
mod list;
mod lock;
mod place;
mod process;
mod qos;
mod room;
mod server;
mod unfinished;
mod unmet;
mod waker;

pub use cleaner::{Cleaner, spawn_cleaner};
pub use leftovers::{
    Cleaned, Leftovers, NodeOwner, Unmapped, clean_leftovers, leftovers, unreaped_by,
};
pub use link::IoxLink;
pub use list::{InstanceInfo, list_instances};
pub use lock::{Holder, Lock, locks};
pub use place::Place;
pub use process::{Process, process, shares};
pub use room::{bytes_needed, cramped, scarce};
pub use server::{Server, ServerOptions};
pub use waker::Waker;
