//! The tree of `/tf`: links between frames, and the pose of a frame by its chain of links to the scene's frame.
//!
//! In: links as they come. Out: poses with the stamps of their chains, or why there is none. Pure.

use std::collections::BTreeMap;

use crate::limits::QUATERNION_NORM_TOLERANCE;
use crate::math::{Pose, pose_from};
use crate::wire::RejectReason;
use crate::wire::ros::TransformStamped;

/// Frames of one tree: a robot has some hundred; beyond it somebody invents names, and memory would grow.
const FRAMES_MAX: usize = 1 << 16;
/// Links of one chain; a longer one is as good as a loop.
const CHAIN_MAX: usize = 256;

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
    /// Receipt, nanoseconds of `CLOCK_BOOTTIME`.
    received_ns: u64,
    /// It came as one that never changes, and has no age.
    fixed: bool,
}

/// What became of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// It is the newest of its frame.
    Newer,
    /// One with a stamp later by so much is there already, nanoseconds; it is passed over.
    Older(u64),
    /// It is so much older than the one that is there that time has gone back.
    WentBack,
    /// A frame without a name, hung on itself, or one too many.
    Refused,
}

/// Where a frame is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    /// Position in the scene's frame, metres.
    pub(super) position: [f64; 3],
    /// Orientation x, y, z, w.
    pub(super) orientation: [f64; 4],
    /// Oldest stamp of the chain's links that have an age; 0: none has.
    pub(super) stamp_ns: u64,
    /// How far the stamps lie apart, nanoseconds.
    pub(super) skew_ns: u64,
    /// Latest and earliest receipt of links that have an age, nanoseconds of `CLOCK_BOOTTIME`; `None`: none has.
    pub(super) received_ns: Option<(u64, u64)>,
}

/// Why a frame has no pose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Missing {
    /// The chain ends at this frame, which nobody has linked yet.
    Frame(String),
    /// The chain comes back to this frame.
    Loop(String),
    /// The link of this frame has numbers that are no pose.
    Bad(String, RejectReason),
}

/// The links that were heard.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    ids: BTreeMap<String, usize>,
    names: Vec<String>,
    links: Vec<Option<Link>>,
}

/// tf2 knows no slash in front; old senders write it.
fn plain(frame: &str) -> &str {
    frame.strip_prefix('/').unwrap_or(frame)
}

impl Tree {
    /// The number of a frame, a new one if need be; `None`: one too many.
    pub(super) fn id(&mut self, frame: &str) -> Option<usize> {
        let frame = plain(frame);
        if let Some(&id) = self.ids.get(frame) {
            return Some(id);
        }
        if self.names.len() >= FRAMES_MAX {
            return None;
        }
        let id = self.names.len();
        self.ids.insert(frame.to_owned(), id);
        self.names.push(frame.to_owned());
        self.links.push(None);
        Some(id)
    }

    /// Whether the link of a frame that is there is one that never changes, and this is none, or the other way round.
    pub(super) fn is_otherwise(&self, child: &str, fixed: bool) -> bool {
        let id = self.ids.get(plain(child));
        let link = id.and_then(|id| self.links.get(*id)?.as_ref());
        link.is_some_and(|link| link.fixed != fixed)
    }

    /// Forgets every link that has an age.
    pub(super) fn forget(&mut self) {
        for link in &mut self.links {
            if link.as_ref().is_some_and(|link| !link.fixed) {
                *link = None;
            }
        }
    }

    /// Takes a link.
    ///
    /// * `back_ns` - an older stamp by more than this means that the sender's time went back.
    pub(super) fn take(
        &mut self,
        link: &TransformStamped,
        fixed: bool,
        received_ns: u64,
        back_ns: u64,
    ) -> Taken {
        let (child, parent) = (&link.child_frame_id, &link.header.frame_id);
        if plain(child).is_empty() || plain(parent).is_empty() || plain(child) == plain(parent) {
            return Taken::Refused;
        }
        let (Some(child), Some(parent)) = (self.id(child), self.id(parent)) else {
            return Taken::Refused;
        };
        let stamp_ns = link.header.stamp.to_ns();
        let mut taken = Taken::Newer;
        if let Some(Some(old)) = self.links.get(child)
            && !fixed
            && !old.fixed
            && stamp_ns < old.stamp_ns
        {
            if old.stamp_ns - stamp_ns <= back_ns {
                return Taken::Older(old.stamp_ns - stamp_ns);
            }
            taken = Taken::WentBack;
            self.forget();
        }
        let position = link.transform.translation.into();
        let orientation = link.transform.rotation.into();
        let new = Link {
            parent,
            position,
            orientation,
            pose: sound(position, orientation).ok(),
            stamp_ns,
            received_ns,
            fixed,
        };
        if let Some(slot) = self.links.get_mut(child) {
            *slot = Some(new);
        }
        taken
    }

