//! What the narrow phase reports of a pair to `publish` and others. In: a pair's slot. Out: a [`Finding`].

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
    /// How far work got.
    pub level: Level,
    /// Finished, and 0 lies inside the rounding interval.
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

    /// Pairs whose verdict is not `apart`, in no particular order.
    #[must_use]
    pub fn active(&self) -> &[PairSlot] {
        &self.active
    }

    /// Pairs that became active since [`Narrow::clear_entered`]; by now they may be inactive, or the slot reused.
    #[must_use]
    pub fn entered(&self) -> &[PairSlot] {
        &self.entered
    }

    /// The entered pairs have been read.
    pub fn clear_entered(&mut self) {
        self.entered.clear();
        // Their number differs from tick to tick: the capacity follows the largest number of active pairs.
        self.entered.reserve(self.active.len());
    }

    /// Whether a pair's verdict is not `apart`.
    #[must_use]
    pub fn is_active(&self, slot: PairSlot) -> bool {
        (self.hot.get(slot.index())).is_some_and(|hot| hot.live && hot.verdict != Verdict::Apart)
    }

    /// Pairs that were active in the last tick, or after its findings were published, and are now proved apart.
    #[must_use]
    pub fn left(&self) -> &[PairSlot] {
        &self.left
    }

    /// Pairs whose verdicts changed in the last [`Narrow::go_on`]: at this tick's poses, but after its findings were
    /// published. Meaningless once the next tick has begun.
    #[must_use]
    pub fn late(&self) -> &[PairSlot] {
        &self.late
    }

    /// Whether the finding of a pair may have changed since [`Narrow::told`]: it was visited or worked on, a body of it
    /// moved, or its slot holds another pair.
    #[must_use]
    pub fn is_stirred(&self, slot: PairSlot) -> bool {
        self.stirred.has(slot)
    }

    /// The pair's finding has been published.
    pub fn told(&mut self, slot: PairSlot) {
        self.stirred.clear(slot);
    }

    /// Prefetches what [`Narrow::finding`] of a pair reads.
    #[inline]
    pub fn ask_ahead(&self, slot: PairSlot) {
        if let (Some(hot), Some(memo)) = (self.hot.get(slot.index()), self.memos.get(slot.index()))
        {
            prefetch(hot);
            prefetch(memo);
        }
    }

    /// Prefetches what [`Narrow::contacts`] of a pair reads.
    #[inline]
    pub fn ask_ahead_for_contacts(&self, slot: PairSlot) {
        let memo = self.memos.get(slot.index());
        let set = memo.and_then(|memo| self.contact_sets.get(memo.contacts));
        if let Some(first) = set.and_then(|set| set.contacts().first()) {
            prefetch(first);
        }
    }
}
