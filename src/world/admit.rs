//! Admission: one frame comes in, checked as a whole and row by row.
//!
//! In: a decoded frame from a client that may be wrong in every field. Out: poses taken, ages renewed, refusals
//! counted, bodies marked unknown. No allocation once a source has sent its largest frame, but for frames that wait; a
//! row costs no lookup when it stands where its body stood in the frame before.

use super::World;
use super::ahead::AHEAD;
use super::filters::{BARS, KEEPS};
use super::source::{Standing, owns, stand};
use crate::ids::{BodyId, BodySlot, SourceSlot};
use crate::limits::FRAME_ROWS_MAX;
use crate::wire::{
    Frame, FrameHeader, RejectReason, TransformRow, WIRE_VERSION, frame_flags, name_str,
};

/// A row that names no body of its source.
pub(super) const NO_BODY: BodySlot = BodySlot(u32::MAX);

/// Result of admitting a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Admission {
    /// Taken.
    Admitted {
        /// The source that sent it.
        source: SourceSlot,
        /// Poses admitted.
        poses: u64,
        /// Rows refused; counted by reason.
        refused_rows: u64,
    },
    /// Waits for a later scene revision, for at most one time-out of its source.
    Waiting {
        /// The source that sent it.
        source: SourceSlot,
    },
    /// Refused as a whole and counted.
    Refused {
        /// The source that sent it, if known.
        source: Option<SourceSlot>,
        /// The reason.
        reason: RejectReason,
    },
}

/// Receipt of a frame and start of the age of its content, nanoseconds of `CLOCK_BOOTTIME`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Times {
    pub(super) received_ns: u64,
    pub(super) since_ns: u64,
}

impl Times {
    /// The times of one row of the frame, which may have an age of its own.
    pub(super) fn of_row(self, frame: &Frame, at: usize) -> Self {
        let own_ns = frame.since_ns.get(at).copied();
        let since_ns = own_ns.map_or(self.since_ns, |own_ns| own_ns.min(self.received_ns));
        Self { since_ns, ..self }
    }
}

impl World {
    /// Admits one frame, or returns the reason for the refusal. Bad input is counted, never an error.
    ///
    /// Cost: O(rows); a row that repeats the last pose bit by bit costs a comparison.
    pub fn admit(&mut self, frame: &Frame, now_boot_ns: u64) -> Admission {
        self.now_ns = self.now_ns.max(now_boot_ns);
        let checked = self.check_frame(frame).and_then(|source| {
            self.flush_waiting(source);
            self.admit_of(source, frame)
                .map_err(|reason| (Some(source), reason))
        });
        checked.unwrap_or_else(|(source, reason)| {
            self.note_refused(reason, source, &frame.header.source);
            Admission::Refused { source, reason }
        })
    }

    /// Whether a frame is refused in whatever session its source is, its rows left aside.
    #[must_use]
    pub fn would_refuse(&self, frame: &Frame) -> bool {
        let session = frame.header.session;
        self.check_frame(frame).ok().is_none_or(|source| {
            // The current session is not over.
            self.sources[source.index()].session != session && self.over.holds(source, session)
        })
    }

