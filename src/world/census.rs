//! Effects of the filters on the whole scene: the number of ignored pairs, and the pairs that are always candidates.
//!
//! In: the compiled filters. Out: a count and a sorted list, computed again when the scene changes.
//!
//! The count does not visit all pairs. Bodies that match the same pattern rules form a class, and each pair of classes
//! that a rule matches is decided once. Rigid groups and roots add pairs according to their sizes. Pairs of neighbours
//! and of plain rules are corrected one by one.

use std::collections::{BTreeMap, BTreeSet};

use super::filters::{
    Because, EXACT, Filters, HALF_SPACES, Hot, LIVE, MOVES, NO_GROUP, SIDED, are_neighbours,
    by_default_of_strangers, by_rule, never,
};
use super::names::{NameId, Names};
use super::rules::{SIDE_A, SIDE_B, ignores};
use crate::ids::{BodySlot, PairKey, small};

/// Most pairs one rule may force to be candidates; a rule with more widens the boxes of its bodies instead.
pub(super) const FORCED_PER_RULE_MAX: usize = 1 << 12;
/// If one side of such a rule has this many times as many bodies as the other, only those of the shorter side are
/// widened, by the whole distance: a box in a crowd that is widened by twice as much meets up to eight times as many.
const LOPSIDED: usize = 8;

/// The properties that a class shares: the pattern rules that match, with their sides, and the flags that decide
/// whether a pair is possible.
type Kind<'a> = (&'a [(u32, u8)], u16);

/// Bodies of the same kind.
struct Class<'a> {
    sided: &'a [(u32, u8)],
    count: u64,
    /// One of them.
    hot: &'a Hot,
}

/// All classes, and the class of each slot; `None`: no body.
struct Classes<'a> {
    list: Vec<Class<'a>>,
    of_slot: Vec<Option<u32>>,
}

impl Filters {
    /// Counts the ignored pairs, whether their bodies are enabled or not.
    ///
    /// Cost: O(bodies + n log n + plain rules + pairs of classes that a pattern rule matches + pairs of classes within
    /// one rigid group or root), where n counts the bodies with a pattern rule, a group or an attachment.
    pub(super) fn count_ignored(&mut self, names: &Names) {
        let classes = self.classes();
        let mut ignored = self.count_by_patterns(&classes);
        // Pairs within rigid groups and roots that no rule matches; pairs that share both are counted once.
        let alike = |key: fn(&Hot) -> u64, has: &dyn Fn(&Hot) -> bool| {
            let keyed = self.bodies.iter().zip(&classes.of_slot);
            let keyed = keyed.filter(|(hot, _)| has(hot));
            self.count_alike(
                &classes,
                keyed.filter_map(|(hot, class)| Some((key(hot), (*class)?))),
            )
        };
        let (rigid, root) = (
            |hot: &Hot| u64::from(hot.rigid),
            |hot: &Hot| u64::from(hot.root.0),
        );
        let both = |hot: &Hot| u64::from(hot.rigid) << 32 | u64::from(hot.root.0);
        let grouped = |hot: &Hot| hot.rigid != NO_GROUP;
        // Most bodies have no attachment: their roots have no other member.
        let hanging = self.bodies.iter().filter(|hot| hot.root != hot.name);
        let roots: BTreeSet<NameId> = hanging.map(|hot| hot.root).collect();
        let is_of_tree = |hot: &Hot| roots.contains(&hot.root);
        ignored += alike(rigid, &grouped) + alike(root, &is_of_tree) - alike(both, &grouped);
        // Exceptions: the decision made without them is taken back and replaced.
        for key in self.exceptions(names) {
            let (a, b) = key.slots();
            let (hot_a, hot_b) = (&self.bodies[a.index()], &self.bodies[b.index()]);
            let said = self.decide_plainly(hot_a, hot_b);
            ignored -= u64::from(said.is_ignored());
            ignored += u64::from(self.decide_enabled(hot_a, hot_b).is_ignored());
        }
        self.ignored = ignored;
    }

