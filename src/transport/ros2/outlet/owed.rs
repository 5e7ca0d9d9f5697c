//! A latched topic of which every message must come out: what its writer does not take yet is published again until it
//! does, because nothing that comes later would say it. Where a reader has stopped, or the writer keeps too few
//! messages for those that come late, a new writer says all of it anew.
//!
//! In: what a topic says from now on. Out: its messages, in order.

use ros2_client::{Context, Node, Publisher, WriteError};
use serde::Serialize;

use super::super::topics::{Out, TypeName, publisher};
use super::super::wheel::{CATCH_UP_NS, Means};
use crate::error::Result;

/// A writer that keeps more than so many words gives way to one that keeps one or two.
const WORDS_KEPT_MAX: usize = 4;

/// A writer and what it has not taken.
pub(in super::super) struct Owed<M: Serialize> {
    writer: Publisher<M>,
    full_name: String,
    kind: TypeName,
    out: Out,
    /// Messages that the first writer keeps.
    depth_least: usize,
    /// What the topic says from now on; empty as soon as the writer has taken all.
    word: Vec<M>,
    /// How many of these the writer has taken.
    taken: usize,
    /// Since when the writer has been full, nanoseconds of `CLOCK_BOOTTIME`.
    full_ns: Option<u64>,
}

impl<M: Serialize + Clone> Owed<M> {
    /// Creates the first writer; nothing to say yet.
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

    /// Says this from now on; what of the last word has not been taken is void.
    ///
    /// * returns - messages that are lost.
    pub(in super::super) fn say(&mut self, word: Vec<M>, with: &mut Means<'_>) -> u64 {
        (self.word, self.taken) = (word, 0);
        let depth = self.word.len().next_power_of_two().max(self.depth_least);
        // Or late joiners lack a part; or they get many words of before, which nobody needs.
        if self.word.len() > self.out.depth || self.out.depth > WORDS_KEPT_MAX * depth {
            self.turn(Out { depth, ..self.out }, with);
        }
        self.hand_over(with)
    }

    /// Whether the writer has not taken all.
    pub(in super::super) fn holds(&self) -> bool {
        !self.word.is_empty()
    }

    /// Publishes what the writer takes now, on a new writer where a reader has stopped.
    ///
    /// * returns - messages that are lost.
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
        // Not kept: of a large scene it is as much as all names.
        (self.word, self.taken) = (Vec::new(), 0);
        lost
    }

    /// Whether the writer has been full for longer than a reader that has just come takes to catch up.
    fn is_stuck(&mut self, with: &Means<'_>) -> bool {
        let full_ns = *self.full_ns.get_or_insert(with.now_ns);
        with.now_ns.saturating_sub(full_ns) >= CATCH_UP_NS
    }

    /// Goes on with a new writer, which says all of the word; whether there is one.
    ///
    /// Its readers get it all because it is latched, so nothing is lost with the old one.
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
