//! Frames that wait for their tick, in order of receipt; their memory goes round between here and the inbox.
//!
//! In: the frames of a drain. Out: the frames of a tick. A full frame stands for the older ones of its session, which
//! are passed over and counted; a partial one does not, because those may hold bodies that it lacks, and one of a
//! source that moves continuous bodies does not, because those are on their way. A pause stands for the one before it.

use super::fold::{fold, is_sound};
use crate::limits::{FRAME_ROWS_MAX, FRAMES_PER_DRAIN_MAX, FRAMES_WAITING_MAX, SOURCES_MAX};
use crate::wire::{Frame, Inbox, frame_flags};

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

impl Held {
    pub(super) fn is_pause(&self) -> bool {
        self.frame.header.flags == frame_flags::PAUSED
    }
}

/// What the frames of a source are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// Each makes a tick of its own.
    Each,
    /// All go with the next tick: each is a part of a body's way.
    Way,
    /// The newest poses go with the next tick.
    Newest,
}

/// The frames that wait, and spare memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Queue {
    frames: Vec<Held>,
    spare: Vec<Held>,
    /// Memory of [`fold`].
    ids: Vec<u64>,
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
    /// * `turn` - what the frames of this source are for: where each counts, none with poses is passed over for a newer
    ///   one.
    /// * returns - how many frames of its source are passed over for it.
    pub(super) fn put(&mut self, frame: &mut Frame, whose: Whose, turn: Turn) -> u64 {
        let mut held = self.spare.pop().unwrap_or_default();
        std::mem::swap(&mut held.frame, frame);
        held.whose = whose;
        let mut passed = 0;
        let mut place = None;
        if turn == Turn::Newest && is_whole(&held.frame) {
            // It takes the place of the oldest that it stands for: a session that was heard in time must not seem
            // silent to one that asked in between.
            place = self.frames.iter().position(|old| replaces(&held, old));
            // A pause behind that place would come too late: what it says holds is said anew.
            let overtaken = |at: usize, old: &Held| {
                old.is_pause() && place.is_some_and(|place| place < at) && is_newer(&held, old)
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
        } else if turn != Turn::Each
            && let Some(at) = self.pause_before(&held)
        {
            let old = &self.frames[at].frame;
            (held.frame.first_seq, held.frame.cut) = (old.stands_from(), old.cut);
            self.drop_at(at);
            passed += 1;
            place = Some(at);
        }
        passed += self.make_room(&mut held, turn);
        let end = self.frames.len();
        self.frames.insert(place.unwrap_or(end).min(end), held);
        passed
    }

    /// The pause right before this one, which says of the same poses that they hold: none that was sent in between was
    /// lost.
    fn pause_before(&self, held: &Held) -> Option<usize> {
        let (frame, whose) = (&held.frame, &held.whose);
        if !(held.is_pause() && whose.speaks) || frame.waited && frame.header.sent_ns == 0 {
            return None;
        }
        let at = self
            .frames
            .iter()
            .rposition(|old| is_of_session(held, old))?;
        let (old, header) = (&self.frames[at], &self.frames[at].frame.header);
        let follows = header.seq.checked_add(1) == Some(frame.header.seq);
        (old.is_pause() && old.whose.speaks && header.epoch == frame.header.epoch && follows)
            .then_some(at)
    }

    /// Makes room for one more frame of its source.
    ///
    /// * returns - how many are passed over for it.
    fn make_room(&mut self, held: &mut Held, turn: Turn) -> u64 {
        let (source, speaks) = (held.whose.source, held.whose.speaks);
        // What the world would refuse takes nobody's room but that of its like.
        let alike = |old: &Held| old.whose.source == source && old.whose.speaks == speaks;
        let each_counts = speaks && turn != Turn::Newest;
        let mut passed = 0;
        loop {
            let (mut frames, mut rows) = (1, held.frame.transforms.len());
            for old in self.frames.iter().filter(|old| alike(old)) {
                frames += 1;
                rows += old.frame.transforms.len();
            }
            let fits_many = frames <= FRAMES_WAITING_MAX && rows <= FRAME_ROWS_MAX;
            if frames <= FRAMES_PER_DRAIN_MAX || each_counts && fits_many {
                return passed;
            }
            passed += 1;
            if speaks && turn == Turn::Newest && self.fold_two(held) {
                continue;
            }
            // Without the one before it a pause renews nothing: it is what can be missed.
            let pause = |old: &Held| turn == Turn::Newest && alike(old) && old.is_pause();
            let pause = self.frames.iter().position(pause);
            let Some(at) = pause.or_else(|| self.frames.iter().position(alike)) else {
                return passed;
            };
            let gone = self.frames.remove(at);
            let mut behind = self.frames[at..].iter_mut().chain([&mut *held]);
            if let Some(next) = behind.find(|next| is_newer(next, &gone)) {
                next.frame.cut = true;
            }
            self.spare.push(gone);
        }
    }

    /// Folds a frame of a source into its next one with poses: of those that can be, the two with the fewest rows, so
    /// that no row is copied often. Not into a frame that a pause follows, which renews the bodies of that one alone.
    ///
    /// * returns - whether any could.
    fn fold_two(&mut self, held: &Held) -> bool {
        let has_poses = |other: &Held| {
            let whose = (other.whose.source, other.whose.speaks);
            whose == (held.whose.source, held.whose.speaks) && !other.is_pause()
        };
        let mut fewest: Option<(usize, usize, usize)> = None;
        let mut older: Option<usize> = None;
        for (at, new) in self.frames.iter().enumerate() {
            if !has_poses(new) {
                continue;
            }
            if let Some(older) = older.replace(at) {
                let old = &self.frames[older];
                let rows = old.frame.transforms.len() + new.frame.transforms.len();
                let are_of_one =
                    is_newer(new, old) && old.frame.header.epoch == new.frame.header.epoch;
                if are_of_one
                    && is_sound(&old.frame)
                    && is_sound(&new.frame)
                    && !self.is_renewed(at, held)
                    && fewest.is_none_or(|(least, ..)| rows < least)
                {
                    fewest = Some((rows, older, at));
                }
            }
        }
        let Some((_, older, at)) = fewest else {
            return false;
        };
        let (front, back) = self.frames.split_at_mut(at);
        let is_folded = fold(&front[older], &mut back[0], &mut self.ids);
        if is_folded {
            self.drop_at(older);
        }
        is_folded
    }

    /// Whether the next frame of the session behind this one is a pause.
    fn is_renewed(&self, at: usize, held: &Held) -> bool {
        let frame = &self.frames[at];
        let mut behind = self.frames[at + 1..].iter().chain([held]);
        behind
            .find(|next| is_of_session(next, frame))
            .is_some_and(Held::is_pause)
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

/// Whether nothing in the frame itself keeps the world from taking it: only then may an older one be dropped for it.
fn is_whole(frame: &Frame) -> bool {
    frame.header.flags == frame_flags::FULL && is_sound(frame)
}

/// Whether the world would take the new frame wherever it would take the old one, and then not need the old one.
fn replaces(new: &Held, old: &Held) -> bool {
    is_newer(new, old) && new.frame.header.scene_rev <= old.frame.header.scene_rev
}

/// Whether the one is of the same session as the other, and was sent after it.
fn is_newer(new: &Held, old: &Held) -> bool {
    let (a, b) = (&new.frame.header, &old.frame.header);
    is_of_session(new, old) && (a.epoch, a.seq) > (b.epoch, b.seq)
}

fn is_of_session(one: &Held, other: &Held) -> bool {
    one.whose.source == other.whose.source && one.frame.header.session == other.frame.header.session
}
