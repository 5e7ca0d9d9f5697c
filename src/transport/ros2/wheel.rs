//! A reliable topic that one stopped reader cannot hold up: when its writer is full of what that reader has not
//! acknowledged, a new writer takes its place, and the others go on.
//!
//! DDS keeps what a reliable reader has not acknowledged, and a reader that was stopped is given up only by its lease
//! (20 s with Fast DDS); until then a bounded writer takes nothing more for anybody. Best effort would not do: plain
//! subscribers ask for reliable topics. Larger bounds would not do: 5 MB/s for 20 s is 100 MB a stopped reader.
//!
//! In: messages. Out: the same, on a writer that has room. The one that is full stays until the next turn, so that what
//! is on its way to the healthy readers is not lost. A new writer takes some 170 ms until its readers know it
//! (measured: 5 ticks at 30 Hz were lost a turn); so while a reader is stuck, the next one is made in advance.

use ros2_client::{Context, Node, Publisher, WriteError};
use rustdds::GUID;
use serde::Serialize;

use super::readers::Readers;
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
    /// It is on its way by a new writer, because a reader does not acknowledge. With the last writer but one that
    /// reader has lost up to so many messages.
    Turned {
        given_up: u64,
        /// The last writer but one, which is gone.
        gone: Option<GUID>,
    },
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
    pub(super) fn is_read(&self, readers: &Readers) -> bool {
        let read = |writer: &Publisher<M>| readers.count(writer) > 0;
        read(&self.current)
            || self.before.as_ref().is_some_and(read)
            || self.next.as_ref().is_some_and(read)
    }

    /// Sets whether lost messages are sent again, which a writer keeps for its life: another one takes its place. Where
    /// DDS makes none, the old one stays until the next call.
    pub(super) fn set_reliable(&mut self, node: &mut Node, context: &Context, reliable: bool) {
        if self.out.reliable == reliable {
            return;
        }
        self.out.reliable = reliable;
        match self.make(node, context) {
            Some(writer) => {
                self.current = writer;
                (self.before, self.next) = (None, None);
                (self.stuck, self.sent) = (false, 0);
            }
            None => self.out.reliable = !reliable,
        }
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
        let full = std::mem::replace(&mut self.current, next);
        let gone = self.before.replace(full).map(|writer| writer.guid());
        let given_up = gone.map_or(0, |_| window as u64);
        self.sent = 1;
        match self.current.publish(message) {
            Ok(()) => Sent::Turned { given_up, gone },
            Err(_) => Sent::No,
        }
    }

    fn make(&self, node: &mut Node, context: &Context) -> Option<Publisher<M>> {
        let topic = (self.full_name.as_str(), self.kind);
        publisher(node, context, topic, self.out).ok()
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::disallowed_methods,
        reason = "real DDS and a real process need real time"
    )]

    use std::process::{Child, Command};
    use std::time::{Duration, Instant};

    use ros2_client::{NodeName, NodeOptions, Subscription};
    use rustix::process::{Pid, Signal, kill_process};

    use super::super::env::{Network, Range};
    use super::super::node::join;
    use super::super::topics::{In, subscription};
    use super::*;
    use crate::wire::ros::State;

    const TOPIC: (&str, TypeName) = ("/wheel", ("sweepd_msgs", "State"));
    /// Says to the reader's process which domain it is to join.
    const DOMAIN: &str = "SWEEPD_TEST_WHEEL_DOMAIN";
    /// Between two messages.
    const STEP: Duration = Duration::from_millis(40);

    fn peer(domain: u16, name: &str) -> (Context, Node) {
        let network = Network {
            domain,
            range: Range::Localhost,
            pinned: false,
        };
        let (context, _) = join(network).unwrap();
        let name = NodeName::new("/", name).unwrap();
        let node = context.new_node(name, NodeOptions::new()).unwrap();
        (context, node)
    }

    fn reader(context: &Context, node: &mut Node) -> Subscription<State> {
        let quality = In {
            reliable: true,
            latched: false,
            depth: 1,
        };
        subscription(node, context, TOPIC, quality).unwrap()
    }

    /// The process that is stopped: no test unless another one starts it.
    #[test]
    fn a_reader_in_a_process_of_its_own() {
        let Some(domain) = std::env::var(DOMAIN).ok().and_then(|d| d.parse().ok()) else {
            return;
        };
        let (context, mut node) = peer(domain, "stopped");
        let from = reader(&context, &mut node);
        let end = Instant::now() + Duration::from_secs(60);
        while Instant::now() < end {
            let _passed_over = from.take();
            std::thread::sleep(STEP / 4);
        }
    }

    struct Killed(Child);

    impl Drop for Killed {
        fn drop(&mut self) {
            let _gone = self.0.kill();
            let _reaped = self.0.wait();
        }
    }

    #[test]
    fn a_reader_that_stops_turns_the_writer_and_the_others_go_on() {
        let domain = 101 + u16::try_from(std::process::id() % 100).unwrap();
        let (context, mut node) = peer(domain, "writer");
        let (other, mut healthy) = peer(domain, "healthy");
        // A window of 16 messages: with 40 ms between them a stopped reader fills it in 0.6 s.
        let out = Out {
            bytes: 1 << 20,
            ..Out::RELIABLE
        };
        let mut wheel = Wheel::<State>::new(&mut node, &context, TOPIC, out).unwrap();
        let from = reader(&other, &mut healthy);
        let child = Command::new(std::env::current_exe().unwrap())
            .args([
                "transport::ros2::wheel::tests::a_reader_in_a_process_of_its_own",
                "--exact",
            ])
            .env(DOMAIN, domain.to_string())
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        let child = Killed(child);
        let (mut next, mut heard) = (0_u64, Vec::new());
        let mut step = |wheel: &mut Wheel<State>, node: &mut Node| {
            next += 1;
            let message = State {
                worst_a: next,
                ..State::default()
            };
            // Time enough for a turn, as far as the wheel knows.
            let sent = wheel.publish(node, &context, message, next * 2 * TURN_NS);
            std::thread::sleep(STEP);
            while let Ok(Some((message, _))) = from.take() {
                heard.push(message.worst_a);
            }
            (next, sent, heard.last().copied())
        };
        let end = Instant::now() + Duration::from_secs(30);
        let mut readers = Readers::of(&context);
        while readers.count(&wheel.current) < 2 {
            assert!(Instant::now() < end, "both readers are found");
            std::thread::sleep(STEP);
            readers.hear();
        }
        for _ in 0..50 {
            assert_eq!(
                step(&mut wheel, &mut node).1,
                Sent::Yes,
                "everybody acknowledges"
            );
        }
        kill_process(Pid::from_child(&child.0), Signal::STOP).unwrap();
        let (mut turned, mut lost, mut given_up) = (0, 0, 0);
        for _ in 0..150 {
            match step(&mut wheel, &mut node).1 {
                Sent::Yes => {}
                Sent::Turned {
                    given_up: count, ..
                } => {
                    turned += 1;
                    given_up += count;
                }
                Sent::No => lost += 1,
            }
        }
        assert!(turned >= 3, "{turned} turns");
        assert_eq!(lost, 0, "a writer with room was there for every message");
        let window = out.window() as u64;
        assert_eq!(
            given_up,
            (turned - 1) * window,
            "all that the stopped one lost"
        );
        // The healthy one goes on, also by the writer that is new by now.
        let end = Instant::now() + Duration::from_secs(10);
        let (number, ..) = step(&mut wheel, &mut node);
        while step(&mut wheel, &mut node)
            .2
            .is_none_or(|last| last < number)
        {
            assert!(Instant::now() < end, "the healthy reader goes on");
        }
        let after = heard.iter().filter(|n| **n > 50).count();
        assert!(after >= 75, "{after} of 150 came to the healthy reader");
        assert!(heard.is_sorted(), "in their order");
    }
}
