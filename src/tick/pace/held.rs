//! Frames that wait for their tick, in order of receipt; their memory goes round between here and the inbox.
//!
//! In: the frames of a drain. Out: the frames of a tick. A full frame stands for the older ones of its session, which
//! are passed over and counted; a partial one does not, because those may hold bodies that it lacks, and one of a
//! source that moves continuous bodies does not, because those are on their way.

use super::source::Source;
use crate::limits::{
    FRAMES_PER_DRAIN_MAX, SOURCES_MAX, VERTEX_FRAMES_WAITING_MAX, VERTEX_ROWS_WAITING_MAX,
};
use crate::wire::{Frame, Inbox, VertexFrame, VertexHeader, WIRE_VERSION, frame_flags};

/// Whose a frame is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Whose {
    /// Place of its source; `None`: of no source of the scene, to be refused and counted by the world.
    pub(super) source: Option<usize>,
    /// Its receipt, nanoseconds of `CLOCK_BOOTTIME`.
    pub(super) received_ns: u64,
    /// It is of the session that speaks for its source once the frames before it are with the world.
    pub(super) speaks: bool,
}

/// A frame and whose it is.
#[derive(Clone, Debug, Default)]
pub(super) struct Held {
    pub(super) frame: Frame,
    pub(super) whose: Whose,
}

/// The frames that wait, and spare memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Queue {
    frames: Vec<Held>,
    spare: Vec<Held>,
}

impl Queue {
    pub(super) fn frames(&self) -> &[Held] {
        &self.frames
    }

    pub(super) fn frames_mut(&mut self) -> &mut [Held] {
        &mut self.frames
    }

    /// Takes one frame out of an inbox.
    ///
    /// * `stands_alone` - each frame of this source makes a tick of its own, or is a part of a body's way: none is
    ///   passed over for a newer one.
    /// * returns - how many frames of its source are passed over for it.
    pub(super) fn put(&mut self, frame: &mut Frame, whose: Whose, stands_alone: bool) -> u64 {
        let mut held = self.spare.pop().unwrap_or_default();
        std::mem::swap(&mut held.frame, frame);
        held.whose = whose;
        let mut passed = 0;
        let mut place = None;
        if !stands_alone && is_whole(&held.frame) {
            // It takes the place of the oldest that it stands for: a session that was heard in time must not seem
            // silent to one that asked in between.
            place = self.frames.iter().position(|old| replaces(&held, old));
            // A pause behind that place would come too late: what it says holds is said anew.
            let overtaken = |at: usize, old: &Held| {
                old.frame.header.flags == frame_flags::PAUSED
                    && place.is_some_and(|place| place < at)
                    && is_newer(&held, old)
            };
            for at in (0..self.frames.len()).rev() {
                let old = &self.frames[at];
                if replaces(&held, old) || overtaken(at, old) {
                    self.drop_at(at);
                    passed += 1;
                }
            }
            // Any other keeps its turn.
            let before = self.frames.iter().rposition(|old| is_newer(&held, old));
            place = place.map(|place| place.max(before.map_or(0, |before| before + 1)));
        }
        let of_source = |old: &Held| old.whose.source == whose.source;
        if self.frames.iter().filter(|old| of_source(old)).count() >= FRAMES_PER_DRAIN_MAX {
            passed += 1;
            // What the world would refuse makes room first, be it the newest.
            let stranger = |old: &Held| of_source(old) && !old.whose.speaks;
            let crowded_out = self.frames.iter().position(stranger);
            let oldest = || whose.speaks.then(|| self.frames.iter().position(of_source));
            let Some(at) = crowded_out.or_else(|| oldest().flatten()) else {
                self.spare.push(held);
                return passed;
            };
            self.drop_at(at);
        }
        let end = self.frames.len();
        self.frames.insert(place.unwrap_or(end).min(end), held);
        passed
    }

    /// Hands out the frames that `wanted` picks, the oldest first.
    pub(super) fn take(&mut self, into: &mut Inbox, mut wanted: impl FnMut(&Held) -> bool) {
        let mut kept = 0;
        for at in 0..self.frames.len() {
            if wanted(&self.frames[at]) {
                std::mem::swap(into.push(), &mut self.frames[at].frame);
            } else {
                self.frames.swap(kept, at);
                kept += 1;
            }
        }
        self.spare.extend(self.frames.drain(kept..));
    }

