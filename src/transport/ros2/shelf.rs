//! Where frames from ROS 2 wait for the tick thread. In: whole frames of `~/transforms`, poses of common topics, from
//! the receiving thread. Out: frames in an inbox. Bounded: the newest are kept, what is passed over is counted.

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

/// A pose of one body that came on a common topic, or why it is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Update {
    /// Place of the body among those of its source.
    pub(super) member: usize,
    /// Where it is.
    pub(super) result: std::result::Result<TransformRow, RejectReason>,
    /// Its velocity, scene frame; of every pose of a source or of none.
    pub(super) velocity: Option<[f64; 6]>,
    /// Sender's stamp, nanoseconds.
    pub(super) stamp_ns: u64,
    /// Receipt, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) received_ns: u64,
    /// From when its age counts: receipt of the oldest that it is made of, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) since_ns: u64,
    /// Whether it waited while the process stood still.
    pub(super) waited: bool,
}

/// A body's place in a group; nobody's: id 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Seat {
    pub(super) body: u64,
    /// Whether each of its poses is a part of its way, so that one that gave way to a newer one is missing.
    pub(super) continuous: bool,
    /// Whether it hangs on another body: its poses say nothing, only that its source lives.
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

/// The newest poses of one source of common topics; they go out as one partial frame.
#[derive(Debug)]
struct Group {
    name: [u8; SOURCE_NAME_LEN],
    session: u64,
    /// That which spoke for the source in the newest tick; 0: none.
    in_force: u64,
    epoch: u64,
    seq: u64,
    /// Poses of continuous bodies that gave way since the last frame: its number tells how many are missing.
    missing: u64,
    seats: Vec<Seat>,
    /// The newest update of each body since the last frame.
    newest: Vec<Option<Update>>,
    /// Members that have one.
    touched: Vec<usize>,
}

#[derive(Debug, Default)]
struct Waiting {
    /// With the place of their source in the scene, `None` for all that are of none.
    frames: VecDeque<(Option<usize>, Frame)>,
    spare: Vec<Frame>,
    groups: Vec<Group>,
}

/// Frames and poses that wait.
#[derive(Debug, Default)]
pub(super) struct Shelf {
    waiting: Mutex<Waiting>,
    passed_over: AtomicU64,
}

impl Shelf {
    /// Adds a source of common topics; groups are numbered in the order they are added.
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

    /// Gives a place of a group to a body, or to nobody; what waits there is dropped.
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

    /// The body at a place of a group is another now, by its id or by what it is; what waits there stays.
    pub(super) fn renew_member(&self, group: usize, member: usize, seat: Seat) {
        let mut waiting = open(&self.waiting);
        let group = waiting.groups.get_mut(group);
        if let Some(old) = group.and_then(|group| group.seats.get_mut(member)) {
            *old = seat;
        }
    }

    /// An emptied frame whose memory has been used before.
    pub(super) fn spare(&self) -> Frame {
        open(&self.waiting).spare.pop().unwrap_or_default()
    }

    /// Puts a whole frame behind the others; the oldest of its source goes when there are too many.
    ///
    /// * `source` - place of its source in the scene; those of sources that it lacks, whose names anybody may make up,
    ///   count as one.
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

    /// Puts poses of a group's bodies; the newer one of a body stands for the older.
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
            // The very same, said again, is no part of a way.
            let is_other = (old.result, old.stamp_ns) != (update.result, update.stamp_ns);
            let seat = group.seats.get(update.member);
            let goes_on = seat.is_some_and(|seat| seat.continuous && !seat.attached);
            group.missing += u64::from(goes_on && is_other && old.result.is_ok());
        }
    }

    /// The senders' time went back: what is known of the group's bodies is void.
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

    /// Learns from a tick who speaks for the sources of groups. A session that somebody else has ended by speaking for
    /// its source is refused for as long as the daemon runs: where another one has come into force, or none is any
    /// more, the group goes on under a new one, which is taken as soon as the stranger is silent for the time-out.
    ///
    /// * `tick` - one that has ended.
    /// * `draw` - a random session; where it fails it is drawn after the next tick.
    pub(super) fn hear(&self, tick: &TickRow, draw: impl Fn() -> Result<u64>) {
        for group in &mut open(&self.waiting).groups {
            let mut sources = tick.sources.iter().take(usize::from(tick.sources_len));
            let Some(row) = sources.find(|row| row.name == group.name) else {
                continue;
            };
            // That a stranger is gone ends his session alone, and frames of ours may wait for their tick.
            let may_be_over = row.session != 0 || group.in_force == group.session;
            if may_be_over && row.session != group.in_force && row.session != group.session {
                let Ok(session) = draw() else { continue };
                group.session = session;
            }
            group.in_force = row.session;
        }
    }

    /// The sessions of the groups are over.
    pub(super) fn end(&self, inbox: &mut Inbox) {
        let mut sessions: Vec<u64> = (open(&self.waiting).groups.iter())
            .map(|group| group.session)
            .collect();
        sessions.sort_unstable();
        sessions.dedup();
        (sessions.into_iter()).for_each(|session| inbox.end_session(session));
    }

    /// Frames that were passed over for newer ones since the last call.
    pub(super) fn take_passed_over(&self) -> u64 {
        self.passed_over.swap(0, Ordering::Relaxed)
    }

    /// Hands everything to the tick thread.
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
    /// What is new as a partial frame, in which each pose has its own age: bodies that moved together stay together,
    /// and none is older for the chain of another. What waited while the process stood still has a frame of its own
    /// before it, for that is refused as a whole.
    fn drain(&mut self, inbox: &mut Inbox) {
        let mut touched = std::mem::take(&mut self.touched);
        for waited in [true, false] {
            let of = |&member: &usize| self.newest.get(member).copied().flatten();
            let mut news = touched.iter().filter_map(of);
            if news.any(|update| update.waited == waited) {
                self.fill(&mut touched, waited, inbox.push());
            }
        }
        // A place whose body has left has nothing new.
        touched.clear();
        self.touched = touched;
    }

    /// One frame of those that `waited` or did not.
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
                // The daemon would refuse it, in each tick, and nobody could end that.
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
            // Frames that waited while the process stood still say nothing of their age.
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
