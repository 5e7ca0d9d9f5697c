//! The daemon's side: opens every service, waits, copies frames in. In: samples. Out: [`Inbox`], [`Demand`].

mod asked;
mod frames;
mod owed;
mod readers;
mod sent;
mod troubles;
mod waiting;

use std::collections::BTreeMap;
use std::fmt::Debug;

use asked::Arrivals;
use frames::In;
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::event_id::EventId;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::server::Server as RequestServer;
use iceoryx2::prelude::{
    AllocationStrategy, BackpressureStrategy, Node, PortFactory as _, SignalHandlingMode,
    ZeroCopySend,
};
use iceoryx2::service::port_factory::event::PortFactory as EventFactory;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory as PubSub;
use iceoryx2::waitset::{WaitSet, WaitSetBuilder};
use readers::Changes;
use troubles::Troubles;

use super::leftovers::{leftovers, unreaped_by};
use super::lock::{Holder, InstanceLock, RootLock};
use super::place::Place;
use super::process::process;
use super::qos::{self, Ipc, Open, events, failed};
use super::room::check_limits;
use super::unfinished::take_over;
use super::unmet::Unmet;
use crate::error::{Error, Result};
use crate::limits;
use crate::time::Clock;
use crate::transport::patience::Patience;
use crate::transport::{Door, ICEORYX2_VERSION, RequestToken, Wake};
use crate::wire::{
    AnswerHeader, BodyRow, ContactRow, Demand, Hello, Inbox, MessageHeader, NameRow, Outbox,
    PairRow, RegionRow, RequestHeader, TickRow, TransformRow, TransformVelRow, Undelivered,
    VertexHeader, VertexRow, WIRE_VERSION,
};

/// Options for opening a server.
#[derive(Clone, Debug)]
pub struct ServerOptions {
    /// Instance and files.
    pub place: Place,
    /// Random number of this start, never 0; in every message.
    pub boot_id: u64,
    /// The daemon's heartbeat, nanoseconds: frames found after a longer silence are marked as having waited.
    pub heartbeat_ns: u64,
    /// Largest frame, rows.
    pub frame_rows_max: usize,
    /// How long a wait spins before it sleeps, nanoseconds; `u64::MAX`: it never sleeps. Spinning finds a message in
    /// 0.5 us, waking from a sleep takes 10 to 25 us.
    pub spin_ns: u64,
}

impl ServerOptions {
    /// The usual options for a place.
    #[must_use]
    pub fn new(place: Place, boot_id: u64) -> Self {
        Self {
            place,
            boot_id,
            heartbeat_ns: limits::HEARTBEAT_MS_DEFAULT * 1_000_000,
            frame_rows_max: limits::FRAME_ROWS_MAX,
            spin_ns: crate::transport::spin_default_ns(),
        }
    }
}

/// A result message's service and the daemon's publisher on it. Drop order: the port, then the service.
struct Out<T, H = MessageHeader>
where
    T: Debug + ZeroCopySend + 'static,
    H: Debug + ZeroCopySend + 'static,
{
    publisher: Publisher<Ipc, [T], H>,
    service: PubSub<Ipc, [T], H>,
}

impl<T: Debug + ZeroCopySend + 'static> Out<T> {
    fn open(node: &Node<Ipc>, place: &Place, topic: &str, unmet: &Unmet) -> Result<Self> {
        Self::of(qos::results(node, place, topic, Open::Create)?, unmet)
    }
}

impl<T, H> Out<T, H>
where
    T: Debug + ZeroCopySend + 'static,
    H: Debug + ZeroCopySend + Copy + Default + 'static,
{
    fn of(service: PubSub<Ipc, [T], H>, unmet: &Unmet) -> Result<Self> {
        let publisher = qos::slice_publisher(&service, qos::SLICE_LEN_START, unmet)?;
        Ok(Self { publisher, service })
    }

    fn read(&self) -> bool {
        self.service.dynamic_config().number_of_subscribers() > 0
    }
}

type Asked = ActiveRequest<Ipc, [u8], RequestHeader, [u8], AnswerHeader>;

