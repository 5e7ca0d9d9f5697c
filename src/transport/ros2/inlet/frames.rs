//! Frames of `~/transforms` as the daemon's, and what is odd about them, in words.

use super::super::poses::{Receipt, off};
use super::super::speak::Book;
use super::super::tf::sound;
use crate::limits::FRAME_ROWS_MAX;
use crate::wire::ros::{BodyTransforms, Twist};
use crate::wire::{Frame, FrameHeader, RejectReason, TransformRow, WIRE_VERSION, name_bytes};

/// What is wrong with a frame that is not in the scene's frame.
pub(super) fn foreign(message: &BodyTransforms, frame_id: &str) -> Option<String> {
    let given = message.header.frame_id.trim_start_matches('/');
    (!given.is_empty() && given != frame_id).then(|| {
        format!(
            "frames of source {} are in \"{given}\", not in the scene's frame \"{frame_id}\": they are refused",
            message.source
        )
    })
}

/// What is odd about a frame whose other bodies are taken as they come: a pose that is none, or a stamp far from the
/// node's clock where it is said to be of that.
pub(super) fn odd(message: &BodyTransforms, receipt: Receipt) -> Option<String> {
    let source = message.source.as_str();
    let no_pose = message.transforms.iter().find_map(|body| {
        let (position, orientation) = (body.pose.position.into(), body.pose.orientation.into());
        let reason = sound(position, orientation).err()?;
        let body = match body.name.as_str() {
            "" => body.body.to_string(),
            name => name.to_owned(),
        };
        Some(format!(
            "body {body}: its pose from source {source} is no pose: {reason}"
        ))
    });
    no_pose.or_else(|| {
        if message.clock_id != 0 {
            return None;
        }
        let stamp_ns = message.header.stamp.to_ns();
        let text = off(("source", source), stamp_ns, receipt, 0)?;
        Some(format!(
            "{text}; frames of another clock have a clock_id other than 0"
        ))
    })
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
        reserved: 0,
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
        // No body has id 0: a name that nobody has is counted where unknown ids are.
        body: match body.name.as_str() {
            "" => body.body,
            name => book.id(name).unwrap_or(0),
        },
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
    use crate::wire::ros::BodyTransform;

    const S: u64 = 1_000_000_000;

    #[test]
    fn a_pose_that_is_none_and_a_stamp_of_another_time_are_told_by_name() {
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
            source: "sim".to_owned(),
            transforms: vec![body],
            ..BodyTransforms::default()
        };
        message.header.stamp.sec = 100;
        assert_eq!(odd(&message, receipt), None);
        message.header.stamp.sec = 7;
        assert!(
            odd(&message, receipt)
                .unwrap()
                .contains("source sim: its stamp lies 93.000 s in the past")
        );
        message.clock_id = 3;
        assert_eq!(odd(&message, receipt), None, "the time of another clock");
        message.transforms[0].pose.orientation.w = 0.0;
        assert!(
            odd(&message, receipt)
                .unwrap()
                .contains("body lid: its pose from source sim is no pose")
        );
    }
}
