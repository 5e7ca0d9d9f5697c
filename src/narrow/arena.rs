//! Memory of many owners in one place, so that a tick at constant scene allocates nothing and released memory serves
//! the other owners.
//!
//! It grows by chunks, each as large as all earlier ones together, and no item moves: a single vector that doubles
//! copied some megabytes now and then, a millisecond in which no deadline is checked.

use crate::ids::small;
use crate::time::Meter;

/// Items of the smallest block.
const BLOCK_MIN: usize = 4;
/// Sizes of blocks: each is twice the one before.
const CLASSES: usize = 24;
/// Items of the first chunk.
const CHUNK_MIN: usize = 256;
/// The low bits of a place in the arena, this many, are the item's place in its chunk; the bits above name the chunk.
const PLACE_BITS: u32 = 26;
const CHUNK_MAX: usize = 1 << PLACE_BITS;
/// Bytes that the operating system gives at once.
const PAGE: usize = 4096;
/// Most pages touched ahead of their use: fewer, and the end of a tick meets untouched ones; more, and memory is taken
/// that may never be used.
const PAGES_AHEAD: usize = 8;
/// Most pages that one call of [`Arena::touch_ahead`] touches.
const PAGES_AT_ONCE: usize = 2;
/// A page is touched only if this much time is left, nanoseconds: it takes up to 30 us on a virtual machine.
const PAGE_NS: u64 = 40_000;
/// No block.
const NONE: u32 = u32::MAX;

/// An item of an arena; in a free block the first item links to the next free block.
pub(super) trait Linked: Copy {
    /// The same item with a link in it.
    #[must_use]
    fn linked(self, next: u32) -> Self;
    /// The stored link.
    fn next(&self) -> u32;
}

/// The items of one owner: a place in an [`Arena`]. Dropping it without a release leaks its block.
#[derive(Debug, Default)]
pub(super) struct Run {
    at: u32,
    len: u32,
    /// Items that its block can hold; 0: it has none.
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

    /// Its chunk, and the range in it.
    fn range(&self) -> (usize, std::ops::Range<usize>) {
        let (chunk, at) = split(self.at);
        (chunk, at..at + self.len as usize)
    }
}

/// Blocks of 4, 8, 16, ... items in chunks; chunks are only ever added, up to a limit.
///
/// A released block serves the next owner, whole or split; blocks are not merged, so the memory is at most the sum of
/// the peaks of each size.
#[derive(Debug)]
pub(super) struct Arena<T> {
    /// Each allocated with its final capacity.
    chunks: Vec<Vec<T>>,
    /// Items of all blocks.
    len: usize,
    /// End of the memory of the last chunk that was touched ahead, in items.
    touched: usize,
    /// The first free block of each size.
    free: [u32; CLASSES],
    most: usize,
}

impl<T> Default for Arena<T> {
    /// Without a limit.
    fn default() -> Self {
        Self {
            chunks: Vec::new(),
            len: 0,
            touched: 0,
            free: [NONE; CLASSES],
            most: NONE as usize,
        }
    }
}

impl<T: Linked> Arena<T> {
    /// At most this many items of all owners together, free blocks included.
    pub(super) fn new(most: usize) -> Self {
        Self {
            most: most.min(NONE as usize),
            ..Self::default()
        }
    }

    /// Bytes of all blocks, free ones included.
    pub(super) fn bytes(&self) -> usize {
        self.len * size_of::<T>()
    }

    pub(super) fn all(&self, run: &Run) -> &[T] {
        let (chunk, range) = run.range();
        self.chunks.get(chunk).map_or(&[], |items| &items[range])
    }

    pub(super) fn all_mut(&mut self, run: &Run) -> &mut [T] {
        let (chunk, range) = run.range();
        (self.chunks.get_mut(chunk)).map_or(&mut [], |items| &mut items[range])
    }

    /// Appends an item; returns false, and changes nothing, if there is no room.
    pub(super) fn push(&mut self, run: &mut Run, item: T) -> bool {
        if run.len == run.room && !self.grow(run, item) {
            return false;
        }
        *self.item_mut(run.at + run.len) = item;
        run.len += 1;
        true
    }

    pub(super) fn pop(&mut self, run: &mut Run) -> Option<T> {
        run.len = run.len.checked_sub(1)?;
        Some(*self.item_mut(run.at + run.len))
    }

