//! From messages of common types to poses of bodies. In: links of `/tf`, stamped poses, odometry. Out: [`Update`]s
//! for the bodies concerned, or the reason why a body's place is not known. Pure: no DDS beyond the names of
//! publishers, no clock.

mod judge;
mod links;
mod roster;
mod stamps;

use judge::judge;
pub(super) use stamps::off;
use stamps::{Passing, older};

use ros2_client::Gid;

use super::RosScene;
use super::order::{Order, Step};
use super::shelf::{Seat, Update};
use super::tf::{Found, Missing, Tree, no_pose, plain, sound};
use super::told::brief;
use crate::config::RosKind;
use crate::math::{Quat, Vec3, pose_from};
use crate::wire::ros::{Odometry, PoseStamped};
use crate::wire::{RejectReason, SOURCE_NAME_LEN, TransformRow, name_bytes};

/// When and how a message came.
#[derive(Clone, Copy, Debug)]
pub(super) struct Receipt {
    /// Nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) now_ns: u64,
    /// Whether the process stood still before it was read.
    pub(super) waited: bool,
    /// The node's time, which is what senders stamp with, nanoseconds; 0: not known.
    pub(super) ros_now_ns: u64,
    /// Who sent it.
    pub(super) from: Gid,
}

/// In place of a body that has left: no body has this id.
const NOBODY: Seat = Seat {
    body: 0,
    continuous: false,
    attached: false,
};

/// One body of a source of common topics.
#[derive(Debug)]
struct Member {
    seat: Seat,
    name: String,
    /// Number of its frame in the tree (kind `tf`).
    frame: usize,
    /// Its topic (other kinds).
    topic: String,
    /// The stamps of its poses.
    order: Order,
    /// What was last handed on of it, to say only what is new: links of one round have one time of receipt.
    last: Option<Result<Found, Missing>>,
    /// When it was last handed on, nanoseconds of `CLOCK_BOOTTIME`.
    told_ns: u64,
    /// It was then said of a moment at which the process had just stood still, and may not have been taken.
    told_late: bool,
    /// From when on its pose grows old, nanoseconds of `CLOCK_BOOTTIME`; `None`: it has none that does.
    since_ns: Option<u64>,
    /// What is wrong with it now, for people.
    fault: Option<String>,
}

/// A source of common topics and its bodies.
#[derive(Debug)]
pub(super) struct Source {
    pub(super) kind: RosKind,
    pub(super) name: [u8; SOURCE_NAME_LEN],
    pub(super) topic: String,
    pub(super) static_topic: String,
    /// Its place in the scene.
    pub(super) place: usize,
    timeout_ns: u64,
    max_skew_ns: u64,
    /// `max_skew_ns` as the scene says it.
    scene_skew_ns: u64,
    /// The scene's frame, by name and by its number in the tree.
    root: (String, usize),
    tree: Tree,
    members: Vec<Member>,
    /// Widest skew of a chain at the last look, nanoseconds; `None`: no chain.
    pub(super) skew_ns: Option<u64>,
    /// Messages or links that were refused.
    pub(super) refused: u64,
    /// What was wrong a moment ago.
    passing: Passing,
}

impl Source {
    /// The sources of common topics of a scene, in its order.
    pub(super) fn of(scene: &RosScene) -> Vec<Self> {
        let mut all = Vec::new();
        for (place, spec) in scene.sources.iter().enumerate() {
            let Some(ros) = &spec.ros2 else { continue };
            let (mut tree, root) = Tree::rooted(&scene.frame_id);
            let bodies = scene.bodies.iter().filter(|b| b.source == Some(place));
            let members = bodies.map(|body| Member::of(body, &mut tree)).collect();
            all.push(Self {
                kind: ros.kind,
                name: name_bytes(&spec.name),
                topic: ros.topic.clone(),
                static_topic: ros.static_topic.clone(),
                place,
                timeout_ns: spec.timeout_ns,
                max_skew_ns: ros.max_skew_ns,
                scene_skew_ns: ros.max_skew_ns,
                members,
                root: (scene.frame_id.clone(), root),
                tree,
                skew_ns: None,
                refused: 0,
                passing: Passing::default(),
            });
        }
        all
    }

