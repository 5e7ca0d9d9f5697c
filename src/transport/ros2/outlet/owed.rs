//! A latched topic that loses no message: what the writer does not accept is published again until it does, because no
//! later message repeats it. If a reader has stopped, or the writer keeps too few messages for late joiners, a new
//! writer publishes the whole content again.
//!
//! In: the new content of a topic. Out: its messages, in order.

use ros2_client::{Context, Node, Publisher, WriteError};
use serde::Serialize;

use super::super::topics::{Out, TypeName, publisher};
use super::super::wheel::{CATCH_UP_NS, Means};
use crate::error::Result;

/// A writer that keeps more than this many versions of the content is replaced by one that keeps one or two.
const WORDS_KEPT_MAX: usize = 4;

/// A writer, and the messages that it has not accepted yet.
pub(in super::super) struct Owed<M: Serialize> {
    writer: Publisher<M>,
    full_name: String,
    kind: TypeName,
    out: Out,
    /// Messages that the first writer keeps.
    depth_least: usize,
    /// The content of the topic; empty as soon as the writer has accepted all.
    word: Vec<M>,
    /// Number of these that the writer has accepted.
    taken: usize,
    /// Time since which the writer has been full, nanoseconds of `CLOCK_BOOTTIME`.
    full_ns: Option<u64>,
}

impl<M: Serialize + Clone> Owed<M> {
    /// Creates the first writer, without content.
    ///
    /// # Errors
    /// `Error::Io` when DDS refuses.
    pub(in super::super) fn new(
        node: &mut Node,
        context: &Context,
        (full_name, kind): (&str, TypeName),
        out: Out,
    ) -> Result<Self> {
        Ok(Self {
            writer: publisher(node, context, (full_name, kind), out)?,
            full_name: full_name.to_owned(),
            kind,
            out,
            depth_least: out.depth,
            word: Vec::new(),
            taken: 0,
            full_ns: None,
        })
    }

    /// Sets the content; messages of the last content that were not accepted are dropped.
    ///
    /// * returns - number of lost messages.
    pub(in super::super) fn say(&mut self, word: Vec<M>, with: &mut Means<'_>) -> u64 {
        (self.word, self.taken) = (word, 0);
        let depth = self.word.len().next_power_of_two().max(self.depth_least);
        // Otherwise late joiners would lack a part, or get many outdated versions.
        if self.word.len() > self.out.depth || self.out.depth > WORDS_KEPT_MAX * depth {
            self.turn(Out { depth, ..self.out }, with);
        }
        self.hand_over(with)
    }

    /// Whether the writer has not accepted all messages.
    pub(in super::super) fn holds(&self) -> bool {
        !self.word.is_empty()
    }

    /// Publishes the messages that the writer accepts now; on a new writer if a reader has stopped.
    ///
    /// * returns - number of lost messages.
    pub(in super::super) fn hand_over(&mut self, with: &mut Means<'_>) -> u64 {
        let mut lost = 0;
        while let Some(message) = self.word.get(self.taken) {
            match self.writer.publish(message.clone()) {
                Err(WriteError::WouldBlock { .. }) => {
                    if !self.is_stuck(with) || !self.turn(self.out, with) {
                        return lost;
                    }
                    continue;
                }
                Err(_) => lost += 1,
                Ok(()) => {}
            }
            (self.taken, self.full_ns) = (self.taken + 1, None);
        }
        // Its memory is freed: for a large scene it is as large as all names.
        (self.word, self.taken) = (Vec::new(), 0);
        lost
    }

    /// Whether the writer has been full for longer than a new reader takes to catch up.
    fn is_stuck(&mut self, with: &Means<'_>) -> bool {
        let full_ns = *self.full_ns.get_or_insert(with.now_ns);
        with.now_ns.saturating_sub(full_ns) >= CATCH_UP_NS
    }

    /// Continues with a new writer, which publishes the whole content; returns whether it could be created.
    ///
    /// The topic is latched, so readers get the whole content, and nothing is lost with the old writer.
    fn turn(&mut self, out: Out, with: &mut Means<'_>) -> bool {
        let topic = (self.full_name.as_str(), self.kind);
        let Ok(writer) = publisher(with.node, with.context, topic, out) else {
            return false;
        };
        let old = std::mem::replace(&mut self.writer, writer);
        with.readers.forget(old.guid());
        (self.out, self.taken, self.full_ns) = (out, 0, None);
        true
    }
}

#[cfg(test)]
mod tests;
