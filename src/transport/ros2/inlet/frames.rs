//! Frames of `~/transforms` as the daemon's, and what is odd about them, in words.

use super::super::RosScene;
use super::super::poses::{Receipt, off};
use super::super::tf::{plain, sound};
use super::super::told::brief;
use crate::limits::FRAME_ROWS_MAX;
use crate::wire::ros::{BodyTransform, BodyTransforms, Book, Twist};
use crate::wire::{Frame, FrameHeader, RejectReason, TransformRow, WIRE_VERSION, name_bytes};

/// What is wrong with a frame that is not in the scene's frame.
fn foreign(message: &BodyTransforms, frame_id: &str) -> Option<String> {
    let given = plain(&message.header.frame_id);
    (!given.is_empty() && given != plain(frame_id)).then(|| {
        format!(
            "frames of source {} are in \"{}\", not in the scene's frame \"{frame_id}\": they are refused",
            brief(&message.source),
            brief(given)
        )
    })
}

/// What frames are held against.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Local {
    /// The scene's frame.
    pub(super) frame_id: String,
    /// The scene's sources by name, in its order.
    sources: Vec<String>,
    /// This run of the daemon.
    boot_id: u64,
}

impl Local {
    /// Of a scene, in this run of the daemon.
    pub(in super::super) fn of(scene: &RosScene, boot_id: u64) -> Self {
        let sources = scene.sources.iter();
        Self {
            frame_id: scene.frame_id.clone(),
            sources: sources.map(|source| source.name.clone()).collect(),
            boot_id,
        }
    }

    /// The place of a source in the scene.
    pub(super) fn place(&self, source: &str) -> Option<usize> {
        self.sources.iter().position(|own| own == source)
    }

    /// What is wrong with a frame as a whole, and why it is refused for that: it is not in the scene's frame, or names
    /// bodies by ids that are of another run of the daemon, where they may be other bodies'.
    pub(super) fn fault(&self, message: &BodyTransforms) -> Option<(RejectReason, String)> {
        if let Some(text) = foreign(message, &self.frame_id) {
            return Some((RejectReason::BadChain, text));
        }
        let by_id = message.transforms.iter().any(|body| body.name.is_empty());
        if !by_id || message.boot_id == self.boot_id {
            return None;
        }
        let text = format!(
            "frames of source {} say bodies by id with boot_id {}, and this run of the daemon is {}: they are refused; send names, or ids with the boot_id of the ~/names they are from",
            brief(&message.source),
            message.boot_id,
            self.boot_id
        );
        Some((RejectReason::SessionOver, text))
    }

    /// What is odd about a frame whose other bodies are taken as they come: a pose that is none, a body that another
    /// source moves, or a stamp far from the node's clock where it is said to be of that.
    pub(super) fn odd(
        &self,
        message: &BodyTransforms,
        receipt: Receipt,
        book: &Book,
    ) -> Option<String> {
        let place = self.place(&message.source);
        let source = brief(&message.source);
        let odd_body = message.transforms.iter().find_map(|body| {
            let id = id(body, book);
            let name = match body.name.as_str() {
                "" => body.body.to_string(),
                name => brief(name).into_owned(),
            };
            let (position, orientation) = (body.pose.position.into(), body.pose.orientation.into());
            if let Err(reason) = sound(position, orientation) {
                return Some(format!(
                    "body {name}: its pose from source {source} is no pose: {reason}"
                ));
            }
            // A source that the scene does not have is counted as that.
            let owner = place.and(book.source(id));
            let other = owner.filter(|owner| Some(*owner) != place)?;
            let other = self.sources.get(other).map_or("?", String::as_str);
            Some(format!(
                "body {name}: source {source} sends it on ~/transforms, but the scene has source {other} move it: what {source} says of it is refused"
            ))
        });
        odd_body.or_else(|| {
            if message.clock_id != 0 {
                return None;
            }
            let stamp_ns = message.header.stamp.to_ns();
            let text = off(("source", &source), stamp_ns, receipt, 0)?;
            Some(format!(
                "{text}; frames of another clock have a clock_id other than 0"
            ))
        })
    }
}

/// The id of a body; no body has id 0, so a name that nobody has is counted where unknown ids are.
fn id(body: &BodyTransform, book: &Book) -> u64 {
    match body.name.as_str() {
        "" => body.body,
        name => book.id(name).unwrap_or(0),
    }
}

