//! The tree of `/tf`: links between frames, and how each new link is taken. Poses by chains of links are in `chain`.
//!
//! In: links as they arrive, frames of bodies. Out: the newest link of each frame. Pure: nothing of DDS but the GIDs of
//! publishers.

mod chain;
mod room;

use std::collections::BTreeMap;

use ros2_client::Gid;

use super::lines::Heard;
use super::order::{Order, Step};
use crate::limits::QUATERNION_NORM_TOLERANCE;
use crate::math::{Pose, pose_from};
use crate::wire::RejectReason;
use crate::wire::ros::TransformStamped;
pub(super) use crate::wire::ros::plain_frame as plain;
pub(super) use chain::{Found, Missing};
use room::FRAME_NAME_BYTES_MAX;

/// A link: the pose of a frame in its parent.
#[derive(Clone, Debug)]
struct Link {
    parent: usize,
    position: [f64; 3],
    orientation: [f64; 4],
    /// `None`: the numbers are not a pose.
    pose: Option<Pose>,
    /// Sender's stamp, nanoseconds.
    stamp_ns: u64,
    /// Order of its stamps.
    order: Order,
    /// Receipt, nanoseconds of `CLOCK_BOOTTIME`.
    received_ns: u64,
    /// Whether it is a fixed link: it never changes and has no age.
    fixed: bool,
    /// Number of looks before it arrived.
    looks: u64,
}

/// Result of taking a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// The link is the newest of its frame.
    Newer,
    /// The link is older than the newest one of its frame by so many nanoseconds, and is skipped.
    Older(u64),
    /// The sender's clock restarted, and the pose of a body depends on the link.
    WentBack,
    /// The link does not join two valid frames; the reason.
    Refused(&'static str),
    /// There is no room for a new frame.
    Full,
}

/// A frame of a body or of a link.
#[derive(Clone, Debug, Default)]
struct Frame {
    name: String,
    link: Option<Link>,
    /// Publishers of its link.
    heard: Heard,
    /// Publisher of its newest fixed link.
    fixed_by: Option<Gid>,
    /// Number of bodies with this frame, plus one if it is the scene's; the frame stays while this is not 0.
    pins: usize,
}

/// The frames and their newest links.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    ids: BTreeMap<String, usize>,
    frames: Vec<Frame>,
    /// Indices of removed frames.
    free: Vec<usize>,
    /// Number of pinned frames: those of bodies and of the scene.
    pinned: usize,
    /// The scene's frame; `None`: not set.
    root: Option<usize>,
    /// Links refused since room was last made.
    denied: usize,
    /// Fixed links dropped for lack of room, since the last call that took the number.
    let_go: u64,
    /// Number of looks at all bodies.
    looks: u64,
}

impl Tree {
    /// Creates a tree with the scene's frame; returns the tree and the index of that frame.
    pub(super) fn rooted(frame: &str) -> (Self, usize) {
        let mut tree = Self::default();
        let root = tree.pin(frame);
        tree.root = Some(root);
        (tree, root)
    }

    /// Pins the frame of a body or the scene and returns its index. It is never refused, and stays until it is
    /// unpinned: the scene limits the number of such frames.
    pub(super) fn pin(&mut self, frame: &str) -> usize {
        let id = self.id(plain(frame));
        if let Some(frame) = self.frames.get_mut(id) {
            frame.pins += 1;
            self.pinned += usize::from(frame.pins == 1);
        }
        id
    }

    /// Unpins the frame of a removed body.
    pub(super) fn unpin(&mut self, frame: usize) {
        if let Some(frame) = self.frames.get_mut(frame).filter(|frame| frame.pins > 0) {
            frame.pins -= 1;
            self.pinned -= usize::from(frame.pins == 0);
        }
    }

    /// The index of a frame, which is added if it is new.
    fn id(&mut self, frame: &str) -> usize {
        if let Some(&id) = self.ids.get(frame) {
            return id;
        }
        let id = self.free.pop().unwrap_or(self.frames.len());
        if id == self.frames.len() {
            self.frames.push(Frame::default());
        }
        if let Some(slot) = self.frames.get_mut(id) {
            frame.clone_into(&mut slot.name);
        }
        self.ids.insert(frame.to_owned(), id);
        id
    }

    /// Notes the publisher of a frame's link; returns whether another one sends it, too.
    pub(super) fn hear(&mut self, child: &str, from: Gid, now_ns: u64) -> bool {
        let id = self.ids.get(plain(child));
        let frame = id.and_then(|id| self.frames.get_mut(*id));
        frame.is_some_and(|frame| {
            frame.heard.hear(from, now_ns);
            frame.heard.are_two(now_ns)
        })
    }

    /// Whether the frame has a fixed link and this one is not fixed, or the reverse.
    pub(super) fn is_otherwise(&self, child: &str, fixed: bool) -> bool {
        let id = self.ids.get(plain(child));
        let link = id.and_then(|id| self.link(*id));
        link.is_some_and(|link| link.fixed != fixed)
    }

