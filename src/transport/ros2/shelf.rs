//! The queue of frames from ROS 2 for the tick thread. In: whole frames of `~/transforms` and poses of common topics,
//! from the receiving thread. Out: frames in an inbox. Bounded: the newest are kept, dropped ones are counted.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use super::open;
use crate::error::Result;
use crate::limits::FRAMES_PER_DRAIN_MAX;
use crate::transport::BodyNote;
use crate::wire::{
    Frame, FrameHeader, Inbox, RejectReason, SOURCE_NAME_LEN, TickRow, TransformRow, WIRE_VERSION,
    frame_flags,
};

/// The newest pose of a body from a common topic, or why it has none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Update {
    /// Index of the body among those of its source.
    pub(super) member: usize,
    /// Its pose in the scene's frame, or the refusal.
    pub(super) result: std::result::Result<TransformRow, RejectReason>,
    /// Its velocity, scene frame; either all poses of a source have one, or none.
    pub(super) velocity: Option<[f64; 6]>,
    /// Sender's stamp, nanoseconds.
    pub(super) stamp_ns: u64,
    /// Receipt, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) received_ns: u64,
    /// Start of its age: receipt of its oldest part, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) since_ns: u64,
    /// Whether it waited while the process was stalled.
    pub(super) waited: bool,
}

/// The body at an index of a group; id 0: none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Seat {
    pub(super) body: u64,
    /// Whether the body is continuous: each pose is part of its path, so one dropped for a newer one is missing.
    pub(super) continuous: bool,
    /// Whether it is attached to another body: its poses only show that its source is alive.
    pub(super) attached: bool,
}

impl Seat {
    pub(super) fn of(body: &BodyNote) -> Self {
        Self {
            body: body.id,
            continuous: body.continuous,
            attached: body.attached,
        }
    }
}

/// The newest poses of one source of common topics; they are sent as one partial frame.
#[derive(Debug)]
struct Group {
    name: [u8; SOURCE_NAME_LEN],
    session: u64,
    /// Session in force for the source in the newest tick; 0: none.
    in_force: u64,
    epoch: u64,
    seq: u64,
    /// Poses of continuous bodies replaced by newer ones since the last frame; `seq` skips as many numbers.
    missing: u64,
    seats: Vec<Seat>,
    /// The newest update of each body since the last frame.
    newest: Vec<Option<Update>>,
    /// Members with an update.
    touched: Vec<usize>,
}

#[derive(Debug, Default)]
struct Waiting {
    /// Whole frames, with the index of their source in the scene; `None` for all sources that the scene lacks.
    frames: VecDeque<(Option<usize>, Frame)>,
    spare: Vec<Frame>,
    groups: Vec<Group>,
}

/// Frames and poses that wait for the tick thread.
#[derive(Debug, Default)]
pub(super) struct Shelf {
    waiting: Mutex<Waiting>,
    passed_over: AtomicU64,
}

impl Shelf {
    /// Adds a source of common topics; groups are numbered in the order of addition.
    pub(super) fn add_group(&self, name: [u8; SOURCE_NAME_LEN], session: u64, seats: Vec<Seat>) {
        open(&self.waiting).groups.push(Group {
            name,
            session,
            in_force: 0,
            epoch: 1,
            seq: 0,
            missing: 0,
            newest: vec![None; seats.len()],
            touched: Vec::with_capacity(seats.len()),
            seats,
        });
    }

    /// Sets the body at an index of a group, or none; drops its waiting update.
    pub(super) fn set_member(&self, group: usize, member: usize, seat: Seat) {
        let mut waiting = open(&self.waiting);
        let Some(group) = waiting.groups.get_mut(group) else {
            return;
        };
        if member >= group.seats.len() {
            group.seats.resize(member + 1, Seat::default());
            group.newest.resize(member + 1, None);
        }
        if let (Some(old), Some(newest)) =
            (group.seats.get_mut(member), group.newest.get_mut(member))
        {
            *old = seat;
            *newest = None;
            group.touched.retain(|&touched| touched != member);
        }
    }

