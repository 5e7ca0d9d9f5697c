//! What the filters make of the scene as a whole: how many pairs are ignored, and which pairs are always candidates.
//!
//! In: the compiled filters. Out: a count and a sorted list; both anew when the scene changes, never in between.
//!
//! The count needs no walk over all pairs: bodies of which the pattern rules, rigid groups and attachments say the
//! same form a class, classes are decided once a pair of classes, and the pairs of neighbours and of plain rules are
//! put right one by one.

use std::collections::{BTreeMap, BTreeSet};

use super::filters::{
    Because, EXACT, Filters, Hot, LIVE, MOVES, NO_GROUP, SIDED, UNBOUNDED, are_neighbours,
    by_default_of_strangers, by_rule, never,
};
use super::names::{NameId, Names};
use super::rules::{SIDE_A, SIDE_B, ignores, sides_of};
use crate::ids::{BodySlot, PairKey};

/// Most pairs one rule may force to be candidates; a rule with more widens the boxes of its bodies instead.
pub(super) const FORCED_PER_RULE_MAX: usize = 1 << 12;

/// What makes two bodies alike for the count.
type Class<'a> = (&'a [(u32, u8)], u32, u32, u16);

impl Filters {
    /// Counts the ignored pairs, whether their bodies are enabled or not.
    ///
    /// Cost: O(classes^2 + plain rules + bodies log bodies).
    pub(super) fn count_ignored(&mut self, names: &Names) {
        let alone = self.lone_roots();
        let mut classes: BTreeMap<Class<'_>, (u64, &Hot)> = BTreeMap::new();
        for hot in self.bodies.iter().filter(|hot| hot.has(LIVE)) {
            let class = self.class_of(hot, &alone);
            classes.entry(class).or_insert((0, hot)).0 += 1;
        }
        let mut ignored: u64 = 0;
        let listed: Vec<_> = classes.iter().collect();
        for (place, (class_a, (count_a, hot_a))) in listed.iter().enumerate() {
            let same_root = class_a.2 != NO_GROUP;
            let within = self.decide_class(hot_a, hot_a, class_a, class_a, same_root);
            ignored += u64::from(within.is_ignored()) * (count_a * (count_a - 1) / 2);
            for (class_b, (count_b, hot_b)) in &listed[place + 1..] {
                let same_root = class_a.2 == class_b.2 && class_a.2 != NO_GROUP;
                let because = self.decide_class(hot_a, hot_b, class_a, class_b, same_root);
                ignored += u64::from(because.is_ignored()) * (count_a * count_b);
            }
        }
        // The exceptions: what the classes said is taken back, what holds is put in its place.
        for key in self.exceptions(names) {
            let (a, b) = key.slots();
            let (hot_a, hot_b) = (&self.bodies[a.index()], &self.bodies[b.index()]);
            let same_root = hot_a.root == hot_b.root;
            let (class_a, class_b) = (self.class_of(hot_a, &alone), self.class_of(hot_b, &alone));
            let said = self.decide_class(hot_a, hot_b, &class_a, &class_b, same_root);
            ignored -= u64::from(said.is_ignored());
            ignored += u64::from(self.decide_enabled(hot_a, hot_b).is_ignored());
        }
        self.ignored = ignored;
    }

    /// Roots on which nothing but the body itself hangs.
    fn lone_roots(&self) -> BTreeSet<NameId> {
        let mut seen: BTreeMap<NameId, u32> = BTreeMap::new();
        for hot in self.bodies.iter().filter(|hot| hot.has(LIVE)) {
            *seen.entry(hot.root).or_insert(0) += 1;
        }
        seen.retain(|_, count| *count == 1);
        seen.into_keys().collect()
    }

