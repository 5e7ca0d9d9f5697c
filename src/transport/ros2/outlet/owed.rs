//! A latched topic of which every message must come out: what its writer does not take yet is published again until it
//! does, because nothing that comes later would say it. In: what a topic says from now on. Out: its messages, in order.

use std::collections::VecDeque;

use ros2_client::{Publisher, WriteError};
use serde::Serialize;

/// A writer and what it has not taken.
pub(in super::super) struct Owed<M: Serialize> {
    writer: Publisher<M>,
    owed: VecDeque<M>,
}

impl<M: Serialize> Owed<M> {
    /// Nothing to say yet.
    pub(in super::super) fn of(writer: Publisher<M>) -> Self {
        let owed = VecDeque::new();
        Self { writer, owed }
    }

    /// Says this from now on; what of the last word has not been taken is void.
    ///
    /// * returns - messages that are lost.
    pub(in super::super) fn say(&mut self, messages: impl IntoIterator<Item = M>) -> u64 {
        self.owed = messages.into_iter().collect();
        self.hand_over()
    }

    /// Whether the writer has not taken all.
    pub(in super::super) fn holds(&self) -> bool {
        !self.owed.is_empty()
    }

    /// Publishes what the writer takes now.
    ///
    /// * returns - messages that are lost.
    pub(in super::super) fn hand_over(&mut self) -> u64 {
        let mut lost = 0;
        while let Some(message) = self.owed.pop_front() {
            match self.writer.publish(message) {
                Ok(()) => {}
                Err(WriteError::WouldBlock { data }) => {
                    self.owed.push_front(data);
                    break;
                }
                Err(_) => lost += 1,
            }
        }
        lost
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods, reason = "real DDS needs real time")]

    use std::time::{Duration, Instant};

    use super::super::super::topics::{Out, publisher};
    use super::super::super::wheel::tests::{SMALL, TOPIC, domain, hear, message, peer, reader};
    use super::*;

    #[test]
    fn bug_what_is_said_while_a_reader_catches_up_is_said_when_it_has() {
        let domain = domain(2);
        let (context, mut node) = peer(domain, "writer");
        let latched = Out {
            latched: true,
            ..SMALL
        };
        let writer = publisher(&mut node, &context, TOPIC, latched).unwrap();
        let mut owed = Owed::of(writer);
        let mut first = peer(domain, "first");
        let from = reader(&first.0, &mut first.1, true);
        let mut heard = Vec::new();
        let end = Instant::now() + Duration::from_secs(60);
        let mut number = 0;
        let mut say = |owed: &mut Owed<_>, heard: &mut Vec<u64>| {
            number += 1;
            assert_eq!(owed.say([message(number)]), 0);
            while heard.last() != Some(&number) {
                assert!(Instant::now() < end, "{number} is heard");
                std::thread::sleep(Duration::from_millis(2));
                assert_eq!(owed.hand_over(), 0);
                hear(&from, heard);
            }
        };
        for _ in 0..3 * SMALL.window() {
            say(&mut owed, &mut heard);
        }
        // Each of these holds the writer up for a moment, and something is said in it.
        for round in 0..3 {
            let mut newcomer = peer(domain, &format!("newcomer_{round}"));
            let _from = reader(&newcomer.0, &mut newcomer.1, true);
            let until = Instant::now() + Duration::from_secs(2);
            while Instant::now() < until {
                say(&mut owed, &mut heard);
            }
        }
        assert!(!owed.holds());
        assert!(heard.windows(2).all(|two| two[1] == two[0] + 1));
    }
}