    /// Whether a fixed link differs from its frame's current one, which another publisher sent.
    pub(super) fn is_disputed(&self, link: &TransformStamped, from: Gid) -> bool {
        let id = self.ids.get(plain(&link.child_frame_id));
        let Some((frame, old)) = id.and_then(|&id| Some((self.frames.get(id)?, self.link(id)?)))
        else {
            return false;
        };
        let parent = self.frames.get(old.parent).map(|parent| &*parent.name);
        let position = link.transform.translation.into();
        let is_same = parent == Some(plain(&link.header.frame_id))
            && (old.position, old.orientation) == (position, link.transform.rotation.into());
        old.fixed && !is_same && frame.fixed_by.is_some_and(|by| by != from)
    }

    /// Notes the publisher of a fixed link that was taken.
    pub(super) fn note_fixed(&mut self, child: &str, from: Gid) {
        let id = self.ids.get(plain(child));
        if let Some(frame) = id.and_then(|id| self.frames.get_mut(*id)) {
            frame.fixed_by = Some(from);
        }
    }

    /// Starts a look at all bodies: links received until now are no longer news.
    pub(super) fn note_look(&mut self) {
        self.looks += 1;
    }

    /// Whether the link of a frame is not fixed and arrived since the last look.
    pub(super) fn is_news(&self, child: &str) -> bool {
        let id = self.ids.get(plain(child));
        let link = id.and_then(|id| self.link(*id));
        link.is_some_and(|link| !link.fixed && link.looks == self.looks)
    }

    fn link(&self, frame: usize) -> Option<&Link> {
        self.frames.get(frame)?.link.as_ref()
    }

    /// Drops all links that are not fixed.
    pub(super) fn forget(&mut self) {
        for frame in &mut self.frames {
            frame.link.take_if(|link| !link.fixed);
        }
    }

    /// Takes a link.
    ///
    /// * `timeout_ns` - time-out of its source, which tells late links from those of a restarted clock (see `order`).
    pub(super) fn take(
        &mut self,
        link: &TransformStamped,
        fixed: bool,
        received_ns: u64,
        timeout_ns: u64,
    ) -> Taken {
        let (child, parent) = (plain(&link.child_frame_id), plain(&link.header.frame_id));
        if let Some(why) = unfit(child, parent) {
            return Taken::Refused(why);
        }
        if !self.has_room(child, parent) {
            return Taken::Full;
        }
        let (child, parent) = (self.id(child), self.id(parent));
        let stamp_ns = link.header.stamp.to_ns();
        let mut taken = Taken::Newer;
        let mut order = Order::from(stamp_ns);
        let old = self.frames.get_mut(child);
        if let Some(old) = old.and_then(|frame| frame.link.as_mut())
            && !fixed
            && !old.fixed
        {
            let step = old.order.take(stamp_ns, received_ns, timeout_ns);
            order = old.order;
            match step {
                Step::On => {}
                Step::Late(by_ns) => return Taken::Older(by_ns),
                // A restarted clock of a frame that no body depends on, such as a camera's detection, is ignored.
                Step::Anew if self.is_needed(child) => {
                    taken = Taken::WentBack;
                    self.forget();
                }
                Step::Anew => {}
            }
        }
        let position = link.transform.translation.into();
        let orientation = link.transform.rotation.into();
        let new = Link {
            parent,
            position,
            orientation,
            pose: sound(position, orientation).ok(),
            stamp_ns,
            order,
            received_ns,
            fixed,
            looks: self.looks,
        };
        if let Some(frame) = self.frames.get_mut(child) {
            frame.link = Some(new);
        }
        taken
    }
}

/// Why a link between these frames is refused, if it is.
fn unfit(child: &str, parent: &str) -> Option<&'static str> {
    const { assert!(FRAME_NAME_BYTES_MAX == 255, "it is in the words below") };
    if child.is_empty() {
        Some("it has no name: give it one (`child_frame_id`)")
    } else if parent.is_empty() {
        Some("its parent has no name: give it one (`header.frame_id`)")
    } else if child.len().max(parent.len()) > FRAME_NAME_BYTES_MAX {
        Some("it or its parent has a name of more than 255 bytes: give it a shorter one")
    } else if child == parent {
        Some("it is linked to itself: link it to another frame, or leave the link out")
    } else {
        None
    }
}

/// The pose of raw numbers, or why they are not a pose.
pub(super) fn sound(position: [f64; 3], orientation: [f64; 4]) -> Result<Pose, RejectReason> {
    if !position.iter().chain(&orientation).all(|v| v.is_finite()) {
        return Err(RejectReason::NotFinite);
    }
    let norm = orientation.iter().map(|v| v * v).sum::<f64>().sqrt();
    if (norm - 1.0).abs() > QUATERNION_NORM_TOLERANCE {
        return Err(RejectReason::BadQuaternion);
    }
    pose_from(position, orientation).ok_or(RejectReason::BadQuaternion)
}

/// Text for numbers that are not a pose, with the fix.
pub(super) fn no_pose(reason: RejectReason) -> String {
    format!("no pose: {reason}: {}", reason.mend())
}

#[cfg(test)]
mod tests;
