//! Readers that stop, and new readers, do not affect the other readers.

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
use crate::time::{Clock as _, SystemClock};
use crate::wire::ros::State;

pub(in super::super) const TOPIC: (&str, TypeName) = ("/wheel", ("sweepd_msgs", "State"));
/// Environment variable with the domain for the reader's process.
const DOMAIN: &str = "SWEEPD_TEST_WHEEL_DOMAIN";
/// Time between two messages.
pub(in super::super) const STEP: Duration = Duration::from_millis(40);
/// A window of 16 messages: with 40 ms between messages a stopped reader fills it in 0.6 s.
pub(in super::super) const SMALL: Out = Out {
    bytes: 1 << 20,
    ..Out::RELIABLE
};

/// The domain of this process for `place`; another process has the same one only if its id is equal modulo 16.
pub(in super::super) fn domain(place: u16) -> u16 {
    101 + u16::try_from(std::process::id() % 16).unwrap() * 8 + place
}

pub(in super::super) fn peer(domain: u16, name: &str) -> (Context, Node) {
    let network = Network {
        domain,
        range: Range::Localhost,
        pinned: false,
        unsecured: false,
        cyclone: false,
    };
    let (context, _) = join(network).unwrap();
    let name = NodeName::new("/", name).unwrap();
    let node = context.new_node(name, NodeOptions::new()).unwrap();
    (context, node)
}

pub(in super::super) fn reader(
    context: &Context,
    node: &mut Node,
    latched: bool,
) -> Subscription<State> {
    let quality = In {
        reliable: true,
        latched,
        depth: 100,
        patience: In::AT_START,
    };
    subscription(node, context, TOPIC, quality).unwrap()
}

/// Appends the numbers of the received messages.
pub(in super::super) fn hear(from: &Subscription<State>, heard: &mut Vec<u64>) {
    while let Ok(Some((message, _))) = from.take() {
        heard.push(message.worst_a);
    }
}

pub(in super::super) fn message(number: u64) -> State {
    State {
        worst_a: number,
        ..State::default()
    }
}

/// The body of the process that is stopped; does nothing as a test of its own.
#[test]
fn a_reader_in_a_process_of_its_own() {
    let Some(domain) = std::env::var(DOMAIN).ok().and_then(|d| d.parse().ok()) else {
        return;
    };
    let (context, mut node) = peer(domain, "stopped");
    let from = reader(&context, &mut node, false);
    let end = Instant::now() + Duration::from_secs(60);
    while Instant::now() < end {
        let _passed_over = from.take();
        std::thread::sleep(STEP / 4);
    }
}

pub(in super::super) struct Killed(Child);

impl Killed {
    /// Stops the process, which acknowledges nothing from then on.
    pub(in super::super) fn stop(&self) {
        kill_process(Pid::from_child(&self.0), Signal::STOP).unwrap();
    }
}

/// Starts a reader in a process of its own, to be stopped.
pub(in super::super) fn stopped(domain: u16) -> Killed {
    let child = Command::new(std::env::current_exe().unwrap())
        .args([
            "transport::ros2::wheel::tests::a_reader_in_a_process_of_its_own",
            "--exact",
        ])
        .env(DOMAIN, domain.to_string())
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    Killed(child)
}

impl Drop for Killed {
    fn drop(&mut self) {
        let _gone = self.0.kill();
        let _reaped = self.0.wait();
    }
}

/// A wheel, and a healthy reader in another participant of this process.
struct Rig {
    node: Node,
    context: Context,
    wheel: Wheel<State>,
    readers: Readers,
    _healthy: (Context, Node),
    from: Subscription<State>,
    next: u64,
    heard: Vec<u64>,
    sent: Sent,
    turns: u64,
}

impl Rig {
    fn of(domain: u16) -> Self {
        let (context, mut node) = peer(domain, "writer");
        let readers = Readers::of(&context);
        let mut healthy = peer(domain, "healthy");
        let wheel = Wheel::new(&mut node, &context, TOPIC, SMALL).unwrap();
        let from = reader(&healthy.0, &mut healthy.1, false);
        Self {
            node,
            context,
            wheel,
            readers,
            _healthy: healthy,
            from,
            next: 0,
            heard: Vec::new(),
            sent: Sent::default(),
            turns: 0,
        }
    }

