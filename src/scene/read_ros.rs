//! ROS 2 in a scene: which sources are topics of common types, and which frame or topic belongs to a body.
//!
//! In: the `ros2` table of a source, the `ros_frame` and `ros_topic` of bodies. Out: [`RosSource`], or an error.

use std::collections::BTreeMap;

use crate::config::{RosKind, RosSource, ros_name};
use crate::scene::SourceSpec;
use crate::scene::node::{Fault, Node};
use crate::scene::read_body::{BodyDraft, ROS_NAME_BYTES_MAX};
use crate::scene::read_scene::time_ns;
use crate::scene::resolve::within;
use crate::scene::table::{Table, shortened};

/// Default for `max_skew_ms`, nanoseconds: two frames of a 20 Hz localisation between a 100 Hz arm's.
const MAX_SKEW_NS_DEFAULT: u64 = 100_000_000;

/// Reads the `ros2` table of a source.
pub(crate) fn read_ros(node: Option<Node>) -> Result<Option<RosSource>, Fault> {
    let Some(node) = node else {
        return Ok(None);
    };
    const KEYS: &[&str] = &["type", "topic", "static_topic", "max_skew_ms"];
    let mut table = Table::open(node, "ros2", KEYS)?;
    let at = table.at("type");
    let kind = match table.text("type")?.as_deref() {
        Some("tf") => RosKind::Tf,
        Some("pose") => RosKind::Pose,
        Some("odometry") => RosKind::Odometry,
        other => {
            let text = format!(
                "ros2 has type \"{}\": write \"tf\" (TFMessage), \"pose\" (PoseStamped) or \"odometry\" (Odometry); a source of `~/transforms` needs no ros2",
                shortened(other.unwrap_or_default())
            );
            return Err(Fault::new(at, text));
        }
    };
    if kind != RosKind::Tf
        && let Some(key) = KEYS[1..].iter().find(|key| table.has(key))
    {
        let text = format!(
            "`{key}` is for type \"tf\": remove it; with this type each body says its own ros_topic"
        );
        return Err(Fault::new(table.at(key), text));
    }
    let mut topic = |key: &str, default: &str| -> Result<String, Fault> {
        let given = read_topic(&mut table, key)?;
        Ok(given.unwrap_or_else(|| default.to_owned()))
    };
    let (links, fixed) = (topic("topic", "/tf")?, topic("static_topic", "/tf_static")?);
    Ok(Some(RosSource {
        kind,
        topic: links,
        static_topic: fixed,
        max_skew_ns: time_ns(&mut table, "max_skew_ms", 0.0)?.unwrap_or(MAX_SKEW_NS_DEFAULT),
    }))
}

/// Takes the name of a topic from a table.
pub(crate) fn read_topic(table: &mut Table, key: &str) -> Result<Option<String>, Fault> {
    let at = table.at(key);
    match table.name(key, ROS_NAME_BYTES_MAX)? {
        Some(name) if !ros_name::is_topic(&name) => {
            let why = ros_name::no_topic(&shortened(&name));
            Err(Fault::new(at, format!("{key}: {why}")))
        }
        given => Ok(given),
    }
}

/// The message for a source of topics that is set to lead in lockstep, which it cannot.
pub(crate) fn no_lockstep(name: &str) -> String {
    format!(
        "on_frame names source \"{}\", whose poses come from ROS 2 topics body by body, so that no message of theirs is a whole frame: write mode = \"on_all\" or rate = HZ, or send `~/transforms` and take `ros2` out of the source",
        shortened(name)
    )
}