/// The daemon's side of an instance. Not `Send`: open it on the tick thread.
///
/// Fields drop in this order, and the order matters: open requests and ports, then services, then the node, then the
/// locks; what a killed process leaves is cleaned up by any other node.
pub struct Server {
    arrivals: Arrivals,
    asked: BTreeMap<RequestToken, Asked>,
    answers: RequestServer<Ipc, [u8], RequestHeader, [u8], AnswerHeader>,
    transforms: In<TransformRow>,
    transforms_vel: In<TransformVelRow>,
    vertices: In<VertexRow, VertexHeader>,
    wake: Listener<Ipc>,
    /// For sleeping; holds a port only during a sleep.
    sleeper: WaitSet<Ipc>,
    ready: Notifier<Ipc>,
    contacts: Out<ContactRow>,
    regions: Out<RegionRow>,
    pairs: Out<PairRow>,
    changes: Changes<PairRow>,
    contact_changes: Changes<ContactRow>,
    bodies: Out<BodyRow>,
    body_verdicts: Out<u8>,
    names: Out<NameRow>,
    names_owed: bool,
    /// Begins, with their ends, that were never sent because the messages of both reached no reader.
    cancelled: u64,
    plan: Out<u8>,
    plan_owed: bool,
    tick: Publisher<Ipc, TickRow, ()>,
    hello: Publisher<Ipc, Hello, ()>,
    _services: Services,
    _node: Node<Ipc>,
    _root: RootLock,
    _lock: InstanceLock,
    options: ServerOptions,
    /// Session of each publisher id seen, to detect when its node is gone.
    sessions: BTreeMap<u128, u64>,
    /// Publishers at the last check, and those that it found gone.
    alive: Vec<u128>,
    gone: Vec<u128>,
    looked_ns: u64,
    peers_changed: bool,
    drained_ns: Option<u64>,
    /// When the wake-up port was last checked, monotonic.
    listened_ns: u64,
    patience: Patience,
    demand: Demand,
    next_token: u64,
    troubles: Troubles,
}

/// Services whose ports are held elsewhere; they stay open as long as the server.
struct Services {
    _requests: qos::Requests,
    _tick: PubSub<Ipc, TickRow, ()>,
    _hello: PubSub<Ipc, Hello, ()>,
    _events: [EventFactory<Ipc>; 2],
}

impl Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Server")
            .field("options", &self.options)
            .field("open_requests", &self.asked.len())
            .finish_non_exhaustive()
    }
}

impl Server {
    /// Opens every service of the instance and sends hello.
    ///
    /// # Errors
    /// `Error::Refused` when the instance is taken, the root is another user's, or clients of a daemon with other
    /// sizes still hold its services; `Error::Io` when shared memory fails.
    pub fn open(options: ServerOptions) -> Result<Self> {
        let (place, troubles) = (&options.place, Troubles::default());
        place.check_owner()?;
        check_limits()?;
        let lock = InstanceLock::take(place, &holder(&options))?;
        let root = RootLock::hold(place)?;
        let node = take_over(place)?;
        let unmet = &troubles.unmet;
        let requests = qos::requests(&node, place, Open::Create).map_err(held)?;
        // One server per service: refuses a second daemon even if the lock file was removed by hand.
        let answers = requests
            .server_builder()
            .initial_max_slice_len(qos::REQUEST_LEN_START)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .set_request_degradation_handler(unmet.handler())
            .set_response_degradation_handler(unmet.handler())
            .create()
            .map_err(|e| refused_twice(place, &e))?;
        let wake = qos::event(&node, place, "wake", Open::Create).map_err(held)?;
        let ready = qos::event(&node, place, "ready", Open::Create).map_err(held)?;
        let tick = qos::ticks(&node, place, Open::Create).map_err(held)?;
        let hello = qos::hellos(&node, place, Open::Create).map_err(held)?;
        let mut server = Self {
            arrivals: Arrivals::default(),
            asked: BTreeMap::new(),
            answers,
            transforms: In::open(&node, place, "transforms", unmet).map_err(held)?,
            transforms_vel: In::open(&node, place, "transforms_vel", unmet).map_err(held)?,
            vertices: In::open_vertices(&node, place, unmet).map_err(held)?,
            wake: wake
                .listener_builder()
                .create()
                .map_err(|e| failed("wake", e))?,
            sleeper: WaitSetBuilder::new()
                .signal_handling_mode(SignalHandlingMode::Disabled)
                .create()
                .map_err(|e| failed("wake", e))?,
            ready: ready
                .notifier_builder()
                .default_event_id(EventId::new(events::SENT))
                .create()
                .map_err(|e| failed("ready", e))?,
            contacts: Out::open(&node, place, "contacts", unmet).map_err(held)?,
            regions: Out::open(&node, place, "regions", unmet).map_err(held)?,
            pairs: Out::open(&node, place, "pairs", unmet).map_err(held)?,
            changes: Changes::open(&node, place, "changes", unmet).map_err(held)?,
            contact_changes: Changes::open(&node, place, "contact_changes", unmet).map_err(held)?,
            bodies: Out::open(&node, place, "bodies", unmet).map_err(held)?,
            body_verdicts: Out::open(&node, place, "body_verdicts", unmet).map_err(held)?,
            names: Out::open(&node, place, "names", unmet).map_err(held)?,
            names_owed: false,
            cancelled: 0,
            plan: Out::open(&node, place, "plan", unmet).map_err(held)?,
            plan_owed: false,
            tick: single_publisher(&tick, unmet)?,
            hello: single_publisher(&hello, unmet)?,
            _services: Services {
                _requests: requests,
                _tick: tick,
                _hello: hello,
                _events: [wake, ready],
            },
            _node: node,
            _root: root,
            _lock: lock,
            sessions: BTreeMap::new(),
            alive: Vec::new(),
            gone: Vec::new(),
            looked_ns: 0,
            peers_changed: false,
            drained_ns: None,
            listened_ns: 0,
            patience: Patience::new(options.spin_ns),
            demand: Demand::default(),
            next_token: 1,
            troubles,
            options,
        };
        server.say_hello()?;
        Ok(server)
    }
}

