//! A message that stays from tick to tick: rows that have nothing new to say are left where they are, or moved.
//!
//! In: for each pair in order, where its rows stood in the message of the last tick and whether they still hold. Out:
//! the message of this tick. While nothing came or went, rows stay or are rewritten in place; from the first that did,
//! the message is put together from the old one, in runs as long as they go.

use std::ops::Range;

/// How far a message has been gone through.
#[derive(Debug)]
pub(super) struct Kept<T> {
    /// Rows that are settled.
    at: usize,
    /// The message of the last tick, once a row had to move.
    old: Vec<T>,
    moved: bool,
    /// Of the old message: what comes next in the new one, and is not there yet.
    run: Range<usize>,
    /// Rows of one pair, while they are made.
    made: Vec<T>,
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
            old: Vec::new(),
            moved: false,
            run: 0..0,
            made: Vec::new(),
        }
    }
}

impl<T: Copy> Kept<T> {
    /// Starts at the top of the message.
    pub(super) fn begin(&mut self) {
        (self.at, self.moved, self.run) = (0, false, 0..0);
    }

    /// The next rows are those that stood at `was` in the last tick; spans come in the order in which they stood.
    ///
    /// * returns - where they stand now.
    pub(super) fn keep(&mut self, out: &mut Vec<T>, was: Span) -> Span {
        let (first, len) = (was.first as usize, was.len as usize);
        if !self.moved && len > 0 && first != self.at {
            self.part(out);
        }
        if self.moved {
            if self.run.end != first {
                self.copy_run(out);
                self.run = first..first;
            }
            self.run.end += len;
        }
        self.span(len)
    }

    /// The next rows are made now, by `make`, which appends them; they take the place of those at `was`.
    ///
    /// * returns - where they stand.
    pub(super) fn make(
        &mut self,
        out: &mut Vec<T>,
        was: Span,
        make: impl FnOnce(&mut Vec<T>),
    ) -> Span {
        if !self.moved {
            self.made.clear();
            make(&mut self.made);
            let there = was.first as usize == self.at && was.len as usize == self.made.len();
            if there && let Some(rows) = out.get_mut(self.at..self.at + self.made.len()) {
                rows.copy_from_slice(&self.made);
            } else if was.len > 0 || !self.made.is_empty() {
                self.part(out);
                out.extend_from_slice(&self.made);
            }
            return self.span(self.made.len());
        }
        self.copy_run(out);
        let before = out.len();
        make(out);
        self.span(out.len() - before)
    }

    /// Ends the message: what stood behind its last row is gone.
    pub(super) fn finish(&mut self, out: &mut Vec<T>) {
        self.copy_run(out);
        out.truncate(self.at);
        // In which tick rows have to move is not known: room for all is made when they are more than ever.
        self.old.clear();
        self.old.reserve(out.len());
    }

    /// Rows have to move: starts the message again, with those that are settled.
    fn part(&mut self, out: &mut Vec<T>) {
        std::mem::swap(out, &mut self.old);
        out.clear();
        out.extend_from_slice(self.old.get(..self.at).unwrap_or_default());
        (self.moved, self.run) = (true, 0..0);
    }

    fn copy_run(&mut self, out: &mut Vec<T>) {
        let run = std::mem::replace(&mut self.run, 0..0);
        out.extend_from_slice(self.old.get(run).unwrap_or_default());
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

    /// A pair's rows hold its number and in which tick they were made.
    #[test]
    fn a_message_is_the_same_whether_its_rows_are_kept_or_made() {
        let mut random = Random::new(8);
        let (mut kept, mut out) = (Kept::default(), Vec::new());
        // Number of the pair, its rows, when they were made, and where they stand.
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
                    *span = kept.make(&mut out, *span, |out| out.extend((0..copies).map(|_| row)));
                } else {
                    *span = kept.keep(&mut out, *span);
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