    /// Replaces the body at an index of a group by one of another id or shape; keeps its waiting update.
    pub(super) fn renew_member(&self, group: usize, member: usize, seat: Seat) {
        let mut waiting = open(&self.waiting);
        let group = waiting.groups.get_mut(group);
        if let Some(old) = group.and_then(|group| group.seats.get_mut(member)) {
            *old = seat;
        }
    }

    /// An empty frame, with memory from earlier use.
    pub(super) fn spare(&self) -> Frame {
        open(&self.waiting).spare.pop().unwrap_or_default()
    }

    /// Queues a whole frame; when too many of its source wait, the oldest of that source is dropped.
    ///
    /// * `source` - index of its source in the scene. All sources that the scene lacks count as one, because anybody
    ///   can make up their names.
    pub(super) fn put(&self, source: Option<usize>, mut frame: Frame) {
        let mut waiting = open(&self.waiting);
        let of_source = |(other, _): &(Option<usize>, Frame)| *other == source;
        if waiting.frames.iter().filter(|old| of_source(old)).count() >= FRAMES_PER_DRAIN_MAX
            && let Some(at) = waiting.frames.iter().position(of_source)
            && let Some((_, oldest)) = waiting.frames.remove(at)
        {
            let session = oldest.header.session;
            let follows = |next: &&mut (Option<usize>, Frame)| {
                next.0 == source && next.1.header.session == session
            };
            match waiting.frames.range_mut(at..).find(follows) {
                Some((_, next)) => next.cut = true,
                None => frame.cut |= frame.header.session == session,
            }
            waiting.spare.push(oldest);
            self.passed_over.fetch_add(1, Ordering::Relaxed);
        }
        waiting.frames.push_back((source, frame));
    }

    /// Merges poses of a group's bodies; a newer pose of a body replaces the older one.
    pub(super) fn merge(&self, group: usize, updates: &[Update]) {
        let mut waiting = open(&self.waiting);
        let Some(group) = waiting.groups.get_mut(group) else {
            return;
        };
        for update in updates {
            let Some(slot) = group.newest.get_mut(update.member) else {
                continue;
            };
            let Some(old) = slot.replace(*update) else {
                group.touched.push(update.member);
                continue;
            };
            // An identical update that was repeated is not part of a path.
            let is_other = (old.result, old.stamp_ns) != (update.result, update.stamp_ns);
            let seat = group.seats.get(update.member);
            let goes_on = seat.is_some_and(|seat| seat.continuous && !seat.attached);
            group.missing += u64::from(goes_on && is_other && old.result.is_ok());
        }
    }

    /// Discards the state of a group, because the senders' time went back.
    pub(super) fn reset(&self, group: usize) {
        if let Some(group) = open(&self.waiting).groups.get_mut(group) {
            group.epoch += 1;
            (group.seq, group.missing) = (0, 0);
            for member in group.touched.drain(..) {
                if let Some(slot) = group.newest.get_mut(member) {
                    *slot = None;
                }
            }
        }
    }

    /// Learns from a tick which sessions are in force for the sources of groups. A group's session that ended because
    /// a stranger sent frames under its source's name is refused for as long as the daemon runs. So if another session
    /// has come into force, or the group's own no longer is, the group draws a new one. It comes into force as soon as
    /// the stranger is silent for the time-out.
    ///
    /// * `tick` - a tick that has ended.
    /// * `draw` - draws a random session; if it fails, it is called again after the next tick.
    pub(super) fn hear(&self, tick: &TickRow, draw: impl Fn() -> Result<u64>) {
        for group in &mut open(&self.waiting).groups {
            let mut sources = tick.sources.iter().take(usize::from(tick.sources_len));
            let Some(row) = sources.find(|row| row.name == group.name) else {
                continue;
            };
            // The end of a stranger's session ends no other, and frames of ours may wait for their tick.
            let may_be_over = row.session != 0 || group.in_force == group.session;
            if may_be_over && row.session != group.in_force && row.session != group.session {
                let Ok(session) = draw() else { continue };
                group.session = session;
            }
            group.in_force = row.session;
        }
    }

