//! Memory of many owners in one place, so that a tick at constant scene allocates nothing and what one gave back serves
//! the others.

/// Items of the smallest block.
const BLOCK_MIN: usize = 4;
/// Sizes of blocks: each is twice the one before.
const CLASSES: usize = 24;
/// No block.
const NONE: u32 = u32::MAX;

/// An item of an arena; in a free block the first one says where the next free block is.
pub(super) trait Linked: Copy {
    /// The same with a link in it.
    #[must_use]
    fn linked(self, next: u32) -> Self;
    /// The link put in.
    fn next(&self) -> u32;
}

/// The items of one owner: a place in an [`Arena`]. To forget it leaks its block.
#[derive(Debug, Default)]
pub(super) struct Run {
    at: u32,
    len: u32,
    /// Items its block holds; 0: it has none.
    room: u32,
}

impl Run {
    pub(super) fn len(&self) -> usize {
        self.len as usize
    }

    pub(super) fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Forgets the items and keeps the block.
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    fn range(&self) -> std::ops::Range<usize> {
        let at = self.at as usize;
        at..at + self.len as usize
    }
}

/// Blocks of 4, 8, 16, ... items in one vector that only ever grows, up to a limit.
///
/// A block that is given back serves the next owner, whole or split; blocks are not merged, so the vector is at most
/// the sum of what was ever in use at once of each size.
#[derive(Debug)]
pub(super) struct Arena<T> {
    items: Vec<T>,
    /// The first free block of each size.
    free: [u32; CLASSES],
    most: usize,
}

impl<T> Default for Arena<T> {
    /// Without a limit of its own.
    fn default() -> Self {
        Self {
            items: Vec::new(),
            free: [NONE; CLASSES],
            most: NONE as usize,
        }
    }
}

impl<T: Linked> Arena<T> {
    /// At most so many items of all owners together, free blocks included.
    pub(super) fn new(most: usize) -> Self {
        Self {
            most: most.min(NONE as usize),
            ..Self::default()
        }
    }

    /// Bytes of all blocks, free ones included.
    pub(super) fn bytes(&self) -> usize {
        self.items.len() * size_of::<T>()
    }

    pub(super) fn all(&self, run: &Run) -> &[T] {
        &self.items[run.range()]
    }

    pub(super) fn all_mut(&mut self, run: &Run) -> &mut [T] {
        &mut self.items[run.range()]
    }

    /// Appends an item; false, and nothing is changed, where there is no room.
    pub(super) fn push(&mut self, run: &mut Run, item: T) -> bool {
        if run.len == run.room && !self.grow(run, item) {
            return false;
        }
        self.items[(run.at + run.len) as usize] = item;
        run.len += 1;
        true
    }

    pub(super) fn pop(&mut self, run: &mut Run) -> Option<T> {
        run.len = run.len.checked_sub(1)?;
        Some(self.items[(run.at + run.len) as usize])
    }

    /// Takes an item out; the last one takes its place.
    pub(super) fn swap_remove(&mut self, run: &mut Run, at: usize) -> Option<T> {
        let last = self.pop(run)?;
        let hole = self.items[run.range()].get_mut(at);
        Some(hole.map_or(last, |hole| std::mem::replace(hole, last)))
    }

    /// Gives the block back.
    pub(super) fn release(&mut self, run: &mut Run) {
        if run.room > 0 {
            self.give(run.at, class_of(run.room as usize));
        }
        *run = Run::default();
    }

    /// Moves a run into a block of twice the size.
    fn grow(&mut self, run: &mut Run, filler: T) -> bool {
        let room = (2 * run.room as usize).max(BLOCK_MIN);
        let Some(at) = self.take(class_of(room), filler) else {
            return false;
        };
        self.items.copy_within(run.range(), at as usize);
        let moved = Run {
            at,
            len: run.len,
            room: u32::try_from(room).unwrap_or(NONE),
        };
        self.release(run);
        *run = moved;
        true
    }

    /// A block: a free one, half of a larger one, or a new one.
    fn take(&mut self, class: usize, filler: T) -> Option<u32> {
        let larger = (class..CLASSES).find(|&c| self.free[c] != NONE);
        let Some(larger) = larger else {
            let at = self.items.len();
            let end = at + (BLOCK_MIN << class);
            if class >= CLASSES || end > self.most {
                return None;
            }
            self.items.resize(end, filler);
            return u32::try_from(at).ok();
        };
        let at = self.free[larger];
        self.free[larger] = self.items[at as usize].next();
        for half in class..larger {
            let rest = at as usize + (BLOCK_MIN << half);
            self.give(u32::try_from(rest).unwrap_or(NONE), half);
        }
        Some(at)
    }

    fn give(&mut self, at: u32, class: usize) {
        let first = &mut self.items[at as usize];
        *first = first.linked(self.free[class]);
        self.free[class] = at;
    }
}

