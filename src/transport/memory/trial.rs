//! Setup for tests of readers. Out: a server and its client in memory; ticks in progress.

use std::sync::Arc;

use super::{Hub, MemoryServer};
use crate::time::SystemClock;
use crate::transport::client::Client;
use crate::wire::{Reason, State, TickRow};

/// Heartbeat and time-outs of tests, nanoseconds.
pub(crate) const SECOND_NS: u64 = 1_000_000_000;

/// A server with boot id 7, and a client without a source.
pub(crate) fn met() -> (MemoryServer, Client) {
    let hub = Hub::new();
    let server = MemoryServer::open(&hub, 7, SECOND_NS).unwrap();
    let link = Box::new(hub.link());
    let client = Client::over(link, Arc::new(SystemClock), None, SECOND_NS).unwrap();
    (server, client)
}

/// The announcement of a tick of [`met`]'s server that has not ended.
pub(crate) fn under_way(number: u64) -> TickRow {
    let mut tick = TickRow::default();
    (tick.header.boot_id, tick.header.tick) = (7, number);
    tick.header.state = State::Unknown.code();
    tick.reasons = Reason::Undecided.bit();
    tick
}
