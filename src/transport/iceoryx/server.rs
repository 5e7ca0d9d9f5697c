//! The daemon's side: opens every service, waits, copies frames in. In: samples. Out: [`Inbox`], [`Demand`].

mod asked;
mod sent;

use std::collections::BTreeMap;
use std::time::Duration;

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::event_id::EventId;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::server::Server as RequestServer;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::{DegradationAction, ReceiveError};
use iceoryx2::prelude::{CallbackProgression, Node, PayloadHeader, PortFactory as _};
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::event::PortFactory as EventFactory;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory as PubSub;

use super::ICEORYX2_VERSION;
use super::lock::{Holder, InstanceLock, RootLock};
use super::place::Place;
use super::qos::{self, Ipc, Open, events, failed};
use crate::error::{Error, Result};
use crate::limits;
use crate::time::Clock;
use crate::transport::{Door, RequestToken, Wake};
use crate::wire::{
    AnswerHeader, BodyRow, ContactRow, Demand, FrameHeader, Hello, Inbox, MessageHeader, NameRow,
    Outbox, PairRow, RejectReason, RequestHeader, TickRow, TransformRow, TransformVelRow,
    WIRE_VERSION,
};

/// Spins of a busy poll between two looks at the wake-up port, whose socket costs a system call.
const SPINS_PER_LOOK: u32 = 256;

/// How a server opens.
#[derive(Clone, Debug)]
pub struct ServerOptions {
    /// Instance and files.
    pub place: Place,
    /// Random number of this start, never 0; in every message.
    pub boot_id: u64,
    /// The daemon's heartbeat, nanoseconds: a longer silence marks the frames found after it as having waited.
    pub heartbeat_ns: u64,
    /// Largest frame, rows.
    pub frame_rows_max: usize,
    /// Spin instead of sleeping: 0.5 us instead of 12 us to wake up, for a core of its own.
    pub busy_poll: bool,
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
            busy_poll: false,
        }
    }
}

/// A result message's service and the daemon's publisher on it. Drop order: the port, then the service.
struct Out<T>
where
    T: std::fmt::Debug + iceoryx2::prelude::ZeroCopySend + 'static,
{
    publisher: Publisher<Ipc, [T], MessageHeader>,
    service: PubSub<Ipc, [T], MessageHeader>,
}

impl<T: std::fmt::Debug + iceoryx2::prelude::ZeroCopySend + 'static> Out<T> {
    fn open(node: &Node<Ipc>, place: &Place, topic: &str) -> Result<Self> {
        let service = qos::results::<T>(node, place, topic, Open::Create)?;
        let publisher = qos::slice_publisher(&service, qos::SLICE_LEN_START)?;
        Ok(Self { publisher, service })
    }

    fn read(&self) -> bool {
        self.service.dynamic_config().number_of_subscribers() > 0
    }
}

/// One of the two frame services. Drop order: samples, then the port, then the service.
struct In<T>
where
    T: std::fmt::Debug + iceoryx2::prelude::ZeroCopySend + 'static,
{
    /// Samples of the drain in progress: kept until its end, so that one source gives at most its queue.
    kept: Vec<Sample<Ipc, [T], FrameHeader>>,
    subscriber: Subscriber<Ipc, [T], FrameHeader>,
    service: PubSub<Ipc, [T], FrameHeader>,
}

type Asked = ActiveRequest<Ipc, [u8], RequestHeader, [u8], AnswerHeader>;

