//! A client's ports over shared memory. It only opens what a daemon has created.

mod answers;
mod news;
mod read;
mod send;
mod why;

use std::time::Duration;

use iceoryx2::port::client::Client as RequestClient;
use iceoryx2::port::listener::{Listener, ListenerWaitError};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{AllocationStrategy, EventId, ZeroCopySend};

use answers::{Pending, next_answer};
use news::{News, Spot};
use read::{Reader, read};
use send::send_frame;
use why::{not_found, of_another_version, opened, out_of_files};

use super::place::Place;
use super::qos::{self, Ipc, Open, SLEEP_MIN, events, failed};
use super::room::check_client_room;
use super::unmet::Unmet;
use crate::error::{Error, Result};
use crate::limits;
use crate::time::Clock;
use crate::transport::client::{Link, Message, Rows, Topics};
use crate::transport::open_files::check_client;
use crate::wire::{
    AnswerHeader, BodyRow, ChangesHeader, ContactRow, FrameHeader, Hello, MessageHeader, NameRow,
    PairRow, RegionRow, RequestHeader, TickRow, TransformRow, TransformVelRow, VertexHeader,
    VertexRow,
};

/// Time between two attempts to find a daemon.
const RETRY: Duration = Duration::from_millis(50);
/// A longer plan is invalid, bytes.
const PLAN_BYTES_MAX: usize = 1 << 24;

type Sender<T> = Option<Publisher<Ipc, [T], FrameHeader>>;
type Asker = RequestClient<Ipc, [u8], RequestHeader, [u8], AnswerHeader>;

/// A client's ports over shared memory. Not `Send`.
///
/// Ports keep their services open; all are dropped before the node (field order).
pub struct IoxLink {
    pending: Vec<Pending>,
    requests: Option<Asker>,
    transforms: Sender<TransformRow>,
    transforms_vel: Sender<TransformVelRow>,
    vertices: Option<Publisher<Ipc, [VertexRow], VertexHeader>>,
    wake: Notifier<Ipc>,
    ready: Listener<Ipc>,
    tick: Subscriber<Ipc, TickRow, ()>,
    hello: Subscriber<Ipc, Hello, ()>,
    pairs: Reader<PairRow>,
    changes: News<PairRow>,
    contact_changes: News<ContactRow>,
    contacts: Reader<ContactRow>,
    regions: Reader<RegionRow>,
    bodies: Reader<BodyRow>,
    body_verdicts: Reader<u8>,
    names: Reader<NameRow>,
    plan: Reader<u8>,
    spot: Spot,
}

impl std::fmt::Debug for IoxLink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("IoxLink")
            .field("place", &self.spot.place)
            .finish_non_exhaustive()
    }
}

impl IoxLink {
    /// Opens the instance's services, retrying until they are there or `until_ns` (monotonic) is reached.
    ///
    /// # Errors
    /// `Error::Refused` when the files are another user's or of another iceoryx2, the daemon speaks another wire
    /// version, this process may open too few files, or shared memory is full;
    /// `Error::TimedOut` otherwise.
    pub fn open(place: &Place, clock: &dyn Clock, until_ns: u64) -> Result<Self> {
        check_client()?;
        check_client_room()?;
        loop {
            // A node of ours would create a missing root, which only the daemon should.
            let tried = if place.check_owner()? {
                Self::try_open(place)
            } else {
                Err(Error::TimedOut(format!(
                    "{} is missing",
                    place.root().display()
                )))
            };
            let why = match tried {
                Ok(link) => return Ok(link),
                Err(refused @ Error::Refused(_)) => return Err(refused),
                Err(why) => why,
            };
            if clock.monotonic_ns() >= until_ns {
                return Err(not_found(place, &why));
            }
            std::thread::park_timeout(RETRY);
        }
    }