    fn class_of(&self, hot: &Hot, alone: &BTreeSet<NameId>) -> Class<'_> {
        let root = if alone.contains(&hot.root) {
            NO_GROUP
        } else {
            hot.root.0
        };
        let flags = hot.flags & (MOVES | UNBOUNDED | SIDED);
        (self.rules.sided_of(hot.name), hot.rigid, root, flags)
    }

    /// A pair of two classes, plain rules and neighbours left aside.
    fn decide_class(
        &self,
        hot_a: &Hot,
        hot_b: &Hot,
        class_a: &Class<'_>,
        class_b: &Class<'_>,
        same_root: bool,
    ) -> Because {
        if let Some(never) = never(hot_a, hot_b) {
            return never;
        }
        if let Some((_, rule)) = self.rules.last_sided_match(class_a.0, class_b.0) {
            return by_rule(ignores(rule));
        }
        // The bodies stand for others of their class: their own roots mean nothing here.
        let (mut hot_a, mut hot_b) = (*hot_a, *hot_b);
        hot_a.root = NameId(0);
        hot_b.root = NameId(u32::from(!same_root));
        by_default_of_strangers(&hot_a, &hot_b)
    }

    /// As [`Filters::decide`], enabled or not.
    fn decide_enabled(&self, a: &Hot, b: &Hot) -> Because {
        if let Some(never) = never(a, b) {
            return never;
        }
        match self.rules.last_match(a.name, b.name) {
            Some((_, rule)) => by_rule(ignores(rule)),
            None if are_neighbours(a, b) => Because::Neighbours,
            None => by_default_of_strangers(a, b),
        }
    }

    /// The pairs of neighbours and of plain rules whose bodies are there.
    fn exceptions(&self, names: &Names) -> BTreeSet<PairKey> {
        let mut keys = BTreeSet::new();
        let mut put = |slot: usize, other: NameId| {
            let slot = slot_at(slot);
            if let Some(other) = names.all().get(other.index()).and_then(|n| n.slot)
                && other != slot
            {
                keys.insert(PairKey::new(slot, other));
            }
        };
        for (slot, hot) in self.bodies.iter().enumerate() {
            if hot.has(LIVE) {
                put(slot, hot.parent);
            }
            if hot.has(LIVE) && hot.has(EXACT) {
                for other in self.rules.exact_partners(hot.name) {
                    put(slot, other);
                }
            }
        }
        keys
    }

    /// Finds the pairs that rules report farther than their bodies' boxes are widened, and for rules with too many of
    /// them the margin that makes their boxes meet instead.
    pub(super) fn find_forced(&mut self, names: &Names) {
        self.forced.clear();
        self.margins_m.clear();
        self.margins_m.resize(self.bodies.len(), 0.0);
        if !self.rules.any_report() {
            return;
        }
        for (place, rule) in self.rules.list().iter().enumerate() {
            let Some(report_within_m) = rule.report_within_m else {
                continue;
            };
            let sided: Vec<(BodySlot, u8)> = names
                .all()
                .iter()
                .filter_map(|name| Some((name.slot?, sides_of(rule, &name.text))))
                .filter(|(_, sides)| *sides != 0)
                .collect();
            let on = |bit: u8| sided.iter().filter(move |(_, s)| s & bit != 0);
            if on(SIDE_A).count().saturating_mul(on(SIDE_B).count()) > FORCED_PER_RULE_MAX {
                for (slot, _) in &sided {
                    let margin_m = &mut self.margins_m[slot.index()];
                    *margin_m = margin_m.max(report_within_m / 2.0);
                }
                continue;
            }
            for &(a, _) in on(SIDE_A) {
                for &(b, _) in on(SIDE_B).filter(|(b, _)| *b != a) {
                    if self.is_forced(a, b, place, report_within_m) {
                        self.forced.push(PairKey::new(a, b));
                    }
                }
            }
        }
        self.forced.sort_unstable();
        self.forced.dedup();
    }

    /// Whether this rule decides an allowed pair, and reports it farther than the boxes are widened.
    fn is_forced(&self, a: BodySlot, b: BodySlot, rule: usize, report_within_m: f64) -> bool {
        let (hot_a, hot_b) = (&self.bodies[a.index()], &self.bodies[b.index()]);
        report_within_m > hot_a.report_within_m + hot_b.report_within_m
            && self
                .rules
                .last_match(hot_a.name, hot_b.name)
                .is_some_and(|(last, _)| last == rule)
            && self.decide(a, b).allows()
    }
}

/// Slots are u32.
pub(super) fn slot_at(index: usize) -> BodySlot {
    BodySlot(u32::try_from(index).unwrap_or(u32::MAX))
}
