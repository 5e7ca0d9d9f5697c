//! Which axes are kept sorted, and when sorting anew is cheaper than repairing. Decided by counted work alone, never
//! by a clock, so that a replay decides alike.
//!
//! Things that lie on a floor share one interval on the upright axis: its ends pass one another at every jitter and
//! tell nothing. Such an axis is skipped (RTR3 section 17.5): pairs that overlap on the two others are kept, and the
//! third is asked of their boxes.

/// Updates of moving bodies between two looks at the axes.
const LOOK_EVERY: u32 = 64;
/// An axis is clumped when more pairs overlap on it than so many times the next one. In the pile of 10,000 bodies
/// that the broad-phase figures use the factor is about 12, in a gas 1.
const CLUMPED: u64 = 4;
/// Below so many bodies skipping saves nothing that one could measure.
const BODIES_MIN: usize = 64;
/// Pairs kept for two axes, a body: beyond it walking them costs more than the swaps that the third axis takes.
const PARTIAL_PER_BODY: usize = 16;
// What one step of each kind costs, nanoseconds, measured on an AMD EPYC in the gas of 10,000 bodies of
// `benches/broad`. Only their ratios matter, and only for the choice between two right ways.
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
/// Most updates that go straight to sorting anew before repairing is tried again, as a power of two.
const STREAK_MAX: u32 = 6;

/// The plan of the axes and the memory behind it.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    skipped: Option<usize>,
    /// Swaps by axis since the last look.
    swaps: [u64; 3],
    /// Overlapping pairs by axis at the last count; of a skipped axis: not known.
    crowding: [u64; 3],
    /// Boxes that the last sweep compared.
    swept: u64,
    /// Updates until the next look.
    until_look: u32,
    /// How long the next pause between an axis kept again and the next skip is.
    pause: u32,
    /// Failed repairs in a row.
    streak: u32,
    /// Updates left that go straight to sorting.
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

    /// The two axes, or the one twice, that are kept beside `axis`.
    pub(super) fn beside(&self, axis: usize) -> [usize; 2] {
        let mut others = self.kept().iter().copied().filter(|k| *k != axis);
        let first = others.next().unwrap_or(axis);
        [first, others.next().unwrap_or(first)]
    }

    /// Whether an axis is kept sorted.
    pub(super) fn keeps(&self, axis: usize) -> bool {
        self.skipped != Some(axis)
    }

    /// The kept axis with the fewest overlaps: the one to sweep along.
    pub(super) fn clearest(&self) -> usize {
        let kept = (0..3).filter(|k| self.keeps(*k));
        kept.min_by_key(|k| self.crowding[*k]).unwrap_or(0)
    }

    /// Notes the clumping of an axis.
    pub(super) fn note_crowding(&mut self, axis: usize, pairs: u64) {
        self.crowding[axis] = pairs;
    }

    /// Notes swaps on an axis.
    pub(super) fn note_swaps(&mut self, axis: usize, swaps: u64) {
        self.swaps[axis] += swaps;
    }

    /// Swaps that cost about as much as sorting anew and one sweep.
    pub(super) fn allowance(&self, bodies: usize) -> u64 {
        let ends = 2 * bodies.max(16) as u64;
        let sorting = 3 * ends * u64::from(ends.ilog2()) * SORT_NS;
        (sorting + self.sweep_ns(bodies)) / SWAP_NS
    }

    /// About what a sweep costs, judged by the last one, nanoseconds on a common machine.
    fn sweep_ns(&self, bodies: usize) -> u64 {
        self.swept * SWEEP_TEST_NS + bodies as u64 * SWEEP_BODY_NS
    }

    /// Whether so many bodies are better looked for by a sweep than by comparing each with every box.
    pub(super) fn prefers_sweep(&self, asked: usize, bodies: usize) -> bool {
        asked as u64 * bodies as u64 * SCAN_TEST_NS > self.sweep_ns(bodies)
    }

    /// Notes how many boxes a sweep compared.
    pub(super) fn note_sweep(&mut self, tests: u64) {
        self.swept = tests;
    }

    /// Whether this update need not even try to repair: the last ones failed.
    pub(super) fn goes_straight(&mut self) -> bool {
        let straight = self.straight > 0;
        self.straight = self.straight.saturating_sub(1);
        straight
    }

    /// A repair of many moved bodies was too dear, or was not. The first failure is forgiven: a single jump of all.
    pub(super) fn note_repair(&mut self, succeeded: bool) {
        if succeeded {
            self.streak = 0;
        } else {
            self.straight = (1 << self.streak) - 1;
            self.streak = (self.streak + 1).min(STREAK_MAX);
        }
    }

    /// Whether it is time to count the overlaps of each axis, and enough has moved to pay for it.
    pub(super) fn looks(&mut self, bodies: usize) -> bool {
        self.until_look = self.until_look.saturating_sub(1);
        self.until_look == 0 && self.swaps.iter().sum::<u64>() > bodies as u64
    }

    /// After counting: whether an axis is to be skipped from now on.
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

    /// Most pairs that may be kept for two axes.
    pub(super) fn partial_max(bodies: usize) -> usize {
        PARTIAL_PER_BODY * bodies.max(BODIES_MIN)
    }

    /// Keeps all axes again; the next skip comes later than the last, so that a scene between the two states does not
    /// pay for the change again and again.
    pub(super) fn keep_all(&mut self) {
        self.skipped = None;
        self.swaps = [0; 3];
        self.pause = self.pause.saturating_mul(2).min(1 << 13);
        self.until_look = self.pause;
    }
}