    fn try_open(place: &Place) -> Result<Self> {
        let unmet = Unmet::default();
        let node = qos::node(place, "client")?;
        let hello = qos::hellos(&node, place, Open::Existing)?
            .subscriber_builder()
            .set_degradation_handler(unmet.handler())
            .create()
            .map_err(|e| failed("hello", e))?;
        let tick = qos::ticks(&node, place, Open::Existing)
            .map_err(|why| of_another_version(&hello, why))?
            .subscriber_builder()
            .set_degradation_handler(unmet.handler())
            .create()
            .map_err(|e| failed("tick", e))?;
        let ready = qos::event(&node, place, "ready", Open::Existing)?
            .listener_builder()
            .create()
            .map_err(|e| failed("ready", e))?;
        // Last: its creation wakes the daemon, which then sends us the newest hello and tick.
        let wake = qos::event(&node, place, "wake", Open::Existing)?
            .notifier_builder()
            .default_event_id(EventId::new(events::SENT))
            .create()
            .map_err(|e| failed("wake", e))?;
        Ok(Self {
            pending: Vec::new(),
            requests: None,
            transforms: None,
            transforms_vel: None,
            vertices: None,
            wake,
            ready,
            tick,
            hello,
            pairs: None,
            changes: News::new("changes"),
            contact_changes: News::new("contact_changes"),
            contacts: None,
            regions: None,
            bodies: None,
            body_verdicts: None,
            names: None,
            plan: None,
            spot: Spot {
                unmet,
                node,
                place: place.clone(),
            },
        })
    }

    /// Fails if this client's connections could not be made because it may not open enough files: nothing else would
    /// show it.
    fn check_met(&self) -> Result<()> {
        match self.spot.unmet.take() {
            0 => Ok(()),
            _ => out_of_files().map_or(Ok(()), Err),
        }
    }

    fn wake(&self, event: usize) {
        // A daemon that is away is no error: it finds what was sent when it is back.
        let _nobody_there = self.wake.notify_with_custom_event_id(EventId::new(event));
    }

    fn reader<T: std::fmt::Debug + ZeroCopySend>(
        &self,
        topic: &str,
    ) -> Result<Subscriber<Ipc, [T], MessageHeader>> {
        let open = || {
            qos::results::<T>(&self.spot.node, &self.spot.place, topic, Open::Existing)?
                .subscriber_builder()
                .set_degradation_handler(self.spot.unmet.handler())
                .create()
                .map_err(|e| failed(topic, e))
        };
        opened(open())
    }

    fn sender<T: std::fmt::Debug + ZeroCopySend>(
        &self,
        topic: &str,
        rows: usize,
    ) -> Result<Publisher<Ipc, [T], FrameHeader>> {
        let service = opened(qos::frames::<T>(
            &self.spot.node,
            &self.spot.place,
            topic,
            Open::Existing,
        ))?;
        // Room for the first frame: a sample sent right after a growth is lost if its sender ends before it is mapped.
        let rows = rows.max(qos::SLICE_LEN_START);
        opened(qos::slice_publisher(&service, rows, &self.spot.unmet))
    }
}

impl Link for IoxLink {
    fn subscribe(&mut self, topics: Topics) -> Result<()> {
        if topics.pairs && self.pairs.is_none() {
            self.pairs = Some(self.reader("pairs")?);
        }
        if topics.changes {
            self.changes.open(&self.spot)?;
        }
        if topics.contact_changes {
            self.contact_changes.open(&self.spot)?;
        }
        if topics.contacts && self.contacts.is_none() {
            self.contacts = Some(self.reader("contacts")?);
        }
        if topics.regions && self.regions.is_none() {
            self.regions = Some(self.reader("regions")?);
        }
        if topics.bodies && self.bodies.is_none() {
            self.bodies = Some(self.reader("bodies")?);
        }
        if topics.body_verdicts && self.body_verdicts.is_none() {
            self.body_verdicts = Some(self.reader("body_verdicts")?);
        }
        if topics.names && self.names.is_none() {
            self.names = Some(self.reader("names")?);
        }
        if topics.plan && self.plan.is_none() {
            self.plan = Some(self.reader("plan")?);
        }
        // The daemon then sends us the newest names and plan.
        self.wake(events::CREATED);
        self.check_met()
    }

    fn send(&mut self, header: &FrameHeader, rows: Rows<'_>) -> Result<()> {
        match rows {
            Rows::Poses(rows) => {
                if self.transforms.is_none() {
                    self.transforms = Some(self.sender("transforms", rows.len())?);
                }
                if let Some(port) = &self.transforms {
                    send_frame(port, header, rows)?;
                }
            }
            Rows::Moving(rows) => {
                if self.transforms_vel.is_none() {
                    self.transforms_vel = Some(self.sender("transforms_vel", rows.len())?);
                }
                if let Some(port) = &self.transforms_vel {
                    send_frame(port, header, rows)?;
                }
            }
        }
        self.wake(events::SENT);
        self.check_met()
    }

