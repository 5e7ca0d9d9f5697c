//! Edits of pair rules, looked at before anything is applied. In: one edit. Out: nothing, or what is wrong.

use super::super::rule_draft::RuleDraft;
use super::Draft;
use crate::scene::{PairRule, is_pattern, literal_ends, pattern_matches};

/// Most pair rules. Every new name is matched with each rule that has a pattern.
const RULES_MAX: usize = 1 << 20;

impl<'a> Draft<'a> {
    /// Whether a body that is there at this point of the request has such a name.
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
            let from_head = self.bodies.range(head..);
            from_head
                .take_while(|(name, _)| name.starts_with(head))
                .any(|(name, body)| body.is_some() && pattern_matches(pattern, name))
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

    pub(super) fn look_at_drop(&mut self, a: &'a str, b: &'a str) -> Result<(), String> {
        if self.rules().drop_of(a, b).is_empty() {
            return Err(format!(
                "there is no pair rule for `{a}` and `{b}`: write both as the rule does"
            ));
        }
        Ok(())
    }
}
