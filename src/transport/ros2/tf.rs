//! The tree of `/tf`: links between frames, and what becomes of each that comes; poses by chains of links: `chain`.
//!
//! In: links as they come, frames of bodies. Out: the newest link of each frame. Pure: no DDS beyond the names of
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

/// A link: where a frame is in its parent.
#[derive(Clone, Debug)]
struct Link {
    parent: usize,
    position: [f64; 3],
    orientation: [f64; 4],
    /// `None`: its numbers are no pose.
    pose: Option<Pose>,
    /// Sender's stamp, nanoseconds.
    stamp_ns: u64,
    /// Its stamps so far.
    order: Order,
    /// Receipt, nanoseconds of `CLOCK_BOOTTIME`.
    received_ns: u64,
    /// It came as one that never changes, and has no age.
    fixed: bool,
    /// How many looks there had been when it came.
    looks: u64,
}

/// What became of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// It is the newest of its frame.
    Newer,
    /// One with a stamp later by so much is there already, nanoseconds; it is passed over.
    Older(u64),
    /// Its sender's time began anew, and a body hangs on it.
    WentBack,
    /// It links no two frames, and why.
    Refused(&'static str),
    /// A frame too many.
    Full,
}

/// A frame that a body has or that was heard of.
#[derive(Clone, Debug, Default)]
struct Frame {
    name: String,
    link: Option<Link>,
    /// Who sends its link.
    heard: Heard,
    /// Who sent it as one that never changes.
    fixed_by: Option<Gid>,
    /// How many bodies, and the scene, have it as theirs: it stays while there is one.
    pins: usize,
}

/// The links that were heard.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    ids: BTreeMap<String, usize>,
    frames: Vec<Frame>,
    /// Numbers of frames that have gone.
    free: Vec<usize>,
    /// Frames that bodies or the scene have.
    pinned: usize,
    /// The scene's frame; `None`: not said.
    root: Option<usize>,
    /// Links refused since room was last made.
    denied: usize,
    /// Links that never change which had to go.
    let_go: u64,
    /// How often all bodies were looked for.
    looks: u64,
}

impl Tree {
    /// An empty one, and the number of the scene's frame in it.
    pub(super) fn rooted(frame: &str) -> (Self, usize) {
        let mut tree = Self::default();
        let root = tree.pin(frame);
        tree.root = Some(root);
        (tree, root)
    }

    /// The number of a frame that a body or the scene has. It is never refused, and stays until it is unpinned: the
    /// scene bounds how many there are.
    pub(super) fn pin(&mut self, frame: &str) -> usize {
        let id = self.id(plain(frame));
        if let Some(frame) = self.frames.get_mut(id) {
            frame.pins += 1;
            self.pinned += usize::from(frame.pins == 1);
        }
        id
    }

    /// A body that has this frame has left.
    pub(super) fn unpin(&mut self, frame: usize) {
        if let Some(frame) = self.frames.get_mut(frame).filter(|frame| frame.pins > 0) {
            frame.pins -= 1;
            self.pinned -= usize::from(frame.pins == 0);
        }
    }

    /// The number of a frame, a new one if need be.
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

    /// Takes who sent the link of a frame; whether another one sends it, too.
    pub(super) fn hear(&mut self, child: &str, from: Gid, now_ns: u64) -> bool {
        let id = self.ids.get(plain(child));
        let frame = id.and_then(|id| self.frames.get_mut(*id));
        frame.is_some_and(|frame| {
            frame.heard.hear(from, now_ns);
            frame.heard.are_two(now_ns)
        })
    }

    /// Whether the link of a frame that is there is one that never changes, and this is none, or the other way round.
    pub(super) fn is_otherwise(&self, child: &str, fixed: bool) -> bool {
        let id = self.ids.get(plain(child));
        let link = id.and_then(|id| self.link(*id));
        link.is_some_and(|link| link.fixed != fixed)
    }

    /// Whether a fixed link differs from that of its frame which another publisher sent.
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

    /// A publisher has sent a fixed link of a frame, and it was taken.
    pub(super) fn note_fixed(&mut self, child: &str, from: Gid) {
        let id = self.ids.get(plain(child));
        if let Some(frame) = id.and_then(|id| self.frames.get_mut(*id)) {
            frame.fixed_by = Some(from);
        }
    }

    /// Bodies are looked for: what came until now is no news any more.
    pub(super) fn note_look(&mut self) {
        self.looks += 1;
    }

    /// Whether the link of a frame has come since the last look, and changes.
    pub(super) fn is_news(&self, child: &str) -> bool {
        let id = self.ids.get(plain(child));
        let link = id.and_then(|id| self.link(*id));
        link.is_some_and(|link| !link.fixed && link.looks == self.looks)
    }

    fn link(&self, frame: usize) -> Option<&Link> {
        self.frames.get(frame)?.link.as_ref()
    }

    /// Forgets every link that has an age.
    pub(super) fn forget(&mut self) {
        for frame in &mut self.frames {
            frame.link.take_if(|link| !link.fixed);
        }
    }

    /// Takes a link.
    ///
    /// * `timeout_ns` - of its source, which tells late ones from those of a clock that began anew (`order`).
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
                // The clock of a frame that no body hangs on, such as what a camera detects, is nothing to bodies.
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

/// Why these are no two frames that can be linked, if they are none.
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

/// The pose of numbers as they come, or what is wrong with them.
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

/// Words for numbers that are no pose, and what to write instead.
pub(super) fn no_pose(reason: RejectReason) -> String {
    format!("no pose: {reason}: {}", reason.mend())
}

#[cfg(test)]
mod tests;