    /// Hands out the frames that are in no round: the world refuses them, and that is told soon. One that came behind
    /// frames of its source that count goes after them: it must not find the source silent.
    pub(super) fn take_strangers(&mut self, into: &mut Inbox) {
        let mut waited_for = [false; SOURCES_MAX];
        self.take(into, |held| {
            let source = held.whose.source;
            let Some(waited_for) = source.and_then(|place| waited_for.get_mut(place)) else {
                return true;
            };
            *waited_for |= held.whose.speaks;
            !*waited_for
        });
    }

    fn drop_at(&mut self, at: usize) {
        let held = self.frames.remove(at);
        self.spare.push(held);
    }
}

/// Vertices that wait, and spare memory.
///
/// None is passed over for a newer one, and those of a session go out in the order of their sending: a range stands on
/// the version before. They wait for the frame of their session that they belong with, so that a tick has vertices and
/// poses of one moment: those of the source each of whose frames makes a tick, and those whose frame is in a round that
/// is under way, until it goes out; the others for a time-out of their source at most, for a frame that is lost, or one
/// that waits for a lead who is silent, must not keep back a shape that is known. Without a frame of their own those of
/// a new session wait for the frames of the one before.
#[derive(Clone, Debug, Default)]
pub(super) struct Vertices {
    waiting: Vec<Bent>,
    spare: Vec<VertexFrame>,
    /// Sessions of which a message goes out with its frame in the tick that is being made, and the place of the last
    /// one: what was sent before it goes, too.
    going: Vec<(Whom, usize)>,
    /// Sessions of which a message waits on: so does what was sent after it.
    staying: Vec<Whom>,
}

/// Place of a source, and a session.
type Whom = (Option<usize>, u64);

/// What there is to wait for as a tick is made.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ahead<'a> {
    pub(super) now_ns: u64,
    /// Place of the source each of whose frames makes a tick of its own.
    pub(super) lead: Option<usize>,
    /// Nobody's vertices wait for a frame but those of who speaks: others are refused, and that is told soon.
    pub(super) sources: &'a [Source],
    /// Those that go on waiting.
    pub(super) frames: &'a [Held],
}

/// A message of vertices that waits.
#[derive(Clone, Debug, Default)]
struct Bent {
    frame: VertexFrame,
    /// Place of its source.
    source: Option<usize>,
    /// Its receipt, nanoseconds of `CLOCK_BOOTTIME`.
    received_ns: u64,
}

impl Vertices {
    /// Takes vertices out of an inbox. Of more than a source may have waiting the oldest go: the numbers of those that
    /// follow tell that they are missing.
    pub(super) fn put(&mut self, frame: &mut VertexFrame, source: Option<usize>, received_ns: u64) {
        while let Some(oldest) = self.crowded_out_by(frame, source) {
            let oldest = self.waiting.remove(oldest);
            self.spare.push(oldest.frame);
        }
        let mut held = Bent {
            frame: self.spare.pop().unwrap_or_default(),
            source,
            received_ns,
        };
        std::mem::swap(&mut held.frame, frame);
        self.waiting.push(held);
    }

    /// The oldest of a source, where this one of it is one message or one row too many.
    fn crowded_out_by(&self, frame: &VertexFrame, source: Option<usize>) -> Option<usize> {
        let of_source = |held: &&Bent| held.source == source;
        let (mut messages, mut rows) = (0, frame.rows.len());
        for held in self.waiting.iter().filter(of_source) {
            messages += 1;
            rows += held.frame.rows.len();
        }
        let fits = messages < VERTEX_FRAMES_WAITING_MAX && rows <= VERTEX_ROWS_WAITING_MAX;
        let oldest = self.waiting.iter().position(|held| of_source(&held));
        oldest.filter(|_| !fits)
    }

