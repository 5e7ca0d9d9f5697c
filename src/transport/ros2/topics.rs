//! Topics with their types and qualities of service. In: full names. Out: publishers and subscriptions of a node.

use ros2_client::qos::{History, QosProfile, WhenFull};
use ros2_client::{MessageTypeName, Node, Publisher, Subscription};
use rustdds::policy::ResourceLimits;
use rustdds::{QosPolicies, QosPolicyBuilder, Topic, TopicKind};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::time::Duration;

use crate::error::{Error, Result};

/// Bytes of unacknowledged messages that one reliable topic may keep: a reader that has stopped is given up by its
/// lease after 20 s, and until then must cost no more than this.
const UNACKED_BYTES_MAX: usize = 8 << 20;
/// Unacknowledged messages that one topic may keep, however small.
const UNACKED_MAX: usize = 1 << 14;
/// Lease of liveliness, offered where silence must be told: shorter ones flap, because the crate asserts once a second.
const LEASE: Duration = Duration::from_secs(3);

/// A topic's package and type, such as `sweepd_msgs` and `Tick`.
pub(super) type TypeName = (&'static str, &'static str);

/// How a topic goes out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Out {
    /// Whether lost messages are sent again.
    pub(super) reliable: bool,
    /// Whether late joiners get the last one.
    pub(super) latched: bool,
    /// Two heartbeats, where silence must be told.
    pub(super) deadline: Option<Duration>,
    /// Messages kept for late joiners and repairs.
    pub(super) depth: usize,
    /// Bytes of a message at its largest, for the bound of what is kept.
    pub(super) bytes: usize,
}

impl Out {
    /// Reliable, nothing kept.
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
            // A full window is this node's loss, never its wait.
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

    /// Messages that may wait for acknowledgement.
    pub(super) fn window(self) -> usize {
        (UNACKED_BYTES_MAX / self.bytes.max(1)).clamp(self.depth.max(16), UNACKED_MAX)
    }
}

/// How a topic comes in.
#[derive(Clone, Copy, Debug)]
pub(super) struct In {
    /// Whether it asks for lost messages again; such a reader does not match best-effort writers.
    pub(super) reliable: bool,
    /// Whether it asks for what was said before it came.
    pub(super) latched: bool,
    /// Messages that may wait.
    pub(super) depth: usize,
}

impl In {
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
    node.create_subscription(&topic, None)
        .map_err(|e| failed(full, e))
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

/// What DDS said of a topic or service.
pub(super) fn failed(name: &str, e: impl std::error::Error + Send + Sync + 'static) -> Error {
    Error::io(format!("ROS 2: {name} cannot be opened"), e)
}
