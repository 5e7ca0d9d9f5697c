//! A reliable topic that one stopped reader cannot hold up: when its writer is full of what that reader has not
//! acknowledged, a new writer takes its place, and the others go on.
//!
//! DDS keeps what a reliable reader has not acknowledged, and a reader that was stopped is given up only by its lease
//! (20 s with Fast DDS); until then a bounded writer takes nothing more for anybody. Best effort would not do: plain
//! subscribers ask for reliable topics. Larger bounds would not do: 5 MB/s for 20 s is 100 MB a stopped reader.
//!
//! In: messages. Out: the same, on a writer that has room. The one that is full stays until the next turn, so that what
//! is on its way to the healthy readers is not lost. A new writer takes some 170 ms until its readers know it (measured:
//! 5 ticks at 30 Hz were lost a turn); so while a reader is stuck, the next one is made in advance.

use ros2_client::{Context, Node, Publisher, WriteError};
use serde::Serialize;

use super::topics::{Out, TypeName, publisher};
use crate::error::Result;

/// Least time between two turns, nanoseconds: where a new writer is full at once, the network is, and no turn helps.
const TURN_NS: u64 = 250_000_000;

/// A topic's writer, and the one before.
pub(super) struct Wheel<M: Serialize> {
    current: Publisher<M>,
    before: Option<Publisher<M>>,
    /// Made in advance, while a reader is stuck.
    next: Option<Publisher<M>>,
    /// Whether the last writer became full.
    stuck: bool,
    /// Messages on the current writer.
    sent: usize,
    full_name: String,
    kind: TypeName,
    out: Out,
    turned_ns: u64,
}

/// What became of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sent {
    /// It is on its way.
    Yes,
    /// It is on its way by a new writer, because a reader does not acknowledge.
    Turned,
    /// It is lost.
    No,
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
            stuck: false,
            sent: 0,
            full_name: full_name.to_owned(),
            kind,
            out,
            turned_ns: 0,
        })
    }

    /// Whether somebody listens. A new writer is known to its readers a little later than the old one was.
    pub(super) fn is_read(&self, node: &Node) -> bool {
        let read = |writer: &Publisher<M>| writer.get_subscription_count(node) > 0;
        read(&self.current)
            || self.before.as_ref().is_some_and(read)
            || self.next.as_ref().is_some_and(read)
    }

    /// Publishes, on a new writer if need be.
    pub(super) fn publish(
        &mut self,
        node: &mut Node,
        context: &Context,
        message: M,
        now_ns: u64,
    ) -> Sent {
        let window = self.out.window();
        if self.stuck && self.next.is_none() && self.sent >= window / 2 {
            self.next = self.make(node, context);
        }
        let message = match self.current.publish(message) {
            Ok(()) => {
                self.sent += 1;
                if self.sent > 2 * window {
                    // Everybody acknowledges again.
                    self.stuck = false;
                    self.next = None;
                }
                return Sent::Yes;
            }
            Err(WriteError::WouldBlock { data }) => data,
            Err(_) => return Sent::No,
        };
        if now_ns.saturating_sub(self.turned_ns) < TURN_NS {
            return Sent::No;
        }
        self.turned_ns = now_ns;
        self.stuck = true;
        let next = self.next.take();
        let Some(next) = next.or_else(|| self.make(node, context)) else {
            return Sent::No;
        };
        self.before = Some(std::mem::replace(&mut self.current, next));
        self.sent = 1;
        match self.current.publish(message) {
            Ok(()) => Sent::Turned,
            Err(_) => Sent::No,
        }
    }

    fn make(&self, node: &mut Node, context: &Context) -> Option<Publisher<M>> {
        let topic = (self.full_name.as_str(), self.kind);
        publisher(node, context, topic, self.out).ok()
    }
}
