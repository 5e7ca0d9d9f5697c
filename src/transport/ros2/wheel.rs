//! A reliable topic that one reader cannot block. A new reader is waited for until it has caught up. If a reader has
//! stopped, a new writer replaces the one that is full of messages that the reader has not acknowledged.
//!
//! DDS keeps messages until each reliable reader has acknowledged them, and drops a stopped reader only when its lease
//! ends (20 s with Fast DDS); until then a bounded writer takes no more messages for any reader. Refused: best effort,
//! because plain subscribers request reliable topics; larger limits, because 5 MB/s for 20 s is 100 MB per stopped
//! reader.
//!
//! A new reader has acknowledged nothing, and all messages ever sent count against it: a writer that has sent more than
//! its window takes no message until the first acknowledgement arrives, after some 100 ms.
//!
//! In: messages. Out: the same in order, on a writer with room; messages that no writer takes yet are held. A full
//! writer is kept until the next turn, so that its messages on the way to healthy readers are not lost. Readers do not
//! hear a new writer for some 170 ms (measured: messages sent in that time were lost). So the next writer is made in
//! advance, and becomes current when it has the readers of the old one and they have had time to find it.

use std::collections::VecDeque;

use ros2_client::{Context, Node, Publisher, WriteError};
use serde::Serialize;

use super::readers::Readers;
use super::topics::{Out, TypeName, publisher};
use crate::error::Result;

/// Least time between two turns, nanoseconds: if a new writer fills at once, the network is full, and no turn helps.
const TURN_NS: u64 = 250_000_000;
/// Time for a new reader to catch up, nanoseconds; after it, a reader that does not acknowledge counts as stopped.
pub(super) const CATCH_UP_NS: u64 = 1_000_000_000;
/// Time for readers to find a writer that has matched them, nanoseconds: twice the measured time.
const FOUND_NS: u64 = 350_000_000;
/// Time after which a full writer is replaced even by one that lacks readers, nanoseconds.
const FULL_NS: u64 = 3_000_000_000;
/// Least limit of messages held for a writer with room: over two seconds at 100 Hz.
const HELD_MIN: usize = 256;

/// The current writer of a topic, the previous one, and the next one.
pub(super) struct Wheel<M: Serialize> {
    current: Publisher<M>,
    before: Option<Publisher<M>>,
    /// Made in advance, while a reader blocks a writer.
    next: Option<Publisher<M>>,
    /// Messages that no writer has taken yet, oldest first.
    held: VecDeque<M>,
    /// Since when the current writer has been full, nanoseconds of `CLOCK_BOOTTIME`.
    full_ns: Option<u64>,
    /// Whether a reader that should have caught up blocks a writer.
    stuck: bool,
    /// Messages on the current writer since it became current, or was last full.
    sent: usize,
    full_name: String,
    kind: TypeName,
    out: Out,
    turned_ns: u64,
    /// Messages lost since the last call of [`Self::take_lost`].
    lost: u64,
}

/// Resources for publishing.
pub(super) struct Means<'a> {
    pub(super) node: &'a mut Node,
    pub(super) context: &'a Context,
    pub(super) readers: &'a mut Readers,
    /// Nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) now_ns: u64,
}

/// Result of publishing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sent {
    /// Messages lost, or sent on a writer without readers while another writer of the topic has some.
    pub(super) lost: u64,
    /// Upper bound of the messages that a stopped reader lost with the writer before the previous one.
    pub(super) given_up: u64,
    /// Whether a new writer became current.
    pub(super) turned: bool,
}

impl<M: Serialize> Wheel<M> {
    /// Creates the first writer.
    ///
    /// # Errors
    /// `Error::Io` when DDS refuses.
    pub(super) fn new(
        node: &mut Node,
        context: &Context,
        (full_name, kind): (&str, TypeName),
        out: Out,
    ) -> Result<Self> {
        Ok(Self {
            current: publisher(node, context, (full_name, kind), out)?,
            before: None,
            next: None,
            held: VecDeque::new(),
            full_ns: None,
            stuck: false,
            sent: 0,
            full_name: full_name.to_owned(),
            kind,
            out,
            turned_ns: 0,
            lost: 0,
        })
    }

    /// Whether the topic has readers. A new writer matches its readers a little later than the old one did.
    pub(super) fn is_read(&self, readers: &Readers) -> bool {
        readers.count(&self.current) > 0 || self.is_read_beside(readers)
    }

    fn is_read_beside(&self, readers: &Readers) -> bool {
        let mut beside = self.before.iter().chain(&self.next);
        beside.any(|writer| readers.count(writer) > 0)
    }

