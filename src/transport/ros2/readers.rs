//! Who reads what this node writes. In: what DDS says of endpoints that match and that go. Out: counts; and who was
//! lost and is back, which DDS says to the same listener.
//!
//! DDS says it once, to one listener, in a queue of 2048: this is the only one, and it is asked at each turn of the
//! sending thread, ten times a second at least.

use std::collections::{BTreeMap, BTreeSet};

use ros2_client::{Context, Publisher};
use rustdds::{
    DomainParticipantStatusEvent, DomainParticipantStatusListener, GUID, LostReason,
    StatusEvented as _,
};
use serde::Serialize;

use super::absent::Absent;

/// Readers of each writer.
pub(super) struct Readers {
    listener: DomainParticipantStatusListener,
    of: BTreeMap<GUID, Matched>,
    pub(super) absent: Absent,
}

/// Readers of one writer.
#[derive(Default)]
struct Matched {
    readers: BTreeSet<GUID>,
    /// When the last one came, nanoseconds of `CLOCK_BOOTTIME`.
    newest_ns: u64,
}

impl Readers {
    /// Of the writers of a participant.
    pub(super) fn of(context: &Context) -> Self {
        Self {
            listener: context.domain_participant().status_listener(),
            of: BTreeMap::new(),
            absent: Absent::default(),
        }
    }

    /// Takes what DDS has said since the last call.
    ///
    /// * `now_ns` - nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) fn hear(&mut self, now_ns: u64) {
        while let Some(event) = self.listener.try_recv_status() {
            match event {
                DomainParticipantStatusEvent::RemoteReaderMatched {
                    local_writer,
                    remote_reader,
                } => {
                    let matched = self.of.entry(local_writer).or_default();
                    matched.readers.insert(remote_reader);
                    matched.newest_ns = now_ns;
                }
                DomainParticipantStatusEvent::ReaderLost { guid, .. } => {
                    self.lose(|reader| *reader == guid);
                }
                // Who was killed or fell silent takes all its readers with it, and nothing is said of each.
                DomainParticipantStatusEvent::ParticipantLost { id, reason } => {
                    self.lose(|reader| reader.prefix == id);
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

    /// Forgets a writer that was given up.
    pub(super) fn forget(&mut self, writer: GUID) {
        self.of.remove(&writer);
    }

    #[cfg(test)]
    pub(super) fn knows(&self, writer: &GUID) -> bool {
        self.of.contains_key(writer)
    }

    fn lose(&mut self, gone: impl Fn(&GUID) -> bool) {
        self.of.retain(|_, matched| {
            matched.readers.retain(|reader| !gone(reader));
            !matched.readers.is_empty()
        });
    }

    /// How many read this writer, as of the last [`Self::hear`].
    pub(super) fn count<M: Serialize>(&self, writer: &Publisher<M>) -> usize {
        let matched = self.of.get(&writer.guid());
        matched.map_or(0, |matched| matched.readers.len())
    }

    /// When the last of those came that read this writer, nanoseconds of `CLOCK_BOOTTIME`; 0: there are none.
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
