//! Frames of `~/transforms` that came before the names of their scene revision are known here: they wait, since a name
//! that nobody has yet would be nobody's.
//!
//! In: messages, the revision of the names. Out: messages whose time has come, those of a session in their order.

use std::collections::VecDeque;

use super::super::poses::Receipt;
use crate::limits::FRAMES_PER_DRAIN_MAX;
use crate::wire::ros::BodyTransforms;

/// A message that waits, since when, and until when at most.
#[derive(Debug)]
struct Waiting {
    message: BodyTransforms,
    receipt: Receipt,
    until_ns: u64,
}

/// Frames that wait.
#[derive(Debug, Default)]
pub(super) struct Early {
    waiting: VecDeque<Waiting>,
}

impl Early {
    /// Whether none waits.
    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Takes a message that must wait, or that comes behind one of its session that does; gives back any other.
    ///
    /// * `names_rev` - scene revision of the names that are known here.
    /// * `timeout_ns` - of its source; `None`: the scene has no such source, and the frame is refused for that.
    /// * returns - a message that need not wait, and how many were passed over because too many of its source wait.
    pub(super) fn take(
        &mut self,
        message: BodyTransforms,
        receipt: Receipt,
        names_rev: u64,
        timeout_ns: Option<u64>,
    ) -> (Option<BodyTransforms>, u64) {
        let Some(timeout_ns) = timeout_ns else {
            return (Some(message), 0);
        };
        // Only a session has an order (law 4.2): a stranger under the name of a source must not hold it up.
        let is_behind =
            (self.waiting.iter()).any(|other| session(&other.message) == session(&message));
        if !is_behind && !is_early(&message, names_rev) {
            return (Some(message), 0);
        }
        let of_source = |other: &Waiting| other.message.source == message.source;
        let ahead = self.waiting.iter().filter(|other| of_source(other)).count();
        let oldest = self.waiting.iter().position(of_source);
        let gone = oldest.filter(|_| ahead >= FRAMES_PER_DRAIN_MAX);
        let gone = gone.and_then(|at| self.waiting.remove(at));
        self.waiting.push_back(Waiting {
            message,
            receipt,
            // As for frames that the daemon knows the names of (law 4.3): one time-out, then it is refused for its
            // revision.
            until_ns: receipt.now_ns.saturating_add(timeout_ns),
        });
        (None, u64::from(gone.is_some()))
    }

    /// A message whose time has come: its names are there, or it has waited for its time-out.
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

/// Whose a frame is: what has an order of its own.
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
    use crate::wire::ros::BodyTransform;

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

    /// What comes out now, as sources and numbers.
    fn out(early: &mut Early, now_ns: u64, names_rev: u64) -> Vec<(String, u64)> {
        std::iter::from_fn(|| early.next(now_ns, names_rev))
            .map(|(message, _)| (message.source, message.seq))
            .collect()
    }

    #[test]
    fn bug_a_frame_waits_for_the_names_of_its_revision_and_those_behind_it_wait_too() {
        let mut early = Early::default();
        let mut take = |message| early.take(message, at(10), 4, Some(100)).0;
        assert!(take(frame("sim", 1, 4)).is_some(), "its names are there");
        assert!(take(frame("sim", 2, 5)).is_none());
        assert!(
            take(frame("sim", 3, 0)).is_none(),
            "it is behind one that waits"
        );
        assert!(take(frame("arm", 1, 0)).is_some(), "another source's");
        let mut by_id = frame("arm", 2, 5);
        by_id.transforms[0].name.clear();
        assert!(take(by_id).is_some(), "its ids wait in the world");
        assert_eq!(out(&mut early, 20, 4), []);
        let both = [("sim".to_owned(), 2), ("sim".to_owned(), 3)];
        assert_eq!(out(&mut early, 20, 5), both);
        assert!(early.is_empty());
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
        let mut take = |message| early.take(message, at(10), 4, Some(100)).0;
        assert!(take(stranger).is_none());
        assert!(take(own(2, 0)).is_some(), "the live session goes on");
        assert!(take(own(3, 5)).is_none());
        assert!(take(own(4, 0)).is_none(), "behind its own");
        let both = [("sim".to_owned(), 3), ("sim".to_owned(), 4)];
        assert_eq!(
            out(&mut early, 20, 5),
            both,
            "and waits for its own names only"
        );
    }

    #[test]
    fn a_frame_waits_for_one_time_out_and_a_flood_keeps_its_newest() {
        let mut early = Early::default();
        early.take(frame("sim", 1, 9), at(10), 4, Some(100));
        early.take(frame("sim", 2, 9), at(60), 4, Some(100));
        assert_eq!(out(&mut early, 109, 4), []);
        assert_eq!(out(&mut early, 110, 4), [("sim".to_owned(), 1)]);
        assert_eq!(out(&mut early, 160, 4), [("sim".to_owned(), 2)]);
        let gone = (0..100).map(|seq| early.take(frame("sim", seq, 9), at(10), 4, Some(100)).1);
        assert_eq!(gone.sum::<u64>(), 100 - FRAMES_PER_DRAIN_MAX as u64);
        assert_eq!(
            out(&mut early, 999, 4).last(),
            Some(&("sim".to_owned(), 99))
        );
        let unknown = early.take(frame("nobody", 1, 9), at(10), 4, None);
        assert!(unknown.0.is_some(), "refused for its source");
    }
}
