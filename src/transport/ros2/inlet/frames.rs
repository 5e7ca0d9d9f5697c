//! Frames of `~/transforms` as the daemon's. In: messages, names of bodies. Out: frames with ids. Pure.

use super::super::poses::Receipt;
use super::super::shared::Shared;
use super::super::shelf::Shelf;
use super::{Local, Wrongs};
use crate::limits::FRAME_ROWS_MAX;
use crate::wire::ros::{BodyTransform, BodyTransforms, Book, Twist};
use crate::wire::{Frame, FrameHeader, RejectReason, TransformRow, WIRE_VERSION, name_bytes};

/// The id of a body; no body has id 0, so a name that nobody has is counted where unknown ids are.
pub(super) fn id(body: &BodyTransform, book: &Book) -> u64 {
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
    (frame.first_seq, frame.cut) = (0, false);
    frame.transforms.clear();
    frame.velocities.clear();
    frame.stamps_ns.clear();
    frame.since_ns.clear();
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
    let velocities = message.velocities.iter().map(velocity);
    frame.velocities.extend(velocities);
}

/// Linear and angular velocity, metres and radians a second.
pub(super) fn velocity(twist: &Twist) -> [f64; 6] {
    let (l, a) = (twist.linear, twist.angular);
    [l.x, l.y, l.z, a.x, a.y, a.z]
}

/// Puts a frame of `~/transforms` on the shelf, and takes note of what is wrong with it.
pub(super) fn put_frame(
    (shelf, shared): (&Shelf, &Shared),
    (local, wrongs): (&Local, &mut Wrongs),
    (message, receipt, refused): (&BodyTransforms, Receipt, Option<RejectReason>),
    book: &Book,
) {
    let mut frame = shelf.spare();
    fill(&mut frame, message, book, receipt);
    let own = local.refuse(message);
    if let Some(reason) = own.as_ref().map(|(reason, _)| *reason).or(refused) {
        shared.note_refused(1);
        frame.refused = Some(reason);
    }
    shelf.put(local.place(&message.source), frame);
    let own = own.as_ref().map(|(_, text)| text.as_str());
    wrongs.note(local, (message, own), receipt, book);
}
