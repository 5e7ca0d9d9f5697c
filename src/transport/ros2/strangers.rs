//! Endpoints on a topic of this node with another message type. In: discovered readers and writers. Out: a text for
//! each such topic and type, for as long as they exist.
//!
//! DDS does not match endpoints of different types: messages of a wrong type are not received, and nothing reports it.

use std::collections::BTreeMap;

use ros2_client::{Context, MessageTypeName};
use rustdds::RTPSEntity as _;

use super::RosScene;
use super::names::Names;
use super::told::brief;
use super::topics::TypeName;
use crate::config::RosKind;

/// The topics of every node.
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

/// Time between two looks, nanoseconds: a look copies the data of every endpoint in the domain.
const LOOK_NS: u64 = 1_000_000_000;

/// Looks for endpoints of another type.
pub(super) struct Strangers {
    context: Context,
    /// The type of each topic, both with their DDS names.
    own: BTreeMap<String, String>,
    /// Result of the last look, and its time, nanoseconds of `CLOCK_BOOTTIME`.
    found: Vec<String>,
    looked_ns: u64,
}

impl Strangers {
    /// Watches the topics of a node and of its sources.
    pub(super) fn of(context: &Context, names: &Names, scene: &RosScene) -> Self {
        let mut own = BTreeMap::new();
        let mut put = |name: &str, (package, kind): TypeName| {
            // An invalid name has no topic.
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

    /// Adds the topic of a body, by its full name.
    pub(super) fn meet(&mut self, topic: &str, kind: RosKind) {
        let (package, kind) = match kind {
            RosKind::Pose => ("geometry_msgs", "PoseStamped"),
            RosKind::Odometry => ("nav_msgs", "Odometry"),
            RosKind::Tf => return,
        };
        let kind = MessageTypeName::new(package, kind).dds_msg_type();
        self.own.insert(format!("rt{topic}"), kind);
    }

    /// Removes the topic of a body that was removed, by its full name.
    pub(super) fn part(&mut self, topic: &str) {
        self.own.remove(&format!("rt{topic}"));
    }

    /// The texts of the last look.
    pub(super) fn found(&self) -> &[String] {
        &self.found
    }

    /// Looks once per second; returns the texts that are new.
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

    /// One text per topic and type.
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

/// A DDS type name as ROS users write it.
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
