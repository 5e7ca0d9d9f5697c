//! Endpoints of another type on a topic of this node. In: what participants say of their readers and writers. Out:
//! words on each topic where one is, while it is there.
//!
//! DDS matches no two endpoints of different types: who sends a wrong type is not heard, and nothing else would tell.

use std::collections::BTreeMap;

use ros2_client::{Context, MessageTypeName};
use rustdds::RTPSEntity as _;

use super::RosScene;
use super::names::Names;
use super::told::brief;
use super::topics::TypeName;
use crate::config::RosKind;

/// The topics that every node has.
const OWN: [(&str, TypeName); 10] = [
    ("~/transforms", ("sweepd_msgs", "BodyTransforms")),
    ("~/state", ("sweepd_msgs", "State")),
    ("~/tick", ("sweepd_msgs", "Tick")),
    ("~/pairs", ("sweepd_msgs", "Pairs")),
    ("~/contacts", ("sweepd_msgs", "Contacts")),
    ("~/names", ("sweepd_msgs", "Names")),
    ("~/markers", ("visualization_msgs", "MarkerArray")),
    ("~/collisions", ("ros_gz_interfaces", "Contacts")),
    ("/diagnostics", ("diagnostic_msgs", "DiagnosticArray")),
    ("/clock", ("rosgraph_msgs", "Clock")),
];

/// Between two looks, nanoseconds: a look copies what is known of every endpoint in the domain.
const LOOK_NS: u64 = 1_000_000_000;

/// Looks for endpoints of another type.
pub(super) struct Strangers {
    context: Context,
    /// The type of each topic, both as DDS names them.
    own: BTreeMap<String, String>,
    /// What the last look found, and when it was, nanoseconds of `CLOCK_BOOTTIME`.
    found: Vec<String>,
    looked_ns: u64,
}

impl Strangers {
    /// A look-out on the topics of a node and of its sources.
    pub(super) fn of(context: &Context, names: &Names, scene: &RosScene) -> Self {
        let mut own = BTreeMap::new();
        let mut put = |name: &str, (package, kind): TypeName| {
            // A name that is none has no topic.
            if let Ok(full) = names.resolve(name) {
                let kind = MessageTypeName::new(package, kind).dds_msg_type();
                own.insert(format!("rt{full}"), kind);
            }
        };
        for (name, kind) in OWN {
            put(name, kind);
        }
        for ros in scene.sources.iter().filter_map(|s| s.ros2.as_ref()) {
            if ros.kind == RosKind::Tf {
                put(&ros.topic, ("tf2_msgs", "TFMessage"));
                put(&ros.static_topic, ("tf2_msgs", "TFMessage"));
            }
        }
        let mut watch = Self {
            context: context.clone(),
            own,
            found: Vec::new(),
            looked_ns: 0,
        };
        for body in &scene.bodies {
            let source = body.source.and_then(|place| scene.sources.get(place));
            let ros = source.and_then(|source| source.ros2.as_ref());
            if let (Some(ros), Some(topic)) = (ros, names.of_body(&body.topic)) {
                watch.meet(&topic, ros.kind);
            }
        }
        watch
    }

    /// Takes the topic of a body, by its full name.
    pub(super) fn meet(&mut self, topic: &str, kind: RosKind) {
        let (package, kind) = match kind {
            RosKind::Pose => ("geometry_msgs", "PoseStamped"),
            RosKind::Odometry => ("nav_msgs", "Odometry"),
            RosKind::Tf => return,
        };
        let kind = MessageTypeName::new(package, kind).dds_msg_type();
        self.own.insert(format!("rt{topic}"), kind);
    }

    /// The topic of a body that has left, by its full name, is nothing to this node any more.
    pub(super) fn part(&mut self, topic: &str) {
        self.own.remove(&format!("rt{topic}"));
    }

    /// What is so now.
    pub(super) fn found(&self) -> &[String] {
        &self.found
    }

    /// Looks once a second; what is new.
    pub(super) fn watch(&mut self, now_ns: u64) -> Vec<String> {
        if now_ns.saturating_sub(self.looked_ns) < LOOK_NS {
            return Vec::new();
        }
        self.looked_ns = now_ns;
        let found = self.look();
        let before = std::mem::replace(&mut self.found, found);
        let new = self.found.iter().filter(|text| !before.contains(text));
        new.cloned().collect()
    }

    /// A line a topic and type.
    fn look(&self) -> Vec<String> {
        let participant = self.context.domain_participant();
        let here = participant.guid().prefix;
        let mut found: BTreeMap<(String, String), usize> = BTreeMap::new();
        let mut note = |topic: &str, kind: &str| {
            if self.own.get(topic).is_some_and(|own| own != kind) {
                let key = (topic.to_owned(), kind.to_owned());
                *found.entry(key).or_default() += 1;
            }
        };
        for writer in participant.discovered_writers() {
            let data = &writer.publication_topic_data;
            if data.key.prefix != here {
                note(&data.topic_name, &data.type_name);
            }
        }
        for reader in participant.discovered_readers() {
            let data = &reader.subscription_topic_data;
            if data.key().prefix != here {
                note(data.topic_name(), data.type_name());
            }
        }
        let own = |topic: &str| self.own.get(topic).map_or("", String::as_str);
        let text = |((topic, kind), count): (&(String, String), &usize)| {
            format!(
                "topic {}: {count} endpoints of other nodes have type {} there, and this node {}: they do not hear each other; remap one or send the right type",
                topic.trim_start_matches("rt"),
                brief(&as_ros(kind)),
                as_ros(own(topic)),
            )
        };
        found.iter().map(text).collect()
    }
}

/// A type as ROS users write it.
fn as_ros(kind: &str) -> String {
    let plain = kind.replace("::dds_::", "/").replace("::", "/");
    plain.strip_suffix('_').unwrap_or(&plain).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_said_as_ros_users_write_them() {
        let kind = MessageTypeName::new("std_msgs", "String").dds_msg_type();
        assert_eq!(as_ros(&kind), "std_msgs/msg/String");
    }
}
