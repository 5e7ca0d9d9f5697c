//! Wakes the tick thread from another thread of the daemon (a shape is built, a signal came).

use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{EventId, Node, ipc_threadsafe};

use super::place::Place;
use super::qos::{self, Open, events};
use crate::error::Result;

/// Wakes [`Server::wait`](super::Server) of its place; may be sent to and shared by threads.
#[derive(Debug)]
pub struct Waker {
    notifier: Notifier<ipc_threadsafe::Service>,
    _node: Node<ipc_threadsafe::Service>,
}

impl Waker {
    /// A waker of the place; the server must be open.
    ///
    /// # Errors
    /// `Error::Io` when there is no server, or no port is free.
    pub fn new(place: &Place) -> Result<Self> {
        let node = qos::node_of::<ipc_threadsafe::Service>(place, "waker")?;
        let notifier = qos::event(&node, place, "wake", Open::Existing)?
            .notifier_builder()
            .default_event_id(EventId::new(events::INTERNAL))
            .create()
            .map_err(|e| qos::failed("wake", e))?;
        Ok(Self {
            notifier,
            _node: node,
        })
    }

    /// Wakes the server; a server that is gone is no error.
    pub fn wake(&self) {
        let _nobody_there = self.notifier.notify();
    }
}

/// The waker must be usable from other threads.
const _: () = {
    const fn shared<T: Send + Sync>() {}
    shared::<Waker>();
};
