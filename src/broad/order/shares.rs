//! Splits blocks into runs of equal work, based on the cost of the last runs.
//!
//! In: the work of each run. Out: where the next runs end; this affects only time.

use std::ops::Range;

use crate::limits::THREADS_MAX;
use crate::simd::boxes::WIDTH;

/// Most runs.
pub(super) const RUNS_MAX: usize = THREADS_MAX;

/// The last runs, and their work.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shares {
    /// Where the first run begins, and where each ends.
    start: usize,
    ends: [usize; RUNS_MAX],
    runs: usize,
    /// By finished run: its work; and the number of finished runs.
    took: [u64; RUNS_MAX],
    over: usize,
}

impl Shares {
    /// Splits blocks into `runs` runs; equally if the work of runs is unknown.
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

    /// How many of the blocks make up the first `run` of `runs` equal runs, if work is distributed as last time.
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

    /// Number of finished runs.
    pub(super) fn over(&self) -> usize {
        self.over
    }

    /// Finishes the next run, with its work.
    pub(super) fn note(&mut self, took: u64) {
        if let Some(run) = self.took.get_mut(self.over) {
            *run = took;
            self.over += 1;
        }
    }

    /// Total work of the finished runs.
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
        // All of it in the first run, except as much in the second half.
        for took in [500, 0, 250, 250] {
            shares.note(took);
        }
        assert_eq!(shares.sum(), 1000);
        // Twice as many blocks, from another start.
        shares.deal(0..1280, 4);
        assert_eq!(ends(&shares), [160, 320, 960, 1280]);
        // Unfinished runs are ignored.
        shares.note(1);
        shares.deal(0..1280, 2);
        assert_eq!(ends(&shares), [640, 1280]);
        shares.deal(0..0, RUNS_MAX);
        assert_eq!(ends(&shares), [0; RUNS_MAX]);
    }
}