    /// The seats of its bodies, in their order.
    pub(super) fn seats(&self) -> Vec<Seat> {
        self.members.iter().map(|member| member.seat).collect()
    }

    /// The topic of each of its bodies.
    pub(super) fn topics(&self) -> impl Iterator<Item = &str> {
        self.members.iter().map(|member| member.topic.as_str())
    }

    /// What is wrong with its bodies now, at most `most` of them. One that hangs on another is not its to move.
    pub(super) fn faults(&self, most: usize, now_ns: u64) -> Vec<String> {
        let members = self.members.iter();
        let members = members.filter(|member| member.seat != NOBODY && !member.seat.attached);
        let faulty = members.filter_map(|member| {
            let fault = member.fault.clone();
            let fault = fault.or_else(|| self.silence(member, now_ns))?;
            Some(format!("body {}: {fault}", member.name))
        });
        faulty.chain(self.passing.now(now_ns)).take(most).collect()
    }

    /// Sets its time-out, and the widest skew of a chain (`None`: as the scene says).
    pub(super) fn set_limits(&mut self, timeout_ns: u64, max_skew_ns: Option<u64>) {
        self.timeout_ns = timeout_ns;
        self.max_skew_ns = max_skew_ns.unwrap_or(self.scene_skew_ns);
    }

    /// The clock of all senders went back.
    pub(super) fn forget(&mut self) {
        self.tree.forget();
        for member in &mut self.members {
            member.order = Order::default();
            (member.last, member.since_ns) = (None, None);
        }
    }

    /// The poses of bodies whose chains have changed since the last look, or are due for a word.
    pub(super) fn look(&mut self, receipt: Receipt, updates: &mut Vec<Update>) {
        if self.kind != RosKind::Tf {
            return;
        }
        let (mut skew_ns, root) = (None, self.root.1);
        self.tree.note_look();
        let members = self.members.iter_mut().enumerate();
        for (place, member) in members.filter(|(_, member)| member.seat != NOBODY) {
            let found = self.tree.find(member.frame, root);
            if let Ok(found) = &found
                && found.received_ns.is_some()
            {
                skew_ns = skew_ns.max(Some(found.skew_ns));
            }
            // A chain that never changes is said again and again, because its source vouches for it; one that is broken
            // until it was said in time.
            let due = receipt.now_ns.saturating_sub(member.told_ns) >= self.timeout_ns / 3;
            let lasts = match &found {
                Ok(found) => found.received_ns.is_none(),
                Err(_) => member.told_late,
            };
            if member.last.as_ref() == Some(&found) && !(due && lasts) {
                continue;
            }
            member.last = Some(found.clone());
            let (result, fault) = judge(
                &found,
                receipt.now_ns,
                self.max_skew_ns,
                self.timeout_ns,
                &self.root.0,
            );
            member.fault = fault;
            let Some(result) = result else { continue };
            (member.told_ns, member.told_late) = (receipt.now_ns, receipt.waited);
            // A chain is as old as its oldest link (law 3.8); that there is no pose is news of now.
            let earliest = found.as_ref().ok().and_then(|found| found.received_ns);
            let since_ns = earliest.filter(|_| result.is_ok()).map(|(_, ns)| ns);
            member.since_ns = since_ns;
            updates.push(Update {
                member: place,
                result,
                velocity: None,
                stamp_ns: found.as_ref().map_or(0, |found| found.stamp_ns),
                received_ns: receipt.now_ns,
                since_ns: since_ns.unwrap_or(receipt.now_ns),
                waited: receipt.waited,
            });
        }
        self.skew_ns = skew_ns;
    }

