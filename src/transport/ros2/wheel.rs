//! A reliable topic that one reader cannot hold up: a reader that comes is waited for until it has caught up, and where
//! one has stopped, a new writer takes the place of the one that is full of what it has not acknowledged.
//!
//! DDS keeps what a reliable reader has not acknowledged, and a reader that was stopped is given up only by its lease
//! (20 s with Fast DDS); until then a bounded writer takes nothing more for anybody. Best effort would not do: plain
//! subscribers ask for reliable topics. Larger bounds would not do: 5 MB/s for 20 s is 100 MB a stopped reader.
//!
//! Who has just come has acknowledged nothing, and all that was ever sent counts against it: a writer that has sent
//! more than its window takes nothing until the first acknowledgement is there, some 100 ms.
//!
//! In: messages. Out: the same, in their order, on a writer that has room; what none takes yet is held. The writer that
//! is full stays until the next turn, so that what is on its way to the healthy readers is not lost. Readers do not
//! hear a new writer for some 170 ms (measured: what was sent in that time was lost), so one is made in advance, and is
//! gone over to when it has the readers of the old one and they have had time to find it.

use std::collections::VecDeque;

use ros2_client::{Context, Node, Publisher, WriteError};
use serde::Serialize;

use super::readers::Readers;
use super::topics::{Out, TypeName, publisher};
use crate::error::Result;

/// Least time between two turns, nanoseconds: where a new writer is full at once, the network is, and no turn helps.
const TURN_NS: u64 = 250_000_000;
/// A reader that came within this time catches up, nanoseconds; after it, it is taken for one that has stopped.
pub(super) const CATCH_UP_NS: u64 = 1_000_000_000;
/// How long readers have to find a writer that knows them, nanoseconds: twice what was measured.
const FOUND_NS: u64 = 350_000_000;
/// A writer that has been full for so long is left for one that lacks readers, too, nanoseconds.
const FULL_NS: u64 = 3_000_000_000;
/// Messages that wait for a writer with room, at least: at 100 Hz those of two seconds.
const HELD_MIN: usize = 256;

/// A topic's writer, the one before, and the one after.
pub(super) struct Wheel<M: Serialize> {
    current: Publisher<M>,
    before: Option<Publisher<M>>,
    /// Made in advance, while a reader is stuck.
    next: Option<Publisher<M>>,
    /// What no writer has taken yet, the oldest first.
    held: VecDeque<M>,
    /// Since when the writer has been full, nanoseconds.
    full_ns: Option<u64>,
    /// Whether a reader held a writer up that had caught up with it.
    stuck: bool,
    /// Messages on the current writer since it was new, or full.
    sent: usize,
    full_name: String,
    kind: TypeName,
    out: Out,
    turned_ns: u64,
    /// Since it was asked last.
    lost: u64,
}

/// What it takes to publish.
pub(super) struct Means<'a> {
    pub(super) node: &'a mut Node,
    pub(super) context: &'a Context,
    pub(super) readers: &'a mut Readers,
    /// Nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) now_ns: u64,
}

/// What became of messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sent {
    /// Lost, or on a writer whose readers are those of another one.
    pub(super) lost: u64,
    /// So many at most were lost by a reader that does not acknowledge, with the last writer but one.
    pub(super) given_up: u64,
    /// A new writer goes on.
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

    /// Whether somebody listens. A new writer is known to its readers a little later than the old one was.
    pub(super) fn is_read(&self, readers: &Readers) -> bool {
        readers.count(&self.current) > 0 || self.is_read_beside(readers)
    }

    fn is_read_beside(&self, readers: &Readers) -> bool {
        let mut beside = self.before.iter().chain(&self.next);
        beside.any(|writer| readers.count(writer) > 0)
    }

    /// Whether messages wait for a writer with room.
    pub(super) fn holds(&self) -> bool {
        !self.held.is_empty()
    }

    /// Sets whether lost messages are sent again, which a writer keeps for its life: another one takes its place. Where
    /// DDS makes none, the old one stays until the next call.
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

    /// Its topic, and what was lost since the last call.
    pub(super) fn take_lost(&mut self) -> (String, u64) {
        (self.full_name.clone(), std::mem::take(&mut self.lost))
    }

    /// Publishes behind what is held.
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

    /// Publishes what is held, on a new writer if need be.
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

    /// The writer has taken one.
    fn go_on(&mut self, readers: &mut Readers) {
        self.full_ns = None;
        self.sent += 1;
        if self.sent > 2 * self.out.window() {
            // Everybody acknowledges again.
            self.stuck = false;
            if let Some(next) = self.next.take() {
                readers.forget(next.guid());
            }
        }
    }

    /// The writer is full: goes over to the next one, or says that it is too early.
    fn turn(&mut self, with: &mut Means<'_>, sent: &mut Sent) -> bool {
        let now_ns = with.now_ns;
        // Why it is full may be a reader that has not been heard of here yet.
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
