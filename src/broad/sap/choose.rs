//! Which axes are kept sorted, and when sorting from scratch is cheaper than repairing. Decided by counted work only,
//! never by a clock, so that a replay decides alike.
//!
//! Bodies on a floor share one interval on the vertical axis: its ends pass one another at every jitter and carry no
//! information. Such an axis is skipped (RTR3 section 17.5): pairs that overlap on the two others are kept, and their
//! boxes are tested on the third.

/// Updates with moving bodies between two reviews of the axes.
const LOOK_EVERY: u32 = 64;
/// An axis is clumped when this many times more pairs overlap on it than on the next one. In the pile of 10,000 bodies
/// used for the broad-phase figures the factor is about 12, in a gas 1.
const CLUMPED: u64 = 4;
/// With fewer bodies skipping saves nothing measurable.
const BODIES_MIN: usize = 64;
/// Two-axis pairs kept, per body: beyond it walking them costs more than the swaps on the third axis.
const PARTIAL_PER_BODY: usize = 16;
// Cost of one step of each kind, nanoseconds, measured on an AMD EPYC in the gas of 10,000 bodies of `benches/broad`.
// Only their ratios matter, and only for the choice between two correct ways.
/// A comparison while sorting.
const SORT_NS: u64 = 1;
/// A swap, with its share of comparisons of boxes.
const SWAP_NS: u64 = 4;
/// A comparison of boxes in a sweep.
const SWEEP_TEST_NS: u64 = 2;
/// Copying a body into its bands.
const SWEEP_BODY_NS: u64 = 80;
/// A comparison of one box with every other.
const SCAN_TEST_NS: u64 = 4;
/// Most updates that sort from scratch at once before repairing is tried again, as a power of two.
const STREAK_MAX: u32 = 6;

/// The plan for the axes and the data behind it.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    skipped: Option<usize>,
    /// Swaps by axis since the last review.
    swaps: [u64; 3],
    /// Overlapping pairs by axis at the last count; unknown for a skipped axis.
    crowding: [u64; 3],
    /// Boxes that the last sweep compared.
    swept: u64,
    /// Updates until the next review.
    until_look: u32,
    /// Length of the next pause between keeping an axis again and skipping one again.
    pause: u32,
    /// Failed repairs in a row.
    streak: u32,
    /// Remaining updates that sort from scratch at once.
    straight: u32,
}

impl Default for Choice {
    fn default() -> Self {
        Self {
            skipped: None,
            swaps: [0; 3],
            crowding: [0; 3],
            swept: 0,
            until_look: LOOK_EVERY,
            pause: LOOK_EVERY,
            streak: 0,
            straight: 0,
        }
    }
}

impl Choice {
    /// The axis that is not kept.
    pub(super) fn skipped(&self) -> Option<usize> {
        self.skipped
    }

    /// The axes kept sorted, two or three.
    pub(super) fn kept(&self) -> &'static [usize] {
        match self.skipped {
            Some(0) => &[1, 2],
            Some(1) => &[0, 2],
            Some(_) => &[0, 1],
            None => &[0, 1, 2],
        }
    }

    /// The kept axes other than `axis`: two, or one listed twice.
    pub(super) fn beside(&self, axis: usize) -> [usize; 2] {
        let mut others = self.kept().iter().copied().filter(|k| *k != axis);
        let first = others.next().unwrap_or(axis);
        [first, others.next().unwrap_or(first)]
    }

    /// Returns whether an axis is kept sorted.
    pub(super) fn keeps(&self, axis: usize) -> bool {
        self.skipped != Some(axis)
    }

    /// The kept axis with the fewest overlaps: the one to sweep along.
    pub(super) fn clearest(&self) -> usize {
        let kept = (0..3).filter(|k| self.keeps(*k));
        kept.min_by_key(|k| self.crowding[*k]).unwrap_or(0)
    }

    /// Records the clumping of an axis.
    pub(super) fn note_crowding(&mut self, axis: usize, pairs: u64) {
        self.crowding[axis] = pairs;
    }

    /// Records swaps on an axis.
    pub(super) fn note_swaps(&mut self, axis: usize, swaps: u64) {
        self.swaps[axis] += swaps;
    }

    /// Swaps that cost about as much as sorting from scratch and one sweep.
    pub(super) fn allowance(&self, bodies: usize) -> u64 {
        let ends = 2 * bodies.max(16) as u64;
        let sorting = 3 * ends * u64::from(ends.ilog2()) * SORT_NS;
        (sorting + self.sweep_ns(bodies)) / SWAP_NS
    }

    /// Approximate cost of a sweep, estimated from the last one, nanoseconds on a typical machine.
    fn sweep_ns(&self, bodies: usize) -> u64 {
        self.swept * SWEEP_TEST_NS + bodies as u64 * SWEEP_BODY_NS
    }

    /// Returns whether a sweep is cheaper for `asked` bodies than comparing each with every box.
    pub(super) fn prefers_sweep(&self, asked: usize, bodies: usize) -> bool {
        asked as u64 * bodies as u64 * SCAN_TEST_NS > self.sweep_ns(bodies)
    }

    /// Records how many boxes a sweep compared.
    pub(super) fn note_sweep(&mut self, tests: u64) {
        self.swept = tests;
    }

    /// Returns whether this update skips the attempt to repair, because the last ones failed.
    pub(super) fn goes_straight(&mut self) -> bool {
        let straight = self.straight > 0;
        self.straight = self.straight.saturating_sub(1);
        straight
    }

    /// Records whether a repair of many moved bodies was within the allowance. The first failure has no consequence: it
    /// may be a single jump of all.
    pub(super) fn note_repair(&mut self, succeeded: bool) {
        if succeeded {
            self.streak = 0;
        } else {
            self.straight = (1 << self.streak) - 1;
            self.streak = (self.streak + 1).min(STREAK_MAX);
        }
    }

    /// Returns whether it is time to count the overlaps of each axis, and enough has moved to pay for it.
    pub(super) fn looks(&mut self, bodies: usize) -> bool {
        self.until_look = self.until_look.saturating_sub(1);
        self.until_look == 0 && self.swaps.iter().sum::<u64>() > bodies as u64
    }

    /// After the count: returns whether an axis is skipped from now on.
    pub(super) fn decide(&mut self, bodies: usize) -> bool {
        let swaps = std::mem::take(&mut self.swaps);
        self.until_look = LOOK_EVERY;
        if self.skipped.is_some() || bodies < BODIES_MIN {
            return false;
        }
        let clumped = (0..3).max_by_key(|k| self.crowding[*k]).unwrap_or(0);
        let rest = (0..3).filter(|k| *k != clumped);
        let next = rest.clone().map(|k| self.crowding[k]).max().unwrap_or(0);
        let others: u64 = rest.map(|k| swaps[k]).sum();
        let skip = self.crowding[clumped] > CLUMPED * next && swaps[clumped] > others;
        if skip {
            self.skipped = Some(clumped);
        }
        skip
    }

    /// Most two-axis pairs that may be kept.
    pub(super) fn partial_max(bodies: usize) -> usize {
        PARTIAL_PER_BODY * bodies.max(BODIES_MIN)
    }

    /// Keeps all axes again; the next skip comes later than the last, so that a scene between the two states does not
    /// pay for the change repeatedly.
    pub(super) fn keep_all(&mut self) {
        self.skipped = None;
        self.swaps = [0; 3];
        self.pause = self.pause.saturating_mul(2).min(1 << 13);
        self.until_look = self.pause;
    }
}