    /// Takes a stamped pose for one of its bodies.
    ///
    /// * returns - whether the sender's time went back.
    pub(super) fn take_pose(
        &mut self,
        member: usize,
        message: &PoseStamped,
        receipt: Receipt,
        updates: &mut Vec<Update>,
    ) -> bool {
        let row = TransformRow {
            position: message.pose.position.into(),
            orientation: message.pose.orientation.into(),
            ..TransformRow::default()
        };
        let stamp_ns = message.header.stamp.to_ns();
        self.put(
            member,
            &message.header.frame_id,
            stamp_ns,
            row,
            None,
            receipt,
            updates,
        )
    }

    /// Takes odometry for one of its bodies; its twist is in the body's frame.
    ///
    /// * returns - whether the sender's time went back.
    pub(super) fn take_odometry(
        &mut self,
        member: usize,
        message: &Odometry,
        receipt: Receipt,
        updates: &mut Vec<Update>,
    ) -> bool {
        let pose = &message.pose.pose;
        let row = TransformRow {
            position: pose.position.into(),
            orientation: pose.orientation.into(),
            ..TransformRow::default()
        };
        let turn = pose_from(row.position, row.orientation).map(|pose| pose.rotation);
        let twist = &message.twist.twist;
        let velocity = turned(turn, twist.linear.into(), twist.angular.into());
        let (frame, stamp_ns) = (&message.header.frame_id, message.header.stamp.to_ns());
        self.put(
            member,
            frame,
            stamp_ns,
            row,
            Some(velocity),
            receipt,
            updates,
        )
    }

    #[allow(
        clippy::too_many_arguments,
        reason = "the one place where both kinds of messages meet"
    )]
    fn put(
        &mut self,
        place: usize,
        frame: &str,
        stamp_ns: u64,
        row: TransformRow,
        velocity: Option<[f64; 6]>,
        receipt: Receipt,
        updates: &mut Vec<Update>,
    ) -> bool {
        let Some(member) = self.members.get_mut(place) else {
            return false;
        };
        let mut back = false;
        let step = (member.order).take(stamp_ns, receipt.now_ns, self.timeout_ns);
        match step {
            Step::On => {}
            Step::Late(by_ns) => {
                let odd = older(("body", &member.name), by_ns);
                self.refused += 1;
                self.tell(Some(odd), receipt);
                return false;
            }
            Step::Anew => back = true,
        }
        let odd = off(("body", &member.name), stamp_ns, receipt, self.timeout_ns);
        let mut result = sound(row.position, row.orientation).map(|_| row);
        member.fault = result
            .err()
            .map(|reason| format!("its pose is {}", no_pose(reason)));
        if plain(frame) != plain(&self.root.0) {
            result = Err(RejectReason::BadChain);
            member.fault = Some(format!(
                "its pose is in frame \"{}\", not in the scene's \"{}\": send it there, or use a source of type tf",
                brief(frame),
                self.root.0
            ));
        }
        if back {
            self.forget();
        }
        if let Some(member) = self.members.get_mut(place) {
            if back {
                member.order = Order::from(stamp_ns);
            }
            member.since_ns = result.is_ok().then_some(receipt.now_ns);
        }
        self.tell(odd, receipt);
        updates.push(Update {
            member: place,
            result,
            velocity,
            stamp_ns,
            received_ns: receipt.now_ns,
            since_ns: receipt.now_ns,
            waited: receipt.waited,
        });
        back
    }
}

/// Nanoseconds as seconds.
pub(super) fn seconds(ns: u64) -> f64 {
    std::time::Duration::from_nanos(ns).as_secs_f64()
}

/// A twist of the body's frame in the scene's frame; zeros beside a pose that is none, which is refused for itself.
fn turned(turn: Option<Quat>, linear: [f64; 3], angular: [f64; 3]) -> [f64; 6] {
    let Some(turn) = turn else {
        return [0.0; 6];
    };
    let (l, a) = (turn * Vec3::from(linear), turn * Vec3::from(angular));
    [l.x, l.y, l.z, a.x, a.y, a.z]
}

#[cfg(test)]
mod tests;
