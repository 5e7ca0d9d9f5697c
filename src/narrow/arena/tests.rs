//! Runs and heaps compared with the standard library; growth, limits, and memory touched ahead.

use super::*;
use crate::time::ManualClock;
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
    /// Next to heaps of the standard library; most steps add items, some remove, few release.
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
            prop_assert_eq!(arena.validate_heap(run), Ok(()));
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
            prop_assert_eq!(arena.validate(&runs.each_ref().map(|(run, _)| run)), Ok(()));
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
    // The blocks that it grew out of are reused by others, and then its own.
    (0..16).for_each(|k| assert!(arena.push(&mut other, k)));
    let before = arena.bytes();
    arena.release(&mut one);
    (16..32).for_each(|k| assert!(arena.push(&mut other, k)));
    assert_eq!(arena.bytes(), before);
    assert!(!arena.push(&mut other, 32));
    assert_eq!(arena.all(&other), (0..32).collect::<Vec<_>>());
}

#[test]
fn growth_moves_the_items_of_the_run_that_grows_alone() {
    let mut arena = Arena::new(1 << 16);
    let (mut one, mut other) = (Run::default(), Run::default());
    (0..8).for_each(|k| assert!(arena.push(&mut one, k)));
    let place = arena.all(&one).as_ptr();
    (0..10_000).for_each(|k| assert!(arena.push(&mut other, k)));
    assert!(std::ptr::eq(place, arena.all(&one).as_ptr()));
    assert_eq!(arena.all(&one), (0..8).collect::<Vec<_>>());
    assert_eq!(arena.all(&other), (0..10_000).collect::<Vec<_>>());
    assert!(arena.chunks.len() > 2);
}

#[test]
fn memory_is_touched_ahead_a_little_at_a_time_and_nothing_is_in_it() {
    let clock = ManualClock::new(0);
    let mut meter = Meter::unlimited(&clock);
    let mut arena = Arena::new(1 << 20);
    arena.touch_ahead(&mut meter);
    let mut runs: Vec<Run> = (0..10_000).map(|_| Run::default()).collect();
    for (item, run) in (0..).zip(&mut runs) {
        assert!(arena.push(run, item));
    }
    let bytes = arena.bytes();
    let last = arena
        .chunks
        .last()
        .map(|items| (items.len(), items.capacity()));
    let (len, room) = last.unwrap_or_default();
    let page = PAGE / size_of::<u32>();
    assert!(room > len + PAGES_AHEAD * page);
    let mut short = Meter::new(&clock, Some(PAGE_NS), None);
    arena.touch_ahead(&mut short);
    assert!(arena.touched <= len, "there was no time for it");
    for calls in 1..=PAGES_AHEAD {
        arena.touch_ahead(&mut meter);
        let touched = arena.touched - len;
        assert_eq!(touched, (calls * PAGES_AT_ONCE).min(PAGES_AHEAD) * page);
    }
    assert_eq!(arena.bytes(), bytes);
    for (item, run) in (0..).zip(&runs) {
        assert_eq!(arena.all(run), [item]);
    }
}

/// Three runs that have grown, a released one between them, and an empty one.
fn grown() -> (Arena<u32>, [Run; 4]) {
    let mut arena = Arena::new(1 << 10);
    let mut runs: [Run; 4] = Default::default();
    for item in 0..80 {
        assert!(arena.push_heap(&mut runs[item % 4], small(item)));
    }
    let [mut gone, a, b, c] = runs;
    arena.release(&mut gone);
    (arena, [a, b, c, Run::default()])
}

/// A fault to introduce, and the message expected for it.
type Fault = (&'static str, fn(&mut Arena<u32>, &mut [Run; 4]));

const FAULTS: [Fault; 9] = [
    ("is lost, or two overlap", |_, runs| {
        runs[0] = Run::default()
    }),
    ("is lost, or two overlap", |arena, _| arena.free[0] = NONE),
    ("is lost, or two overlap", |_, runs| runs[1].at += 4),
    ("items in a block of", |_, runs| {
        runs[2].len = runs[2].room + 1
    }),
    ("is lost, or two overlap", |_, runs| {
        let Run { at, len, room } = runs[0];
        runs[3] = Run { at, len, room };
    }),
    ("is there twice, or in no chunk", |_, runs| {
        let at = 3 << PLACE_BITS;
        runs[3] = Run {
            at,
            len: 0,
            room: 4,
        };
    }),
    ("go round in a circle", |arena, _| {
        let first = arena.free[0];
        *arena.item_mut(first) = first;
    }),
    ("is in no chunk", |arena, _| arena.free[2] = 1 << PLACE_BITS),
    ("counted", |arena, _| arena.len += 4),
];

#[test]
fn what_is_broken_in_an_arena_is_found() {
    for (told, fault) in FAULTS {
        let (mut arena, mut runs) = grown();
        arena.validate(&runs.each_ref()).unwrap();
        fault(&mut arena, &mut runs);
        let why = arena.validate(&runs.each_ref()).unwrap_err();
        assert!(why.contains(told), "{why}, not {told}");
    }
    let (mut arena, runs) = grown();
    arena.validate_heap(&runs[0]).unwrap();
    arena.all_mut(&runs[0]).swap(0, 1);
    assert!(
        arena
            .validate_heap(&runs[0])
            .unwrap_err()
            .contains("item 1 of a heap")
    );
}