    fn send_vertices(&mut self, header: &VertexHeader, rows: &[VertexRow]) -> Result<()> {
        if self.vertices.is_none() {
            let service = qos::vertices(&self.spot.node, &self.spot.place, Open::Existing)?;
            let rows = rows.len().max(qos::SLICE_LEN_START);
            self.vertices = Some(qos::slice_publisher(&service, rows, &self.spot.unmet)?);
        }
        if let Some(port) = &self.vertices {
            send_frame(port, header, rows)?;
        }
        // No wake-up: the frame that they belong to comes next.
        Ok(())
    }

    fn wait(&mut self, timeout_ns: u64) -> Result<()> {
        self.check_met()?;
        let timeout = Duration::from_nanos(timeout_ns);
        let heard = if timeout < SLEEP_MIN {
            self.ready.try_wait(|_| {})
        } else {
            self.ready.timed_wait(|_| {}, timeout)
        };
        match heard {
            Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
            Err(e) => Err(failed("ready", e)),
        }
    }

    fn tick(&mut self) -> Result<Option<TickRow>> {
        let sample = self.tick.receive().map_err(|e| failed("tick", e))?;
        Ok(sample.map(|sample| *sample.payload()))
    }

    fn pairs(&mut self, into: &mut Message<PairRow>) -> Result<bool> {
        read(&self.pairs, limits::ROWS_MAX, into)
    }

    fn changes(&mut self, into: &mut Message<PairRow, ChangesHeader>) -> Result<bool> {
        if self.changes.owed {
            self.renew_changes()?;
        }
        self.changes.read(into)
    }

    fn renew_changes(&mut self) -> Result<()> {
        if self.changes.renew(&self.spot)? {
            self.wake(events::CREATED);
        }
        Ok(())
    }

    fn contact_changes(&mut self, into: &mut Message<ContactRow, ChangesHeader>) -> Result<bool> {
        if self.contact_changes.owed {
            self.renew_contact_changes()?;
        }
        self.contact_changes.read(into)
    }

    fn renew_contact_changes(&mut self) -> Result<()> {
        if self.contact_changes.renew(&self.spot)? {
            self.wake(events::CREATED);
        }
        Ok(())
    }

    fn contacts(&mut self, into: &mut Message<ContactRow>) -> Result<bool> {
        read(&self.contacts, limits::ROWS_MAX, into)
    }

    fn regions(&mut self, into: &mut Message<RegionRow>) -> Result<bool> {
        read(&self.regions, limits::ROWS_MAX, into)
    }

    fn bodies(&mut self, into: &mut Message<BodyRow>) -> Result<bool> {
        read(&self.bodies, limits::BODIES_MAX, into)
    }

    fn body_verdicts(&mut self, into: &mut Message<u8>) -> Result<bool> {
        read(&self.body_verdicts, limits::BODIES_MAX, into)
    }

    fn names(&mut self, into: &mut Message<NameRow>) -> Result<bool> {
        read(&self.names, limits::BODIES_MAX, into)
    }

    fn plan(&mut self, into: &mut Message<u8>) -> Result<bool> {
        read(&self.plan, PLAN_BYTES_MAX, into)
    }

    fn hello(&mut self) -> Result<Option<Hello>> {
        let mut newest = None;
        while let Some(sample) = self.hello.receive().map_err(|e| failed("hello", e))? {
            newest = Some(*sample.payload());
        }
        Ok(newest)
    }

    fn request(&mut self, header: &RequestHeader, json: &[u8], blobs: &[&[u8]]) -> Result<()> {
        let len = json.len() + blobs.iter().map(|b| b.len()).sum::<usize>();
        if self.requests.is_none() {
            let port = qos::requests(&self.spot.node, &self.spot.place, Open::Existing)?
                .client_builder()
                .initial_max_slice_len(len.max(qos::REQUEST_LEN_START))
                .allocation_strategy(AllocationStrategy::PowerOfTwo)
                .create()
                .map_err(|e| failed("requests", e))?;
            self.requests = Some(port);
        }
        let Some(port) = &self.requests else {
            return Ok(());
        };
        // Requests whose answers can no longer come free their place.
        self.pending.retain(Pending::is_connected);
        let mut request = port
            .loan_slice_uninit(len)
            .map_err(|e| failed("request", e))?;
        *request.user_header_mut() = *header;
        let mut bytes = json.iter().chain(blobs.iter().flat_map(|blob| blob.iter()));
        let request = request.write_from_fn(|_| bytes.next().copied().unwrap_or(0));
        self.pending
            .push(request.send().map_err(|e| failed("request", e))?);
        self.wake(events::ASKED);
        Ok(())
    }

    fn answer(&mut self, into: &mut Vec<u8>) -> Result<Option<AnswerHeader>> {
        next_answer(&mut self.pending, into)
    }
}
