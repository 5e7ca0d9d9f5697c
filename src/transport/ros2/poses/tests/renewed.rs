//! Updates that are repeated without a change.

use super::*;

/// A source whose body has a chain with a loop, or a link with a zero quaternion.
fn broken(zero: bool) -> Source {
    let mut one = tf("a");
    let mut message = link("world", "a", 2 * MS);
    if zero {
        message.transforms[0].transform.rotation = [0.0; 4].into();
    } else {
        one.take_links(&link("b", "a", MS), false, at(MS));
        message = link("a", "b", MS);
    }
    one.take_links(&message, false, at(2 * MS));
    one
}

#[test]
fn bug_a_refusal_that_was_said_where_the_process_had_stood_still_was_never_said_again() {
    for (zero, reason) in [
        (false, RejectReason::BadChain),
        (true, RejectReason::BadQuaternion),
    ] {
        let mut one = broken(zero);
        let mut updates = Vec::new();
        let waited = Receipt {
            waited: true,
            ..at(2 * MS)
        };
        one.look(waited, &mut updates);
        assert!(updates[0].waited && updates[0].result == Err(reason));
        assert!(look(&mut one, 100 * MS).is_empty());
        let said = look(&mut one, 200 * MS);
        assert!(!said[0].waited && said[0].result == Err(reason));
        assert!(look(&mut one, 300 * MS).is_empty());
    }
}

#[test]
fn a_chain_that_ends_is_never_said() {
    let mut one = tf("tool");
    one.take_links(&link("base", "tool", MS), false, at(MS));
    for now_ms in [1, 200, 400] {
        assert!(look(&mut one, now_ms * MS).is_empty());
    }
}

#[test]
fn bug_a_body_on_fixed_links_was_unknown_for_long_once_it_was_let_go_or_reset() {
    let mut one = tf("tool");
    one.timeout_ns = 30_000 * MS;
    one.take_links(&link("world", "tool", 0), true, at(MS));
    assert_eq!(look(&mut one, MS).len(), 1);
    assert!(look(&mut one, 2 * MS).is_empty());
    // Nothing tells the node of a reset: the pose is repeated soon enough.
    assert!(look(&mut one, 500 * MS).is_empty());
    assert_eq!(look(&mut one, 501 * MS).len(), 1);
    one.hang_body("a", true).unwrap();
    assert!(look(&mut one, 502 * MS).is_empty());
    one.hang_body("a", false).unwrap();
    assert_eq!(look(&mut one, 503 * MS).len(), 1);
    // A pose of links that change is not repeated: it may be old.
    let mut one = tf("base");
    one.take_links(&link("world", "base", MS), false, at(510 * MS));
    assert_eq!(look(&mut one, 510 * MS).len(), 1);
    one.hang_body("a", true).unwrap();
    one.hang_body("a", false).unwrap();
    assert!(look(&mut one, 511 * MS).is_empty());
}
