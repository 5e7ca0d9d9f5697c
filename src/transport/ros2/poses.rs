//! Converts messages of common types to poses of bodies. In: links of `/tf`, stamped poses, odometry. Out: [`Update`]s
//! of the bodies concerned, with the reason if a pose is unknown. Pure: no clock, and nothing of DDS but the GIDs of
//! publishers.

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

/// Time and sender of a message.
#[derive(Clone, Copy, Debug)]
pub(super) struct Receipt {
    /// Time of receipt, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) now_ns: u64,
    /// Whether the process was suspended or stalled before the message was read.
    pub(super) waited: bool,
    /// The node's time, which senders use for stamps, nanoseconds; 0: unknown.
    pub(super) ros_now_ns: u64,
    /// GID of the publisher.
    pub(super) from: Gid,
}

/// Seat of a removed body; no body has id 0.
const NOBODY: Seat = Seat {
    body: 0,
    continuous: false,
    attached: false,
};

/// Longest time between two updates with the pose of a chain of fixed links, nanoseconds: after a reset its body is
/// unknown for so long.
const AGAIN_NS: u64 = 500_000_000;

/// A body of a source of common topics.
#[derive(Debug)]
struct Member {
    seat: Seat,
    name: String,
    /// Index of its frame in the tree (kind `tf`).
    frame: usize,
    /// Its topic (other kinds).
    topic: String,
    /// Order of the stamps of its poses.
    order: Order,
    /// Result of the last lookup; only a different one is reported. Links of one round share one receipt time.
    last: Option<Result<Found, Missing>>,
    /// Time of the last update, nanoseconds of `CLOCK_BOOTTIME`.
    told_ns: u64,
    /// Whether the last update was made just after the process had stalled; the daemon may have refused it.
    told_late: bool,
    /// Start of its pose's age, nanoseconds of `CLOCK_BOOTTIME`; `None`: no pose, or a pose that does not age.
    since_ns: Option<u64>,
    /// First look at faults at which it had no pose, nanoseconds of `CLOCK_BOOTTIME`; `None`: no look yet.
    awaited_ns: Option<u64>,
    /// Its current fault, for messages.
    fault: Option<String>,
}

/// A source of common topics, with its bodies.
#[derive(Debug)]
pub(super) struct Source {
    pub(super) kind: RosKind,
    pub(super) name: [u8; SOURCE_NAME_LEN],
    pub(super) topic: String,
    pub(super) static_topic: String,
    /// Its index in the scene.
    pub(super) place: usize,
    timeout_ns: u64,
    max_skew_ns: u64,
    /// `max_skew_ns` as set in the scene.
    scene_skew_ns: u64,
    /// The scene's frame: its name and its index in the tree.
    root: (String, usize),
    tree: Tree,
    members: Vec<Member>,
    /// Largest skew of a chain at the last look, nanoseconds; `None`: no chain with aging links.
    pub(super) skew_ns: Option<u64>,
    /// Messages and links refused since the counter was last taken.
    pub(super) refused: u64,
    /// Recent faults that end by themselves.
    passing: Passing,
}

impl Source {
    /// The sources of common topics of a scene, in the scene's order.
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

    /// The seats of its bodies, in the order of its members.
    pub(super) fn seats(&self) -> Vec<Seat> {
        self.members.iter().map(|member| member.seat).collect()
    }

    /// The topic of each member.
    pub(super) fn topics(&self) -> impl Iterator<Item = &str> {
        self.members.iter().map(|member| member.topic.as_str())
    }

    /// The current faults of its bodies, at most `most`. Attached bodies are skipped: their source does not move them.
    pub(super) fn faults(&mut self, most: usize, now_ns: u64) -> Vec<String> {
        for member in &mut self.members {
            member.awaited_ns.get_or_insert(now_ns);
        }
        let members = self.members.iter();
        let members = members.filter(|member| member.seat != NOBODY && !member.seat.attached);
        let faulty = members.filter_map(|member| {
            let fault = member.fault.clone();
            let fault = fault.or_else(|| self.silence(member, now_ns))?;
            Some(format!("body {}: {fault}", member.name))
        });
        faulty.chain(self.passing.now(now_ns)).take(most).collect()
    }

    /// Sets its time-out and the largest skew of a chain (`None`: as set in the scene).
    pub(super) fn set_limits(&mut self, timeout_ns: u64, max_skew_ns: Option<u64>) {
        self.timeout_ns = timeout_ns;
        self.max_skew_ns = max_skew_ns.unwrap_or(self.scene_skew_ns);
    }

    /// Drops everything that depends on the senders' clock, because it went back.
    pub(super) fn forget(&mut self) {
        self.tree.forget();
        for member in &mut self.members {
            member.order = Order::default();
            (member.last, member.since_ns) = (None, None);
            member.awaited_ns = None;
        }
    }

    /// Appends updates for bodies whose chains have changed since the last look, or whose update must be repeated.
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
            // The pose of a chain of fixed links is repeated, so that it does not become stale; the refusal of a broken
            // chain is repeated until an update was made without a stall before it.
            let again_ns = AGAIN_NS.min(self.timeout_ns / 3);
            let due = receipt.now_ns.saturating_sub(member.told_ns) >= again_ns;
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
            // A chain is as old as its oldest link (law 3.8); a refusal has the age of this look.
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

    /// Takes a stamped pose of a body.
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

    /// Takes the odometry of a body; its twist is in the body's frame.
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

/// Converts nanoseconds to seconds.
pub(super) fn seconds(ns: u64) -> f64 {
    std::time::Duration::from_nanos(ns).as_secs_f64()
}

/// Rotates a twist from the body's frame to the scene's frame; zeros if the pose is invalid, which is refused itself.
fn turned(turn: Option<Quat>, linear: [f64; 3], angular: [f64; 3]) -> [f64; 6] {
    let Some(turn) = turn else {
        return [0.0; 6];
    };
    let (l, a) = (turn * Vec3::from(linear), turn * Vec3::from(angular));
    [l.x, l.y, l.z, a.x, a.y, a.z]
}

#[cfg(test)]
mod tests;
