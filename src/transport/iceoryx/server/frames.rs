//! Incoming frames: a fair drain, and the sessions whose node is gone.

use std::collections::BTreeMap;
use std::fmt::Debug;

use iceoryx2::port::ReceiveError;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{CallbackProgression, Node, PayloadHeader, PortFactory as _, ZeroCopySend};
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory as PubSub;

use super::Server;
use crate::error::Result;
use crate::time::Clock;
use crate::transport::iceoryx::place::Place;
use crate::transport::iceoryx::qos::{self, Ipc, Open, failed};
use crate::transport::iceoryx::unmet::Unmet;
use crate::wire::{Frame, FrameHeader, Inbox, RejectReason, VertexHeader, VertexRow};

/// Most unreadable messages skipped by one drain: a client that floods with them must not hold it up.
const LOST_MAX: u64 = 64;

/// One of the services that sources send on. Drop order: samples, then the port, then the service.
pub(super) struct In<T, H = FrameHeader>
where
    T: Debug + ZeroCopySend + 'static,
    H: Debug + ZeroCopySend + 'static,
{
    /// Samples of the drain in progress: kept until its end, so that one source gives at most its queue.
    kept: Vec<Sample<Ipc, [T], H>>,
    pub(super) subscriber: Subscriber<Ipc, [T], H>,
    service: PubSub<Ipc, [T], H>,
}

/// Result of a drain: messages, and failed receives.
struct Drained {
    frames: usize,
    errors: u64,
}

/// Data common to all frames of a drain.
#[derive(Clone, Copy)]
struct Stamped {
    now_ns: u64,
    waited: bool,
}

impl Stamped {
    /// Adds a frame with this header to the inbox; returns its session.
    fn take<T>(
        self,
        inbox: &mut Inbox,
        header: FrameHeader,
        rows: Option<&[T]>,
        copy: impl Fn(&mut Frame, &[T]),
    ) -> u64 {
        let frame = inbox.push();
        frame.header = header;
        (frame.received_ns, frame.waited) = (self.now_ns, self.waited);
        match rows {
            Some(rows) => copy(frame, rows),
            None => frame.refused = Some(RejectReason::OverLimit),
        }
        header.session
    }

    fn take_vertices(
        self,
        inbox: &mut Inbox,
        header: VertexHeader,
        rows: Option<&[VertexRow]>,
    ) -> u64 {
        let frame = inbox.push_vertices();
        frame.header = header;
        (frame.received_ns, frame.waited) = (self.now_ns, self.waited);
        match rows {
            Some(rows) => frame.set_rows(rows),
            None => frame.refused = Some(RejectReason::OverLimit),
        }
        header.session
    }
}

impl<T: Debug + ZeroCopySend + 'static> In<T> {
    pub(super) fn open(
        node: &Node<Ipc>,
        place: &Place,
        topic: &str,
        unmet: &Unmet,
    ) -> Result<Self> {
        let service = qos::frames::<T>(node, place, topic, Open::Create)?;
        Self::of(service, topic, unmet)
    }
}

impl In<VertexRow, VertexHeader> {
    pub(super) fn open_vertices(node: &Node<Ipc>, place: &Place, unmet: &Unmet) -> Result<Self> {
        let service = qos::vertices(node, place, Open::Create)?;
        Self::of(service, "vertices", unmet)
    }
}

impl<T, H> In<T, H>
where
    T: Debug + ZeroCopySend + 'static,
    H: Debug + ZeroCopySend + Copy + 'static,
{
    fn of(service: PubSub<Ipc, [T], H>, topic: &str, unmet: &Unmet) -> Result<Self> {
        let subscriber = service
            .subscriber_builder()
            .set_degradation_handler(unmet.handler())
            .create()
            .map_err(|e| failed(topic, e))?;
        Ok(Self {
            kept: Vec::new(),
            subscriber,
            service,
        })
    }

    /// Passes on what is there, header and rows; no rows if there are more than `rows_max`. The samples stay borrowed
    /// until [`Self::release`], so that one source gives at most its queue however often this is called.
    ///
    /// * `take` - yields the session.
    fn drain(
        &mut self,
        rows_max: usize,
        sessions: &mut BTreeMap<u128, u64>,
        mut take: impl FnMut(H, Option<&[T]>) -> u64,
    ) -> Drained {
        let before = self.kept.len();
        let mut errors = 0;
        loop {
            let is_there = self.subscriber.has_samples().unwrap_or(false);
            match self.subscriber.receive() {
                Ok(Some(sample)) => {
                    let header = *sample.user_header();
                    let publisher = sample.header().publisher_id().value();
                    // The count comes from the sender: it is checked before it makes a slice.
                    let rows = usize::try_from(sample.header().number_of_elements());
                    let fits = rows.is_ok_and(|rows| rows <= rows_max);
                    let session = take(header, fits.then(|| sample.payload()));
                    sessions.insert(publisher, session);
                    self.kept.push(sample);
                }
                // A sample in memory that cannot be mapped: iceoryx2 drops it silently, and there are others after it.
                Ok(None) if is_there && errors < LOST_MAX => errors += 1,
                // Every source has given its whole queue: the fair end of a drain.
                Ok(None) | Err(ReceiveError::ExceedsMaxBorrows) => break,
                Err(_) => {
                    errors += 1;
                    break;
                }
            }
        }
        let frames = self.kept.len() - before;
        Drained { frames, errors }
    }

    fn release(&mut self) {
        self.kept.clear();
    }
}

