//! The rows of an admitted frame: takes poses, renews ages, refuses bad rows together with their bodies.
//!
//! In: a frame whose rows have been matched with bodies. Out: bodies placed and settled. A row that repeats the last
//! pose bit by bit only renews the age.

use super::World;
use super::admit::{NO_BODY, Times};
use super::ahead::AHEAD;
use super::tag::Tag;
use super::twist::Twist;
use crate::ids::BodyId;
use crate::ids::{BodySlot, SourceSlot};
use crate::limits::{COORDINATE_MAX_M, QUATERNION_NORM_TOLERANCE};
use crate::math::{Pose, Vec3, pose_from};
use crate::wire::{BodyStatus, Frame, RejectReason, TransformRow};

impl World {
    /// Takes the poses of the rows that were found. A body with two rows is refused: its newest pose is not known.
    pub(super) fn take_rows(
        &mut self,
        source: SourceSlot,
        frame: &Frame,
        rows: &[BodySlot],
        times: Times,
    ) -> u64 {
        let number = self.sources[source.index()].pose_frame;
        let timeout_ns = self.sources[source.index()].timeout_ns;
        let mut refused = 0;
        for (at, (row, &slot)) in frame.transforms.iter().zip(rows).enumerate() {
            self.ask_along(at, |step| rows.get(step).map(|slot| [*slot]));
            if let Some(&ahead) = rows.get(at + AHEAD) {
                self.ask_ahead_for_entry(ahead);
            }
            if slot == NO_BODY {
                continue;
            }
            let times = times.of_row(frame, at);
            let deadline_ns = times.since_ns.saturating_add(timeout_ns);
            let young = deadline_ns > self.now_ns;
            let velocity = frame.velocities.get(at);
            let raw = raw_of(row);
            let entry = &self.entries[slot.index()];
            let twice = entry.twice == number;
            let repeated = entry.has_pose && !entry.refused && same_raw(&entry.raw, &raw);
            let checked = if twice {
                Err(RejectReason::Duplicate)
            } else if velocity.is_some_and(|v| !v.iter().all(|x| x.is_finite())) {
                Err(RejectReason::NotFinite)
            } else if repeated {
                Ok(None)
            } else {
                pose_of(row).map(Some)
            };
            match checked {
                Ok(pose) => {
                    let stamp_ns = frame.stamps_ns.get(at).copied();
                    let stamp_ns = stamp_ns.unwrap_or(frame.header.stamp_ns);
                    let velocity = velocity.map(Twist::of_row);
                    let declared = self.declared_turn(slot, stamp_ns, velocity);
                    let other_speed = self.renew(slot, stamp_ns, velocity, times);
                    let pose = pose.map(|pose| (pose, raw));
                    let moved = self.accept(slot, pose, declared, deadline_ns, young);
                    if other_speed && !moved {
                        self.lists.restated(slot);
                    }
                }
                Err(reason) => {
                    self.note_reject(reason, Some(source));
                    self.refuse_pose(slot, reason);
                    refused += 1;
                }
            }
        }
        refused
    }

    /// Refuses bodies of this source whose newest pose the transport could not determine.
    pub(super) fn refuse_bodies(&mut self, source: SourceSlot, frame: &Frame) -> u64 {
        for &(body, reason) in &frame.refused_bodies {
            self.note_reject(reason, Some(source));
            let slot = self.slot_of(BodyId(body));
            if let Some(slot) = slot.filter(|slot| self.may_move(source, *slot).is_ok()) {
                self.refuse_pose(slot, reason);
            }
        }
        u64::try_from(frame.refused_bodies.len()).unwrap_or(u64::MAX)
    }

    /// Takes stamp, velocity and age of a good row.
    ///
    /// * returns - whether the velocity of a body in the broad phase changed.
    fn renew(
        &mut self,
        slot: BodySlot,
        stamp_ns: u64,
        velocity: Option<Twist>,
        times: Times,
    ) -> bool {
        if let Some(body) = self.bodies[slot.index()].as_mut() {
            let was = std::mem::replace(&mut body.velocity, velocity);
            let other_speed = !Twist::is_same(was, velocity);
            self.entries[slot.index()].stood_ns = None;
            body.stamp_ns = stamp_ns;
            body.since_ns = Some(times.since_ns);
            body.received_ns = times.received_ns;
            body.lent_timeout_ns = u64::MAX;
            // A body that has not moved is not settled again, so its tag is set here.
            if other_speed {
                self.tags.set(slot, Some(Tag::of(body)));
            }
            return other_speed && body.in_broad;
        }
        false
    }