    /// Where `frame` is in `root`.
    ///
    /// A single link is handed on as it came, so that its pose is bit by bit what the sender wrote.
    pub(super) fn find(&self, frame: usize, root: usize) -> Result<Found, Missing> {
        let name = |at: usize| self.names.get(at).cloned().unwrap_or_default();
        let (mut at, mut pose, mut single) = (frame, None::<Pose>, None);
        let (mut oldest, mut newest) = (u64::MAX, 0);
        let (mut earliest, mut latest) = (u64::MAX, 0);
        for length in 0.. {
            if at == root {
                break;
            }
            if length == CHAIN_MAX {
                return Err(Missing::Loop(name(at)));
            }
            let Some(link) = self.links.get(at).and_then(Option::as_ref) else {
                return Err(Missing::Frame(name(at)));
            };
            let Some(own) = link.pose else {
                let reason = sound(link.position, link.orientation).err();
                return Err(Missing::Bad(
                    name(at),
                    reason.unwrap_or(RejectReason::NotFinite),
                ));
            };
            if !link.fixed {
                (oldest, newest) = (oldest.min(link.stamp_ns), newest.max(link.stamp_ns));
                earliest = earliest.min(link.received_ns);
                latest = latest.max(link.received_ns);
            }
            single = pose.is_none().then_some((link.position, link.orientation));
            pose = Some(pose.map_or(own, |inner| own * inner));
            at = link.parent;
        }
        let pose = pose.unwrap_or_else(Pose::identity);
        let turned = pose.rotation.coords;
        let composed = (
            [pose.translation.x, pose.translation.y, pose.translation.z],
            [turned.x, turned.y, turned.z, turned.w],
        );
        let (position, orientation) = single.unwrap_or(composed);
        let aged = oldest != u64::MAX;
        Ok(Found {
            position,
            orientation,
            stamp_ns: if aged { oldest } else { 0 },
            skew_ns: newest.saturating_sub(oldest),
            received_ns: aged.then_some((latest, earliest)),
        })
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

#[cfg(test)]
mod tests {
    #![allow(clippy::float_cmp, reason = "numbers are handed on bit by bit")]

    use super::*;
    use crate::wire::ros::{Header, Time, Transform};

    const BACK_NS: u64 = 500;

    fn link(parent: &str, child: &str, x: f64, stamp_ns: u64) -> TransformStamped {
        let rotation = [0.0, 0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt()].into();
        TransformStamped {
            header: Header {
                stamp: Time::from_ns(stamp_ns),
                frame_id: parent.to_owned(),
            },
            child_frame_id: child.to_owned(),
            transform: Transform {
                translation: [x, 0.0, 0.0].into(),
                rotation,
            },
        }
    }

    fn find(tree: &mut Tree, frame: &str) -> Result<Found, Missing> {
        let (frame, root) = (tree.id(frame).unwrap(), tree.id("world").unwrap());
        tree.find(frame, root)
    }

    #[test]
    fn a_chain_is_composed_and_its_stamps_are_compared() {
        let mut tree = Tree::default();
        tree.take(&link("/world", "base", 1.0, 100), false, 7, BACK_NS);
        tree.take(&link("base", "tool", 2.0, 130), false, 8, BACK_NS);
        tree.take(&link("tool", "tip", 0.0, 0), true, 9, BACK_NS);
        let found = find(&mut tree, "tip").unwrap();
        // A quarter turn at the base swings the tool to +y; three of them make the tip look back along -y.
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(
            near(found.position[0], 1.0) && near(found.position[1], 2.0),
            "{found:?}"
        );
        assert_eq!((found.stamp_ns, found.skew_ns), (100, 30));
        assert_eq!(found.received_ns, Some((8, 7)));
    }

    #[test]
    fn a_single_link_is_handed_on_bit_by_bit() {
        let mut tree = Tree::default();
        let mut sent = link("world", "b", 0.1, 5);
        sent.transform.rotation = [0.0, 0.0, 0.0, 1.000_001].into();
        tree.take(&sent, false, 1, BACK_NS);
        assert_eq!(
            find(&mut tree, "b").unwrap().orientation,
            [0.0, 0.0, 0.0, 1.000_001]
        );
    }

    #[test]
    fn loops_gaps_and_bad_numbers_are_told_apart() {
        let mut tree = Tree::default();
        tree.take(&link("a", "b", 0.0, 1), false, 1, BACK_NS);
        assert_eq!(find(&mut tree, "b"), Err(Missing::Frame("a".to_owned())));
        tree.take(&link("b", "a", 0.0, 1), false, 1, BACK_NS);
        assert!(matches!(find(&mut tree, "b"), Err(Missing::Loop(_))));
        let mut zero = link("world", "a", 0.0, 2);
        zero.transform.rotation = [0.0; 4].into();
        tree.take(&zero, false, 1, BACK_NS);
        let bad = Missing::Bad("a".to_owned(), RejectReason::BadQuaternion);
        assert_eq!(find(&mut tree, "b"), Err(bad));
        assert_eq!(
            tree.take(&link("a", "a", 0.0, 1), false, 1, BACK_NS),
            Taken::Refused
        );
        assert_eq!(
            tree.take(&link("", "x", 0.0, 1), false, 1, BACK_NS),
            Taken::Refused
        );
    }

    #[test]
    fn an_older_link_is_passed_over_and_a_much_older_one_turns_time_back() {
        let mut tree = Tree::default();
        tree.take(&link("world", "a", 1.0, 2000), false, 1, BACK_NS);
        tree.take(&link("world", "b", 1.0, 2000), false, 1, BACK_NS);
        assert_eq!(
            tree.take(&link("world", "a", 2.0, 1900), false, 2, BACK_NS),
            Taken::Older(100)
        );
        assert_eq!(find(&mut tree, "a").unwrap().position[0], 1.0);
        assert_eq!(
            tree.take(&link("world", "a", 3.0, 100), false, 3, BACK_NS),
            Taken::WentBack
        );
        assert_eq!(find(&mut tree, "a").unwrap().position[0], 3.0);
        assert_eq!(find(&mut tree, "b"), Err(Missing::Frame("b".to_owned())));
    }
}