/// The daemon's side of an instance. Not `Send`: open it on the tick thread.
///
/// Fields drop in this order, and the order matters: open requests and ports, then services, then the node, then the
/// locks; a killed process leaves what it had to the clean-up of any other node.
pub struct Server {
    asked: BTreeMap<RequestToken, Asked>,
    answers: RequestServer<Ipc, [u8], RequestHeader, [u8], AnswerHeader>,
    transforms: In<TransformRow>,
    transforms_vel: In<TransformVelRow>,
    wake: Listener<Ipc>,
    ready: Notifier<Ipc>,
    contacts: Out<ContactRow>,
    pairs: Out<PairRow>,
    bodies: Out<BodyRow>,
    body_verdicts: Out<u8>,
    names: Out<NameRow>,
    plan: Out<u8>,
    tick: Publisher<Ipc, TickRow, ()>,
    hello: Publisher<Ipc, Hello, ()>,
    _services: Services,
    _node: Node<Ipc>,
    _root: RootLock,
    _lock: InstanceLock,
    options: ServerOptions,
    /// Publisher ids of each session seen, to tell when its node is gone.
    sessions: BTreeMap<u128, u64>,
    alive: Vec<u128>,
    peers_changed: bool,
    drained_ns: Option<u64>,
    demand: Demand,
    next_token: u64,
    receive_errors: u64,
}

/// Services whose ports are held elsewhere; they stay open as long as the server.
struct Services {
    _requests: qos::Requests,
    _tick: PubSub<Ipc, TickRow, ()>,
    _hello: PubSub<Ipc, Hello, ()>,
    _events: [EventFactory<Ipc>; 2],
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Server")
            .field("options", &self.options)
            .field("open_requests", &self.asked.len())
            .finish_non_exhaustive()
    }
}

impl Server {
    /// Opens every service of the instance and says hello.
    ///
    /// # Errors
    /// `Error::Refused` when the instance is taken, the root is another user's, or clients of a daemon with other
    /// sizes still hold its services; `Error::Io` when shared memory fails.
    pub fn open(options: ServerOptions) -> Result<Self> {
        let place = &options.place;
        place.check_owner()?;
        let lock = InstanceLock::take(place, &holder(&options))?;
        let root = RootLock::hold(place)?;
        let node = qos::node(place, "daemon")?;
        let requests = qos::requests(&node, place, Open::Create).map_err(held)?;
        // one server a service: refuses a second daemon even where the lock file was removed by hand
        let answers = requests
            .server_builder()
            .initial_max_slice_len(qos::REQUEST_LEN_START)
            .allocation_strategy(iceoryx2::prelude::AllocationStrategy::PowerOfTwo)
            .backpressure_strategy(iceoryx2::prelude::BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| refused_twice(place, &e))?;
        let wake = qos::event(&node, place, "wake", Open::Create).map_err(held)?;
        let ready = qos::event(&node, place, "ready", Open::Create).map_err(held)?;
        let tick = qos::ticks(&node, place, Open::Create).map_err(held)?;
        let hello = qos::hellos(&node, place, Open::Create).map_err(held)?;
        let mut server = Self {
            asked: BTreeMap::new(),
            answers,
            transforms: In::open(&node, place, "transforms").map_err(held)?,
            transforms_vel: In::open(&node, place, "transforms_vel").map_err(held)?,
            wake: wake
                .listener_builder()
                .create()
                .map_err(|e| failed("wake", e))?,
            ready: ready
                .notifier_builder()
                .default_event_id(EventId::new(events::SENT))
                .create()
                .map_err(|e| failed("ready", e))?,
            contacts: Out::open(&node, place, "contacts").map_err(held)?,
            pairs: Out::open(&node, place, "pairs").map_err(held)?,
            bodies: Out::open(&node, place, "bodies").map_err(held)?,
            body_verdicts: Out::open(&node, place, "body_verdicts").map_err(held)?,
            names: Out::open(&node, place, "names").map_err(held)?,
            plan: Out::open(&node, place, "plan").map_err(held)?,
            tick: single_publisher(&tick)?,
            hello: single_publisher(&hello)?,
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
            peers_changed: false,
            drained_ns: None,
            demand: Demand::default(),
            next_token: 1,
            receive_errors: 0,
            options,
        };
        server.say_hello()?;
        Ok(server)
    }

    /// Times a receive failed in this boot; the samples behind it are lost (a client's files were tampered with).
    #[must_use]
    pub fn receive_errors(&self) -> u64 {
        self.receive_errors
    }

