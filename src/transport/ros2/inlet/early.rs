//! Frames of `~/transforms` whose scene revision is newer than the names known here: they wait, since their new names
//! could not be resolved.
//!
//! In: messages, the revision of the names. Out: messages that may be resolved now, in order within each session.

use std::collections::VecDeque;

use super::super::poses::Receipt;
use crate::limits::{FRAME_ROWS_MAX, FRAMES_PER_DRAIN_MAX};
use crate::wire::ros::BodyTransforms;
use crate::wire::{BODY_NAME_LEN, RejectReason};

/// A waiting message, with its receipt and its deadline.
#[derive(Debug)]
struct Waiting {
    message: BodyTransforms,
    receipt: Receipt,
    until_ns: u64,
}

/// Waiting frames.
#[derive(Debug, Default)]
pub(super) struct Early {
    waiting: VecDeque<Waiting>,
}

impl Early {
    /// Earliest deadline of a waiting frame, nanoseconds of `CLOCK_BOOTTIME`; `None`: none waits.
    pub(super) fn until_ns(&self) -> Option<u64> {
        self.waiting.iter().map(|one| one.until_ns).min()
    }

    /// Takes a message. It is kept if it must wait, or if an earlier one of its session waits; otherwise it goes to
    /// `put` at once. If too many of a source wait, the oldest go to `put` as refused.
    ///
    /// * `names_rev` - scene revision of the names known here.
    /// * `timeout_ns` - time-out of its source; `None`: the scene has no such source, so the frame will be refused.
    /// * `put` - takes messages, with the reason if they are refused.
    pub(super) fn take(
        &mut self,
        message: BodyTransforms,
        receipt: Receipt,
        names_rev: u64,
        timeout_ns: Option<u64>,
        put: &mut impl FnMut(&BodyTransforms, Receipt, Option<RejectReason>),
    ) {
        // Order exists only within a session (law 4.2): another sender with the same source name must not delay it.
        let is_behind =
            (self.waiting.iter()).any(|other| session(&other.message) == session(&message));
        let waits = is_behind || is_early(&message, names_rev);
        let Some(timeout_ns) = timeout_ns.filter(|_| waits && may_be_kept(&message)) else {
            return put(&message, receipt, None);
        };
        while let Some(oldest) = self.crowded_out_by(&message) {
            put(
                &oldest.message,
                oldest.receipt,
                Some(RejectReason::SceneRevision),
            );
        }
        self.waiting.push_back(Waiting {
            message,
            receipt,
            // As law 4.3 says for frames of later revisions: refused after one time-out.
            until_ns: receipt.now_ns.saturating_add(timeout_ns),
        });
    }

    /// The oldest waiting frame of a source, if this one would exceed the limit of frames or rows.
    fn crowded_out_by(&mut self, message: &BodyTransforms) -> Option<Waiting> {
        let of_source = |other: &&Waiting| other.message.source == message.source;
        let ahead = self.waiting.iter().filter(of_source);
        let (frames, ahead_rows) = ahead.fold((0, 0), |(frames, all), other| {
            (frames + 1, all + rows(&other.message))
        });
        let fits = frames < FRAMES_PER_DRAIN_MAX && ahead_rows + rows(message) <= FRAME_ROWS_MAX;
        let oldest = self.waiting.iter().position(|other| of_source(&other));
        self.waiting.remove(oldest.filter(|_| !fits)?)
    }

    /// The next message whose names are known, or whose deadline has passed.
    pub(super) fn next(
        &mut self,
        now_ns: u64,
        names_rev: u64,
    ) -> Option<(BodyTransforms, Receipt)> {
        let is_due = |one: &Waiting| !is_early(&one.message, names_rev) || one.until_ns <= now_ns;
        let is_first = |at: usize, one: &Waiting| {
            let mut ahead = self.waiting.iter().take(at);
            ahead.all(|other| session(&other.message) != session(&one.message))
        };
        let mut all = self.waiting.iter().enumerate();
        let (at, _) = all.find(|(at, one)| is_due(one) && is_first(*at, one))?;
        let one = self.waiting.remove(at)?;
        Some((one.message, one.receipt))
    }
}

/// Number of rows of a message, for the limit of memory.
fn rows(message: &BodyTransforms) -> usize {
    message.transforms.len().max(message.velocities.len())
}

/// Whether a message is within the limits of names and rows.
fn may_be_kept(message: &BodyTransforms) -> bool {
    let is_short = |name: &str| name.len() <= BODY_NAME_LEN;
    rows(message) <= FRAME_ROWS_MAX && message.transforms.iter().all(|row| is_short(&row.name))
}

/// Sender of a frame: frames with equal keys have an order.
fn session(message: &BodyTransforms) -> (&str, u64) {
    (&message.source, message.session)
}

