//! Remote readers of this node's writers. In: DDS status events of matched and lost endpoints. Out: reader counts, and,
//! from the same listener, participants that were lost and are back, and endpoints of incompatible quality of service.
//!
//! DDS reports each event once, to one listener, through a queue of 2048. This is the only listener; the sending thread
//! polls it in each of its rounds, at least ten times per second.

use std::collections::{BTreeMap, BTreeSet};

use ros2_client::{Context, Publisher};
use rustdds::{
    DomainParticipantStatusEvent, DomainParticipantStatusListener, GUID, LostReason, QosPolicies,
    StatusEvented as _,
};
use serde::Serialize;

use super::absent::Absent;
use super::misfits::{Misfits, Remote};

/// Readers of each writer.
pub(super) struct Readers {
    listener: DomainParticipantStatusListener,
    of: BTreeMap<GUID, Matched>,
    pub(super) absent: Absent,
    pub(super) misfits: Misfits,
    context: Context,
}

/// Remote readers of one writer.
#[derive(Default)]
struct Matched {
    readers: BTreeSet<GUID>,
    /// When the newest reader matched, nanoseconds of `CLOCK_BOOTTIME`.
    newest_ns: u64,
}

impl Readers {
    /// Creates the listener of a participant.
    pub(super) fn of(context: &Context) -> Self {
        Self {
            listener: context.domain_participant().status_listener(),
            of: BTreeMap::new(),
            absent: Absent::default(),
            misfits: Misfits::default(),
            context: context.clone(),
        }
    }