    /// Ends the sessions of the groups.
    pub(super) fn end(&self, inbox: &mut Inbox) {
        let mut sessions: Vec<u64> = (open(&self.waiting).groups.iter())
            .map(|group| group.session)
            .collect();
        sessions.sort_unstable();
        sessions.dedup();
        (sessions.into_iter()).for_each(|session| inbox.end_session(session));
    }

    /// Takes the number of frames dropped for newer ones since the last call.
    pub(super) fn take_passed_over(&self) -> u64 {
        self.passed_over.swap(0, Ordering::Relaxed)
    }

    /// Moves everything to the tick thread's inbox.
    pub(super) fn drain(&self, inbox: &mut Inbox) {
        let mut waiting = open(&self.waiting);
        let Waiting {
            frames,
            spare,
            groups,
        } = &mut *waiting;
        for (_, mut frame) in frames.drain(..) {
            std::mem::swap(inbox.push(), &mut frame);
            spare.push(frame);
        }
        for group in groups.iter_mut().filter(|group| !group.touched.is_empty()) {
            group.drain(inbox);
        }
    }
}

impl Group {
    /// Sends new updates as one partial frame with an age per pose: bodies that moved together stay together, and the
    /// chain of one body does not make another older. Updates that waited while the process was stalled get a frame of
    /// their own before it, because such a frame is refused as a whole.
    fn drain(&mut self, inbox: &mut Inbox) {
        let mut touched = std::mem::take(&mut self.touched);
        for waited in [true, false] {
            let of = |&member: &usize| self.newest.get(member).copied().flatten();
            let mut news = touched.iter().filter_map(of);
            if news.any(|update| update.waited == waited) {
                self.fill(&mut touched, waited, inbox.push());
            }
        }
        // A member whose body was removed has no update.
        touched.clear();
        self.touched = touched;
    }

    /// Fills a frame with the updates whose `waited` is as given.
    fn fill(&mut self, touched: &mut Vec<usize>, waited: bool, frame: &mut Frame) {
        self.seq += 1 + std::mem::take(&mut self.missing);
        let (mut received_ns, mut since_ns, mut stamp_ns) = (u64::MAX, 0, 0);
        touched.retain(|&member| {
            let slot = self.newest.get_mut(member);
            let update = slot.and_then(|slot| slot.take_if(|update| update.waited == waited));
            let Some(update) = update else {
                return true;
            };
            let Seat { body, attached, .. } = self.seats.get(member).copied().unwrap_or_default();
            received_ns = received_ns.min(update.received_ns);
            since_ns = since_ns.max(update.since_ns);
            stamp_ns = stamp_ns.max(update.stamp_ns);
            match update.result {
                // The daemon refuses poses of attached bodies, in each tick, and no user could end that.
                _ if attached => {}
                Ok(row) => {
                    frame.transforms.push(TransformRow { body, ..row });
                    frame.stamps_ns.push(update.stamp_ns);
                    frame.since_ns.push(update.since_ns);
                    frame.velocities.extend(update.velocity);
                }
                Err(reason) => frame.refused_bodies.push((body, reason)),
            }
            false
        });
        frame.waited = waited;
        frame.received_ns = received_ns;
        frame.header = FrameHeader {
            session: self.session,
            epoch: self.epoch,
            seq: self.seq,
            // The age of frames that waited while the process was stalled is unknown.
            sent_ns: if waited { 0 } else { since_ns },
            stamp_ns,
            source: self.name,
            flags: frame_flags::PARTIAL,
            schema: WIRE_VERSION,
            ..FrameHeader::default()
        };
    }
}

#[cfg(test)]
mod tests;
