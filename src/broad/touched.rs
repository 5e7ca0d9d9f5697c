//! What a change of a body implies without any list: which of its stored pairs end, and which forced pairs and pairs
//! with unbounded bodies it gets. Used by every method that tests only what changed.

use super::Proxies;
use super::commit::{Found, Judge};
use super::members::{ASKED, IN, MOVED, REFILTERED, UNBOUNDED};
use crate::ids::{BodySlot, PairKey};
use crate::pairs::{PairPolicy, PairSet};

/// Ends the pairs of moved and queried bodies whose boxes parted or whose filters changed.
///
/// Cost: the stored pairs of those bodies.
pub(super) fn end(
    judge: &Judge<'_, impl Proxies, impl PairPolicy>,
    pairs: &mut PairSet,
    found: &mut Found,
) {
    let members = judge.members;
    let looks = |slot: &BodySlot| members.has(*slot, MOVED | REFILTERED);
    pairs.list(members.touched().iter().filter(|slot| looks(slot)).count());
    let mut doomed = std::mem::take(&mut found.doomed);
    for slot in members.touched().iter().filter(|slot| looks(slot)) {
        let mine = members.has(*slot, REFILTERED);
        for (pair, other) in pairs.partners(*slot) {
            // If both bodies are to be tested, the one with the lower slot does it.
            if other < *slot && looks(&other) {
                continue;
            }
            let refiltered = mine || members.has(other, REFILTERED);
            if let Some(cause) = judge.ends(PairKey::new(*slot, other), refiltered) {
                doomed.push((pair, cause));
            }
        }
    }
    for key in judge.forced.changed() {
        let stored = pairs.find(*key);
        doomed.extend(stored.and_then(|pair| Some((pair, judge.ends(*key, false)?))));
    }
    for (pair, cause) in doomed.drain(..) {
        found.end(pair, cause, members, pairs);
    }
    found.doomed = doomed;
}

/// Suggests the pairs that do not depend on boxes: forced ones and those of unbounded bodies.
pub(super) fn begin(judge: &Judge<'_, impl Proxies, impl PairPolicy>, found: &mut Found) {
    let members = judge.members;
    found.maybe.extend_from_slice(judge.forced.changed());
    for slot in members.touched() {
        if !members.has(*slot, ASKED) || !members.has(*slot, IN) {
            continue;
        }
        found.maybe.extend(judge.forced.of(*slot));
        let key = |other: &BodySlot| PairKey::new(*slot, *other);
        if !members.has(*slot, UNBOUNDED) {
            found.maybe.extend(members.unbounded().iter().map(key));
            continue;
        }
        found.maybe.extend(members.bounded().iter().map(key));
        let others = members.unbounded().iter().filter(|other| *other != slot);
        let keys = others.map(key).filter(|key| judge.may_be(*key));
        found.maybe.extend(keys);
    }
}
