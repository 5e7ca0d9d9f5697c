//! Frames that wait for their tick, in order of receipt; their memory goes round between here and the inbox.
//!
//! In: the frames of a drain. Out: the frames of a tick. A full frame stands for the older ones of its session, which
//! are passed over and counted; a partial one does not, because those may hold bodies that it lacks.

use crate::limits::FRAMES_PER_DRAIN_MAX;
use crate::wire::{Frame, Inbox, WIRE_VERSION, frame_flags};

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
    /// * `stands_alone` - each frame of this source makes a tick of its own: none is passed over for a newer one.
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
