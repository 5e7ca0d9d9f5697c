//! Compiled pair rules: a list of rules for each name, so that a pair is decided by a short merge.
//!
//! In: the scene's rules, in order, and rules added by edits. Out: the last rule that matches a pair of names. A rule
//! of two plain names costs one search; a rule with patterns is matched with each name once, when either turns up.

use super::names::{NameId, Names};
use crate::ids::small;
use crate::scene::{PairAction, PairRule, is_pattern, pattern_matches as matches};

/// Up to this many new names are matched with each pattern; for more, each pattern searches the sorted names.
const FEW_NAMES: usize = 16;

/// The name stands on the `a` side of the rule.
pub(super) const SIDE_A: u8 = 1;
/// The name stands on the `b` side of the rule.
pub(super) const SIDE_B: u8 = 2;

/// The rules that match one name.
#[derive(Clone, Debug, Default)]
struct OfName {
    /// Rules of two plain names: the other name and the rule, by name; of one pair the last rule only.
    exact: Vec<(u32, u32)>,
    /// Rules with a pattern: the rule and the sides this name stands on, by rule.
    sided: Vec<(u32, u8)>,
}

/// All rules, and those that match each name.
#[derive(Clone, Debug, Default)]
pub(super) struct Rules {
    list: Vec<PairRule>,
    of_name: Vec<OfName>,
    /// The rules with a pattern.
    patterned: Vec<u32>,
    /// Number of names that these match, counted once per side.
    matches: usize,
    any_report: bool,
}

impl Rules {
    pub(super) fn list(&self) -> &[PairRule] {
        &self.list
    }

    /// Moves the list out for an edit; it is set again afterwards.
    pub(super) fn take_list(&mut self) -> Vec<PairRule> {
        std::mem::take(&mut self.list)
    }

    /// Puts a list back as it was taken out.
    pub(super) fn put_back(&mut self, list: Vec<PairRule>) {
        self.list = list;
    }

    /// The rules with a pattern, in order.
    pub(super) fn patterned(&self) -> impl Iterator<Item = &PairRule> {
        let places = self.patterned.iter();
        places.filter_map(|place| self.list.get(*place as usize))
    }

    /// Names that the rules with a pattern match, counted once per side of each.
    pub(super) fn matches(&self) -> usize {
        self.matches
    }

    /// Number of names that the rules are compiled for.
    pub(super) fn names_len(&self) -> usize {
        self.of_name.len()
    }

    /// Replaces all rules and compiles them.
    ///
    /// * `step` - called after each rule.
    ///
    /// Cost: O(rules log names + names that their patterns match or that begin as they do).
    pub(super) fn set(&mut self, list: Vec<PairRule>, names: &mut Names, step: &mut dyn FnMut()) {
        self.list = list;
        self.of_name.clear();
        self.patterned.clear();
        self.matches = 0;
        self.any_report = self.list.iter().any(|r| r.report_within_m.is_some());
        // Plain names first, so that every name of a rule has its number before patterns are matched.
        for (place, rule) in self.list.iter().enumerate() {
            if has_pattern(rule) {
                self.patterned.push(small(place));
                continue;
            }
            let (a, b) = (names.intern(&rule.a), names.intern(&rule.b));
            self.of_name.resize_with(names.len(), OfName::default);
            self.of_name[a.index()].exact.push((b.0, small(place)));
            self.of_name[b.index()].exact.push((a.0, small(place)));
        }
        for of_name in &mut self.of_name {
            keep_last(&mut of_name.exact);
        }
        self.of_name.resize_with(names.len(), OfName::default);
        self.match_patterns(0, names, step);
    }

    /// Compiles the rules for names that are new since the last call.
    pub(super) fn sync(&mut self, names: &Names) {
        let old = self.of_name.len();
        self.of_name.resize_with(names.len(), OfName::default);
        if names.len() - old > FEW_NAMES {
            return self.match_patterns(old, names, &mut || {});
        }
        for name in old..names.len() {
            self.match_name(name, names);
        }
    }

    /// Matches all patterns with the names from `first` on.
    fn match_patterns(&mut self, first: usize, names: &Names, step: &mut dyn FnMut()) {
        for &place in &self.patterned {
            let rule = &self.list[place as usize];
            for (pattern, side) in [(&rule.a, SIDE_A), (&rule.b, SIDE_B)] {
                for name in names.matching(pattern).filter(|name| name.index() >= first) {
                    self.matches += 1;
                    let sided = &mut self.of_name[name.index()].sided;
                    match sided.last_mut() {
                        Some((last, sides)) if *last == place => *sides |= side,
                        _ => sided.push((place, side)),
                    }
                }
            }
            step();
        }
    }

    /// Matches one name with all patterns.
    fn match_name(&mut self, name: usize, names: &Names) {
        let text = &*names.all()[name].text;
        let of_name = &mut self.of_name[name];
        for &place in &self.patterned {
            let sides = sides_of(&self.list[place as usize], text);
            self.matches += sides.count_ones() as usize;
            if sides != 0 {
                of_name.sided.push((place, sides));
            }
        }
    }

    /// Whether any rule matches this name: (a plain rule, a rule with a pattern).
    pub(super) fn speaks_of(&self, name: NameId) -> (bool, bool) {
        let of_name = &self.of_name[name.index()];
        (!of_name.exact.is_empty(), !of_name.sided.is_empty())
    }

    /// Whether any rule sets `report_within_m`.
    pub(super) fn any_report(&self) -> bool {
        self.any_report
    }

