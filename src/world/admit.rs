//! Admission: one frame comes in, checked as a whole and row by row.
//!
//! In: a decoded frame from a client that may be wrong in every field. Out: poses taken, ages renewed, refusals
//! counted, bodies marked unknown. No allocation once a source has sent its largest frame; a row costs no lookup when
//! it stands where its body stood in the frame before.

use super::World;
use super::filters::KEEPS;
use super::source::{Standing, owns, stand};
use crate::ids::{BodyId, BodySlot, SourceSlot};
use crate::limits::{COORDINATE_MAX_M, FRAME_ROWS_MAX, QUATERNION_NORM_TOLERANCE};
use crate::math::{Pose, pose_from};
use crate::wire::{
    BodyStatus, Frame, FrameHeader, RejectReason, TransformRow, WIRE_VERSION, frame_flags, name_str,
};

/// A row that names no body of its source.
pub(super) const NO_BODY: BodySlot = BodySlot(u32::MAX);

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Admission {
    /// Taken.
    Admitted {
        /// Whose it is.
        source: SourceSlot,
        /// Poses admitted.
        poses: u64,
        /// Rows refused; counted by reason.
        refused_rows: u64,
    },
    /// It waits for a later scene revision, for at most one time-out of its source.
    Waiting {
        /// Whose it is.
        source: SourceSlot,
    },
    /// Refused as a whole and counted.
    Refused {
        /// Whose it is, as far as that is known.
        source: Option<SourceSlot>,
        /// Why.
        reason: RejectReason,
    },
}

/// When a frame came and how old what it says is, nanoseconds of `CLOCK_BOOTTIME`.
#[derive(Clone, Copy, Debug)]
struct Times {
    received_ns: u64,
    since_ns: u64,
}

impl World {
    /// Admits one frame, or says why not. Bad input is counted, never an error.
    ///
    /// Cost: O(rows), of which rows that repeat the last pose bit by bit cost a compare.
    pub fn admit(&mut self, frame: &Frame, now_boot_ns: u64) -> Admission {
        self.now_ns = self.now_ns.max(now_boot_ns);
        let checked = self.check_frame(frame).and_then(|source| {
            self.flush_waiting(source);
            self.admit_of(source, frame)
                .map_err(|reason| (Some(source), reason))
        });
        checked.unwrap_or_else(|(source, reason)| {
            self.note_reject(reason);
            if let Some(source) = source {
                self.sources[source.index()].refused += 1;
            }
            Admission::Refused { source, reason }
        })
    }

    /// Layout, flags, counts and source: what can be said without looking at sessions.
    fn check_frame(&self, frame: &Frame) -> Result<SourceSlot, (Option<SourceSlot>, RejectReason)> {
        let header = &frame.header;
        let bad_layout = Err((None, RejectReason::BadLayout));
        if header.schema != WIRE_VERSION || header.session == 0 {
            return bad_layout;
        }
        let Some(name) = name_str(&header.source) else {
            return bad_layout;
        };
        let Some(source) = self.source_named(name) else {
            return Err((None, RejectReason::UnknownSource));
        };
        if let Some(reason) = frame.refused {
            return Err((Some(source), reason));
        }
        let rows = frame.transforms.len();
        let paused = header.flags == frame_flags::PAUSED;
        let has_poses = matches!(header.flags, frame_flags::FULL | frame_flags::PARTIAL);
        let fits = frame.velocities.is_empty() || frame.velocities.len() == rows;
        if !(has_poses || paused && rows == 0) || !fits {
            return Err((Some(source), RejectReason::BadLayout));
        }
        if rows > FRAME_ROWS_MAX {
            return Err((Some(source), RejectReason::OverLimit));
        }
        Ok(source)
    }

    /// Session, order, age, scene revision; then the rows.
    fn admit_of(&mut self, source: SourceSlot, frame: &Frame) -> Result<Admission, RejectReason> {
        let header = &frame.header;
        let times = self.times_of(frame);
        let state = &mut self.sources[source.index()];
        match stand(state, source, &mut self.over, header, times.received_ns) {
            Standing::Refused(reason) => return Err(reason),
            Standing::Afresh => self.forget_poses(source),
            Standing::Next => {}
        }
        // An older frame that still waits has nothing to say any more.
        let state = &mut self.sources[source.index()];
        if state.waiting.until_ns.take().is_some() {
            state.skipped += 1;
        }
        if frame.waited && header.sent_ns == 0 {
            return Err(RejectReason::TooOld);
        }
        if header.scene_rev > self.scene_rev {
            let waiting = &mut state.waiting;
            waiting.until_ns = Some(times.received_ns.saturating_add(state.timeout_ns));
            waiting.frame.clone_from(frame);
            waiting.frame.received_ns = times.received_ns;
            return Ok(Admission::Waiting { source });
        }
        Ok(self.take(source, frame, times))
    }

