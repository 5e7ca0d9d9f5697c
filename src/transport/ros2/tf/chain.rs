//! Chains of links: the pose of a frame in the scene's frame, found as in tf2. Pure.
//!
//! If the scene's frame is an ancestor of the frame, the pose is one chain. Otherwise, both may have a common ancestor
//! (`map` above `odom`, and bodies below `map`): then it is two chains that meet there, the second one inverted.

use super::{Tree, sound};
use crate::math::Pose;
use crate::wire::RejectReason;

/// Most links of a chain; a longer one counts as a loop.
const CHAIN_MAX: usize = 256;

/// The pose of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct Found {
    /// Position in the scene's frame, metres.
    pub(in super::super) position: [f64; 3],
    /// Orientation x, y, z, w.
    pub(in super::super) orientation: [f64; 4],
    /// Oldest stamp of the chain's links that are not fixed; 0: none has one.
    pub(in super::super) stamp_ns: u64,
    /// Difference between its oldest and newest stamp, nanoseconds.
    pub(in super::super) skew_ns: u64,
    /// Latest and earliest receipt of links that are not fixed, nanoseconds of `CLOCK_BOOTTIME`; `None`: all are fixed.
    pub(in super::super) received_ns: Option<(u64, u64)>,
}

/// Why a frame has no pose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in super::super) enum Missing {
    /// The chain ends at this frame, which has no link to a parent yet.
    Frame(String),
    /// As [`Self::Frame`], and the chain of the scene's frame ends at the second frame.
    Apart(String, String),
    /// The chain contains a loop through this frame, or is longer than `CHAIN_MAX`.
    Loop(String),
    /// The link of this frame is not a pose.
    Bad(String, RejectReason),
}

/// Stamps and receipts of the links that are not fixed.
#[derive(Clone, Copy, Debug)]
struct Ages {
    /// Of stamps other than 0, nanoseconds.
    oldest_ns: u64,
    newest_ns: u64,
    /// Of receipts, nanoseconds of `CLOCK_BOOTTIME`.
    earliest_ns: u64,
    latest_ns: u64,
}

impl Ages {
    const NONE: Self = Self {
        oldest_ns: u64::MAX,
        newest_ns: 0,
        earliest_ns: u64::MAX,
        latest_ns: 0,
    };

    fn take(&mut self, stamp_ns: u64, received_ns: u64) {
        // A stamp of 0 means that the sender has no clock.
        if stamp_ns != 0 {
            self.oldest_ns = self.oldest_ns.min(stamp_ns);
            self.newest_ns = self.newest_ns.max(stamp_ns);
        }
        self.earliest_ns = self.earliest_ns.min(received_ns);
        self.latest_ns = self.latest_ns.max(received_ns);
    }

    fn found(self, position: [f64; 3], orientation: [f64; 4]) -> Found {
        let stamped = self.oldest_ns != u64::MAX;
        let aged = self.earliest_ns != u64::MAX;
        Found {
            position,
            orientation,
            stamp_ns: if stamped { self.oldest_ns } else { 0 },
            skew_ns: self.newest_ns.saturating_sub(self.oldest_ns),
            received_ns: aged.then_some((self.latest_ns, self.earliest_ns)),
        }
    }
}

/// The part of a chain from a frame up to an ancestor.
#[derive(Debug, Default)]
struct Climb {
    /// Pose of the frame in the ancestor; `None`: they are the same.
    pose: Option<Pose>,
    /// The unchanged numbers of the link, if there is only one.
    single: Option<([f64; 3], [f64; 4])>,
}

