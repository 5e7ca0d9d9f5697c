//! Checks of edits of pair rules before anything is applied. In: one edit. Out: nothing, or an error text.

use std::collections::BTreeMap;

use super::super::rule_draft::RuleDraft;
use super::super::rules::has_pattern;
use super::Draft;
use crate::limits::PATTERN_MATCHES_MAX;
use crate::scene::{PairRule, is_pattern, literal_ends, pattern_matches};

/// Most pair rules. Every new name is matched with each rule that has a pattern.
const RULES_MAX: usize = 1 << 20;

impl<'a> Draft<'a> {
    /// Whether a body with a matching name exists at this point of the request.
    fn any_matches(&mut self, pattern: &'a str) -> bool {
        if !is_pattern(pattern) {
            return self.has(pattern);
        }
        if self.matched.contains(pattern) {
            return true;
        }
        let world = self.world;
        let there = |text: &str| !matches!(self.bodies.get(text), Some(None));
        let (head, _) = literal_ends(pattern);
        let put = || {
            let from_head = self.bodies.range(head..).map(|(name, _)| *name);
            matching(from_head, pattern).any(there)
        };
        let mut known = world.names.matching(pattern).map(|n| world.names.get(n));
        let any = known.any(|n| n.slot.is_some() && there(&n.text)) || put();
        if any {
            self.matched.insert(pattern);
        }
        any
    }

    fn rules(&mut self) -> &mut RuleDraft<'a> {
        let world = self.world;
        self.rules
            .get_or_insert_with(|| RuleDraft::of(world.filters.rules.list()))
    }

    pub(super) fn look_at_rule(&mut self, rule: &'a PairRule) -> Result<(), String> {
        if rule
            .report_within_m
            .is_some_and(|m| !m.is_finite() || m < 0.0)
        {
            return Err("a rule's `report_within_m` is finite and not negative".to_owned());
        }
        for side in [&rule.a, &rule.b] {
            if !self.any_matches(side) {
                return Err(format!(
                    "no body matches `{side}`: correct the rule, or put the body first"
                ));
            }
        }
        if self.rules().len() >= RULES_MAX {
            return Err(format!(
                "there are {RULES_MAX} pair rules: drop some, or use patterns"
            ));
        }
        self.rules().add(rule);
        Ok(())
    }

    /// Checks that the rules with patterns match few enough names in all, including the names that the request brings.
    ///
    /// * `step` - called after each such rule.
    pub(super) fn patterns_hold(&self, step: &mut dyn FnMut()) -> Result<(), String> {
        let (names, rules) = (&self.world.names, &self.world.filters.rules);
        let brought = self.bodies.keys().copied();
        let brought = brought.filter(|name| names.find_name(name).is_none());
        let mut brought: Vec<&str> = brought.collect();
        if self.rules.is_none() {
            // Names of earlier requests of the same tick.
            let unmatched = names.all().get(rules.names_len()..).unwrap_or_default();
            brought.extend(unmatched.iter().map(|name| &*name.text));
            brought.sort_unstable();
        }
        let count_brought = |pattern: &str| {
            let (head, _) = literal_ends(pattern);
            let first = brought.partition_point(|name| *name < head);
            matching(brought[first..].iter().copied(), pattern).count()
        };
        let (those, mut matches): (Vec<&PairRule>, usize) = match &self.rules {
            None if brought.is_empty() => return Ok(()),
            None => (rules.patterned().collect(), rules.matches()),
            Some(draft) => (draft.iter().filter(|rule| has_pattern(rule)).collect(), 0),
        };
        // Many rules share a side.
        let mut of_side: BTreeMap<&str, usize> = BTreeMap::new();
        for rule in those {
            for side in [&*rule.a, &*rule.b] {
                matches += *of_side.entry(side).or_insert_with(|| {
                    let known = self.rules.as_ref().map(|_| names.matching(side).count());
                    known.unwrap_or_default() + count_brought(side)
                });
            }
            step();
            if matches > PATTERN_MATCHES_MAX {
                return Err(format!(
                    "up to the rule for `{}` and `{}` the pair rules with patterns match more than {PATTERN_MATCHES_MAX} names, each counted for each rule: write fewer rules, or narrower patterns",
                    rule.a, rule.b
                ));
            }
        }
        Ok(())
    }

    pub(super) fn look_at_drop(&mut self, a: &'a str, b: &'a str) -> Result<(), String> {
        if self.rules().drop_of(a, b).is_empty() {
            return Err(format!(
                "there is no pair rule for `{a}` and `{b}`: write both as the rule does"
            ));
        }
        Ok(())
    }
}

/// The names that a pattern matches, out of sorted names from its literal beginning on.
fn matching<'n>(
    from_head: impl Iterator<Item = &'n str>,
    pattern: &str,
) -> impl Iterator<Item = &'n str> {
    let (head, _) = literal_ends(pattern);
    from_head
        .take_while(move |name| name.starts_with(head))
        .filter(move |name| pattern_matches(pattern, name))
}