    /// The last rule that matches a pair.
    ///
    /// Cost: a search in the shorter list of plain rules, and a merge of the two lists of pattern rules.
    pub(super) fn last_match(&self, a: NameId, b: NameId) -> Option<(usize, &PairRule)> {
        let (of_a, of_b) = (&self.of_name[a.index()], &self.of_name[b.index()]);
        let exact = if of_a.exact.len() <= of_b.exact.len() {
            find_exact(&of_a.exact, b)
        } else {
            find_exact(&of_b.exact, a)
        };
        let rule = exact.max(last_sided(&of_a.sided, &of_b.sided))? as usize;
        self.list.get(rule).map(|r| (rule, r))
    }

    /// The last pattern rule that matches two lists of [`Rules::sided_of`].
    pub(super) fn last_sided_match(
        &self,
        a: &[(u32, u8)],
        b: &[(u32, u8)],
    ) -> Option<(usize, &PairRule)> {
        let rule = last_sided(a, b)? as usize;
        self.list.get(rule).map(|r| (rule, r))
    }

    /// The pattern rules that match a name.
    pub(super) fn sided_of(&self, name: NameId) -> &[(u32, u8)] {
        &self.of_name[name.index()].sided
    }

    /// The names that a plain rule pairs with this one.
    pub(super) fn exact_partners(&self, name: NameId) -> impl Iterator<Item = NameId> + '_ {
        self.of_name[name.index()]
            .exact
            .iter()
            .map(|&(other, _)| NameId(other))
    }
}

/// Whether a side of the rule is a pattern.
pub(super) fn has_pattern(rule: &PairRule) -> bool {
    is_pattern(&rule.a) || is_pattern(&rule.b)
}

/// The sides of the rule that a name matches.
pub(super) fn sides_of(rule: &PairRule, text: &str) -> u8 {
    let side = |pattern: &str, bit: u8| if matches(pattern, text) { bit } else { 0 };
    side(&rule.a, SIDE_A) | side(&rule.b, SIDE_B)
}

/// Whether two names that match these sides are a pair of the rule.
fn sides_meet(one: u8, other: u8) -> bool {
    (one & SIDE_A != 0 && other & SIDE_B != 0) || (one & SIDE_B != 0 && other & SIDE_A != 0)
}

/// Whether a rule ignores its pairs.
pub(super) fn ignores(rule: &PairRule) -> bool {
    rule.action == PairAction::Ignore
}

/// Sorts the plain rules of one name by the other name; for each pair only the last rule is kept.
fn keep_last(exact: &mut Vec<(u32, u32)>) {
    exact.sort_unstable();
    exact.dedup_by(|later, kept| {
        let same = later.0 == kept.0;
        if same {
            kept.1 = later.1;
        }
        same
    });
}

fn find_exact(list: &[(u32, u32)], other: NameId) -> Option<u32> {
    let at = list.binary_search_by_key(&other.0, |e| e.0).ok()?;
    Some(list[at].1)
}

fn last_sided(a: &[(u32, u8)], b: &[(u32, u8)]) -> Option<u32> {
    let (mut a, mut b) = (a.iter().rev().peekable(), b.iter().rev().peekable());
    while let (Some(&&(rule_a, side_a)), Some(&&(rule_b, side_b))) = (a.peek(), b.peek()) {
        if rule_a == rule_b && sides_meet(side_a, side_b) {
            return Some(rule_a);
        }
        if rule_a >= rule_b {
            a.next();
        }
        if rule_b >= rule_a {
            b.next();
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(action: PairAction, a: &str, b: &str) -> PairRule {
        PairRule {
            action,
            a: a.to_owned(),
            b: b.to_owned(),
            reason: String::new(),
            report_within_m: None,
        }
    }

    #[test]
    fn compiled_rules_say_what_matching_each_pair_from_the_last_says() {
        use PairAction::{Check, Ignore};
        let list = vec![
            rule(Ignore, "*", "*"),
            rule(Check, "arm_*", "wall"),
            rule(Ignore, "arm_1", "wall"),
            rule(Check, "arm_?", "arm_*"),
            rule(Ignore, "arm_1", "arm_2"),
            rule(Check, "wall", "arm_1"),
            rule(Ignore, "box", "*_2"),
        ];
        let texts = ["arm_1", "arm_2", "arm_22", "wall", "box", "x"];
        // Some names are there before the rules, some turn up after, alone or with many others.
        for others in [0, 2 * FEW_NAMES] {
            let mut names = Names::default();
            names.intern(texts[0]);
            names.intern(texts[5]);
            let mut rules = Rules::default();
            rules.set(list.clone(), &mut names, &mut || {});
            let ids = texts.map(|t| names.intern(t));
            for other in 0..others {
                names.intern(&format!("other_{other}"));
            }
            rules.sync(&names);
            let sides =
                |sided: &[(u32, u8)]| sided.iter().map(|(_, sides)| sides.count_ones()).sum();
            let kept = rules.of_name.iter().map(|of| -> u32 { sides(&of.sided) });
            assert_eq!(rules.matches(), kept.sum::<u32>() as usize);
            assert_as_list(&rules, &list, &texts, &ids);
        }
    }

    fn assert_as_list(rules: &Rules, list: &[PairRule], texts: &[&str], ids: &[NameId]) {
        for (a, &id_a) in texts.iter().zip(ids) {
            for (b, &id_b) in texts.iter().zip(ids).filter(|(b, _)| b != &a) {
                let wanted = list.iter().rposition(|r| {
                    (matches(&r.a, a) && matches(&r.b, b)) || (matches(&r.a, b) && matches(&r.b, a))
                });
                let found = rules.last_match(id_a, id_b).map(|(at, _)| at);
                assert_eq!(found, wanted, "{a} {b}");
            }
        }
    }
}
