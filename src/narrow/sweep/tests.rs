//! The structure check of sweeps: what is broken is found.

use super::*;

#[test]
fn what_is_broken_in_the_sweeps_is_found() {
    let sweeps = || {
        let mut all = Sweeps::default();
        let fresh =
            |slot| Sweep::fresh((PairSlot(slot), BodySlot(0), BodySlot(1)), Warm::default());
        all.list.extend([4, 2].map(fresh));
        all.places = vec![NONE, NONE, 1, NONE, 0];
        all
    };
    sweeps().validate().unwrap();
    let mut swapped = sweeps();
    swapped.list.swap(0, 1);
    assert!(
        swapped
            .validate()
            .unwrap_err()
            .contains("not where its pair says")
    );
    let mut more = sweeps();
    more.places[1] = 0;
    assert!(more.validate().unwrap_err().contains("3 pairs with one"));
}
