//! Names, sizes and builders of the services. A service keeps its creator's sizes while any node has it open, so a
//! number changed here takes effect only after all old clients have left.

use std::fmt::Debug;
use std::time::Duration;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::prelude::{
    AllocationStrategy, BackpressureStrategy, EventId, Node, ServiceName, SignalHandlingMode,
    ZeroCopySend, ipc,
};
use iceoryx2::prelude::{NodeBuilder, NodeName};
use iceoryx2::service::Service;
use iceoryx2::service::builder::publish_subscribe::{
    Builder as PubSubBuilder, PublishSubscribeOpenError,
};
use iceoryx2::service::port_factory::event::PortFactory as EventFactory;
pub(super) use iceoryx2::service::port_factory::publish_subscribe::PortFactory as PubSub;
use iceoryx2::service::port_factory::request_response::PortFactory as ReqRes;

use super::place::Place;
use super::unmet::Unmet;
use crate::error::{Error, Result};
use crate::limits::SOURCES_MAX;
use crate::wire::{
    AnswerHeader, ChangesHeader, Hello, MessageHeader, RequestHeader, TickRow, VertexHeader,
    VertexRow,
};

/// The services of one thread.
pub(super) type Ipc = ipc::Service;
/// Requests: bytes to bytes, both with their header.
pub(super) type Requests = ReqRes<Ipc, [u8], RequestHeader, [u8], AnswerHeader>;

/// Publishers of `transforms`: every source, plus restarted ones, dead ones not yet cleaned up, and a tunnel.
const SOURCE_PUBLISHERS_MAX: usize = SOURCES_MAX + 8;
/// Readers of `transforms`: the daemon, its successor, a recorder, a tunnel.
const SOURCE_SUBSCRIBERS_MAX: usize = 4;
/// Frames of one source that wait for the daemon; beyond that the oldest is dropped (world counts the gap).
pub(super) const SOURCE_BUFFER: usize = 4;
/// Vertex messages of one source that wait for the daemon; beyond that the oldest is dropped, and what the source has
/// bent is unknown until all of its vertices come again.
pub(super) const VERTEX_BUFFER: usize = 64;
/// Publishers of results: the daemon, its successor, a tunnel.
const RESULT_PUBLISHERS_MAX: usize = 3;
/// Readers of `tick`: every source that waits for its result, and as many other readers.
const TICK_SUBSCRIBERS_MAX: usize = 48;
/// Readers of each other message.
const RESULT_SUBSCRIBERS_MAX: usize = 32;
/// Messages that wait for one reader; beyond that the oldest is dropped.
const RESULT_BUFFER: usize = 8;
/// Messages a reader may hold.
const RESULT_BORROWED: usize = 4;
/// Slots of one result message in shared memory: all that readers may hold, one for late joiners, two being written.
pub(super) const RESULT_PLACES: u64 =
    (RESULT_SUBSCRIBERS_MAX * (RESULT_BUFFER + RESULT_BORROWED) + 3) as u64;
/// Nodes on one service.
const NODES_MAX: usize = 64;
/// Clients that may send requests.
const CLIENTS_MAX: usize = 32;
/// Open requests of one client.
const ACTIVE_REQUESTS: usize = 2;
/// Answers that wait for one request.
const RESPONSE_BUFFER: usize = 8;
/// Initial length of slices; they grow by powers of two, and growing costs a mapping on both sides.
pub(super) const SLICE_LEN_START: usize = 256;
/// Initial length of requests, bytes.
pub(super) const REQUEST_LEN_START: usize = 1 << 14;

/// Event ids of `wake` and `ready`.
pub(super) mod events {
    /// `wake`: a frame was sent. `ready`: a tick was sent.
    pub(in super::super) const SENT: usize = 1;
    /// `wake`: a request was sent. `ready`: an answer was sent.
    pub(in super::super) const ASKED: usize = 2;
    /// Another thread of the daemon's own process has work for the tick thread.
    pub(in super::super) const INTERNAL: usize = 3;
    /// A notifier's node died and was cleaned up.
    pub(in super::super) const DEAD: usize = 13;
    /// A notifier came.
    pub(in super::super) const CREATED: usize = 14;
    /// A notifier left.
    pub(in super::super) const DROPPED: usize = 15;
    /// Largest id.
    pub(in super::super) const MAX: usize = 15;
}

/// Shortest sleep on a port: iceoryx2 0.10 passes the system a time in whole microseconds, rounded down, and 0 means
/// for ever.
pub(super) const SLEEP_MIN: Duration = Duration::from_micros(1);

/// Whether a missing service is created. Clients only open: after the root was removed, a client that creates would
/// make a second set of services unnoticed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Open {
    Create,
    Existing,
}

/// An error of an iceoryx2 layer, converted to ours.
pub(super) fn failed<E>(what: impl std::fmt::Display, e: E) -> Error
where
    E: std::error::Error + Send + Sync + 'static,
{
    Error::io(format!("{what}: {e}"), e)
}