    /// Age counts from `sent_ns`, never later than receipt, and receipt is never later than now.
    fn times_of(&self, frame: &Frame) -> Times {
        let received_ns = match frame.received_ns {
            0 => self.now_ns,
            received_ns => received_ns.min(self.now_ns),
        };
        let since_ns = match frame.header.sent_ns {
            0 => received_ns,
            sent_ns => sent_ns.min(received_ns),
        };
        Times {
            received_ns,
            since_ns,
        }
    }

    /// A frame that nothing stands against: its rows, or what a pause renews.
    fn take(&mut self, source: SourceSlot, frame: &Frame, times: Times) -> Admission {
        let state = &mut self.sources[source.index()];
        state.frames += 1;
        state.newest = Some(frame.header);
        state.since_ns = times.since_ns;
        state.alive = self.now_ns.saturating_sub(times.since_ns) < state.timeout_ns;
        if frame.header.flags == frame_flags::PAUSED {
            self.renew_last_poses(source, times);
            return Admission::Admitted {
                source,
                poses: 0,
                refused_rows: 0,
            };
        }
        // Its list of rows is worked on outside of the world, and put back.
        let mut rows = std::mem::take(&mut self.sources[source.index()].rows);
        let refused_rows = self.find_rows(source, &frame.transforms, &mut rows);
        let refused_rows = refused_rows + self.take_rows(source, frame, &rows, times);
        self.sources[source.index()].rows = rows;
        let all = u64::try_from(frame.transforms.len()).unwrap_or(u64::MAX);
        Admission::Admitted {
            source,
            poses: all.saturating_sub(refused_rows),
            refused_rows,
        }
    }

    /// Finds each row's body, checks that this source may move it, and marks bodies that stand there twice.
    ///
    /// * `rows` - in: the slots of the source's last pose frame; out: those of this one, `NO_BODY` where refused.
    fn find_rows(
        &mut self,
        source: SourceSlot,
        transforms: &[TransformRow],
        rows: &mut Vec<BodySlot>,
    ) -> u64 {
        self.pose_frames += 1;
        let number = self.pose_frames;
        self.sources[source.index()].pose_frame = number;
        rows.resize(transforms.len(), NO_BODY);
        let mut refused = 0;
        for (row, place) in transforms.iter().zip(rows.iter_mut()) {
            let id = BodyId(row.body);
            let predicted = self.body(*place).is_some_and(|body| body.id == id);
            let found = if predicted {
                Ok(*place)
            } else {
                self.slot_of(id).ok_or(RejectReason::UnknownBody)
            };
            let found = found.and_then(|slot| self.may_move(source, slot).map(|()| slot));
            match found {
                Ok(slot) => {
                    *place = slot;
                    let entry = &mut self.entries[slot.index()];
                    if entry.seen == number {
                        entry.twice = number;
                    }
                    entry.seen = number;
                }
                Err(reason) => {
                    *place = NO_BODY;
                    self.note_reject(reason);
                    refused += 1;
                }
            }
        }
        refused
    }

    fn may_move(&self, source: SourceSlot, slot: BodySlot) -> Result<(), RejectReason> {
        let entry = &self.entries[slot.index()];
        match self.body(slot) {
            None => Err(RejectReason::UnknownBody),
            Some(body) if owns(source, body) && entry.attach.is_none() => Ok(()),
            Some(body) if !body.moves || entry.attach.is_some() => Err(RejectReason::NotSteerable),
            Some(_) => Err(RejectReason::WrongSource),
        }
    }

