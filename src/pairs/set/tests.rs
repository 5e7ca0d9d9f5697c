//! Compares the set with a plain list of its pairs, for any sequence of operations.

use super::*;

fn key(a: u32, b: u32) -> PairKey {
    PairKey::new(BodySlot(a), BodySlot(b))
}

#[test]
fn a_slot_freed_in_a_tick_is_not_reused_before_the_next() {
    let mut set = PairSet::new(10);
    let first = set.insert(key(1, 2)).unwrap();
    assert_eq!(set.remove(first), Some(key(1, 2)));
    let second = set.insert(key(1, 2)).unwrap();
    assert_ne!(first, second);
    set.open_tick();
    assert_eq!(set.insert(key(3, 2)), Some(first));
    assert_eq!(set.get(first), Some(key(2, 3)));
    set.validate().unwrap();
}

#[test]
fn the_pairs_of_a_body_are_found_whatever_was_removed_between() {
    let mut set = PairSet::new(100);
    set.list(usize::MAX);
    let slots: Vec<_> = (1..9).map(|b| set.insert(key(0, b)).unwrap()).collect();
    set.insert(key(5, 6)).unwrap();
    for at in [0, 3, 7, 4] {
        set.remove(slots[at]);
        set.validate().unwrap();
    }
    let left: Vec<u32> = set.partners(BodySlot(0)).map(|(_, b)| b.0).collect();
    assert_eq!(left, [7, 6, 3, 2]);
    assert!(set.find(key(6, 5)).is_some() && set.find(key(0, 5)).is_none());
    assert_eq!(set.remove(slots[0]), None);
    assert_eq!(set.get(PairSlot(99)), None);
}

#[test]
fn a_full_set_takes_no_pair_and_marks_both_bodies() {
    let mut set = PairSet::new(1);
    assert!(set.insert(key(0, 1)).is_some());
    assert!(set.insert(key(0, 2)).is_none());
    set.miss(key(0, 2));
    assert!(set.is_truncated(BodySlot(0)) && set.is_truncated(BodySlot(2)));
    assert!(!set.is_truncated(BodySlot(1)) && !set.is_truncated(BodySlot(77)));
    assert_eq!((set.missing(), set.truncated().len()), (1, 2));
    set.forget_missing();
    assert_eq!((set.missing(), set.truncated().len()), (0, 0));
    set.validate().unwrap();
}

/// Lists are kept from the first lookup until more pairs have come and gone than there are.
#[test]
fn the_pairs_of_a_body_are_the_same_whether_lists_are_kept_or_not() {
    let mut set = PairSet::new(100);
    let mut stored = std::collections::BTreeMap::new();
    let mut state = 5_u32;
    let mut next = |below: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) % below
    };
    let (mut kept, mut made, mut full) = (0, 0, 0);
    for round in 0..400 {
        set.open_tick();
        set.forget_missing();
        let was_kept = set.lists.is_kept();
        if round % 7 == 0 {
            set.list(9);
            made += u32::from(!was_kept && set.lists.is_kept());
        }
        let some = 1 + next(if round % 50 < 25 { 4 } else { 90 });
        let mut keys: Vec<PairKey> = (0..some)
            .map(|_| {
                let low = next(30);
                key(low, low + 1 + next(9))
            })
            .collect();
        keys.sort_unstable();
        keys.dedup();
        // Pairs whose lower body is even stay; pairs whose higher body is a multiple of three do not begin.
        let goes = |key: PairKey| key.slots().0.0 % 2 == 1;
        let begins = |key: PairKey| !key.slots().1.0.is_multiple_of(3);
        let mut ended = Vec::new();
        set.part(&keys, goes, &mut ended);
        for Ended { slot, key, cause } in ended {
            assert!(goes(key) && keys.contains(&key) && cause == EndCause::Separated);
            assert_eq!(stored.remove(&key), Some(slot));
        }
        assert!(
            !keys
                .iter()
                .any(|key| goes(*key) && stored.contains_key(key))
        );
        let mut began = Vec::new();
        set.insert_all(&keys, begins, &mut began);
        for slot in began {
            let key = set.get(slot).unwrap();
            assert!(begins(key) && keys.contains(&key));
            assert_eq!(stored.insert(key, slot), None);
        }
        let wanted = keys.iter().filter(|key| begins(**key));
        let left = wanted.filter(|key| !stored.contains_key(key)).count();
        assert_eq!(set.missing(), left as u64);
        full += left;
        if let Some(single) = stored.keys().next().copied().filter(|_| round % 3 == 0) {
            let slot = stored.remove(&single).unwrap();
            assert_eq!(set.remove(slot), Some(single));
        }
        set.validate().unwrap();
        kept += u32::from(set.lists.is_kept());
        assert_eq!(set.len(), stored.len());
        for body in (0..40).map(BodySlot) {
            let has = |key: &PairKey| key.slots().0 == body || key.slots().1 == body;
            let mut wanted: Vec<PairSlot> = stored
                .iter()
                .filter(|(key, _)| has(key))
                .map(|(_, slot)| *slot)
                .collect();
            let mut got: Vec<PairSlot> = set.pairs_of(body).collect();
            wanted.sort_unstable();
            got.sort_unstable();
            assert_eq!(got, wanted, "round {round}, {body:?}");
        }
    }
    assert!((50..350).contains(&kept) && made > 5, "{kept} {made}");
    assert!(full > 0, "it was never full");
}