impl Tree {
    /// The pose of `frame` in `root`.
    ///
    /// The numbers of a single link are passed on unchanged, so that the pose is bit by bit that of the sender.
    pub(in super::super) fn find(&self, frame: usize, root: usize) -> Result<Found, Missing> {
        let mut ages = Ages::NONE;
        let first = match self.climb((frame, root), &mut ages) {
            Ok(Climb { pose, single }) => {
                let (position, orientation) = single.unwrap_or_else(|| numbers(pose));
                return Ok(ages.found(position, orientation));
            }
            // The bad link may be above the common ancestor, and then does not matter.
            Err(first @ (Missing::Frame(_) | Missing::Bad(..))) => first,
            Err(other) => return Err(other),
        };
        let top = self.joint(frame, root).map_err(|at| match first {
            Missing::Frame(end) if at != root => Missing::Apart(end, self.name(at)),
            other => other,
        })?;
        let mut ages = Ages::NONE;
        let up = self.climb((frame, top), &mut ages)?.pose;
        let down = self.climb((root, top), &mut ages)?.pose;
        let [up, down] = [up, down].map(|pose| pose.unwrap_or_else(Pose::identity));
        let (position, orientation) = numbers(Some(down.inverse() * up));
        Ok(ages.found(position, orientation))
    }

    /// Composes the links from a frame up to an ancestor.
    fn climb(&self, (from, to): (usize, usize), ages: &mut Ages) -> Result<Climb, Missing> {
        let (mut at, mut way) = (from, Climb::default());
        for length in 0.. {
            if at == to {
                break;
            }
            if length == CHAIN_MAX {
                return Err(Missing::Loop(self.name(at)));
            }
            let Some(link) = self.link(at) else {
                return Err(Missing::Frame(self.name(at)));
            };
            let Some(own) = link.pose else {
                let reason = sound(link.position, link.orientation).err();
                let reason = reason.unwrap_or(RejectReason::NotFinite);
                return Err(Missing::Bad(self.name(at), reason));
            };
            if !link.fixed {
                ages.take(link.stamp_ns, link.received_ns);
            }
            way.single = (way.pose.is_none()).then_some((link.position, link.orientation));
            way.pose = Some(way.pose.map_or(own, |inner| own * inner));
            at = link.parent;
        }
        Ok(way)
    }

    /// The lowest frame that is `root` or above it, and also `frame` or above it.
    ///
    /// # Errors
    /// If there is none: the last frame above `root`.
    fn joint(&self, frame: usize, root: usize) -> Result<usize, usize> {
        let above: Vec<usize> = self.above(frame).collect();
        let mut last = root;
        for at in self.above(root) {
            if above.contains(&at) {
                return Ok(at);
            }
            last = at;
        }
        Err(last)
    }

    /// A frame and its ancestors, at most as many as a chain has.
    fn above(&self, frame: usize) -> impl Iterator<Item = usize> + '_ {
        let next = |&at: &usize| self.link(at).map(|link| link.parent);
        std::iter::successors(Some(frame), next).take(CHAIN_MAX + 1)
    }

    /// Whether the pose of a body depends on the link of a frame, or will once its chain is complete.
    ///
    /// Cost: O(lengths of the chains of all bodies); clocks restart rarely.
    pub(super) fn is_needed(&self, child: usize) -> bool {
        let is_root = |at: usize| Some(at) == self.root;
        let mut above_root = self.root.into_iter().flat_map(|root| self.above(root));
        let is_above_root = above_root.any(|at| at == child);
        // The scene itself pins the root once.
        let pinned = self.frames.iter().enumerate();
        let mut bodies = pinned.filter(|(at, frame)| frame.pins > usize::from(is_root(*at)));
        bodies.any(|(body, _)| {
            let mut own = self.above(body).take_while(|at| !is_root(*at));
            let hangs_on_root = self.above(body).any(is_root);
            own.any(|at| at == child) || !hangs_on_root && is_above_root
        })
    }

    fn name(&self, at: usize) -> String {
        let frame = self.frames.get(at);
        frame.map(|frame| frame.name.clone()).unwrap_or_default()
    }
}

/// Position, metres, and orientation x, y, z, w.
fn numbers(pose: Option<Pose>) -> ([f64; 3], [f64; 4]) {
    let pose = pose.unwrap_or_else(Pose::identity);
    let turned = pose.rotation.coords;
    (
        [pose.translation.x, pose.translation.y, pose.translation.z],
        [turned.x, turned.y, turned.z, turned.w],
    )
}
