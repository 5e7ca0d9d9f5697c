//! Bodies that edits add and remove while the node runs: their members and subscriptions.
//!
//! In: changes by edits, with the subscriptions that the sending thread made. Out: lines and members that match the
//! scene.

use std::collections::BTreeSet;

use rustdds::mio1::Token;

use super::super::lines::{Arrival, Feeder, Line};
use super::super::open;
use super::super::poses::Source;
use super::super::shelf::{Seat, Shelf};
use super::Inlet;
use crate::config::RosKind;
use crate::transport::{BodyChange, BodyNote};

/// Token of lines added later: it only wakes the thread, since every round looks at every line.
const LATER: Token = Token(usize::MAX - 1);

impl Inlet {
    /// Applies changes of bodies by edits.
    pub(super) fn follow_edits(&mut self) {
        let arrivals = std::mem::take(&mut *open(&self.shared.arrivals));
        for Arrival { change, line } in arrivals {
            if let (BodyChange::Put(body), None) = (&change, &line)
                && keep(&mut self.sources, &self.shelf, body)
            {
                continue;
            }
            if let BodyChange::Hung { name, attached } = &change {
                hang(&mut self.sources, &self.shelf, name, *attached);
                continue;
            }
            let name = change.name();
            for (at, source) in self.sources.iter_mut().enumerate() {
                let Some(member) = source.remove_body(name) else {
                    continue;
                };
                self.shelf.set_member(at, member, Seat::default());
                let own = |f: &Feeder| (f.source, f.member) == (at, member);
                self.lines.retain(|line| !line.feeder().is_some_and(own));
            }
            let BodyChange::Put(body) = change else {
                continue;
            };
            let of_body = |source: &Source| Some(source.place) == body.source;
            let Some(at) = self.sources.iter().position(of_body) else {
                continue;
            };
            let member = self
                .sources
                .get_mut(at)
                .map(|source| source.put_body(&body));
            let Some(member) = member else { continue };
            self.shelf.set_member(at, member, Seat::of(&body));
            let Some(mut line) = line else { continue };
            line.feed(at, member);
            line.wake_by(self.poll.registry(), LATER);
            self.lines.push(line);
        }
    }

    /// Registers lines again whose registration failed.
    pub(super) fn wake_for_all(&mut self) {
        for line in self.lines.iter_mut().filter(|line| line.is_unwoken()) {
            line.wake_by(self.poll.registry(), LATER);
        }
    }

    /// Texts about bodies with their own topic that have no subscription.
    pub(super) fn unheard(&self) -> Vec<String> {
        let fed = self.lines.iter().filter_map(Line::feeder);
        let fed: BTreeSet<_> = fed.map(|f| (f.source, f.member)).collect();
        let own = self.sources.iter().enumerate();
        let own = own.filter(|(_, source)| source.kind != RosKind::Tf);
        own.flat_map(|(at, source)| source.bodies().map(move |(member, name)| ((at, member), name)))
            .filter(|(place, _)| !fed.contains(place))
            .map(|(_, name)| {
                format!(
                    "body {name}: no poses of it can come: it has no subscription, and the log says why; it is tried again, eight bodies a second"
                )
            })
            .collect()
    }

    /// Texts about topics that move two bodies: scene files with these are refused, but edits can cause them.
    pub(super) fn shared_topics(&self) -> Vec<String> {
        let mut topics: Vec<&str> = (self.lines.iter())
            .filter_map(|line| Some(line.feeder()?.topic.as_str()))
            .collect();
        topics.sort_unstable();
        let twice = topics.windows(2).filter(|two| two[0] == two[1]);
        let text = |two: &[&str]| {
            format!(
                "topic {}: it moves more than one body: give each a ros_topic of its own",
                two[0]
            )
        };
        twice.map(text).collect()
    }
}

/// Gives a body that keeps its frame and topic its new seat; its state and its waiting poses are kept.
///
/// * returns - whether it is such a body.
fn keep(sources: &mut [Source], shelf: &Shelf, body: &BodyNote) -> bool {
    let mut sources = sources.iter_mut().enumerate();
    let source = sources.find(|(_, source)| Some(source.place) == body.source);
    let kept = source.and_then(|(at, source)| Some((at, source.keep_body(body)?)));
    if let Some((at, member)) = kept {
        shelf.renew_member(at, member, Seat::of(body));
    }
    kept.is_some()
}

/// Attaches a body to another one, which moves it, or detaches it: then it stays until its own source's next pose.
fn hang(sources: &mut [Source], shelf: &Shelf, name: &str, attached: bool) {
    for (at, source) in sources.iter_mut().enumerate() {
        if let Some((member, seat)) = source.hang_body(name, attached) {
            shelf.set_member(at, member, seat);
        }
    }
}