/// Returns whether the service that could not be opened does not exist: no daemon has created it, or it went with its
/// last user.
pub(super) fn is_away(e: &Error) -> bool {
    let Error::Io { source, .. } = e else {
        return false;
    };
    matches!(
        source.downcast_ref(),
        Some(PublishSubscribeOpenError::DoesNotExist)
    )
}

pub(super) fn node(place: &Place, role: &str) -> Result<Node<Ipc>> {
    node_of::<Ipc>(place, role)
}

pub(super) fn node_of<S: Service>(place: &Place, role: &str) -> Result<Node<S>> {
    let name = format!("sweepd/{}/{role}", place.instance());
    let name = NodeName::new(&name).map_err(|e| failed(format!("node name {name}"), e))?;
    NodeBuilder::new()
        .name(&name)
        .config(&place.config()?)
        // Signals belong to the host program.
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<S>()
        .map_err(|e| {
            let root = place.root();
            let root = root.display();
            failed(format!("no node in {root}, see `sweepd doctor`"), e)
        })
}

pub(super) fn service_name(name: &str) -> Result<ServiceName> {
    ServiceName::new(name).map_err(|e| failed(format!("service name {name}"), e))
}

fn open_slice<T, H>(
    name: &str,
    builder: PubSubBuilder<[T], H, Ipc>,
    open: Open,
) -> Result<PubSub<Ipc, [T], H>>
where
    T: Debug + ZeroCopySend,
    H: Debug + ZeroCopySend,
{
    match open {
        Open::Create => builder.open_or_create().map_err(|e| failed(name, e)),
        Open::Existing => builder.open().map_err(|e| failed(name, e)),
    }
}

/// `transforms` or `transforms_vel`.
///
/// No history: a frame without `sent_ns` that a new daemon gets from an old client's history would look fresh.
pub(super) fn frames<T: Debug + ZeroCopySend>(
    node: &Node<Ipc>,
    place: &Place,
    topic: &str,
    open: Open,
) -> Result<PubSub<Ipc, [T], crate::wire::FrameHeader>> {
    let name = place.service(topic);
    let builder = node
        .service_builder(&service_name(&name)?)
        .publish_subscribe::<[T]>()
        .user_header::<crate::wire::FrameHeader>();
    let builder = match open {
        Open::Existing => builder,
        Open::Create => builder
            .max_publishers(SOURCE_PUBLISHERS_MAX)
            .max_subscribers(SOURCE_SUBSCRIBERS_MAX)
            .subscriber_max_buffer_size(SOURCE_BUFFER)
            .subscriber_max_borrowed_samples(SOURCE_BUFFER)
            .history_size(0)
            .enable_safe_overflow(true)
            .max_nodes(NODES_MAX),
    };
    open_slice(&name, builder, open)
}

/// `vertices`: one message per body. No history, as for frames.
pub(super) fn vertices(
    node: &Node<Ipc>,
    place: &Place,
    open: Open,
) -> Result<PubSub<Ipc, [VertexRow], VertexHeader>> {
    let name = place.service("vertices");
    let builder = node
        .service_builder(&service_name(&name)?)
        .publish_subscribe::<[VertexRow]>()
        .user_header::<VertexHeader>();
    let builder = match open {
        Open::Existing => builder,
        Open::Create => builder
            .max_publishers(SOURCE_PUBLISHERS_MAX)
            .max_subscribers(SOURCE_SUBSCRIBERS_MAX)
            .subscriber_max_buffer_size(VERTEX_BUFFER)
            .subscriber_max_borrowed_samples(VERTEX_BUFFER)
            .history_size(0)
            .enable_safe_overflow(true)
            .max_nodes(NODES_MAX),
    };
    open_slice(&name, builder, open)
}

/// A result message: rows with a [`MessageHeader`]. Late joiners get the newest.
pub(super) fn results<T: Debug + ZeroCopySend>(
    node: &Node<Ipc>,
    place: &Place,
    topic: &str,
    open: Open,
) -> Result<PubSub<Ipc, [T], MessageHeader>> {
    results_under(node, place, (topic, 1), open)
}

/// `changes` or `contact_changes`: rows with a [`ChangesHeader`]. No history: the newest message is useless without
/// those before it.
pub(super) fn changes<T: Debug + ZeroCopySend>(
    node: &Node<Ipc>,
    place: &Place,
    topic: &str,
    open: Open,
) -> Result<PubSub<Ipc, [T], ChangesHeader>> {
    results_under(node, place, (topic, 0), open)
}

