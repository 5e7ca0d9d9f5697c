//! What readers that come, readers that stop, and words that grow do to what must be said: nothing.

#![allow(clippy::disallowed_methods, reason = "real DDS needs real time")]

use std::time::{Duration, Instant};

use ros2_client::Subscription;

use super::super::super::readers::Readers;
use super::super::super::wheel::tests::{
    SMALL, TOPIC, domain, hear, message, peer, reader, stopped,
};
use super::*;
use crate::time::{Clock as _, SystemClock};
use crate::wire::ros::State;

/// A latched topic, and a reader in another participant of this process.
struct Rig {
    node: Node,
    context: Context,
    readers: Readers,
    owed: Owed<State>,
    _first: (Context, Node),
    from: Subscription<State>,
    heard: Vec<u64>,
    number: u64,
    end: Instant,
}

impl Rig {
    fn of(domain: u16) -> Self {
        let (context, mut node) = peer(domain, "writer");
        let readers = Readers::of(&context);
        let latched = Out {
            latched: true,
            depth: 4,
            ..SMALL
        };
        let owed = Owed::new(&mut node, &context, TOPIC, latched).unwrap();
        let mut first = peer(domain, "first");
        let from = reader(&first.0, &mut first.1, true);
        Self {
            node,
            context,
            readers,
            owed,
            _first: first,
            from,
            heard: Vec::new(),
            number: 0,
            end: Instant::now() + Duration::from_secs(90),
        }
    }

    fn with<T>(&mut self, what: impl FnOnce(&mut Owed<State>, &mut Means<'_>) -> T) -> T {
        let now_ns = SystemClock.boottime_ns();
        self.readers.hear(now_ns);
        let mut means = Means {
            node: &mut self.node,
            context: &self.context,
            readers: &mut self.readers,
            now_ns,
        };
        what(&mut self.owed, &mut means)
    }

    /// Says a word of so many messages and goes on until all of it is heard.
    fn say(&mut self, count: u64) {
        let word: Vec<u64> = (self.number + 1..=self.number + count).collect();
        self.number += count;
        let messages = word.iter().copied().map(message).collect();
        assert_eq!(self.with(|owed, with| owed.say(messages, with)), 0);
        while !word.iter().all(|number| self.heard.contains(number)) {
            assert!(Instant::now() < self.end, "{word:?} is heard");
            std::thread::sleep(Duration::from_millis(2));
            assert_eq!(self.with(Owed::hand_over), 0);
            hear(&self.from, &mut self.heard);
        }
    }
}

#[test]
fn bug_what_is_said_while_a_reader_catches_up_is_said_when_it_has() {
    let domain = domain(2);
    let mut rig = Rig::of(domain);
    for _ in 0..3 * SMALL.window() {
        rig.say(1);
    }
    // Each of these holds the writer up for a moment, and something is said in it.
    for round in 0..3 {
        let mut newcomer = peer(domain, &format!("newcomer_{round}"));
        let _from = reader(&newcomer.0, &mut newcomer.1, true);
        let until = Instant::now() + Duration::from_secs(2);
        while Instant::now() < until {
            rig.say(1);
        }
    }
    assert!(!rig.owed.holds());
    assert!(rig.heard.windows(2).all(|two| two[1] == two[0] + 1));
}

#[test]
fn bug_a_reader_that_stops_does_not_hold_up_what_must_be_said() {
    let domain = domain(3);
    let mut rig = Rig::of(domain);
    let child = stopped(domain);
    while rig.readers.count(&rig.owed.writer) < 2 {
        assert!(Instant::now() < rig.end, "both are found");
        rig.say(1);
        std::thread::sleep(Duration::from_millis(50));
    }
    let first = rig.owed.writer.guid();
    child.stop();
    // Long before the lease of the stopped one ends; each word is heard by the other, the last one also in full.
    let start = Instant::now();
    for _ in 0..2 * SMALL.window() {
        rig.say(2);
    }
    assert!(start.elapsed() < Duration::from_secs(15));
    assert!(rig.owed.writer.guid() != first, "another writer went on");
    assert!(!rig.owed.holds());
}

#[test]
fn bug_who_comes_late_gets_all_of_a_long_word() {
    let domain = domain(4);
    let mut rig = Rig::of(domain);
    rig.say(1);
    rig.say(75);
    let mut late = peer(domain, "late");
    let from = reader(&late.0, &mut late.1, true);
    let mut heard = Vec::new();
    while heard.len() < 75 {
        assert!(Instant::now() < rig.end, "{heard:?}");
        std::thread::sleep(Duration::from_millis(10));
        hear(&from, &mut heard);
    }
    assert!(heard.ends_with(&(2..=76).collect::<Vec<_>>()), "{heard:?}");
    assert_eq!(rig.owed.out.depth, 128);
    // A writer for long words would keep dozens of short ones, and who comes late would get them all.
    rig.say(1);
    assert_eq!(rig.owed.out.depth, 4);
}