/// A frame of the daemon from one of `~/transforms`.
pub(super) fn fill(frame: &mut Frame, message: &BodyTransforms, book: &Book, receipt: Receipt) {
    frame.header = FrameHeader {
        session: message.session,
        epoch: message.epoch,
        seq: message.seq,
        sent_ns: message.sent_ns,
        stamp_ns: message.header.stamp.to_ns(),
        scene_rev: message.scene_rev,
        deadline_ns: message.deadline_ns,
        time_left_ns: message.time_left_ns,
        source: name_bytes(&message.source),
        flags: message.flags,
        clock_id: message.clock_id,
        schema: WIRE_VERSION,
        boot: 0,
    };
    frame.received_ns = receipt.now_ns;
    frame.waited = receipt.waited;
    frame.refused = None;
    frame.transforms.clear();
    frame.velocities.clear();
    frame.stamps_ns.clear();
    frame.refused_bodies.clear();
    if message.transforms.len() > FRAME_ROWS_MAX {
        frame.refused = Some(RejectReason::OverLimit);
        return;
    }
    let rows = message.transforms.iter().map(|body| TransformRow {
        body: id(body, book),
        position: body.pose.position.into(),
        orientation: body.pose.orientation.into(),
        ..TransformRow::default()
    });
    frame.transforms.extend(rows);
    let velocity = |twist: &Twist| {
        let (l, a) = (twist.linear, twist.angular);
        [l.x, l.y, l.z, a.x, a.y, a.z]
    };
    frame
        .velocities
        .extend(message.velocities.iter().map(velocity));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::NameRow;
    const S: u64 = 1_000_000_000;

    /// A scene of two sources; the second one moves the lid.
    fn local() -> (Local, Book) {
        let name = *b"lid";
        let mut row = NameRow {
            body: 4,
            source: 1,
            len: 3,
            ..NameRow::default()
        };
        row.name[..3].copy_from_slice(&name);
        let local = Local {
            frame_id: "world".to_owned(),
            sources: vec!["sim".to_owned(), "arm".to_owned()],
            boot_id: 77,
        };
        (local, Book::of(&[row]))
    }

    #[test]
    fn a_body_that_two_sources_send_is_told_by_name() {
        let (local, book) = local();
        let receipt = Receipt {
            now_ns: 5,
            waited: false,
            ros_now_ns: 0,
            from: ros2_client::Gid::ZERO,
        };
        let by = |source: &str, name: &str, body: u64| {
            let mut body = BodyTransform {
                name: name.to_owned(),
                body,
                ..BodyTransform::default()
            };
            body.pose.orientation.w = 1.0;
            let message = BodyTransforms {
                source: source.to_owned(),
                transforms: vec![body],
                ..BodyTransforms::default()
            };
            local.odd(&message, receipt, &book)
        };
        for (name, body) in [("lid", 0), ("", 4)] {
            let told = by("sim", name, body).unwrap();
            assert!(told.contains("source sim sends it") && told.contains("source arm"));
            assert_eq!(by("arm", name, body), None, "its own");
            assert_eq!(by("nobody", name, body), None, "counted as no source");
        }
        assert_eq!(by("sim", "nothing", 0), None, "counted as no body");
    }

    #[test]
    fn a_pose_that_is_none_and_a_stamp_of_another_time_are_told_by_name() {
        let (local, book) = local();
        let receipt = Receipt {
            now_ns: 5,
            waited: false,
            ros_now_ns: 100 * S,
            from: ros2_client::Gid::ZERO,
        };
        let mut body = BodyTransform {
            name: "lid".to_owned(),
            ..BodyTransform::default()
        };
        body.pose.orientation.w = 1.0;
        let mut message = BodyTransforms {
            source: "arm".to_owned(),
            transforms: vec![body],
            ..BodyTransforms::default()
        };
        message.header.stamp.sec = 100;
        assert_eq!(local.odd(&message, receipt, &book), None);
        message.header.stamp.sec = 7;
        assert!(
            local
                .odd(&message, receipt, &book)
                .unwrap()
                .contains("source arm: its stamp lies 93.000 s in the past")
        );
        message.clock_id = 3;
        assert_eq!(
            local.odd(&message, receipt, &book),
            None,
            "the time of another clock"
        );
        message.transforms[0].pose.orientation.w = 0.0;
        assert!(
            local
                .odd(&message, receipt, &book)
                .unwrap()
                .contains("body lid: its pose from source arm is no pose")
        );
    }

    #[test]
    fn bug_ids_of_another_run_of_the_daemon_are_refused_and_names_are_not() {
        let (local, _) = local();
        let by = |name: &str, boot_id| {
            let body = BodyTransform {
                name: name.to_owned(),
                body: 4,
                ..BodyTransform::default()
            };
            local.fault(&BodyTransforms {
                source: "arm".to_owned(),
                boot_id,
                transforms: vec![body],
                ..BodyTransforms::default()
            })
        };
        for boot_id in [0, 76] {
            let (reason, text) = by("", boot_id).unwrap();
            assert_eq!(reason, RejectReason::SessionOver);
            assert!(
                text.contains("source arm") && text.contains("is 77"),
                "{text}"
            );
            assert_eq!(by("lid", boot_id), None);
        }
        assert_eq!(by("", 77), None);
    }
}