/// Rows with a header; `topic` comes with the number of newest messages that late joiners get.
fn results_under<T, H>(
    node: &Node<Ipc>,
    place: &Place,
    (topic, history): (&str, usize),
    open: Open,
) -> Result<PubSub<Ipc, [T], H>>
where
    T: Debug + ZeroCopySend,
    H: Debug + ZeroCopySend,
{
    let name = place.service(topic);
    let builder = node
        .service_builder(&service_name(&name)?)
        .publish_subscribe::<[T]>()
        .user_header::<H>();
    let builder = match open {
        Open::Existing => builder,
        Open::Create => builder
            .max_publishers(RESULT_PUBLISHERS_MAX)
            .max_subscribers(RESULT_SUBSCRIBERS_MAX)
            .subscriber_max_buffer_size(RESULT_BUFFER)
            .subscriber_max_borrowed_samples(RESULT_BORROWED)
            .history_size(history)
            .enable_safe_overflow(true)
            .max_nodes(NODES_MAX),
    };
    open_slice(&name, builder, open)
}

/// `tick`: one row per message.
pub(super) fn ticks(
    node: &Node<Ipc>,
    place: &Place,
    open: Open,
) -> Result<PubSub<Ipc, TickRow, ()>> {
    let name = place.service("tick");
    let builder = node
        .service_builder(&service_name(&name)?)
        .publish_subscribe::<TickRow>();
    match open {
        Open::Existing => builder.open().map_err(|e| failed(name, e)),
        Open::Create => builder
            .max_publishers(RESULT_PUBLISHERS_MAX)
            .max_subscribers(TICK_SUBSCRIBERS_MAX)
            .subscriber_max_buffer_size(RESULT_BUFFER)
            .subscriber_max_borrowed_samples(2)
            .history_size(1)
            .enable_safe_overflow(true)
            .max_nodes(NODES_MAX)
            .open_or_create()
            .map_err(|e| failed(name, e)),
    }
}

/// `hello`: its name and layout never change.
pub(super) fn hellos(
    node: &Node<Ipc>,
    place: &Place,
    open: Open,
) -> Result<PubSub<Ipc, Hello, ()>> {
    let name = place.hello();
    let builder = node
        .service_builder(&service_name(&name)?)
        .publish_subscribe::<Hello>();
    match open {
        Open::Existing => builder.open().map_err(|e| failed(name, e)),
        Open::Create => builder
            .max_publishers(RESULT_PUBLISHERS_MAX)
            .max_subscribers(TICK_SUBSCRIBERS_MAX)
            .subscriber_max_buffer_size(1)
            .subscriber_max_borrowed_samples(1)
            .history_size(1)
            .enable_safe_overflow(true)
            .max_nodes(NODES_MAX)
            .open_or_create()
            .map_err(|e| failed(name, e)),
    }
}

/// `wake` or `ready`.
pub(super) fn event<S: Service>(
    node: &Node<S>,
    place: &Place,
    topic: &str,
    open: Open,
) -> Result<EventFactory<S>> {
    let name = place.service(topic);
    let builder = node.service_builder(&service_name(&name)?).event();
    match open {
        Open::Existing => builder.open().map_err(|e| failed(name, e)),
        Open::Create => builder
            .max_notifiers(NODES_MAX)
            .max_listeners(NODES_MAX)
            .max_nodes(NODES_MAX)
            .event_id_max_value(events::MAX)
            .notifier_dead_event(EventId::new(events::DEAD))
            .notifier_created_event(EventId::new(events::CREATED))
            .notifier_dropped_event(EventId::new(events::DROPPED))
            .open_or_create()
            .map_err(|e| failed(name, e)),
    }
}

/// `requests`: one server, so a second daemon is refused here too.
pub(super) fn requests(node: &Node<Ipc>, place: &Place, open: Open) -> Result<Requests> {
    let name = place.service("requests");
    let builder = node
        .service_builder(&service_name(&name)?)
        .request_response::<[u8], [u8]>()
        .request_user_header::<RequestHeader>()
        .response_user_header::<AnswerHeader>();
    match open {
        Open::Existing => builder.open().map_err(|e| failed(name, e)),
        Open::Create => builder
            .max_servers(1)
            .max_clients(CLIENTS_MAX)
            .max_active_requests_per_client(ACTIVE_REQUESTS)
            .max_response_buffer_size(RESPONSE_BUFFER)
            .max_nodes(NODES_MAX)
            .enable_fire_and_forget_requests(false)
            .open_or_create()
            .map_err(|e| failed(name, e)),
    }
}

/// A publisher of slices that never waits for a reader.
pub(super) fn slice_publisher<T, H>(
    service: &PubSub<Ipc, [T], H>,
    len_start: usize,
    unmet: &Unmet,
) -> Result<Publisher<Ipc, [T], H>>
where
    T: Debug + ZeroCopySend,
    H: Debug + ZeroCopySend,
{
    service
        .publisher_builder()
        .initial_max_slice_len(len_start)
        .allocation_strategy(AllocationStrategy::PowerOfTwo)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .set_degradation_handler(unmet.handler())
        .create()
        .map_err(|e| failed("publisher", e))
}