    /// Takes the poses of the rows that were found. Of a body that stands there twice no row is taken: which one is
    /// its newest pose nobody can say.
    fn take_rows(
        &mut self,
        source: SourceSlot,
        frame: &Frame,
        rows: &[BodySlot],
        times: Times,
    ) -> u64 {
        let number = self.sources[source.index()].pose_frame;
        let deadline_ns = times
            .since_ns
            .saturating_add(self.sources[source.index()].timeout_ns);
        let young = deadline_ns > self.now_ns;
        let mut refused = 0;
        for (at, (row, &slot)) in frame.transforms.iter().zip(rows).enumerate() {
            if slot == NO_BODY {
                continue;
            }
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
                    self.renew(slot, &frame.header, velocity.copied(), times);
                    self.accept(slot, pose.map(|pose| (pose, raw)), deadline_ns, young);
                }
                Err(reason) => {
                    self.note_reject(reason);
                    self.refuse_pose(slot, reason);
                    refused += 1;
                }
            }
        }
        refused
    }

    /// A good row: its stamp, velocity and age.
    fn renew(
        &mut self,
        slot: BodySlot,
        header: &FrameHeader,
        velocity: Option<[f64; 6]>,
        times: Times,
    ) {
        if let Some(body) = self.bodies[slot.index()].as_mut() {
            body.velocity = velocity;
            body.stamp_ns = header.stamp_ns;
            body.since_ns = Some(times.since_ns);
            body.received_ns = times.received_ns;
        }
    }

    /// A good row: its pose, where it is not the one the body has.
    fn accept(
        &mut self,
        slot: BodySlot,
        pose: Option<(Pose, [f64; 7])>,
        deadline_ns: u64,
        young: bool,
    ) {
        let mut moved = false;
        if let Some((pose, raw)) = pose {
            moved = self.place(slot, &pose);
            let entry = &mut self.entries[slot.index()];
            entry.raw = raw;
            entry.has_pose = true;
            entry.refused = false;
        }
        let Some(body) = self.bodies[slot.index()].as_mut() else {
            return;
        };
        body.reject = None;
        let known = body.status == BodyStatus::Known && body.in_broad;
        if known && young && !moved {
            // The common case of a world at rest: nothing but the age is new.
            let stamp_ns = body.stamp_ns;
            self.ages.set(slot, Some(deadline_ns), Some(stamp_ns));
            self.entries[slot.index()].touched = self.tick;
        } else {
            self.settle(slot, moved);
        }
    }

    /// The newest pose of a body was refused: it is unknown until a good one comes; its last good one is kept.
    fn refuse_pose(&mut self, slot: BodySlot, reason: RejectReason) {
        self.entries[slot.index()].refused = true;
        if let Some(body) = self.bodies[slot.index()].as_mut() {
            body.reject = Some(reason);
        }
        self.settle(slot, false);
    }

    /// A paused frame: the poses of the last pose frame still hold, for one more time-out.
    fn renew_last_poses(&mut self, source: SourceSlot, times: Times) {
        let number = self.sources[source.index()].pose_frame;
        let rows = std::mem::take(&mut self.sources[source.index()].rows);
        for &slot in rows.iter().filter(|slot| **slot != NO_BODY) {
            let entry = &self.entries[slot.index()];
            // A body put anew or reset since has no pose that could be renewed.
            if entry.seen != number || !entry.has_pose || entry.refused || number == 0 {
                continue;
            }
            if let Some(body) = self.bodies[slot.index()].as_mut() {
                body.since_ns = Some(times.since_ns);
                self.settle(slot, false);
            }
        }
        self.sources[source.index()].rows = rows;
    }

    /// What was known of a source's bodies is void: their pairs end, they are not received.
    pub(super) fn forget_poses(&mut self, source: SourceSlot) {
        for index in 0..self.bodies.len() {
            let slot = super::census::slot_at(index);
            let own = self.entries[index].root == slot;
            if own && self.body(slot).is_some_and(|body| owns(source, body)) {
                self.forget_pose(slot);
            }
        }
    }

    /// One body is not received again.
    pub(super) fn forget_pose(&mut self, slot: BodySlot) {
        let entry = &mut self.entries[slot.index()];
        entry.has_pose = false;
        entry.refused = false;
        entry.seen = 0;
        if let Some(body) = self.bodies[slot.index()].as_mut() {
            body.since_ns = None;
            body.reject = None;
            body.velocity = None;
        }
        if let Some(hot) = self.hot(slot) {
            hot.flags &= !KEEPS;
        }
        self.settle(slot, false);
    }

    /// Admits the frame of a source that waited, where the scene has come to its revision or its wait is over.
    pub(super) fn flush_waiting(&mut self, source: SourceSlot) {
        let state = &mut self.sources[source.index()];
        let Some(until_ns) = state.waiting.until_ns else {
            return;
        };
        if state.waiting.frame.header.scene_rev <= self.scene_rev {
            state.waiting.until_ns = None;
            let frame = std::mem::take(&mut state.waiting.frame);
            let times = self.times_of(&frame);
            self.take(source, &frame, times);
            self.sources[source.index()].waiting.frame = frame;
        } else if until_ns <= self.now_ns {
            state.waiting.until_ns = None;
            state.refused += 1;
            self.note_reject(RejectReason::SceneRevision);
        }
    }
}

fn raw_of(row: &TransformRow) -> [f64; 7] {
    let ([x, y, z], [i, j, k, w]) = (row.position, row.orientation);
    [x, y, z, i, j, k, w]
}

/// Bit by bit; a row that holds NaN is never the same as one that was admitted.
fn same_raw(one: &[f64; 7], other: &[f64; 7]) -> bool {
    one[0].is_finite()
        && one
            .iter()
            .zip(other)
            .all(|(a, b)| a.to_bits() == b.to_bits())
}

/// The pose of a row, or what is wrong with it.
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