    /// Removes an item; the last one takes its place.
    pub(super) fn swap_remove(&mut self, run: &mut Run, at: usize) -> Option<T> {
        let last = self.pop(run)?;
        let hole = self.all_mut(run).get_mut(at);
        Some(hole.map_or(last, |hole| std::mem::replace(hole, last)))
    }

    /// Releases the block.
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
        let ((from, range), (to, first)) = (run.range(), split(at));
        if from == to {
            self.chunks[to].copy_within(range, first);
        } else if let Ok([from, to]) = self.chunks.get_disjoint_mut([from, to]) {
            to[first..first + range.len()].copy_from_slice(&from[range]);
        }
        let moved = Run {
            at,
            len: run.len,
            room: small(room),
        };
        self.release(run);
        *run = moved;
        true
    }

    /// A block: a free one, half of a larger one, or a new one.
    fn take(&mut self, class: usize, filler: T) -> Option<u32> {
        let larger = (class..CLASSES).find(|&c| self.free[c] != NONE);
        let Some(larger) = larger else {
            return self.add_block(class, filler);
        };
        let at = self.free[larger];
        self.free[larger] = self.item_mut(at).next();
        for half in class..larger {
            let rest = at + small(BLOCK_MIN << half);
            self.give(rest, half);
        }
        Some(at)
    }

    /// A block from unused memory: behind the others of a chunk, or in a new chunk.
    fn add_block(&mut self, class: usize, filler: T) -> Option<u32> {
        let room = BLOCK_MIN << class;
        if class >= CLASSES || self.len + room > self.most {
            return None;
        }
        let has_room = |items: &Vec<T>| items.capacity().min(CHUNK_MAX) - items.len() >= room;
        let chunk = match self.chunks.iter().rposition(has_room) {
            Some(chunk) => chunk,
            None if self.chunks.len() < (NONE >> PLACE_BITS) as usize => {
                let all = self.len.clamp(CHUNK_MIN, CHUNK_MAX);
                self.chunks.push(Vec::with_capacity(all.max(room)));
                self.touched = 0;
                self.chunks.len() - 1
            }
            None => return None,
        };
        let items = &mut self.chunks[chunk];
        let at = items.len();
        items.resize(at + room, filler);
        self.len += room;
        Some(small(chunk) << PLACE_BITS | small(at))
    }

    /// Touches the memory of the next blocks, a little at a time and only if there is time, so that the operating
    /// system provides it now: that takes 1 us a page, on a virtual machine up to 30, and must not happen at the end of
    /// a tick.
    pub(super) fn touch_ahead(&mut self, meter: &mut Meter<'_>) {
        let Some(items) = self.chunks.last_mut() else {
            return;
        };
        let Some(&filler) = items.first() else {
            return;
        };
        let (len, page) = (items.len(), (PAGE / size_of::<T>()).max(1));
        let end = (len + PAGES_AHEAD * page).min(items.capacity());
        let first = self.touched.max(len);
        for at in (first..end).step_by(page).take(PAGES_AT_ONCE) {
            if !meter.has_ns(PAGE_NS) {
                return;
            }
            items.spare_capacity_mut()[at - len].write(filler);
            self.touched = at + page;
            meter.refresh();
        }
    }

    fn give(&mut self, at: u32, class: usize) {
        let next = self.free[class];
        let first = self.item_mut(at);
        *first = first.linked(next);
        self.free[class] = at;
    }

    /// The item at a place of a block.
    fn item_mut(&mut self, at: u32) -> &mut T {
        let (chunk, at) = split(at);
        &mut self.chunks[chunk][at]
    }
}

impl<T: Linked + Ord> Arena<T> {
    /// The greatest item of a run that is a heap.
    pub(super) fn peek(&self, run: &Run) -> Option<&T> {
        self.all(run).first()
    }

    /// Adds an item to a run that is a heap; false if there is no room.
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

    /// Removes the greatest item of a run that is a heap.
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
            // Branch-free: which of the two is greater is practically random.
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

/// The chunk that a place names, and the index in it.
fn split(at: u32) -> (usize, usize) {
    ((at >> PLACE_BITS) as usize, at as usize % CHUNK_MAX)
}

/// The class of a block of `room` items; `room` is [`BLOCK_MIN`] times a power of two.
fn class_of(room: usize) -> usize {
    (room / BLOCK_MIN).trailing_zeros() as usize
}

mod validate;

#[cfg(test)]
mod tests;
