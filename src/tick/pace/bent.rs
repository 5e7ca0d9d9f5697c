//! Vertices that wait for the frame that they belong with.
//!
//! In: the vertices of a drain, the frames of a tick. Out: the vertices of that tick.

use super::held::Held;
use super::source::Source;
use crate::limits::{VERTEX_FRAMES_WAITING_MAX, VERTEX_ROWS_WAITING_MAX};
use crate::wire::{Frame, Inbox, VertexFrame, VertexHeader};

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