/// Checks that a body has what its source needs: nothing, a frame, or its own topic.
///
/// * `topics` - the topics of the bodies so far, and their bodies.
pub(crate) fn check_ros(
    draft: &BodyDraft,
    sources: &[SourceSpec],
    topics: &mut BTreeMap<String, String>,
) -> Result<(), Fault> {
    let spec = &draft.spec;
    let source = spec.source.and_then(|source| sources.get(source));
    let kind = source.and_then(|source| source.ros2.as_ref().map(|ros| ros.kind));
    let text = match (kind, &spec.ros_frame, &spec.ros_topic) {
        (None, None, None) | (Some(RosKind::Tf), _, None) => return Ok(()),
        (None, ..) => "it says ros_frame or ros_topic, but its source has no ros2: remove it, or add ros2 = { type = \"..\" } to the source".to_owned(),
        (Some(RosKind::Tf), ..) => "its source is of type \"tf\", which knows bodies by frame: write ros_frame = \"..\" instead of ros_topic".to_owned(),
        (Some(_), Some(_), _) => "its source has a topic a body: write ros_topic = \"..\" instead of ros_frame".to_owned(),
        (Some(_), None, None) => "its source has a topic a body: add ros_topic = \"/..\"".to_owned(),
        (Some(_), None, Some(topic)) => match topics.insert(topic.clone(), spec.name.clone()) {
            None => return Ok(()),
            Some(other) => format!(
                "ros_topic {} is that of body \"{}\": one topic moves one body",
                shortened(topic),
                shortened(&other)
            ),
        },
    };
    Err(within(draft, draft.places.ros.or(draft.places.name), text))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::config::RosKind;
    use crate::scene::Scene;

    fn scene(sources: &str, bodies: &str) -> Result<Scene, String> {
        let text = format!("{sources}\n{bodies}");
        Scene::parse(&text, "s.toml", Path::new("")).map_err(|e| e.to_string())
    }

    fn body(more: &str) -> String {
        format!("[[body]]\nname = 'b'\nshape = {{ type = 'sphere', radius = 1 }}\n{more}\n")
    }

    #[test]
    fn sources_of_topics_have_their_defaults() {
        let scene = scene("[[source]]\nname = 'tf'\nros2 = { type = 'tf' }", &body("")).unwrap();
        let ros = scene.sources[0].ros2.clone().unwrap();
        assert_eq!(
            (ros.kind, ros.topic.as_str(), ros.static_topic.as_str()),
            (RosKind::Tf, "/tf", "/tf_static")
        );
        assert_eq!(ros.max_skew_ns, 100_000_000);
    }

    #[test]
    fn what_does_not_fit_together_is_refused_with_the_mend() {
        let tf = "[[source]]\nname = 's'\nros2 = { type = 'tf' }";
        let pose = "[[source]]\nname = 's'\nros2 = { type = 'pose' }";
        let plain = "[[source]]\nname = 's'";
        let lead = "[run]\non_frame = 's'\n";
        let two = format!(
            "{}[[body]]\nname = 'c'\nros_topic = '/p'\nshape = {{ type = 'sphere', radius = 1 }}\n",
            body("ros_topic = '/p'")
        );
        for (sources, bodies, word) in [
            (
                format!("{lead}{tf}"),
                body(""),
                "no message of theirs is a whole frame",
            ),
            (tf.to_owned(), body("ros_topic = '/p'"), "write ros_frame"),
            (pose.to_owned(), body(""), "add ros_topic"),
            (pose.to_owned(), body("ros_frame = 'x'"), "write ros_topic"),
            (plain.to_owned(), body("ros_frame = 'x'"), "has no ros2"),
            (pose.to_owned(), two, "is that of body"),
            (
                "[[source]]\nname = 's'\nros2 = { type = 'pose', topic = '/x' }".to_owned(),
                String::new(),
                "is for type \"tf\"",
            ),
            (
                "[[source]]\nname = 's'\nros2 = { type = 'points' }".to_owned(),
                String::new(),
                "write \"tf\"",
            ),
        ] {
            let error = scene(&sources, &bodies).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }

    /// `check` found such a scene fine, and `run --ros2` told neither line nor body.
    #[test]
    fn bug_a_topic_that_is_none_is_told_with_its_line_and_body() {
        let source = |more: &str| {
            format!("[[source]]\nname = 's'\nros2 = {{ type = {more} }}\n[[body]]\nname = 'b'\n")
        };
        let shape = "shape = { type = 'sphere', radius = 1 }\n";
        for (text, line) in [
            (source("'pose'") + "ros_topic = '/a//b'\n" + shape, 6),
            (source("'tf', topic = 'a b'") + shape, 3),
            (source("'tf', static_topic = '/1'") + shape, 3),
        ] {
            let error = Scene::parse(&text, "s.toml", Path::new("")).unwrap_err();
            let told = error.to_string();
            let place = format!("s.toml:{line}:");
            assert!(
                told.contains(&place) && told.contains("is no name of a topic"),
                "{told}"
            );
        }
    }
}
