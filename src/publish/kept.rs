//! A message that is kept from tick to tick: rows without changes stay in place, or are moved.
//!
//! In: for each pair in order, where its rows were in the message of the last tick and whether they are still valid.
//! Out: the message of this tick, in the same memory. Rows that keep their position are not touched: those before the
//! first pair that came or went, and later ones as long as as many rows went as came.
//!
//! Refused: composing the message from the old one again. Each tick in which a pair came or went then copied
//! everything, which was most of the cost of publishing a scene mostly at rest.

use std::ops::Range;

/// State while a message is composed.
#[derive(Debug)]
pub(super) struct Kept<T> {
    /// Rows composed so far.
    at: usize,
    /// The rows of the old message that stay, in order.
    runs: Vec<Run>,
    /// New rows, in order: they fill the gaps between the runs.
    made: Vec<T>,
}

/// Adjacent rows that stay together.
#[derive(Clone, Copy, Debug)]
struct Run {
    from: usize,
    to: usize,
    len: usize,
}

impl Run {
    fn old(&self) -> Range<usize> {
        self.from..self.from + self.len
    }
}

/// Rows of one pair in a message: the first, and how many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) first: u32,
    pub(super) len: u32,
}

impl<T> Default for Kept<T> {
    fn default() -> Self {
        Self {
            at: 0,
            runs: Vec::new(),
            made: Vec::new(),
        }
    }
}

impl<T: Copy> Kept<T> {
    /// Starts at the beginning of the message.
    pub(super) fn begin(&mut self) {
        self.at = 0;
        self.runs.clear();
        self.made.clear();
    }

    /// The next rows are those at `was` in the last tick; spans come in their old order.
    ///
    /// * returns - where they are now.
    pub(super) fn keep(&mut self, was: Span) -> Span {
        let (from, to, len) = (was.first as usize, self.at, was.len as usize);
        match self.runs.last_mut() {
            Some(run) if run.old().end == from && run.to + run.len == to => run.len += len,
            _ if len == 0 => {}
            _ => self.runs.push(Run { from, to, len }),
        }
        self.span(len)
    }

    /// The next rows are new; `make` appends them.
    ///
    /// * returns - where they are.
    pub(super) fn make(&mut self, make: impl FnOnce(&mut Vec<T>)) -> Span {
        let before = self.made.len();
        make(&mut self.made);
        self.span(self.made.len() - before)
    }

    /// Ends the message.
    ///
    /// * `out` - the message of the last tick, then that of this one.
    pub(super) fn finish(&mut self, out: &mut Vec<T>) {
        if self.runs.is_empty() {
            std::mem::swap(out, &mut self.made);
            return;
        }
        // If there are more rows than before, some are new.
        if let Some(row) = self.made.first()
            && out.len() < self.at
        {
            out.resize(self.at, *row);
        }
        self.move_runs(out);
        self.put_made(out);
        out.truncate(self.at);
        // The number of new rows varies from tick to tick: room for all is reserved when there are more than ever.
        self.runs.clear();
        self.runs.reserve(out.len() / 2);
        self.made.clear();
        self.made.reserve(out.len());
    }

    /// Writes the new rows between the runs, and after the last.
    fn put_made(&self, out: &mut [T]) {
        let (mut free, mut rows) = (0, self.made.as_slice());
        let ends = self.runs.iter().map(|run| (run.to, run.to + run.len));
        for (end, next) in ends.chain([(self.at, self.at)]) {
            let (these, rest) = rows.split_at((end - free).min(rows.len()));
            if let Some(there) = out.get_mut(free..free + these.len()) {
                there.copy_from_slice(these);
            }
            (free, rows) = (next, rest);
        }
    }

    /// Moves the kept runs to their positions. Runs keep their order, so a run that moves up can only overwrite a later
    /// one that moves up too, which is moved first; a run that moves down only an earlier one that moves down too.
    fn move_runs(&self, out: &mut [T]) {
        let mut put = |run: &Run| {
            if run.from != run.to && run.old().end.max(run.to + run.len) <= out.len() {
                out.copy_within(run.old(), run.to);
            }
        };
        for same in self
            .runs
            .chunk_by(|one, next| (one.from < one.to) == (next.from < next.to))
        {
            if same.first().is_some_and(|run| run.from < run.to) {
                same.iter().rev().for_each(&mut put);
            } else {
                same.iter().for_each(&mut put);
            }
        }
    }

    /// Number of rows of the last message.
    pub(super) fn rows(&self) -> usize {
        self.at
    }

    fn span(&mut self, len: usize) -> Span {
        let place = |rows: usize| u32::try_from(rows).unwrap_or(u32::MAX);
        let first = place(self.at);
        self.at += len;
        Span {
            first,
            len: place(len),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small numbers by chance"
    )]

    use super::*;
    use crate::builtin::Random;

    /// The rows of a pair hold its number and the tick in which they were made.
    #[test]
    fn a_message_is_the_same_whether_its_rows_are_kept_or_made() {
        let mut random = Random::new(8);
        let (mut kept, mut out) = (Kept::default(), Vec::new());
        // Number of the pair, its rows, when they were made, and where they are.
        let mut pairs: Vec<(u64, usize, u64, Span)> = Vec::new();
        for tick in 0..2000 {
            let quiet = random.unit() < 0.3;
            pairs.retain(|_| quiet || random.unit() < 0.95);
            while !quiet && random.unit() < 0.6 {
                let number = (random.unit() * 1e6) as u64;
                let at = pairs.partition_point(|pair| pair.0 < number);
                pairs.insert(at, (number, 0, 0, Span::default()));
            }
            kept.begin();
            for (number, rows, made, span) in &mut pairs {
                if *made == 0 || random.unit() < 0.05 {
                    *rows = if random.unit() < 0.7 {
                        2
                    } else {
                        (random.unit() * 4.0) as usize
                    };
                    *made = tick + 1;
                    let row = (*number, *made);
                    let copies = *rows;
                    *span = kept.make(|out| out.extend((0..copies).map(|_| row)));
                } else {
                    *span = kept.keep(*span);
                    assert_eq!(span.len as usize, *rows);
                }
            }
            kept.finish(&mut out);
            let wanted: Vec<(u64, u64)> = pairs
                .iter()
                .flat_map(|(number, rows, made, _)| vec![(*number, *made); *rows])
                .collect();
            assert_eq!(out, wanted, "tick {tick}");
        }
    }
}