    fn await_readers(&mut self, count: usize) {
        let end = Instant::now() + Duration::from_secs(30);
        while self.readers.count(&self.wheel.current) < count {
            assert!(Instant::now() < end, "all readers are found");
            std::thread::sleep(STEP);
            self.readers.hear(SystemClock.boottime_ns());
        }
    }

    /// Publishes one message, and reads those that arrived.
    fn step(&mut self) {
        self.next += 1;
        let now_ns = SystemClock.boottime_ns();
        self.readers.hear(now_ns);
        let mut means = Means {
            node: &mut self.node,
            context: &self.context,
            readers: &mut self.readers,
            now_ns,
        };
        let sent = self.wheel.publish(message(self.next), &mut means);
        self.sent.lost += sent.lost;
        self.sent.given_up += sent.given_up;
        self.turns += u64::from(sent.turned);
        std::thread::sleep(STEP);
        hear(&self.from, &mut self.heard);
    }

    /// Continues until a message of now or later is received, so that earlier ones are received or lost.
    fn settle(&mut self) {
        let last = self.next;
        let end = Instant::now() + Duration::from_secs(10);
        while self.heard.last().is_none_or(|heard| *heard < last) {
            assert!(Instant::now() < end, "the healthy reader goes on");
            self.step();
        }
    }

    fn missing(&self) -> Vec<u64> {
        let last = self.heard.last().copied().unwrap_or(0);
        (1..last).filter(|n| !self.heard.contains(n)).collect()
    }
}

#[test]
fn a_reader_that_stops_turns_the_writer_and_the_others_go_on() {
    let domain = domain(0);
    let mut rig = Rig::of(domain);
    let child = stopped(domain);
    rig.await_readers(2);
    for _ in 0..50 {
        rig.step();
    }
    assert_eq!(
        (rig.sent, rig.turns),
        (Sent::default(), 0),
        "all acknowledge"
    );
    child.stop();
    for _ in 0..150 {
        rig.step();
    }
    rig.settle();
    assert!(rig.turns >= 3, "{} turns", rig.turns);
    assert_eq!(rig.sent.lost, 0, "a writer with room was there in time");
    let window = SMALL.window() as u64;
    assert_eq!(rig.sent.given_up, (rig.turns - 1) * window);
    assert!(rig.heard.is_sorted(), "in their order");
    assert_eq!(rig.missing(), [0; 0], "of {}", rig.next);
    // A writer of another reliability replaces all writers, and their readers are forgotten.
    let beside = rig.wheel.before.iter().chain(&rig.wheel.next);
    let all: Vec<_> = beside
        .chain([&rig.wheel.current])
        .map(Publisher::guid)
        .collect();
    let known = |rig: &Rig| all.iter().filter(|guid| rig.readers.knows(guid)).count();
    assert!(all.len() >= 2 && known(&rig) >= 2, "{all:?}");
    let mut means = Means {
        node: &mut rig.node,
        context: &rig.context,
        readers: &mut rig.readers,
        now_ns: 0,
    };
    rig.wheel.set_reliable(&mut means, false);
    assert_eq!(known(&rig), 0);
}

#[test]
fn bug_a_reader_that_comes_to_a_busy_topic_costs_the_others_nothing() {
    let domain = domain(1);
    let mut rig = Rig::of(domain);
    rig.await_readers(1);
    // The writer has sent more than its window before the others join.
    for _ in 0..3 * SMALL.window() {
        rig.step();
    }
    for round in 0..3 {
        let mut newcomer = peer(domain, &format!("newcomer_{round}"));
        let from = reader(&newcomer.0, &mut newcomer.1, false);
        let mut heard = Vec::new();
        for _ in 0..60 {
            rig.step();
            hear(&from, &mut heard);
        }
        assert!(!heard.is_empty(), "the newcomer is served");
    }
    rig.settle();
    assert_eq!((rig.sent, rig.turns), (Sent::default(), 0));
    assert_eq!(rig.missing(), [0; 0], "of {}", rig.next);
}