/// Whether a frame has names that are not known here yet.
fn is_early(message: &BodyTransforms, names_rev: u64) -> bool {
    let named =
        |message: &BodyTransforms| message.transforms.iter().any(|row| !row.name.is_empty());
    message.scene_rev > names_rev && named(message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::ros::{BodyTransform, Twist};

    fn frame(source: &str, seq: u64, scene_rev: u64) -> BodyTransforms {
        let body = BodyTransform {
            name: "late".to_owned(),
            ..BodyTransform::default()
        };
        BodyTransforms {
            source: source.to_owned(),
            seq,
            scene_rev,
            transforms: vec![body],
            ..BodyTransforms::default()
        }
    }

    fn at(now_ns: u64) -> Receipt {
        Receipt {
            now_ns,
            waited: false,
            ros_now_ns: 0,
            from: ros2_client::Gid::ZERO,
        }
    }

    /// Takes a message while names are known up to revision 4; returns the messages that come out at once, with
    /// refusals.
    fn take(
        early: &mut Early,
        message: BodyTransforms,
        now_ns: u64,
        timeout_ns: Option<u64>,
    ) -> Vec<(u64, Option<RejectReason>)> {
        let mut out = Vec::new();
        let mut put = |message: &BodyTransforms, _, refused| out.push((message.seq, refused));
        early.take(message, at(now_ns), 4, timeout_ns, &mut put);
        out
    }

    /// The messages that come out now, as sources and numbers.
    fn out(early: &mut Early, now_ns: u64, names_rev: u64) -> Vec<(String, u64)> {
        std::iter::from_fn(|| early.next(now_ns, names_rev))
            .map(|(message, _)| (message.source, message.seq))
            .collect()
    }

    #[test]
    fn bug_a_frame_waits_for_the_names_of_its_revision_and_those_behind_it_wait_too() {
        let mut early = Early::default();
        let mut take = |message| take(&mut early, message, 10, Some(100));
        assert_eq!(take(frame("sim", 1, 4)), [(1, None)], "its names are there");
        assert_eq!(take(frame("sim", 2, 5)), []);
        assert_eq!(take(frame("sim", 3, 0)), [], "it is behind one that waits");
        assert_eq!(take(frame("arm", 1, 0)), [(1, None)], "another source's");
        let mut by_id = frame("arm", 2, 5);
        by_id.transforms[0].name.clear();
        assert_eq!(take(by_id), [(2, None)], "its ids wait in the world");
        assert_eq!(out(&mut early, 20, 4), []);
        let both = [("sim".to_owned(), 2), ("sim".to_owned(), 3)];
        assert_eq!(out(&mut early, 20, 5), both);
        assert_eq!(early.until_ns(), None);
    }

    #[test]
    fn bug_a_second_session_that_waits_holds_nobody_else_up() {
        let mut early = Early::default();
        let stranger = BodyTransforms {
            session: 2,
            ..frame("sim", 1, 9)
        };
        let own = |seq, scene_rev| BodyTransforms {
            session: 1,
            ..frame("sim", seq, scene_rev)
        };
        let mut take = |message| take(&mut early, message, 10, Some(100));
        assert_eq!(take(stranger), []);
        assert_eq!(take(own(2, 0)), [(2, None)], "the live session goes on");
        assert_eq!(take(own(3, 5)), []);
        assert_eq!(take(own(4, 0)), [], "behind its own");
        let both = [("sim".to_owned(), 3), ("sim".to_owned(), 4)];
        assert_eq!(
            out(&mut early, 20, 5),
            both,
            "and waits for its own names only"
        );
    }

    #[test]
    fn a_frame_waits_for_one_time_out() {
        let mut early = Early::default();
        take(&mut early, frame("sim", 1, 9), 10, Some(100));
        take(&mut early, frame("sim", 2, 9), 60, Some(100));
        assert_eq!(early.until_ns(), Some(110));
        assert_eq!(out(&mut early, 109, 4), []);
        assert_eq!(out(&mut early, 110, 4), [("sim".to_owned(), 1)]);
        assert_eq!(early.until_ns(), Some(160));
        assert_eq!(out(&mut early, 160, 4), [("sim".to_owned(), 2)]);
        let unknown = take(&mut early, frame("nobody", 1, 9), 10, None);
        assert_eq!(unknown, [(1, None)], "refused for its source");
    }

    #[test]
    fn bug_of_frames_that_wait_too_many_the_oldest_are_refused_for_their_revision() {
        let mut early = Early::default();
        let mut refused = Vec::new();
        for seq in 0..100 {
            refused.extend(take(&mut early, frame("sim", seq, 9), 10, Some(100)));
        }
        let wanted = 0..100 - FRAMES_PER_DRAIN_MAX as u64;
        let wanted: Vec<_> = wanted
            .map(|seq| (seq, Some(RejectReason::SceneRevision)))
            .collect();
        assert_eq!(refused, wanted);
        let kept = out(&mut early, 999, 4);
        assert_eq!(kept.len(), FRAMES_PER_DRAIN_MAX);
        assert_eq!(kept.last(), Some(&("sim".to_owned(), 99)));
    }

    #[test]
    fn bug_what_waits_of_a_source_has_no_more_rows_than_one_frame_may_have() {
        let mut early = Early::default();
        let of_rows = |seq, rows| BodyTransforms {
            velocities: vec![Twist::default(); rows],
            ..frame("sim", seq, 9)
        };
        let over = take(&mut early, of_rows(1, FRAME_ROWS_MAX + 1), 10, Some(100));
        assert_eq!(over, [(1, None)], "refused for its size");
        assert_eq!(
            take(&mut early, of_rows(2, FRAME_ROWS_MAX / 2), 10, Some(100)),
            []
        );
        assert_eq!(
            take(&mut early, of_rows(3, FRAME_ROWS_MAX / 2), 10, Some(100)),
            []
        );
        let refused = take(&mut early, of_rows(4, 2), 10, Some(100));
        assert_eq!(refused, [(2, Some(RejectReason::SceneRevision))]);
    }
}
