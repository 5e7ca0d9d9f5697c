//! The list of pair rules while a request edits it.
//!
//! In: the old list, and edits in order. Out: the new list. Each edit costs one search, so a request may hold any
//! number of edits.

use std::collections::BTreeMap;

use super::rules::ignores;
use crate::scene::PairRule;

/// Two rules with equal keys are the same: sides in a fixed order, which one is `a`, action, reason, distance. The
/// sides come first, so that the rules of two sides are adjacent.
type Key<'a> = (&'a str, &'a str, bool, bool, &'a str, Option<u64>);

/// A list of rules without duplicates: the earlier of two equal rules has no effect.
#[derive(Debug, Default)]
pub(super) struct RuleDraft<'a> {
    /// The rules in order; `None`: removed. The last entry is never `None`.
    list: Vec<Option<&'a PairRule>>,
    places: BTreeMap<Key<'a>, usize>,
}

impl<'a> RuleDraft<'a> {
    pub(super) fn of(rules: &'a [PairRule]) -> Self {
        let mut draft = Self::default();
        for rule in rules {
            draft.add(rule);
        }
        draft
    }

    pub(super) fn len(&self) -> usize {
        self.places.len()
    }

    /// Adds a rule at the end; returns whether it was not the last one already.
    pub(super) fn add(&mut self, rule: &'a PairRule) -> bool {
        let next = self.list.len();
        let old = self.places.insert(key(rule), next);
        if let Some(old) = old.filter(|old| old + 1 == next) {
            self.places.insert(key(rule), old);
            return false;
        }
        if let Some(place) = old.and_then(|old| self.list.get_mut(old)) {
            *place = None;
        }
        self.list.push(Some(rule));
        true
    }

    /// Removes and returns every rule of these two sides, in either order.
    pub(super) fn drop_of(&mut self, a: &'a str, b: &'a str) -> Vec<&'a PairRule> {
        let (low, high) = if a <= b { (a, b) } else { (b, a) };
        let from: Key<'a> = (low, high, false, false, "", None);
        let of_sides = self.places.range(from..);
        let keys: Vec<Key<'a>> = of_sides
            .map(|(key, _)| *key)
            .take_while(|key| (key.0, key.1) == (low, high))
            .collect();
        let mut dropped = Vec::with_capacity(keys.len());
        for key in keys {
            let place = self.places.remove(&key);
            let rule = place.and_then(|place| self.list.get_mut(place));
            dropped.extend(rule.and_then(Option::take));
        }
        while self.list.last() == Some(&None) {
            self.list.pop();
        }
        dropped
    }

    /// The rules, in order.
    pub(super) fn iter(&self) -> impl Iterator<Item = &'a PairRule> {
        self.list.iter().copied().flatten()
    }

    /// Copies of the rules, in order.
    pub(super) fn to_list(&self) -> Vec<PairRule> {
        self.iter().cloned().collect()
    }
}

fn key(rule: &PairRule) -> Key<'_> {
    let (a, b) = (&*rule.a, &*rule.b);
    let (low, high) = if a <= b { (a, b) } else { (b, a) };
    // 0.0 and -0.0 are the same distance.
    let report = rule.report_within_m.map(|metres| (metres + 0.0).to_bits());
    (low, high, a == low, ignores(rule), &rule.reason, report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::PairAction;

    fn is_rule_of(rule: &PairRule, a: &str, b: &str) -> bool {
        (rule.a == a && rule.b == b) || (rule.a == b && rule.b == a)
    }

    /// The same by a scan of the whole list at each edit.
    fn add(list: &mut Vec<PairRule>, rule: &PairRule) -> bool {
        let changes = list.last() != Some(rule);
        list.retain(|other| other != rule);
        list.push(rule.clone());
        changes
    }

    #[test]
    fn many_edits_make_what_walks_over_the_whole_list_make() {
        let mut random = 5_u64;
        let mut next = |end: u64| {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (random >> 33) % end
        };
        let sides = ["a", "b*", "c"];
        let mut rules = Vec::new();
        for _ in 0..400 {
            let mut side = || sides[usize::try_from(next(3)).unwrap()].to_owned();
            let (a, b) = (side(), side());
            rules.push(PairRule {
                action: if next(2) == 0 {
                    PairAction::Check
                } else {
                    PairAction::Ignore
                },
                a,
                b,
                reason: if next(4) == 0 {
                    "why".to_owned()
                } else {
                    String::new()
                },
                report_within_m: [None, Some(0.0), Some(-0.0), Some(1.0)]
                    [usize::try_from(next(4)).unwrap()],
            });
        }
        let mut draft = RuleDraft::of(&rules[..20]);
        let mut twin = Vec::new();
        rules[..20].iter().for_each(|rule| {
            add(&mut twin, rule);
        });
        for rule in &rules[20..] {
            if next(5) == 0 {
                let before = twin.len();
                twin.retain(|other| !is_rule_of(other, &rule.a, &rule.b));
                assert_eq!(draft.drop_of(&rule.a, &rule.b).len(), before - twin.len());
            } else {
                assert_eq!(draft.add(rule), add(&mut twin, rule));
            }
            assert_eq!((draft.len(), draft.to_list()), (twin.len(), twin.clone()));
        }
    }
}