impl Server {
    pub(super) fn take_frames(&mut self, inbox: &mut Inbox, clock: &dyn Clock) {
        let now_ns = clock.boottime_ns();
        // Half a heartbeat of tolerance: a wait that ends at its time-out is not silence.
        let silence_ns = self.options.heartbeat_ns + self.options.heartbeat_ns / 2;
        let waited = self
            .drained_ns
            .is_none_or(|before_ns| now_ns.saturating_sub(before_ns) > silence_ns);
        self.drained_ns = Some(now_ns);
        // Also without a notification: events are lost if a cleaner removed the socket.
        let looked_long_ago = now_ns.saturating_sub(self.looked_ns) > self.options.heartbeat_ns;
        if std::mem::take(&mut self.peers_changed) || looked_long_ago {
            self.looked_ns = now_ns;
            // Before the drain, which then has everything that gone publishers have sent.
            self.note_gone_publishers();
        }
        let known = self.sessions.len();
        let stamp = Stamped { now_ns, waited };
        let Self {
            transforms,
            transforms_vel,
            vertices,
            sessions,
            troubles,
            options,
            ..
        } = self;
        let rows_max = options.frame_rows_max;
        // Two queues, one order: both are read until neither has more, so that everything a source sent before a
        // received frame is received too; then all are sorted by send order.
        let (mut poses, mut motions) = (0, 0);
        loop {
            let of_poses = transforms.drain(rows_max, sessions, |header, rows| {
                stamp.take(inbox, header, rows, Frame::set_transforms)
            });
            let of_motions = transforms_vel.drain(rows_max, sessions, |header, rows| {
                stamp.take(inbox, header, rows, Frame::set_transforms_vel)
            });
            troubles.failed(of_poses.errors + of_motions.errors);
            poses += of_poses.frames;
            motions += of_motions.frames;
            if of_poses.frames + of_motions.frames == 0 {
                break;
            }
        }
        transforms.release();
        transforms_vel.release();
        if poses > 0 && motions > 0 {
            inbox.sort_by_sending();
        }
        // After the frames: vertices are sent before the frame that they belong to, so those of the frames drained
        // above are there.
        let rows_max = crate::limits::DEFORMING_VERTICES_MAX;
        let of_vertices = vertices.drain(rows_max, sessions, |header, rows| {
            stamp.take_vertices(inbox, header, rows)
        });
        vertices.release();
        troubles.failed(of_vertices.errors);
        // Publishers that came and left between the check and the drain must be checked again.
        self.peers_changed |= self.sessions.len() > known;
        self.troubles.tell(now_ns);
        self.end_sessions(inbox);
    }

    fn note_gone_publishers(&mut self) {
        let Self {
            alive,
            gone,
            sessions,
            transforms,
            transforms_vel,
            vertices,
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
        vertices.service.dynamic_config().list_publishers(|p| {
            alive.push(p.publisher_id.value());
            CallbackProgression::Continue
        });
        let there = |publisher: &u128| alive.contains(publisher);
        gone.extend(sessions.keys().filter(|publisher| !there(publisher)));
    }

    fn end_sessions(&mut self, inbox: &mut Inbox) {
        for publisher in self.gone.drain(..) {
            let Some(session) = self.sessions.remove(&publisher) else {
                continue;
            };
            // A client may have a port on several services: its session ends with the last.
            if !self.sessions.values().any(|s| *s == session) {
                inbox.end_session(session);
            }
        }
    }
}
