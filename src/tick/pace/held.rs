//! Frames that wait for their tick, in order of receipt; their memory goes round between here and the inbox.
//!
//! In: the frames of a drain. Out: the frames of a tick. A full frame stands for the older ones of its session, which
//! are passed over and counted; a partial one does not, because those may hold bodies that it lacks, and one of a
//! source that moves continuous bodies does not, because those are on their way.

use crate::limits::{FRAMES_PER_DRAIN_MAX, VERTEX_FRAMES_WAITING_MAX};
use crate::wire::{Frame, Inbox, VertexFrame, WIRE_VERSION, frame_flags};

/// A frame and whose it is.
#[derive(Clone, Debug, Default)]
pub(super) struct Held {
    pub(super) frame: Frame,
    /// Place of its source; `None`: of no source of the scene, to be refused and counted by the world.
    pub(super) source: Option<usize>,
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

    /// Takes one frame out of an inbox.
    ///
    /// * `stands_alone` - each frame of this source makes a tick of its own, or is a part of a body's way: none is
    ///   passed over for a newer one.
    /// * returns - how many frames of its source are passed over for it.
    pub(super) fn put(
        &mut self,
        frame: &mut Frame,
        source: Option<usize>,
        stands_alone: bool,
    ) -> u64 {
        let mut held = self.spare.pop().unwrap_or_default();
        std::mem::swap(&mut held.frame, frame);
        held.source = source;
        let mut passed = 0;
        let mut place = None;
        if !stands_alone && is_whole(&held.frame) {
            // It takes the place of the oldest that it stands for: a session that was heard in time must not seem
            // silent to one that asked in between.
            place = self.frames.iter().position(|old| replaces(&held, old));
            while let Some(last) = self.frames.iter().rposition(|old| replaces(&held, old)) {
                self.drop_at(last);
                passed += 1;
            }
        }
        let of_source = |old: &Held| old.source == source;
        if self.frames.iter().filter(|old| of_source(old)).count() >= FRAMES_PER_DRAIN_MAX
            && let Some(oldest) = self.frames.iter().position(of_source)
        {
            self.drop_at(oldest);
            passed += 1;
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

    fn drop_at(&mut self, at: usize) {
        let held = self.frames.remove(at);
        self.spare.push(held);
    }
}

/// Vertices that wait, and spare memory.
///
/// None is passed over for a newer one, and those of a source go out in the order of their sending: a range stands on
/// the version before. Those of the source whose frames make ticks wait for the frame that they belong with, so that a
/// tick has vertices and poses of one moment; those of a new session wait for the frames of the one before.
#[derive(Clone, Debug, Default)]
pub(super) struct Vertices {
    waiting: Vec<(VertexFrame, Option<usize>)>,
    spare: Vec<VertexFrame>,
}

impl Vertices {
    /// Takes vertices out of an inbox. Of more than a source may have waiting the oldest go: the numbers of those that
    /// follow tell that they are missing.
    pub(super) fn put(&mut self, frame: &mut VertexFrame, source: Option<usize>) {
        let of_source = |held: &(VertexFrame, Option<usize>)| held.1 == source;
        if self.waiting.iter().filter(|held| of_source(held)).count() >= VERTEX_FRAMES_WAITING_MAX
            && let Some(oldest) = self.waiting.iter().position(of_source)
        {
            let (oldest, _) = self.waiting.remove(oldest);
            self.spare.push(oldest);
        }
        let mut held = self.spare.pop().unwrap_or_default();
        std::mem::swap(&mut held, frame);
        self.waiting.push((held, source));
    }

    /// Hands out what a tick with these frames takes.
    ///
    /// * `lead` - the source each of whose frames makes a tick of its own.
    /// * `frames` - those that go on waiting.
    pub(super) fn take(&mut self, into: &mut Inbox, lead: Option<usize>, frames: &[Held]) {
        let mut kept = 0;
        for at in 0..self.waiting.len() {
            let (frame, source) = &self.waiting[at];
            let header = &frame.header;
            let of_lead = lead.is_some() && *source == lead && header.seq != 0;
            let belongs = |f: &Frame| {
                let frame = &f.header;
                frame.source == header.source
                    && (frame.session != header.session
                        || (frame.epoch, frame.seq) >= (header.epoch, header.seq))
            };
            let before =
                |held: &Held| held.source == *source && held.frame.header.session != header.session;
            let waits = of_lead && !into.frames().iter().any(belongs)
                || frames.iter().any(before)
                || self.waiting[..kept].iter().any(|held| held.1 == *source);
            if waits {
                self.waiting.swap(kept, at);
                kept += 1;
            } else {
                std::mem::swap(into.push_vertices(), &mut self.waiting[at].0);
            }
        }
        self.spare
            .extend(self.waiting.drain(kept..).map(|(frame, _)| frame));
    }

    /// Drops what a session that is over has left without a frame.
    pub(super) fn forget(&mut self, session: u64) {
        let Self { waiting, spare } = self;
        waiting.retain_mut(|(frame, _)| {
            let stays = frame.header.session != session;
            if !stays {
                spare.push(std::mem::take(frame));
            }
            stays
        });
    }
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
    let (a, b) = (&new.frame.header, &old.frame.header);
    new.source == old.source
        && a.session == b.session
        && (a.epoch, a.seq) > (b.epoch, b.seq)
        && a.scene_rev <= b.scene_rev
}