    /// Hands out what a tick with these frames takes.
    pub(super) fn take(&mut self, into: &mut Inbox, ahead: Ahead<'_>) {
        self.going.clear();
        self.staying.clear();
        for (at, held) in self.waiting.iter().enumerate().rev() {
            let header = &held.frame.header;
            let is_told = self.going.iter().any(|(whom, _)| *whom == held.whom());
            let of_tick = || into.frames().iter().any(|frame| belongs(header, frame));
            if !is_told && header.seq != 0 && of_tick() {
                self.going.push((held.whom(), at));
            }
        }
        let mut kept = 0;
        for at in 0..self.waiting.len() {
            let held = &self.waiting[at];
            let whom = held.whom();
            let goes = |(of, last): &(Whom, usize)| *of == whom && at <= *last;
            let is_behind = self.staying.contains(&whom);
            if !self.going.iter().any(goes) && (is_behind || held.waits(into, ahead)) {
                if !is_behind {
                    self.staying.push(whom);
                }
                self.waiting.swap(kept, at);
                kept += 1;
            } else {
                std::mem::swap(into.push_vertices(), &mut self.waiting[at].frame);
            }
        }
        self.spare
            .extend(self.waiting.drain(kept..).map(|held| held.frame));
    }

    /// Drops what a session that is over has left without a frame.
    pub(super) fn forget(&mut self, session: u64) {
        let Self { waiting, spare, .. } = self;
        waiting.retain_mut(|held| {
            let stays = held.frame.header.session != session;
            if !stays {
                spare.push(std::mem::take(&mut held.frame));
            }
            stays
        });
    }
}

impl Bent {
    fn whom(&self) -> Whom {
        (self.source, self.frame.header.session)
    }

    /// Whether it waits for a frame of its own, or for those of the session before.
    fn waits(&self, into: &Inbox, ahead: Ahead<'_>) -> bool {
        let own = |frame: &Frame| frame.header.session == self.frame.header.session;
        let before = |held: &Held| {
            held.whose.source == self.source && held.whose.speaks && !own(&held.frame)
        };
        self.waits_for_its_frame(ahead)
            || ahead.frames.iter().any(before) && !into.frames().iter().any(own)
    }

    fn waits_for_its_frame(&self, ahead: Ahead<'_>) -> bool {
        let header = &self.frame.header;
        let source = self.source.and_then(|place| ahead.sources.get(place));
        let Some(source) = source.filter(|_| header.seq != 0) else {
            return false;
        };
        let is_there = |held: &Held| held.whose.speaks && belongs(header, &held.frame);
        let is_there = ahead.frames.iter().any(is_there);
        let in_round = ahead.lead.is_none() && is_there;
        let speaks = source.alive(ahead.now_ns);
        let speaks = speaks.is_none_or(|session| session == header.session);
        let is_young = ahead.now_ns.saturating_sub(self.received_ns) < source.timeout_ns;
        let may_come = is_young && (is_there || !source.has_heard(header));
        in_round || speaks && (ahead.lead == self.source || may_come)
    }
}

/// Whether vertices may go out with a frame: it is the one that they belong with, or came after it.
fn belongs(vertices: &VertexHeader, frame: &Frame) -> bool {
    let frame = &frame.header;
    frame.source == vertices.source
        && frame.session == vertices.session
        && (frame.epoch, frame.seq) >= (vertices.epoch, vertices.seq)
}

/// Whether nothing in the frame itself keeps the world from taking it: only then may an older one be dropped for it.
fn is_whole(frame: &Frame) -> bool {
    let rows = frame.transforms.len();
    frame.header.flags == frame_flags::FULL
        && frame.header.schema == WIRE_VERSION
        && frame.refused.is_none()
        && (frame.velocities.is_empty() || frame.velocities.len() == rows)
        && !(frame.waited && frame.header.sent_ns == 0)
}

/// Whether the world would take the new frame wherever it would take the old one, and then not need the old one.
fn replaces(new: &Held, old: &Held) -> bool {
    is_newer(new, old) && new.frame.header.scene_rev <= old.frame.header.scene_rev
}

/// Whether the one is of the same session as the other, and was sent after it.
fn is_newer(new: &Held, old: &Held) -> bool {
    let (a, b) = (&new.frame.header, &old.frame.header);
    new.whose.source == old.whose.source
        && a.session == b.session
        && (a.epoch, a.seq) > (b.epoch, b.seq)
}