    /// Rotation of a continuous body since its last pose, as declared by its sender: angular velocity times the time
    /// between the stamps, radians. A pause in between starts the time anew. `None` without a velocity or stamps.
    fn declared_turn(
        &self,
        slot: BodySlot,
        stamp_ns: u64,
        velocity: Option<Twist>,
    ) -> Option<Vec3> {
        let body = self.body(slot).filter(|body| body.path.is_some())?;
        let turning = velocity?.angular_radps;
        let entry = &self.entries[slot.index()];
        // The stamp of a former root may come from another clock.
        let is_own = entry.raw[0].is_finite();
        let stood_ns = match entry.stood_ns {
            Some(0) => 0,
            paused_ns => body.stamp_ns.max(paused_ns.unwrap_or_default()),
        };
        if !is_own || stood_ns == 0 || stamp_ns <= stood_ns {
            return None;
        }
        #[allow(clippy::cast_precision_loss, reason = "stamps of one body are near")]
        let time_s = (stamp_ns - stood_ns) as f64 * 1e-9;
        Some(turning * time_s)
    }

    /// Takes the pose of a good row, if it differs from the body's.
    ///
    /// * returns - whether the body moved.
    fn accept(
        &mut self,
        slot: BodySlot,
        pose: Option<(Pose, [f64; 7])>,
        declared: Option<Vec3>,
        deadline_ns: u64,
        young: bool,
    ) -> bool {
        let mut moved = false;
        if let Some((pose, raw)) = pose {
            moved = self.travel(slot, &pose, declared);
            let entry = &mut self.entries[slot.index()];
            entry.raw = raw;
            entry.has_pose = true;
            entry.refused = false;
        } else if let Some(at) = self.body(slot).filter(|b| b.path.is_some()).map(|b| b.pose) {
            // The pose is repeated: the body stood still for a leg, or turned by whole turns.
            moved = self.travel(slot, &at, declared);
        }
        let Some(body) = self.bodies[slot.index()].as_mut() else {
            return moved;
        };
        body.reject = body.vertices.as_ref().and_then(|v| v.refused);
        let known = body.status == BodyStatus::Known && body.in_broad;
        if known && young && !moved {
            // The common case of a scene at rest: only the age changes.
            let stamp_ns = body.stamp_ns;
            self.ages.set(slot, Some(deadline_ns), Some(stamp_ns));
            self.touch(slot);
        } else {
            self.settle(slot, moved);
        }
        moved
    }

    /// Refuses the newest pose of a body: the body is unknown until a good one comes; its last good one is kept.
    fn refuse_pose(&mut self, slot: BodySlot, reason: RejectReason) {
        self.note_refused_body(reason, slot);
        self.entries[slot.index()].refused = true;
        if let Some(body) = self.bodies[slot.index()].as_mut() {
            body.reject = Some(reason);
        }
        self.settle(slot, false);
    }

    /// Renews the poses of the last pose frame for one more time-out, because of a paused frame.
    ///
    /// * `stamp_ns` - stamp of the paused frame; 0: none.
    pub(super) fn renew_last_poses(&mut self, source: SourceSlot, stamp_ns: u64, times: Times) {
        let number = self.sources[source.index()].pose_frame;
        let rows = std::mem::take(&mut self.sources[source.index()].rows);
        for &slot in rows.iter().filter(|slot| **slot != NO_BODY) {
            let entry = &mut self.entries[slot.index()];
            // A body that was put again or reset since has no pose to renew.
            if entry.seen != number || !entry.has_pose || entry.refused || number == 0 {
                continue;
            }
            entry.stood_ns = Some(stamp_ns);
            if let Some(body) = self.bodies[slot.index()].as_mut() {
                body.since_ns = Some(times.since_ns);
                self.settle(slot, false);
            }
        }
        self.sources[source.index()].rows = rows;
    }
}

fn raw_of(row: &TransformRow) -> [f64; 7] {
    let ([x, y, z], [i, j, k, w]) = (row.position, row.orientation);
    [x, y, z, i, j, k, w]
}

/// Compares bit by bit; a row with NaN never equals an admitted one.
fn same_raw(one: &[f64; 7], other: &[f64; 7]) -> bool {
    one[0].is_finite()
        && one
            .iter()
            .zip(other)
            .all(|(a, b)| a.to_bits() == b.to_bits())
}

/// The pose of a row, or the reason for its refusal.
fn pose_of(row: &TransformRow) -> Result<Pose, RejectReason> {
    let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
    if !finite(&row.position) || !finite(&row.orientation) {
        return Err(RejectReason::NotFinite);
    }
    if row.position.iter().any(|v| v.abs() > COORDINATE_MAX_M) {
        return Err(RejectReason::OverLimit);
    }
    let square: f64 = row.orientation.iter().map(|v| v * v).sum();
    if (square.sqrt() - 1.0).abs() > QUATERNION_NORM_TOLERANCE {
        return Err(RejectReason::BadQuaternion);
    }
    pose_from(row.position, row.orientation).ok_or(RejectReason::BadQuaternion)
}
