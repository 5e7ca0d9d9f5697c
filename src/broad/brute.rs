//! Brute force: every pair of bodies, every update. The reference that the other methods are tested against, and the
//! fastest method for a handful of bodies.

use super::Proxies;
use super::commit::{Found, Judge};
use super::members::{IN, UNBOUNDED};
use crate::ids::PairKey;
use crate::pairs::{PairPolicy, PairSet};
use crate::wire::EndCause;

/// Tests every pair and reads every box from the caller, so that it shares no shortcut with the other methods.
///
/// Cost: O(n^2 + k).
pub(super) fn update(
    judge: &Judge<'_, impl Proxies, impl PairPolicy>,
    pairs: &mut PairSet,
    found: &mut Found,
) {
    let (members, proxies, policy) = (judge.members, judge.proxies, judge.policy);
    let touches = |key: PairKey| {
        let (low, high) = key.slots();
        let without = [low, high].map(|slot| members.has(slot, UNBOUNDED));
        without.contains(&true)
            || judge.forced.has(key)
            || proxies.aabb(low).overlaps(proxies.aabb(high))
    };
    let mut slots = std::mem::take(&mut found.slots);
    slots.clear();
    slots.extend(pairs.iter().map(|(slot, _)| slot));
    for slot in slots.drain(..) {
        let Some(key) = pairs.get(slot) else { continue };
        let (low, high) = key.slots();
        debug_assert!(members.has(low, IN) && members.has(high, IN));
        let cause = if !policy.allows(low, high) {
            EndCause::Filtered
        } else if touches(key) || policy.keeps(low) || policy.keeps(high) {
            continue;
        } else {
            EndCause::Separated
        };
        found.end(slot, cause, members, pairs);
    }
    found.slots = slots;
    let all = || members.bounded().iter().chain(members.unbounded());
    for (at, a) in all().enumerate() {
        for b in all().skip(at + 1) {
            let key = PairKey::new(*a, *b);
            if touches(key) && judge.may_be(key) {
                found.began.push(key);
            }
        }
    }
}