    /// Takes the status events since the last call.
    ///
    /// * `now_ns` - nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) fn hear(&mut self, now_ns: u64) {
        while let Some(event) = self.listener.try_recv_status() {
            match event {
                DomainParticipantStatusEvent::RemoteReaderMatched {
                    local_writer,
                    remote_reader,
                } => {
                    self.fit((local_writer, remote_reader));
                    let matched = self.of.entry(local_writer).or_default();
                    matched.readers.insert(remote_reader);
                    matched.newest_ns = now_ns;
                }
                DomainParticipantStatusEvent::RemoteWriterMatched {
                    local_reader,
                    remote_writer,
                } => self.fit((local_reader, remote_writer)),
                DomainParticipantStatusEvent::RemoteReaderQosIncompatible {
                    local_writer,
                    remote_reader,
                    requested_qos,
                    offered_qos,
                } => {
                    let two = (local_writer, remote_reader);
                    self.note_misfit(two, Remote::Subscriber, (&offered_qos, &requested_qos));
                }
                DomainParticipantStatusEvent::RemoteWriterQosIncompatible {
                    local_reader,
                    remote_writer,
                    requested_qos,
                    offered_qos,
                } => {
                    let two = (local_reader, remote_writer);
                    self.note_misfit(two, Remote::Publisher, (&offered_qos, &requested_qos));
                }
                DomainParticipantStatusEvent::ReaderLost { guid, .. }
                | DomainParticipantStatusEvent::WriterLost { guid, .. } => {
                    self.lose(|endpoint| *endpoint == guid);
                }
                // A participant that was killed or fell silent loses all its readers, without an event for each.
                DomainParticipantStatusEvent::ParticipantLost { id, reason } => {
                    self.lose(|endpoint| endpoint.prefix == id);
                    let prefix = format!("{id:?}");
                    match reason {
                        LostReason::Timeout { lease, .. } => {
                            self.absent.lose(&prefix, lease.to_std());
                        }
                        LostReason::Disposed => self.absent.part(&prefix),
                    }
                }
                DomainParticipantStatusEvent::ParticipantDiscovered { dpd } => {
                    self.absent.meet(&format!("{:?}", dpd.guid.prefix));
                }
                _ => {}
            }
        }
    }

    /// Forgets a writer that was dropped.
    pub(super) fn forget(&mut self, writer: GUID) {
        self.of.remove(&writer);
        self.misfits.lose(|local, _| *local == writer);
    }

    /// Removes a misfit: the two endpoints match now.
    fn fit(&mut self, two: (GUID, GUID)) {
        self.misfits.lose(|local, remote| (*local, *remote) == two);
    }

    /// Notes two endpoints of incompatible quality of service. DDS repeats the event at each announcement of the
    /// remote endpoint; its topic is searched only once, among all endpoints that DDS knows.
    fn note_misfit(
        &mut self,
        two: (GUID, GUID),
        remote: Remote,
        qualities: (&QosPolicies, &QosPolicies),
    ) {
        if self.misfits.holds(two) {
            return;
        }
        let participant = self.context.domain_participant();
        let topic = match remote {
            Remote::Publisher => {
                let mut writers = participant.discovered_writers().into_iter();
                let of = writers.find(|data| data.publication_topic_data.key == two.1);
                of.map(|data| data.publication_topic_data.topic_name)
            }
            Remote::Subscriber => {
                let mut readers = participant.discovered_readers().into_iter();
                let of = readers.find(|data| data.subscription_topic_data.key() == two.1);
                of.map(|data| data.subscription_topic_data.topic_name().clone())
            }
        };
        // An endpoint that DDS no longer knows has left.
        if let Some(topic) = topic {
            self.misfits.put(two, (&topic, remote), qualities);
        }
    }

    #[cfg(test)]
    pub(super) fn knows(&self, writer: &GUID) -> bool {
        self.of.contains_key(writer)
    }

    fn lose(&mut self, gone: impl Fn(&GUID) -> bool) {
        self.misfits.lose(|_, remote| gone(remote));
        self.of.retain(|_, matched| {
            matched.readers.retain(|reader| !gone(reader));
            !matched.readers.is_empty()
        });
    }

    /// Number of readers of a writer, as of the last [`Self::hear`].
    pub(super) fn count<M: Serialize>(&self, writer: &Publisher<M>) -> usize {
        let matched = self.of.get(&writer.guid());
        matched.map_or(0, |matched| matched.readers.len())
    }

    /// When the newest reader of a writer matched, nanoseconds of `CLOCK_BOOTTIME`; 0: it has no readers.
    pub(super) fn newest_ns<M: Serialize>(&self, writer: &Publisher<M>) -> u64 {
        let matched = self.of.get(&writer.guid());
        matched.map_or(0, |matched| matched.newest_ns)
    }

    /// Whether a writer has all the readers of another one.
    pub(super) fn has_those_of<M: Serialize>(
        &self,
        writer: &Publisher<M>,
        other: &Publisher<M>,
    ) -> bool {
        let Some(wanted) = self.of.get(&other.guid()) else {
            return true;
        };
        let own = self.of.get(&writer.guid());
        own.is_some_and(|own| own.readers.is_superset(&wanted.readers))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods, reason = "real DDS needs real time")]

    use std::time::{Duration, Instant};

    use super::super::topics::{Out, publisher};
    use super::super::wheel::tests::{TOPIC, domain, peer, reader};
    use super::*;
    use crate::wire::ros::State;

    #[test]
    fn bug_a_volatile_publisher_beside_a_latched_reader_was_told_nowhere() {
        let (context, mut node) = peer(domain(7), "reads");
        let mut readers = Readers::of(&context);
        let _from = reader(&context, &mut node, true);
        let (far, mut far_node) = peer(domain(7), "writes");
        let writer = publisher::<State>(&mut far_node, &far, TOPIC, Out::RELIABLE).unwrap();
        let end = Instant::now() + Duration::from_secs(60);
        let mut until = |count: usize| {
            while readers.misfits.found().len() != count {
                assert!(Instant::now() < end, "{count}");
                std::thread::sleep(Duration::from_millis(10));
                readers.hear(1);
            }
            readers.misfits.take_new()
        };
        let told = until(1).concat();
        assert!(
            told.contains("topic /wheel: a publisher offers volatile"),
            "{told}"
        );
        drop(writer);
        assert!(until(0).is_empty());
    }
}
