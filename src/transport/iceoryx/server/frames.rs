//! Frames in: a fair drain, and the sessions whose node is gone.

use std::collections::BTreeMap;
use std::fmt::Debug;

use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::{DegradationAction, ReceiveError};
use iceoryx2::prelude::{CallbackProgression, Node, PayloadHeader, PortFactory as _, ZeroCopySend};
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory as PubSub;

use super::Server;
use crate::error::Result;
use crate::time::Clock;
use crate::transport::iceoryx::place::Place;
use crate::transport::iceoryx::qos::{self, Ipc, Open, failed};
use crate::wire::{Frame, FrameHeader, Inbox, RejectReason};

/// One of the two frame services. Drop order: samples, then the port, then the service.
pub(super) struct In<T>
where
    T: Debug + ZeroCopySend + 'static,
{
    /// Samples of the drain in progress: kept until its end, so that one source gives at most its queue.
    kept: Vec<Sample<Ipc, [T], FrameHeader>>,
    pub(super) subscriber: Subscriber<Ipc, [T], FrameHeader>,
    service: PubSub<Ipc, [T], FrameHeader>,
}

/// What is the same for every frame of a drain.
struct Stamped {
    now_ns: u64,
    waited: bool,
    rows_max: usize,
}

impl<T: Debug + ZeroCopySend + 'static> In<T> {
    pub(super) fn open(node: &Node<Ipc>, place: &Place, topic: &str) -> Result<Self> {
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
        copy: impl Fn(&mut Frame, &[T]),
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

impl Server {
    pub(super) fn take_frames(&mut self, inbox: &mut Inbox, clock: &dyn Clock) {
        let now_ns = clock.boottime_ns();
        // half a heartbeat of slack: a wait that ends at its time-out is not silence
        let silence_ns = self.options.heartbeat_ns + self.options.heartbeat_ns / 2;
        let waited = self
            .drained_ns
            .is_none_or(|before_ns| now_ns.saturating_sub(before_ns) > silence_ns);
        self.drained_ns = Some(now_ns);
        // also without a notice: events are lost where a cleaner removed the socket
        let looked_long_ago = now_ns.saturating_sub(self.looked_ns) > self.options.heartbeat_ns;
        if std::mem::take(&mut self.peers_changed) || looked_long_ago {
            self.looked_ns = now_ns;
            // before the drain, which then has all that those who are gone have sent
            self.note_gone_publishers();
        }
        let known = self.sessions.len();
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
        // who came and left between the look and the drain must be looked at again
        self.peers_changed |= self.sessions.len() > known;
        self.end_sessions(inbox);
    }

    fn note_gone_publishers(&mut self) {
        let Self {
            alive,
            gone,
            sessions,
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
        let there = |publisher: &u128| alive.contains(publisher);
        gone.extend(sessions.keys().filter(|publisher| !there(publisher)));
    }

    fn end_sessions(&mut self, inbox: &mut Inbox) {
        for publisher in self.gone.drain(..) {
            let Some(session) = self.sessions.remove(&publisher) else {
                continue;
            };
            // a client may have a port on both services: its session ends with the last
            if !self.sessions.values().any(|s| *s == session) {
                inbox.end_session(session);
            }
        }
    }
}
