//! Topics with their types and quality of service. In: full names. Out: publishers and subscriptions of a node.

use ros2_client::qos::{History, QosProfile, WhenFull};
use ros2_client::{MessageTypeName, Node, Publisher, Subscription};
use rustdds::policy::ResourceLimits;
use rustdds::{QosPolicies, QosPolicyBuilder, Topic, TopicKind};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::time::Duration;

use crate::error::{Error, Result};
use crate::time::{Clock as _, SystemClock};

/// Bytes of unacknowledged messages that a reliable topic may keep. DDS drops a stopped reader only when its lease ends
/// after 20 s; until then it must not cost more memory than this.
const UNACKED_BYTES_MAX: usize = 8 << 20;
/// Unacknowledged messages that a topic may keep, however small they are.
const UNACKED_MAX: usize = 1 << 14;
/// Lease of liveliness, where silence must be detected. Shorter leases flap, because `rustdds` asserts once per second.
const LEASE: Duration = Duration::from_secs(3);

/// Time between two attempts to open a reader for which DDS has no room; DDS empties a full queue in about this time.
/// Each failed attempt is reverted through a queue of four, which may block for 20 ms.
const AGAIN: Duration = Duration::from_millis(10);
/// Error text of DDS for a full queue. New readers wait for the DDS thread in a queue of 100 (rustdds 0.15), and one
/// more is refused at once; new writers wait until they are taken.
const FULL: &str = "full channel";

/// A topic's package and type, such as `sweepd_msgs` and `Tick`.
pub(super) type TypeName = (&'static str, &'static str);

/// Quality of service of a published topic.
#[derive(Clone, Copy, Debug)]
pub(super) struct Out {
    /// Whether lost messages are sent again.
    pub(super) reliable: bool,
    /// Whether late joiners get the last message.
    pub(super) latched: bool,
    /// Deadline of two heartbeats, where silence must be detected.
    pub(super) deadline: Option<Duration>,
    /// Messages kept for late joiners and retransmission.
    pub(super) depth: usize,
    /// Largest size of a message, bytes, for the limit of unacknowledged ones.
    pub(super) bytes: usize,
}

impl Out {
    /// Reliable, with nothing kept for late joiners.
    pub(super) const RELIABLE: Self = Self {
        reliable: true,
        latched: false,
        deadline: None,
        depth: 1,
        bytes: 4096,
    };

    fn profile(self) -> QosProfile {
        let profile =
            QosProfile::publisher_default().history(History::KeepLast { depth: self.depth });
        let profile = if self.reliable {
            // A full window loses messages of this node, but must never block it.
            profile.reliability_reliable(WhenFull::Fail)
        } else {
            profile.reliability_best_effort()
        };
        let profile = if self.latched {
            profile.durability(ros2_client::qos::Durability::TransientLocal)
        } else {
            profile
        };
        match self.deadline {
            Some(_) => profile
                .deadline(self.deadline)
                .liveliness_lease(Some(LEASE)),
            None => profile,
        }
    }

    /// Number of messages that may wait for acknowledgement.
    pub(super) fn window(self) -> usize {
        (UNACKED_BYTES_MAX / self.bytes.max(1)).clamp(self.depth.max(16), UNACKED_MAX)
    }
}

/// Quality of service of a subscribed topic.
#[derive(Clone, Copy, Debug)]
pub(super) struct In {
    /// Whether it requests lost messages again; a reliable reader does not match best-effort writers.
    pub(super) reliable: bool,
    /// Whether it requests messages sent before it existed.
    pub(super) latched: bool,
    /// Messages that may wait to be read.
    pub(super) depth: usize,
    /// Longest wait for room in the DDS queue of new readers.
    pub(super) patience: Duration,
}

impl In {
    /// Before the first tick, when no thread waits.
    pub(super) const AT_START: Duration = Duration::from_secs(2);
    /// During operation, on the thread that publishes ticks: one more attempt.
    pub(super) const BESIDE_TICKS: Duration = Duration::from_millis(6);

    fn profile(self) -> QosProfile {
        let profile =
            QosProfile::subscription_default().history(History::KeepLast { depth: self.depth });
        let profile = if self.reliable {
            profile.reliability_reliable(WhenFull::DEFAULT)
        } else {
            profile
        };
        if self.latched {
            profile.durability(ros2_client::qos::Durability::TransientLocal)
        } else {
            profile
        }
    }
}

