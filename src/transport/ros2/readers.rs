//! Who reads what this node writes. In: what DDS says of endpoints that match and that go. Out: counts.
//!
//! DDS says it once, to one listener, in a queue of 2048: this is the only one, and it is asked at each turn of the
//! sending thread, ten times a second at least.

use std::collections::{BTreeMap, BTreeSet};

use ros2_client::{Context, Publisher};
use rustdds::{
    DomainParticipantStatusEvent, DomainParticipantStatusListener, GUID, StatusEvented as _,
};
use serde::Serialize;

/// Readers of each writer.
pub(super) struct Readers {
    listener: DomainParticipantStatusListener,
    of: BTreeMap<GUID, BTreeSet<GUID>>,
}

impl Readers {
    /// Of the writers of a participant.
    pub(super) fn of(context: &Context) -> Self {
        Self {
            listener: context.domain_participant().status_listener(),
            of: BTreeMap::new(),
        }
    }

    /// Takes what DDS has said since the last call.
    pub(super) fn hear(&mut self) {
        while let Some(event) = self.listener.try_recv_status() {
            match event {
                DomainParticipantStatusEvent::RemoteReaderMatched {
                    local_writer,
                    remote_reader,
                } => {
                    self.of
                        .entry(local_writer)
                        .or_default()
                        .insert(remote_reader);
                }
                DomainParticipantStatusEvent::ReaderLost { guid, .. } => {
                    self.lose(|reader| *reader == guid);
                }
                // Who was killed or fell silent takes all its readers with it, and nothing is said of each.
                DomainParticipantStatusEvent::ParticipantLost { id, .. } => {
                    self.lose(|reader| reader.prefix == id);
                }
                _ => {}
            }
        }
    }

    /// Forgets a writer that was given up.
    pub(super) fn forget(&mut self, writer: GUID) {
        self.of.remove(&writer);
    }

    fn lose(&mut self, gone: impl Fn(&GUID) -> bool) {
        self.of.retain(|_, readers| {
            readers.retain(|reader| !gone(reader));
            !readers.is_empty()
        });
    }

    /// How many read this writer, as of the last [`Self::hear`].
    pub(super) fn count<M: Serialize>(&self, writer: &Publisher<M>) -> usize {
        self.of.get(&writer.guid()).map_or(0, BTreeSet::len)
    }
}