impl Door for Server {
    fn wait(&mut self, timeout_ns: u64, clock: &dyn Clock) -> Result<Wake> {
        let wake = self.spin_then_sleep(timeout_ns, clock)?;
        // A new client gets the newest state now, not at the next tick.
        if wake.peers_changed {
            self.update_connections();
        }
        Ok(wake)
    }

    fn receive(&mut self, inbox: &mut Inbox, clock: &dyn Clock) {
        self.take_frames(inbox, clock);
    }

    fn demand(&mut self) -> Demand {
        let (changes, pairs_owed) = self.changes.look();
        let (contact_changes, contacts_owed) = self.contact_changes.look();
        self.demand = Demand {
            changes,
            contact_changes,
            changes_anew: pairs_owed || contacts_owed,
            pairs: self.pairs.read(),
            contacts: self.contacts.read(),
            regions: self.regions.read(),
            bodies: self.bodies.read(),
            body_verdicts: self.body_verdicts.read(),
        };
        self.demand
    }

    fn publish(&mut self, outbox: &Outbox) -> Result<Undelivered> {
        self.send_all(outbox)
    }

    fn publish_tick(&mut self, tick: &TickRow) -> Result<()> {
        self.send_tick(tick)
    }

    fn requests(&mut self, take: &mut dyn FnMut(RequestToken, RequestHeader, Vec<u8>)) {
        self.take_requests(take);
    }

    fn answer(&mut self, token: RequestToken, ok: bool, json: &str) -> Result<()> {
        self.send_answer(token, ok, json)
    }

    fn housekeeping(&mut self) {
        self.update_connections();
        self.asked.retain(|_, request| request.is_connected());
    }
}

fn single_publisher<T>(service: &PubSub<Ipc, T, ()>, unmet: &Unmet) -> Result<Publisher<Ipc, T, ()>>
where
    T: Debug + ZeroCopySend,
{
    service
        .publisher_builder()
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .set_degradation_handler(unmet.handler())
        .create()
        .map_err(|e| failed("publisher", e))
}

fn holder(options: &ServerOptions) -> Holder {
    Holder {
        pid: std::process::id(),
        boot_id: options.boot_id,
        wire_version: WIRE_VERSION,
        sweepd_version: env!("CARGO_PKG_VERSION").to_owned(),
        iceoryx2_version: ICEORYX2_VERSION.to_owned(),
    }
}

/// A service that exists but does not fit was created by another version, and clients hold it open.
fn held(e: Error) -> Error {
    match e {
        Error::Io { message, .. } => Error::Refused(format!(
            "{message}; if clients of another sweepd version are still running, end them and try again"
        )),
        other => other,
    }
}

/// The lock was free, but another process serves the instance.
fn refused_twice(place: &Place, e: &dyn std::fmt::Display) -> Error {
    let name = format!("sweepd/{}/daemon", place.instance());
    let alive = leftovers(place).map_or_else(|_| Vec::new(), |left| left.alive);
    let mut ours = alive.iter().filter(|node| node.name == name);
    match ours.find_map(|node| Some((node.pid, unreaped_by(node)?))) {
        Some((pid, parent)) => unreaped(place.instance(), pid, parent),
        None => Error::Refused(format!(
            "instance `{}` is taken: another daemon answers its requests ({e}); end it, or choose another name with \
             --instance",
            place.instance()
        )),
    }
}

/// There is no process to end: it has ended, and the kernel keeps it for its parent.
fn unreaped(instance: &str, pid: u32, parent: u32) -> Error {
    let named = process(parent).map_or_else(String::new, |parent| format!(" ({})", parent.name));
    Error::Refused(format!(
        "instance `{instance}`: process {pid} had it and has ended, but counts as alive until its parent \
         {parent}{named} waits for it; end the parent (of a container: restart it), and start daemons under one that \
         waits: a shell, systemd, `docker run --init`"
    ))
}

#[cfg(test)]
mod tests;