    fn pending(&self) -> bool {
        let some = |has: std::result::Result<bool, _>| has.unwrap_or(true);
        some(self.transforms.subscriber.has_samples())
            || some(self.transforms_vel.subscriber.has_samples())
            || some(self.answers.has_requests())
    }

    /// Spins until there is something to receive; looks at the wake-up port now and then for who came and left.
    fn spin(&mut self, timeout_ns: u64, clock: &dyn Clock) -> Result<Wake> {
        let until_ns = clock.monotonic_ns().saturating_add(timeout_ns);
        loop {
            for _ in 0..SPINS_PER_LOOK {
                if self.pending() {
                    // drained, so that a later sleep does not wake for what was already taken
                    let mut wake = self.listen(Duration::ZERO)?;
                    wake.notified = true;
                    return Ok(wake);
                }
                std::hint::spin_loop();
            }
            let wake = self.listen(Duration::ZERO)?;
            if wake != Wake::default() || clock.monotonic_ns() >= until_ns {
                return Ok(wake);
            }
        }
    }

    fn listen(&mut self, timeout: Duration) -> Result<Wake> {
        let mut wake = Wake::default();
        let note = |activation: iceoryx2::port::EventActivation| match activation.id.as_value() {
            events::DEAD | events::CREATED | events::DROPPED => wake.peers_changed = true,
            _ => wake.notified = true,
        };
        let heard = if timeout.is_zero() {
            self.wake.try_wait(note)
        } else {
            self.wake.timed_wait(note, timeout)
        };
        match heard {
            Ok(_) => {}
            Err(iceoryx2::port::listener::ListenerWaitError::InterruptSignal) => {
                wake.interrupted = true;
            }
            Err(e) => return Err(failed("wake", e)),
        }
        self.peers_changed |= wake.peers_changed;
        Ok(wake)
    }

    /// The publishers that are there now, before the drain: what a gone one has sent is in the drain that follows.
    fn list_publishers(&mut self) {
        let Self {
            alive,
            transforms,
            transforms_vel,
            ..
        } = self;
        alive.clear();
        transforms.service.dynamic_config().list_publishers(|p| {
            alive.push(p.publisher_id.value());
            CallbackProgression::Continue
        });
        transforms_vel
            .service
            .dynamic_config()
            .list_publishers(|p| {
                alive.push(p.publisher_id.value());
                CallbackProgression::Continue
            });
    }

    fn end_sessions(&mut self, inbox: &mut Inbox) {
        let Self {
            sessions, alive, ..
        } = self;
        let mut gone = Vec::new();
        sessions.retain(|publisher, session| {
            let there = alive.contains(publisher);
            if !there {
                gone.push(*session);
            }
            there
        });
        for session in gone {
            // a client may have had a port on both services
            if !sessions.values().any(|s| *s == session) && !inbox.ended().contains(&session) {
                inbox.end_session(session);
            }
        }
    }
}

impl Door for Server {
    fn wait(&mut self, timeout_ns: u64, clock: &dyn Clock) -> Result<Wake> {
        let wake = if self.options.busy_poll {
            self.spin(timeout_ns, clock)?
        } else {
            self.listen(Duration::from_nanos(timeout_ns))?
        };
        // who just came gets the newest state now, not at the next tick
        if wake.peers_changed {
            self.update_connections();
        }
        Ok(wake)
    }

    fn receive(&mut self, inbox: &mut Inbox, clock: &dyn Clock) {
        let now_ns = clock.boottime_ns();
        // half a heartbeat of slack: a wait that ends at its time-out is not silence
        let silence_ns = self.options.heartbeat_ns + self.options.heartbeat_ns / 2;
        let waited = self
            .drained_ns
            .is_none_or(|before_ns| now_ns.saturating_sub(before_ns) > silence_ns);
        self.drained_ns = Some(now_ns);
        // also without a notice: events are lost where a cleaner removed the socket
        let look = self.peers_changed || waited;
        if look {
            self.peers_changed = false;
            self.list_publishers();
        }
        let stamp = Stamped {
            now_ns,
            waited,
            rows_max: self.options.frame_rows_max,
        };
        let Self {
            transforms,
            transforms_vel,
            sessions,
            receive_errors,
            ..
        } = self;
        *receive_errors += transforms.drain(inbox, &stamp, sessions, |frame, rows| {
            frame.set_transforms(rows);
        });
        *receive_errors += transforms_vel.drain(inbox, &stamp, sessions, |frame, rows| {
            frame.set_transforms_vel(rows);
        });
        if look {
            self.end_sessions(inbox);
        }
    }