    fn classes(&self) -> Classes<'_> {
        let mut places: BTreeMap<Kind<'_>, u32> = BTreeMap::new();
        let mut list: Vec<Class<'_>> = Vec::new();
        let mut of_slot = Vec::with_capacity(self.bodies.len());
        // Classes of bodies without a pattern rule (often all bodies), by flags.
        let mut plain = [None; 4];
        for hot in &self.bodies {
            if !hot.has(LIVE) {
                of_slot.push(None);
                continue;
            }
            let next = small(list.len());
            let flags = hot.flags & (MOVES | HALF_SPACES);
            let (sided, place) = if hot.has(SIDED) {
                let sided = self.rules.sided_of(hot.name);
                (sided, *places.entry((sided, flags)).or_insert(next))
            } else {
                let by_flags = usize::from(flags / MOVES) % plain.len();
                (&[][..], *plain[by_flags].get_or_insert(next))
            };
            if place == next {
                list.push(Class {
                    sided,
                    count: 0,
                    hot,
                });
            }
            list[place as usize].count += 1;
            of_slot.push(Some(place));
        }
        Classes { list, of_slot }
    }

    /// Counts the pairs whose last matching pattern rule ignores them.
    fn count_by_patterns(&self, classes: &Classes<'_>) -> u64 {
        // By rule: the classes that match each side.
        let mut of_rule: BTreeMap<u32, [Vec<u32>; 2]> = BTreeMap::new();
        for (place, class) in classes.list.iter().enumerate() {
            for &(rule, sides) in class.sided {
                let lists = of_rule.entry(rule).or_default();
                for (side, list) in [SIDE_A, SIDE_B].into_iter().zip(lists) {
                    if sides & side != 0 {
                        list.push(small(place));
                    }
                }
            }
        }
        let mut ignored = 0;
        // The class that each one was last decided with: several rules may match one pair.
        let mut decided = vec![u32::MAX; classes.list.len()];
        for (place, class) in classes.list.iter().enumerate() {
            let a = small(place);
            for &(rule, sides) in class.sided {
                let Some(lists) = of_rule.get(&rule) else {
                    continue;
                };
                for (side, list) in [SIDE_B, SIDE_A].into_iter().zip(lists) {
                    let behind = list.partition_point(|&b| b < a);
                    for &b in list[behind..].iter().filter(|_| sides & side != 0) {
                        if std::mem::replace(&mut decided[b as usize], a) != a {
                            ignored +=
                                self.ignored_of_two(class, &classes.list[b as usize], a == b);
                        }
                    }
                }
            }
        }
        ignored
    }

    /// Number of pairs of two classes that the pattern rules ignore.
    fn ignored_of_two(&self, a: &Class<'_>, b: &Class<'_>, same: bool) -> u64 {
        if never(a.hot, b.hot).is_some() {
            return 0;
        }
        match self.rules.last_sided_match(a.sided, b.sided) {
            Some((_, rule)) if ignores(rule) => pairs_of(a.count, b.count, same),
            _ => 0,
        }
    }

    /// Counts the pairs of bodies with equal keys that could be paired and that no pattern rule matches.
    ///
    /// * `keyed` - key and class of each body that has a key.
    fn count_alike(&self, classes: &Classes<'_>, keyed: impl Iterator<Item = (u64, u32)>) -> u64 {
        let mut keyed: Vec<(u64, u32)> = keyed.collect();
        keyed.sort_unstable();
        let mut alike = 0;
        for group in keyed.chunk_by(|one, other| one.0 == other.0) {
            if group.len() < 2 {
                continue;
            }
            let members: Vec<(u32, u64)> = group
                .chunk_by(|one, other| one.1 == other.1)
                .filter_map(|same| Some((same.first()?.1, u64::try_from(same.len()).ok()?)))
                .collect();
            for (place, &(a, count_a)) in members.iter().enumerate() {
                for &(b, count_b) in &members[place..] {
                    let (one, other) = (&classes.list[a as usize], &classes.list[b as usize]);
                    let open = never(one.hot, other.hot).is_none()
                        && self
                            .rules
                            .last_sided_match(one.sided, other.sided)
                            .is_none();
                    alike += u64::from(open) * pairs_of(count_a, count_b, a == b);
                }
            }
        }
        alike
    }

    /// Decides a pair without plain rules and neighbours.
    fn decide_plainly(&self, a: &Hot, b: &Hot) -> Because {
        if let Some(never) = never(a, b) {
            return never;
        }
        let sided = (self.rules.sided_of(a.name), self.rules.sided_of(b.name));
        match self.rules.last_sided_match(sided.0, sided.1) {
            Some((_, rule)) => by_rule(ignores(rule)),
            None => by_default_of_strangers(a, b),
        }
    }

    /// As [`Filters::decide`], whether the bodies are enabled or not.
    pub(super) fn decide_enabled(&self, a: &Hot, b: &Hot) -> Because {
        if let Some(never) = never(a, b) {
            return never;
        }
        match self.rules.last_match(a.name, b.name) {
            Some((_, rule)) => by_rule(ignores(rule)),
            None if are_neighbours(a, b) => Because::Neighbours,
            None => by_default_of_strangers(a, b),
        }
    }

    /// The pairs of neighbours and of plain rules whose bodies exist.
    fn exceptions(&self, names: &Names) -> BTreeSet<PairKey> {
        let mut keys = BTreeSet::new();
        let mut put = |slot: usize, other: NameId| {
            let slot = BodySlot::at(slot);
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

    /// Finds the pairs that rules report beyond the distance by which their boxes are widened. A rule with too many
    /// such pairs widens the boxes of its bodies instead.
    ///
    /// * returns - whether there are such margins now, or were before.
    pub(super) fn find_forced(&mut self, names: &Names) -> bool {
        self.forced.clear();
        let were_any = std::mem::take(&mut self.any_margin);
        if were_any {
            self.margins_m.fill(0.0);
        }
        self.margins_m.resize(self.bodies.len(), 0.0);
        if !self.rules.any_report() {
            return were_any;
        }
        for (place, rule) in self.rules.list().iter().enumerate() {
            let Some(report_within_m) = rule.report_within_m else {
                continue;
            };
            let there = |pattern| -> Vec<BodySlot> {
                let slots = names.matching(pattern).map(|name| names.get(name).slot);
                slots.flatten().collect()
            };
            let (side_a, side_b) = (there(&rule.a), there(&rule.b));
            if side_a.len().saturating_mul(side_b.len()) > FORCED_PER_RULE_MAX {
                self.any_margin = true;
                widen_sides(&mut self.margins_m, (&side_a, &side_b), report_within_m);
                continue;
            }
            for &a in &side_a {
                for &b in side_b.iter().filter(|b| **b != a) {
                    if self.is_forced(a, b, place, report_within_m) {
                        self.forced.push(PairKey::new(a, b));
                    }
                }
            }
        }
        self.forced.sort_unstable();
        self.forced.dedup();
        were_any || self.any_margin
    }

    /// Whether this rule decides an allowed pair and reports it beyond the distance by which the boxes are widened.
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

/// Raises the margins of a rule's bodies so that boxes of its two sides meet within a distance.
fn widen_sides(margins_m: &mut [f64], (side_a, side_b): (&[BodySlot], &[BodySlot]), within_m: f64) {
    let (shorter, longer) = if side_a.len() <= side_b.len() {
        (side_a, side_b)
    } else {
        (side_b, side_a)
    };
    let (longer, margin_m) = if shorter.len() * LOPSIDED <= longer.len() {
        (&[][..], within_m)
    } else {
        (longer, within_m / 2.0)
    };
    for slot in shorter.iter().chain(longer) {
        let widest_m = &mut margins_m[slot.index()];
        *widest_m = widest_m.max(margin_m);
    }
}

/// Number of pairs of bodies of two classes, or within one.
fn pairs_of(count_a: u64, count_b: u64, same: bool) -> u64 {
    if same {
        count_a * (count_a - 1) / 2
    } else {
        count_a * count_b
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::Random;

    #[test]
    fn the_margins_of_the_two_bodies_of_each_pair_of_a_rule_add_up_to_its_distance() {
        const BODIES: usize = 200;
        let mut random = Random::new(5);
        let mut sides_of_one = 0;
        for _ in 0..200 {
            let mut margins_m = vec![0.0; BODIES];
            let mut rules = Vec::new();
            for _ in 0..4 {
                let mut side = || {
                    let share = random.unit().powi(3);
                    let slots = (0..BODIES).filter(|_| random.unit() < share);
                    slots.map(BodySlot::at).collect::<Vec<_>>()
                };
                let sides = (side(), side());
                rules.push((sides, random.unit() * 10.0));
            }
            for ((a, b), within_m) in &rules {
                widen_sides(&mut margins_m, (a, b), *within_m);
                sides_of_one +=
                    usize::from(a.len().min(b.len()) * LOPSIDED <= a.len().max(b.len()));
            }
            for ((side_a, side_b), within_m) in &rules {
                for (a, b) in side_a
                    .iter()
                    .flat_map(|a| side_b.iter().map(move |b| (a, b)))
                {
                    assert!(margins_m[a.index()] + margins_m[b.index()] >= *within_m);
                }
            }
        }
        assert!(sides_of_one > 100, "both ways are tried: {sides_of_one}");
    }
}
