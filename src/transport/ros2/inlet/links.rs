//! Links of `/tf`, and poses of the bodies at the end of their chains. In: messages, the sources that read them. Out:
//! poses on the shelf.

use super::super::poses::{Receipt, Source};
use super::super::shared::Shared;
use super::super::shelf::{Shelf, Update};
use crate::wire::name_str;
use crate::wire::ros::TfMessage;

/// Takes the links of a message for the sources with these indices.
///
/// If a link has changed since the last look and changes again, poses of continuous bodies are looked up in between,
/// since each pose is part of a path.
pub(super) fn take_links(
    (sources, places): (&mut [Source], impl Iterator<Item = usize>),
    (shelf, shared): (&Shelf, &Shared),
    (message, fixed): (&TfMessage, bool),
    receipt: Receipt,
    updates: &mut Vec<Update>,
) {
    for place in places {
        let Some(source) = sources.get_mut(place) else {
            continue;
        };
        if source.is_overtaken(message) {
            look_at((source, place), shelf, receipt, updates);
        }
        if source.take_links(message, fixed, receipt) {
            shelf.reset(place);
            shared.say_back(&source_name(source), receipt.now_ns);
        }
    }
}

/// Hands on the poses of a source's bodies whose chains have changed; returns whether there are any.
pub(super) fn look_at(
    (source, place): (&mut Source, usize),
    shelf: &Shelf,
    receipt: Receipt,
    updates: &mut Vec<Update>,
) -> bool {
    updates.clear();
    source.look(receipt, updates);
    if !updates.is_empty() {
        shelf.merge(place, updates);
    }
    !updates.is_empty()
}

pub(super) fn source_name(source: &Source) -> String {
    name_str(&source.name).unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use ros2_client::Gid;

    use super::super::super::say::Say;
    use super::super::super::{RosScene, RosSourceSpec};
    use super::*;
    use crate::config::{RosKind, RosSource};
    use crate::transport::BodyNote;
    use crate::wire::Inbox;
    use crate::wire::ros::{Book, Header, Time, Transform, TransformStamped};

    const MS: u64 = 1_000_000;

    /// A source of links with one body, at frame `tool`.
    fn source(continuous: bool) -> Source {
        let ros2 = RosSource {
            kind: RosKind::Tf,
            topic: "/tf".to_owned(),
            static_topic: "/tf_static".to_owned(),
            max_skew_ns: 100 * MS,
        };
        let scene = RosScene {
            frame_id: "world".to_owned(),
            sources: vec![RosSourceSpec {
                name: "s".to_owned(),
                timeout_ns: 500 * MS,
                ros2: Some(ros2),
            }],
            bodies: vec![BodyNote {
                id: 1,
                name: "a".to_owned(),
                source: Some(0),
                frame: "tool".to_owned(),
                continuous,
                ..BodyNote::default()
            }],
            ..RosScene::default()
        };
        Source::of(&scene).remove(0)
    }

    fn link(parent: &str, child: &str, stamp_ns: u64) -> TfMessage {
        let transform = Transform {
            translation: [1e-9 * stamp_ns as f64, 0.0, 0.0].into(),
            rotation: [0.0, 0.0, 0.0, 1.0].into(),
        };
        let header = Header {
            stamp: Time::from_ns(stamp_ns),
            frame_id: parent.to_owned(),
        };
        let child_frame_id = child.to_owned();
        TfMessage {
            transforms: vec![TransformStamped {
                header,
                child_frame_id,
                transform,
            }],
        }
    }

    /// The number of the frame from a round with three links of a body and of its parent frame.
    fn number(continuous: bool) -> u64 {
        let (mut sources, shelf, mut updates) = ([source(continuous)], Shelf::default(), vec![]);
        shelf.add_group(sources[0].name, 9, sources[0].seats());
        let shared = Shared::new("n", Book::default(), &[500 * MS], Say::Warn);
        let receipt = Receipt {
            now_ns: 10 * MS,
            waited: false,
            ros_now_ns: 0,
            from: Gid::ZERO,
        };
        let mut take = |message: &TfMessage, fixed| {
            let of = (&mut sources[..], std::iter::once(0));
            take_links(
                of,
                (&shelf, &shared),
                (message, fixed),
                receipt,
                &mut updates,
            );
        };
        take(&link("world", "base", MS), false);
        for stamp_ns in [MS, 2 * MS, 3 * MS] {
            take(&link("base", "tool", stamp_ns), false);
            // No body depends on this link.
            take(&link("base", "flag", MS), true);
        }
        assert!(look_at((&mut sources[0], 0), &shelf, receipt, &mut updates));
        let mut inbox = Inbox::default();
        shelf.drain(&mut inbox);
        assert_eq!(inbox.frames().len(), 1);
        inbox.frames()[0].header.seq
    }

    #[test]
    fn bug_links_of_a_continuous_body_that_came_in_one_round_counted_as_one_pose() {
        assert_eq!(number(true), 3);
        assert_eq!(number(false), 1);
    }
}
