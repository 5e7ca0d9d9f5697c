//! The order in which an open list yields its pairs, compared with a plain queue that is searched.

use super::*;
use proptest::prelude::*;
use std::collections::VecDeque;

/// What a list of a search yields next: searched in all that was pushed and is still there, the oldest first.
fn next_of(search: Search, all: &mut VecDeque<Open>) -> Option<Open> {
    match search {
        Search::BreadthFirst => all.pop_front(),
        Search::Carried | Search::Restart => all.pop_back(),
        Search::Priority => {
            let mut sorted: Vec<(usize, &Open)> = all.iter().enumerate().collect();
            sorted.sort_by(|(_, x), (_, y)| {
                (x.low.total_cmp(&y.low)).then((x.a.0, x.b.0).cmp(&(y.a.0, y.b.0)))
            });
            let at = sorted.first()?.0;
            all.remove(at)
        }
    }
}

/// Depth and boxes, bit for bit: `Open` compares as the heap does.
fn bits(open: Open) -> (u64, u32, u32) {
    (open.low.to_bits(), open.a.0, open.b.0)
}

proptest! {
    /// Lists of every search order in one arena; few depths, so that there are many ties.
    #[test]
    fn an_open_list_yields_in_the_order_of_its_search(
        steps in proptest::collection::vec((0..4_usize, 0..100_u32, 0..12_u32, 0..6_u32), 0..1500)
    ) {
        let mut arena = Arena::new(1 << 16);
        let searches = [0, 1, 2, 3].map(|at: usize| Search::NAMED[at].0);
        let mut lists = searches.map(|search| {
            let mut list = OpenList::default();
            list.clear(search);
            (list, VecDeque::new())
        });
        for (step, (at, kind, depth, a)) in (0..).zip(steps) {
            let ((list, twin), search) = (&mut lists[at], searches[at]);
            match kind {
                0 => list.clear(search),
                1 => list.release(&mut arena),
                2..45 => {
                    let wanted = next_of(search, twin);
                    prop_assert_eq!(list.pop(&mut arena).map(bits), wanted.map(bits));
                }
                _ => {
                    let open = Open { low: -0.25 * f64::from(depth), a: BoxId(a), b: BoxId(step) };
                    prop_assert!(list.push(&mut arena, open));
                    twin.push_back(open);
                }
            }
            if kind < 2 {
                twin.clear();
            }
            let held = |mut all: Vec<Open>| {
                all.sort_by_key(|open| bits(*open));
                all.into_iter().map(bits).collect::<Vec<_>>()
            };
            prop_assert_eq!(held(list.all(&arena).to_vec()), held(twin.iter().copied().collect()));
            prop_assert_eq!((list.len(), list.is_empty()), (twin.len(), twin.is_empty()));
        }
        for ((list, twin), search) in lists.iter_mut().zip(searches) {
            while let Some(wanted) = next_of(search, twin) {
                prop_assert_eq!(list.pop(&mut arena).map(bits), Some(bits(wanted)));
            }
            prop_assert!(list.pop(&mut arena).is_none() && list.is_empty());
        }
    }
}

#[test]
fn what_is_broken_in_an_open_list_is_found() {
    for &(search, name) in Search::NAMED {
        let (mut arena, mut list) = (Arena::new(1 << 10), OpenList::default());
        list.clear(search);
        for at in 0..9 {
            let low = -f64::from(at * 7 % 5);
            assert!(list.push(
                &mut arena,
                Open {
                    low,
                    a: BoxId(at),
                    b: BoxId(at)
                }
            ));
        }
        list.pop(&mut arena);
        list.validate(&arena).unwrap();
        let head = list.head;
        list.head = 9;
        assert!(
            list.validate(&arena).unwrap_err().contains("head"),
            "{name}"
        );
        list.head = head;
        arena.all_mut(&list.items)[0].low = 1.0;
        assert_eq!(
            list.validate(&arena).is_err(),
            search == Search::Priority,
            "{name}"
        );
    }
}