    fn demand(&mut self) -> Demand {
        self.demand = Demand {
            pairs: self.pairs.read(),
            contacts: self.contacts.read(),
            bodies: self.bodies.read(),
            body_verdicts: self.body_verdicts.read(),
        };
        self.demand
    }

    fn publish(&mut self, outbox: &Outbox) -> Result<u64> {
        self.send_all(outbox)
    }

    fn publish_tick(&mut self, tick: &TickRow) -> Result<()> {
        self.send_tick(tick)
    }

    fn requests(&mut self, take: &mut dyn FnMut(RequestToken, RequestHeader, &[u8])) {
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

/// What is the same for every frame of a drain.
struct Stamped {
    now_ns: u64,
    waited: bool,
    rows_max: usize,
}

impl<T: std::fmt::Debug + iceoryx2::prelude::ZeroCopySend + 'static> In<T> {
    fn open(node: &Node<Ipc>, place: &Place, topic: &str) -> Result<Self> {
        let service = qos::frames::<T>(node, place, topic, Open::Create)?;
        let subscriber = service
            .subscriber_builder()
            // one source with broken files must not silence the others
            .set_degradation_handler(|_, _| DegradationAction::Ignore)
            .create()
            .map_err(|e| failed(topic, e))?;
        Ok(Self {
            kept: Vec::new(),
            subscriber,
            service,
        })
    }

    /// Copies what is there into the inbox.
    ///
    /// * returns - receives that failed.
    fn drain(
        &mut self,
        inbox: &mut Inbox,
        stamp: &Stamped,
        sessions: &mut BTreeMap<u128, u64>,
        copy: impl Fn(&mut crate::wire::Frame, &[T]),
    ) -> u64 {
        let mut errors = 0;
        loop {
            match self.subscriber.receive() {
                Ok(Some(sample)) => {
                    let header = *sample.user_header();
                    let publisher = sample.header().publisher_id().value();
                    sessions.insert(publisher, header.session);
                    let frame = inbox.push();
                    frame.header = header;
                    frame.received_ns = stamp.now_ns;
                    frame.waited = stamp.waited;
                    // the count is the sender's word: checked before it makes a slice
                    let rows = usize::try_from(sample.header().number_of_elements());
                    if rows.is_ok_and(|rows| rows <= stamp.rows_max) {
                        copy(frame, sample.payload());
                    } else {
                        frame.refused = Some(RejectReason::OverLimit);
                    }
                    self.kept.push(sample);
                }
                // every source has given its whole queue: the fair end of a drain
                Ok(None) | Err(ReceiveError::ExceedsMaxBorrows) => break,
                Err(_) => {
                    errors += 1;
                    break;
                }
            }
        }
        self.kept.clear();
        errors
    }
}

fn single_publisher<T>(service: &PubSub<Ipc, T, ()>) -> Result<Publisher<Ipc, T, ()>>
where
    T: std::fmt::Debug + iceoryx2::prelude::ZeroCopySend,
{
    service
        .publisher_builder()
        .backpressure_strategy(iceoryx2::prelude::BackpressureStrategy::DiscardData)
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

/// A service that is there but does not fit was made by another version, and clients hold it open.
fn held(e: Error) -> Error {
    Error::Refused(format!(
        "{e}; if clients of another sweepd version are still running, end them and try again"
    ))
}

fn refused_twice(place: &Place, e: &dyn std::fmt::Display) -> Error {
    Error::Refused(format!(
        "instance `{}` is taken: another daemon answers its requests ({e}); end it, or choose another name with \
         --instance",
        place.instance()
    ))
}