    /// Whether messages are held for a writer with room.
    pub(super) fn holds(&self) -> bool {
        !self.held.is_empty()
    }

    /// Sets whether lost messages are sent again. That is fixed for the life of a writer, so a new writer replaces all.
    /// If DDS creates none, the old one stays until the next call.
    pub(super) fn set_reliable(&mut self, with: &mut Means<'_>, reliable: bool) {
        if self.out.reliable == reliable {
            return;
        }
        self.out.reliable = reliable;
        match self.make(with.node, with.context) {
            Some(writer) => {
                let old = std::mem::replace(&mut self.current, writer);
                let beside = self.before.take().into_iter().chain(self.next.take());
                for gone in beside.chain([old]) {
                    with.readers.forget(gone.guid());
                }
                (self.stuck, self.sent, self.full_ns) = (false, 0, None);
            }
            None => self.out.reliable = !reliable,
        }
    }

    /// The name of the topic, and the messages lost since the last call.
    pub(super) fn take_lost(&mut self) -> (String, u64) {
        (self.full_name.clone(), std::mem::take(&mut self.lost))
    }

    /// Publishes a message after those that are held.
    pub(super) fn publish(&mut self, message: M, with: &mut Means<'_>) -> Sent {
        if self.stuck && self.next.is_none() && self.sent >= self.out.window() / 2 {
            self.next = self.make(with.node, with.context);
        }
        self.held.push_back(message);
        let over = self.held.len() > self.out.window().max(HELD_MIN);
        let lost = over.then(|| self.held.pop_front());
        self.lost += u64::from(lost.is_some());
        let sent = self.flush(with);
        Sent {
            lost: sent.lost + u64::from(lost.is_some()),
            ..sent
        }
    }

    /// Publishes the held messages, on a new writer if needed.
    pub(super) fn flush(&mut self, with: &mut Means<'_>) -> Sent {
        let mut sent = Sent::default();
        while let Some(message) = self.held.pop_front() {
            match self.current.publish(message) {
                Ok(()) => {
                    self.go_on(with.readers);
                    let unheard = with.readers.count(&self.current) == 0;
                    sent.lost += u64::from(unheard && self.is_read_beside(with.readers));
                }
                Err(WriteError::WouldBlock { data }) => {
                    self.held.push_front(data);
                    if !self.turn(with, &mut sent) {
                        break;
                    }
                }
                Err(_) => sent.lost += 1,
            }
        }
        self.lost += sent.lost + sent.given_up;
        sent
    }

    /// Notes that the current writer took a message.
    fn go_on(&mut self, readers: &mut Readers) {
        self.full_ns = None;
        self.sent += 1;
        if self.sent > 2 * self.out.window() {
            // Two windows were accepted, so all readers acknowledge again.
            self.stuck = false;
            if let Some(next) = self.next.take() {
                readers.forget(next.guid());
            }
        }
    }

    /// Replaces a full writer by the next one; returns `false` if it is too early for that.
    fn turn(&mut self, with: &mut Means<'_>, sent: &mut Sent) -> bool {
        let now_ns = with.now_ns;
        // The writer may be full because of a new reader whose match event has not been read yet.
        let Some(full_ns) = self.full_ns else {
            self.full_ns = Some(now_ns);
            return false;
        };
        let full_for_ns = now_ns.saturating_sub(full_ns);
        let catches_up = with.readers.newest_ns(&self.current) + CATCH_UP_NS > now_ns;
        if catches_up && full_for_ns < CATCH_UP_NS {
            return false;
        }
        (self.stuck, self.sent) = (true, 0);
        if self.next.is_none() {
            self.next = self.make(with.node, with.context);
        }
        let readers = &mut with.readers;
        let is_found = self.next.as_ref().is_some_and(|next| {
            readers.has_those_of(next, &self.current)
                && readers.newest_ns(next) + FOUND_NS <= now_ns
        });
        let early = now_ns.saturating_sub(self.turned_ns) < TURN_NS;
        if early || !is_found && full_for_ns < FULL_NS {
            return false;
        }
        let Some(next) = self.next.take() else {
            return false;
        };
        let full = std::mem::replace(&mut self.current, next);
        if let Some(gone) = self.before.replace(full) {
            readers.forget(gone.guid());
            sent.given_up += self.out.window() as u64;
        }
        sent.turned = true;
        (self.turned_ns, self.full_ns) = (now_ns, None);
        true
    }

    fn make(&self, node: &mut Node, context: &Context) -> Option<Publisher<M>> {
        let topic = (self.full_name.as_str(), self.kind);
        publisher(node, context, topic, self.out).ok()
    }
}

#[cfg(test)]
pub(super) mod tests;