#[cfg(test)]
mod tests {
    use ros2_client::Gid;

    use super::super::super::poses::Receipt;
    use super::super::super::{RosScene, RosSourceSpec};
    use super::*;
    use crate::config::{RosKind, RosSource};
    use crate::wire::Inbox;
    use crate::wire::ros::{PoseStamped, Time};

    const MS: u64 = 1_000_000;

    fn body(id: u64) -> BodyNote {
        BodyNote {
            id,
            name: "a".to_owned(),
            source: Some(0),
            frame: "a".to_owned(),
            topic: "/a".to_owned(),
            ..BodyNote::default()
        }
    }

    fn source() -> Source {
        let ros2 = RosSource {
            kind: RosKind::Pose,
            topic: String::new(),
            static_topic: String::new(),
            max_skew_ns: 0,
        };
        let scene = RosScene {
            frame_id: "world".to_owned(),
            sources: vec![RosSourceSpec {
                name: "s".to_owned(),
                timeout_ns: 500 * MS,
                ros2: Some(ros2),
            }],
            bodies: vec![body(1)],
            ..RosScene::default()
        };
        Source::of(&scene).remove(0)
    }

    /// Takes a pose with this stamp; returns the update.
    fn send(source: &mut Source, shelf: &Shelf, stamp_ns: u64) {
        let mut message = PoseStamped::default();
        message.header.frame_id = "world".to_owned();
        message.header.stamp = Time::from_ns(stamp_ns);
        message.pose.orientation.w = 1.0;
        let receipt = Receipt {
            now_ns: stamp_ns,
            waited: false,
            ros_now_ns: 0,
            from: Gid::ZERO,
        };
        let mut updates = Vec::new();
        source.take_pose(0, &message, receipt, &mut updates);
        shelf.merge(0, &updates);
    }

    #[test]
    fn bug_a_body_that_was_put_again_lost_the_pose_that_waited_and_the_order_of_its_stamps() {
        let (mut sources, shelf) = ([source()], Shelf::default());
        shelf.add_group(sources[0].name, 9, sources[0].seats());
        send(&mut sources[0], &shelf, 100 * MS);
        assert!(keep(&mut sources, &shelf, &body(7)));
        // A late pose stays late.
        send(&mut sources[0], &shelf, 90 * MS);
        let mut inbox = Inbox::default();
        shelf.drain(&mut inbox);
        let frame = &inbox.frames()[0];
        assert_eq!(
            (frame.transforms[0].body, frame.stamps_ns[0]),
            (7, 100 * MS)
        );
        assert_eq!(sources[0].seats(), [Seat::of(&body(7))]);
    }

    #[test]
    fn bug_poses_of_a_body_that_hangs_on_another_were_refused_without_an_end() {
        let (mut sources, shelf) = ([source()], Shelf::default());
        shelf.add_group(sources[0].name, 9, sources[0].seats());
        let rows = |shelf: &Shelf| {
            let mut inbox = Inbox::default();
            shelf.drain(&mut inbox);
            let rows = |frame: &crate::wire::Frame| frame.transforms.len();
            inbox.frames().iter().map(rows).collect::<Vec<_>>()
        };
        send(&mut sources[0], &shelf, 100 * MS);
        hang(&mut sources, &shelf, "a", true);
        assert_eq!(rows(&shelf), [0; 0], "what waits is of before");
        send(&mut sources[0], &shelf, 110 * MS);
        assert_eq!(
            rows(&shelf),
            [0],
            "its source lives, and says nothing of it"
        );
        assert!(sources[0].faults(9, 5000 * MS).is_empty());
        hang(&mut sources, &shelf, "a", false);
        assert_eq!(rows(&shelf), [0; 0]);
        send(&mut sources[0], &shelf, 120 * MS);
        assert_eq!(rows(&shelf), [1]);
    }

    #[test]
    fn a_body_that_is_heard_elsewhere_or_came_now_is_not_kept() {
        let (mut sources, shelf) = ([source()], Shelf::default());
        shelf.add_group(sources[0].name, 9, sources[0].seats());
        let topic = "/b".to_owned();
        assert!(!keep(&mut sources, &shelf, &BodyNote { topic, ..body(1) }));
        let frame = "b".to_owned();
        assert!(!keep(&mut sources, &shelf, &BodyNote { frame, ..body(1) }));
        let name = "b".to_owned();
        assert!(!keep(&mut sources, &shelf, &BodyNote { name, ..body(1) }));
        let source = None;
        assert!(!keep(&mut sources, &shelf, &BodyNote { source, ..body(1) }));
        sources[0].remove_body("a");
        assert!(!keep(&mut sources, &shelf, &body(1)));
    }
}