impl<T: Linked + Ord> Arena<T> {
    /// The greatest item of a run that is a heap.
    pub(super) fn peek(&self, run: &Run) -> Option<&T> {
        self.all(run).first()
    }

    /// Adds an item to a run that is a heap; false where there is no room.
    pub(super) fn push_heap(&mut self, run: &mut Run, item: T) -> bool {
        if !self.push(run, item) {
            return false;
        }
        let items = self.all_mut(run);
        let mut at = items.len() - 1;
        while at > 0 && items[(at - 1) / 2] < item {
            items[at] = items[(at - 1) / 2];
            at = (at - 1) / 2;
        }
        items[at] = item;
        true
    }

    /// Takes the greatest item off a run that is a heap.
    pub(super) fn pop_heap(&mut self, run: &mut Run) -> Option<T> {
        let last = self.pop(run)?;
        let items = self.all_mut(run);
        let Some(&top) = items.first() else {
            return Some(last);
        };
        let mut at = 0;
        loop {
            let mut child = 2 * at + 1;
            if child >= items.len() {
                break;
            }
            // Without a branch: which of the two is greater is as good as random.
            child += usize::from(child + 1 < items.len() && items[child] < items[child + 1]);
            if items[child] <= last {
                break;
            }
            items[at] = items[child];
            at = child;
        }
        items[at] = last;
        Some(top)
    }
}

/// Which size of block holds so many items; a power of two of [`BLOCK_MIN`].
fn class_of(room: usize) -> usize {
    (room / BLOCK_MIN).trailing_zeros() as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BinaryHeap;

    impl Linked for u32 {
        fn linked(self, next: u32) -> Self {
            next
        }

        fn next(&self) -> u32 {
            *self
        }
    }

    proptest! {
        /// Runs and heaps of the standard library side by side; most steps put in, some take out, few give back.
        #[test]
        fn runs_behave_as_heaps_of_their_own(
            steps in proptest::collection::vec((0..5_usize, 0..100_u32, 0..200_u32), 0..1500)
        ) {
            let mut arena = Arena::new(1 << 16);
            let mut runs: [(Run, BinaryHeap<u32>); 5] = Default::default();
            for (at, kind, item) in steps {
                let (run, twin) = &mut runs[at];
                match kind {
                    0 => {
                        arena.release(run);
                        twin.clear();
                    }
                    1..70 => {
                        prop_assert!(arena.push_heap(run, item));
                        twin.push(item);
                    }
                    _ => prop_assert_eq!(arena.pop_heap(run), twin.pop()),
                }
                prop_assert_eq!((arena.peek(run), run.len()), (twin.peek(), twin.len()));
            }
            for (mut run, mut twin) in runs {
                while let Some(item) = twin.pop() {
                    prop_assert_eq!(arena.pop_heap(&mut run), Some(item));
                }
                prop_assert!(run.is_empty());
            }
        }

        /// The same for vectors.
        #[test]
        fn runs_behave_as_vectors_of_their_own(
            steps in proptest::collection::vec((0..5_usize, 0..100_u32, 0..40_usize), 0..1500)
        ) {
            let mut arena = Arena::new(1 << 16);
            let mut runs: [(Run, Vec<u32>); 5] = Default::default();
            for (item, (at, kind, place)) in (0..).zip(steps) {
                let (run, twin) = &mut runs[at];
                match kind {
                    0 => {
                        arena.release(run);
                        twin.clear();
                    }
                    1 => {
                        run.clear();
                        twin.clear();
                    }
                    2..20 => prop_assert_eq!(arena.pop(run), twin.pop()),
                    20..30 => {
                        let there = (place < twin.len()).then(|| twin.swap_remove(place));
                        if there.is_some() {
                            prop_assert_eq!(arena.swap_remove(run, place), there);
                        }
                    }
                    _ => {
                        prop_assert!(arena.push(run, item));
                        twin.push(item);
                    }
                }
                prop_assert_eq!(arena.all(run), twin.as_slice());
            }
        }
    }

    #[test]
    fn a_full_arena_says_so_and_what_is_given_back_is_used_again() {
        let mut arena = Arena::new(64);
        let (mut one, mut other) = (Run::default(), Run::default());
        let mut count = 0;
        while arena.push(&mut one, count) {
            count += 1;
        }
        // Blocks of 4, 8, 16 and 32: the next would be one of 64.
        assert_eq!(count, 32);
        assert_eq!(arena.all(&one), (0..32).collect::<Vec<_>>());
        // Those that it grew out of are left to others, and then its own.
        (0..16).for_each(|k| assert!(arena.push(&mut other, k)));
        let before = arena.bytes();
        arena.release(&mut one);
        (16..32).for_each(|k| assert!(arena.push(&mut other, k)));
        assert_eq!(arena.bytes(), before);
        assert!(!arena.push(&mut other, 32));
        assert_eq!(arena.all(&other), (0..32).collect::<Vec<_>>());
    }
}
