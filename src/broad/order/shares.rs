//! Runs of blocks of equal work, by what the last runs took.
//!
//! In: how much work each run was. Out: where the next runs end, which changes nothing but the time.

use std::ops::Range;

use crate::limits::THREADS_MAX;
use crate::simd::boxes::WIDTH;

/// Runs at most.
pub(super) const RUNS_MAX: usize = THREADS_MAX;

/// The last runs, and what they took.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shares {
    /// Where the first run begins, and where each ends.
    start: usize,
    ends: [usize; RUNS_MAX],
    runs: usize,
    /// By run, of those that are over.
    took: [u64; RUNS_MAX],
    over: usize,
}

impl Shares {
    /// Deals blocks to so many runs; as many to each where it is not known what runs take.
    ///
    /// * `blocks` - from a multiple of `WIDTH` on.
    pub(super) fn deal(&mut self, blocks: Range<usize>, runs: usize) {
        let mut ends = [blocks.end; RUNS_MAX];
        let most = runs.clamp(1, RUNS_MAX);
        for (run, end) in ends[..most - 1].iter_mut().enumerate() {
            let before = (run + 1) * blocks.len() / most;
            let before = self.before(run + 1, most, blocks.len()).unwrap_or(before);
            *end = blocks.start + before / WIDTH * WIDTH;
        }
        (self.start, self.ends) = (blocks.start, ends);
        (self.runs, self.over) = (most, 0);
    }

    /// How many of the blocks make so many of equal runs, if work is spread as it was.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        clippy::cast_sign_loss,
        reason = "a share of the blocks; where runs end changes no result"
    )]
    fn before(&self, run: usize, runs: usize, blocks: usize) -> Option<usize> {
        if self.over < self.runs || self.sum() == 0 {
            return None;
        }
        let (mut left, mut from) = (self.sum() * run as u64 / runs as u64, self.start);
        for (to, took) in self.ends.iter().zip(&self.took[..self.over]) {
            if left <= *took {
                let share = left as f64 / (*took).max(1) as f64;
                let passed = (from - self.start) as f64 + (to - from) as f64 * share;
                let all = self.ends[self.runs - 1] - self.start;
                return Some((passed / all as f64 * blocks as f64) as usize);
            }
            (left, from) = (left - took, *to);
        }
        None
    }

    /// The blocks of a run.
    pub(super) fn run(&self, at: usize) -> Range<usize> {
        let from = if at == 0 {
            self.start
        } else {
            self.ends[at - 1]
        };
        from..self.ends[at]
    }

    /// How many runs are over.
    pub(super) fn over(&self) -> usize {
        self.over
    }

    /// The next run is over, and took so much.
    pub(super) fn note(&mut self, took: u64) {
        if let Some(run) = self.took.get_mut(self.over) {
            *run = took;
            self.over += 1;
        }
    }

    /// What the runs took that are over.
    pub(super) fn sum(&self) -> u64 {
        self.took[..self.over].iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends(shares: &Shares) -> Vec<usize> {
        (0..shares.runs).map(|run| shares.run(run).end).collect()
    }

    #[test]
    fn runs_are_of_equal_work_once_it_is_known_where_that_is() {
        let mut shares = Shares::default();
        shares.deal(320..960, 4);
        assert_eq!(ends(&shares), [480, 640, 800, 960]);
        // All of it in the first run, but for as much in the second half.
        for took in [500, 0, 250, 250] {
            shares.note(took);
        }
        assert_eq!(shares.sum(), 1000);
        // Twice as many blocks, from elsewhere.
        shares.deal(0..1280, 4);
        assert_eq!(ends(&shares), [160, 320, 960, 1280]);
        // Runs that were not brought to an end tell nothing.
        shares.note(1);
        shares.deal(0..1280, 2);
        assert_eq!(ends(&shares), [640, 1280]);
        shares.deal(0..0, RUNS_MAX);
        assert_eq!(ends(&shares), [0; RUNS_MAX]);
    }
}