    /// Checks layout, flags, counts and source, which need no session.
    fn check_frame(&self, frame: &Frame) -> Result<SourceSlot, (Option<SourceSlot>, RejectReason)> {
        let header = &frame.header;
        let name = name_str(&header.source);
        let source = name.and_then(|name| self.source_named(name));
        if header.schema != WIRE_VERSION || header.session == 0 || name.is_none() {
            return Err((source, RejectReason::BadLayout));
        }
        let Some(source) = source else {
            return Err((None, RejectReason::UnknownSource));
        };
        if let Some(reason) = frame.refused {
            return Err((Some(source), reason));
        }
        if self.is_of_other_boot(header.boot) {
            return Err((Some(source), RejectReason::SessionOver));
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

    /// Sets the boot id of this run of the daemon: frames with another one are refused.
    #[allow(clippy::cast_possible_truncation, reason = "the low half is meant")]
    pub fn set_boot(&mut self, boot_id: u64) {
        self.boot = boot_id as u32;
    }

    /// Whether ids are of another run of the daemon, where they may belong to other bodies.
    pub(super) fn is_of_other_boot(&self, boot: u32) -> bool {
        boot != 0 && self.boot != 0 && boot != self.boot
    }

    /// Checks session, order, age and scene revision, then takes the rows.
    fn admit_of(&mut self, source: SourceSlot, frame: &Frame) -> Result<Admission, RejectReason> {
        let header = &frame.header;
        let times = self.times_of(frame);
        let state = &mut self.sources[source.index()];
        let numbers = (header, frame.stands_from());
        let standing = stand(state, source, &mut self.over, numbers, times.received_ns);
        match standing {
            Standing::Refused(reason) => return Err(reason),
            Standing::Afresh => {
                state.cuts_next = false;
                self.forget_poses(source);
            }
            Standing::Next => {}
        }
        let state = &mut self.sources[source.index()];
        let is_first = standing == Standing::Afresh;
        if frame.waited && header.sent_ns == 0 {
            if is_first {
                state.pass_over_waiting();
            }
            state.note_gap(header);
            state.cuts_next |= frame.cut;
            return Err(RejectReason::TooOld);
        }
        // An older frame that still waits is superseded, unless it may have bodies that this one lacks, or is part of
        // the path of a continuous body.
        let stands_for_older = header.flags == frame_flags::FULL && !state.followed;
        let older_until_ns = if is_first || stands_for_older {
            state.pass_over_waiting()
        } else {
            None
        };
        // A pause has no rows that could belong to another scene revision.
        let has_rows = header.flags != frame_flags::PAUSED;
        if has_rows && (header.scene_rev > self.scene_rev || state.waits()) {
            let own_until_ns = times.received_ns.saturating_add(state.timeout_ns);
            // The limit counts for the stream, not for each frame: otherwise each replacement would extend it.
            let until_ns = match older_until_ns {
                Some(older_ns) if !is_first => older_ns.min(own_until_ns),
                _ => own_until_ns,
            };
            state.skipped += state.waiting.push(frame, times.received_ns, until_ns);
            return Ok(Admission::Waiting { source });
        }
        Ok(self.take(source, frame, times))
    }

    /// Times of a frame: its age starts at `sent_ns`, at latest at receipt, and receipt is at latest now.
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

    /// Takes a frame that passed all checks: its rows, or the renewal by a pause.
    fn take(&mut self, source: SourceSlot, frame: &Frame, times: Times) -> Admission {
        let state = &mut self.sources[source.index()];
        state.frames += 1;
        let number = (frame.header.epoch, frame.header.seq);
        // A frame that waited may be taken after a pause that was sent later.
        let is_newer = |newest: FrameHeader| number > (newest.epoch, newest.seq);
        if state.newest.is_none_or(is_newer) {
            state.newest = Some(frame.header);
            state.admitted = Some((frame.header, times.received_ns));
            state.since_ns = times.since_ns;
            state.alive = self.now_ns.saturating_sub(times.since_ns) < state.timeout_ns;
        }
        let cut = std::mem::take(&mut state.cuts_next) || frame.cut;
        if frame.header.flags == frame_flags::PAUSED {
            state.cuts_next = cut;
            // A pause confirms the poses of the last pose frame sent, which may not have been received.
            if !state.waits() {
                if state.gap == 0 {
                    self.renew_last_poses(source, frame.header.stamp_ns, times);
                }
                self.bend_with(source);
            }
            return Admission::Admitted {
                source,
                poses: 0,
                refused_rows: 0,
            };
        }
        if frame.header.seq >= state.gap {
            state.gap = 0;
        }
        state.pose_frames = state.pose_frames.saturating_add(1);
        // The list of rows is moved out of the world while it is used.
        let mut rows = std::mem::take(&mut state.rows);
        let refused_rows = self.find_rows(source, &frame.transforms, &mut rows);
        let refused_rows = refused_rows + self.take_rows(source, frame, &rows, times);
        self.sources[source.index()].rows = rows;
        if cut {
            self.cut_ways(source);
        }
        let all = u64::try_from(frame.transforms.len()).unwrap_or(u64::MAX);
        let poses = all.saturating_sub(refused_rows);
        let refused_rows = refused_rows + self.refuse_bodies(source, frame);
        self.bend_with(source);
        Admission::Admitted {
            source,
            poses,
            refused_rows,
        }
    }

    /// Finds each row's body, checks that this source may move it, and marks bodies that occur twice.
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
        for (at, row) in transforms.iter().enumerate() {
            if let Some(&ahead) = rows.get(at + AHEAD) {
                self.ask_ahead(ahead);
                self.ask_ahead_for_entry(ahead);
            }
            let place = &mut rows[at];
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
                    self.note_reject(reason, Some(source));
                    refused += 1;
                }
            }
        }
        refused
    }

    pub(super) fn may_move(&self, source: SourceSlot, slot: BodySlot) -> Result<(), RejectReason> {
        let entry = &self.entries[slot.index()];
        match self.body(slot) {
            None => Err(RejectReason::UnknownBody),
            Some(body) if owns(source, body) && entry.attach.is_none() => Ok(()),
            Some(body) if !body.moves || entry.attach.is_some() => Err(RejectReason::NotSteerable),
            Some(_) => Err(RejectReason::WrongSource),
        }
    }

    /// Makes all bodies of a source `not_received`; their pairs end.
    pub(super) fn forget_poses(&mut self, source: SourceSlot) {
        for index in 0..self.bodies.len() {
            let slot = BodySlot::at(index);
            // Attachments are read directly: `root` is not up to date while a request is applied.
            if self.hold_of(slot).is_none()
                && self.body(slot).is_some_and(|body| owns(source, body))
            {
                self.forget_pose(slot);
            }
        }
        // Pairs of attached bodies end together with those of their roots, which may come back in the same tick.
        self.settle_attached();
    }

    /// Makes one body `not_received`.
    pub(super) fn forget_pose(&mut self, slot: BodySlot) {
        let entry = &mut self.entries[slot.index()];
        entry.has_pose = false;
        entry.refused = false;
        entry.seen = 0;
        if let Some(body) = self.bodies[slot.index()].as_mut() {
            body.since_ns = None;
            body.reject = None;
            if let Some(vertices) = body.vertices.as_mut() {
                vertices.forget();
            }
            body.velocity = None;
        }
        if let Some(hot) = self.hot(slot) {
            hot.flags &= !(KEEPS | BARS);
        }
        self.settle(slot, false);
    }

    /// Calls `tell` with header and receipt (nanoseconds of `CLOCK_BOOTTIME`) of the newest frame of each source that
    /// was admitted since the last call.
    pub fn tell_admitted(&mut self, mut tell: impl FnMut(&FrameHeader, u64)) {
        for source in &mut self.sources {
            if let Some((header, received_ns)) = source.admitted.take() {
                tell(&header, received_ns);
            }
        }
    }

    /// Admits waiting frames of a source whose scene revision has been reached, and refuses those that have waited too
    /// long.
    pub(super) fn flush_waiting(&mut self, source: SourceSlot) {
        loop {
            let state = &mut self.sources[source.index()];
            let waiting = &mut state.waiting;
            let (Some(first), Some(until_ns)) = (waiting.first(), waiting.until_ns()) else {
                return;
            };
            let is_due = first.header.scene_rev <= self.scene_rev;
            if !is_due && until_ns > self.now_ns {
                return;
            }
            let Some(frame) = waiting.take() else {
                return;
            };
            waiting.begin_next(state.timeout_ns);
            if is_due {
                let times = self.times_of(&frame);
                self.take(source, &frame, times);
            } else {
                state.note_gap(&frame.header);
                state.cuts_next |= frame.cut;
                state.refused += 1;
                self.note_reject(RejectReason::SceneRevision, Some(source));
            }
        }
    }
}