/// Creates a publisher.
///
/// # Errors
/// `Error::Io` when DDS refuses.
pub(super) fn publisher<M: Serialize>(
    node: &mut Node,
    context: &ros2_client::Context,
    (full, kind): (&str, TypeName),
    out: Out,
) -> Result<Publisher<M>> {
    let window = i32::try_from(out.window()).unwrap_or(i32::MAX);
    let bound = QosPolicyBuilder::new()
        .resource_limits(ResourceLimits {
            max_samples: window,
            max_instances: window,
            max_samples_per_instance: window,
        })
        .build();
    let qos = QosPolicies::from(out.profile()).modify_by(&bound);
    let topic = topic(context, full, kind, &qos)?;
    node.create_publisher(&topic, None)
        .map_err(|e| failed(full, e))
}

/// Creates a subscription.
///
/// # Errors
/// `Error::Io` when DDS refuses.
pub(super) fn subscription<M: DeserializeOwned + 'static>(
    node: &mut Node,
    context: &ros2_client::Context,
    (full, kind): (&str, TypeName),
    quality: In,
) -> Result<Subscription<M>> {
    let qos = QosPolicies::from(quality.profile());
    let topic = topic(context, full, kind, &qos)?;
    patiently(quality.patience, || node.create_subscription(&topic, None))
        .map_err(|e| failed(full, e))
}

/// Creates something with a reader; retries while the DDS queue of new readers is full.
///
/// # Errors
/// The error of the last attempt.
pub(super) fn patiently<T, E: std::fmt::Display>(
    patience: Duration,
    mut make: impl FnMut() -> std::result::Result<T, E>,
) -> std::result::Result<T, E> {
    let begun_ns = SystemClock.boottime_ns();
    loop {
        let made = make();
        let waited_ns = SystemClock.boottime_ns().saturating_sub(begun_ns);
        match &made {
            Err(e) if u128::from(waited_ns) < patience.as_nanos() && is_full(e) => {
                #[allow(
                    clippy::disallowed_methods,
                    reason = "DDS has nothing to wait on; no tick waits for this thread"
                )]
                std::thread::sleep(AGAIN);
            }
            _ => return made,
        }
    }
}

fn is_full(e: &impl std::fmt::Display) -> bool {
    e.to_string().contains(FULL)
}

fn topic(
    context: &ros2_client::Context,
    full: &str,
    (package, kind): TypeName,
    qos: &QosPolicies,
) -> Result<Topic> {
    let kind = MessageTypeName::new(package, kind).dds_msg_type();
    context
        .domain_participant()
        .create_topic(format!("rt{full}"), kind, qos, TopicKind::NoKey)
        .map_err(|e| failed(full, e))
}

/// The error of a topic or service that could not be opened.
pub(super) fn failed(name: &str, e: impl std::error::Error + Send + Sync + 'static) -> Error {
    Error::io(format!("ROS 2: {name} cannot be opened"), e)
}

#[cfg(test)]
mod tests {
    use super::super::lines::of_body;
    use super::super::wheel::tests::{domain, peer};
    use super::*;
    use crate::config::RosKind;

    #[test]
    fn bug_a_scene_of_more_bodies_than_dds_has_room_for_new_readers_did_not_open() {
        let (context, mut node) = peer(domain(6), "many");
        let mut lines = Vec::new();
        for number in 0..180 {
            let (with, topic) = ((&mut node, &context), format!("/many/b{number}"));
            let line = of_body(with, RosKind::Pose, &topic, In::AT_START);
            lines.push(line.unwrap());
        }
    }

    #[test]
    fn what_fails_otherwise_is_not_tried_again_and_patience_has_an_end() {
        let mut tries = 0;
        let mut make = |why: &str, patience| {
            let made: std::result::Result<(), String> = patiently(patience, || {
                tries += 1;
                Err(why.to_owned())
            });
            assert!(made.is_err());
            std::mem::take(&mut tries)
        };
        assert_eq!(make("no such type", In::AT_START), 1);
        assert!(make("sending on a full channel", In::BESIDE_TICKS) > 1);
        assert_eq!(make("sending on a full channel", Duration::ZERO), 1);
    }
}
