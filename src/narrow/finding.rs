//! What the narrow phase says of a pair, for whoever publishes it. In: a pair's slot. Out: a [`Finding`].

use crate::ids::{BodySlot, PairSlot};
use crate::math::Interval;
use crate::simd::boxes::prefetch;
use crate::wire::{Level, Verdict};

use super::memo::Witness;
use super::{NONE, Narrow};

/// What is known of a pair in this tick.
#[derive(Clone, Copy, Debug)]
pub struct Finding<'a> {
    /// Body with the smaller id.
    pub a: BodySlot,
    /// Body with the larger id.
    pub b: BodySlot,
    /// Verdict at this tick's poses.
    pub verdict: Verdict,
    /// Sound interval of the gap at this tick's poses, metres.
    pub gap: Interval,
    /// Nearest or deepest place at the last test.
    pub witness: Option<&'a Witness>,
    /// How far work came.
    pub level: Level,
    /// Finished, with 0 inside the rounding interval.
    pub touching: bool,
    /// Tick of the poses that the bound was computed at; 0: boxes only.
    pub tested: u64,
    /// First tick without a verdict; 0: decided.
    pub undecided_since: u64,
    /// First tick of the pair.
    pub born: u64,
    /// Pairs nearer than this are `near`, metres.
    pub report_m: f64,
}

impl Narrow {
    /// What is known of a pair; `None` for a slot that holds no pair.
    #[must_use]
    pub fn finding(&self, slot: PairSlot) -> Option<Finding<'_>> {
        let hot = self.hot.get(slot.index()).filter(|hot| hot.live)?;
        let memo = &self.memos[slot.index()];
        let level = if memo.tested == 0 {
            Level::Boxes
        } else if memo.cursor != NONE || memo.report_cursor != NONE {
            Level::Partial
        } else if memo.widened_m() > 0.0 {
            Level::Carried
        } else if memo.tight {
            Level::Exact
        } else {
            Level::Partial
        };
        Some(Finding {
            a: hot.a,
            b: hot.b,
            verdict: hot.verdict,
            gap: memo.now,
            witness: memo.witness.as_ref(),
            level,
            touching: memo.touching(),
            tested: memo.tested,
            undecided_since: memo.undecided_since,
            born: memo.born,
            report_m: memo.report_m,
        })
    }

    /// Pairs whose verdict is not `apart`, in no order that means anything.
    #[must_use]
    pub fn active(&self) -> &[PairSlot] {
        &self.active
    }

    /// Pairs that have become active since [`Narrow::clear_entered`]; they may have stopped, or be others by now.
    #[must_use]
    pub fn entered(&self) -> &[PairSlot] {
        &self.entered
    }

    /// What became active was taken down.
    pub fn clear_entered(&mut self) {
        self.entered.clear();
        // How many do differs from tick to tick: room for all of them is made when they are more than ever.
        self.entered.reserve(self.active.len());
    }

    /// Whether a pair's verdict is not `apart`.
    #[must_use]
    pub fn is_active(&self, slot: PairSlot) -> bool {
        (self.hot.get(slot.index())).is_some_and(|hot| hot.live && hot.verdict != Verdict::Apart)
    }

    /// Pairs that were active, in the tick before or after its findings were taken, and are now proved apart.
    #[must_use]
    pub fn left(&self) -> &[PairSlot] {
        &self.left
    }

    /// Pairs whose verdicts changed in the last [`Narrow::go_on`]: of the tick's poses, when its findings were taken
    /// already. Of no meaning once the next tick has begun.
    #[must_use]
    pub fn late(&self) -> &[PairSlot] {
        &self.late
    }

    /// Whether what there is to say of a pair may have changed since [`Narrow::told`]: it was looked at or worked on, a
    /// body of it moved, or its slot holds another pair.
    #[must_use]
    pub fn is_stirred(&self, slot: PairSlot) -> bool {
        self.stirred.has(slot)
    }

    /// What is known of a pair has been taken down.
    pub fn told(&mut self, slot: PairSlot) {
        self.stirred.clear(slot);
    }

    /// Says that [`Narrow::finding`] of a pair is wanted soon.
    #[inline]
    pub fn ask_ahead(&self, slot: PairSlot) {
        if let (Some(hot), Some(memo)) = (self.hot.get(slot.index()), self.memos.get(slot.index()))
        {
            prefetch(hot);
            prefetch(memo);
        }
    }

    /// Says that [`Narrow::contacts`] of a pair are wanted soon.
    #[inline]
    pub fn ask_ahead_for_contacts(&self, slot: PairSlot) {
        let memo = self.memos.get(slot.index());
        let set = memo.and_then(|memo| self.contact_sets.get(memo.contacts));
        if let Some(first) = set.and_then(|set| set.contacts().first()) {
            prefetch(first);
        }
    }
}
