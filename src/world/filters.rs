//! Filters: which pairs are checked, and the reason if not.
//!
//! In: masks, neighbours, rigid groups and rules, compiled when the scene changes. Out: a decision per pair. The common
//! pair (no rule matches both bodies) costs two loads of one cache line each and a few comparisons. Precedence: bodies
//! that can never be paired; then rules (the last that matches); then neighbours, rigid groups and attached bodies;
//! then masks.

use super::names::{NameId, Names};
use super::rules::{Rules, ignores};
use crate::ids::{BodySlot, PairKey};

pub(super) const LIVE: u16 = 1;
pub(super) const ENABLED: u16 = 2;
pub(super) const MOVES: u16 = 4;
/// All of its shapes are half-spaces.
pub(super) const HALF_SPACES: u16 = 8;
pub(super) const KEEPS: u16 = 16;
/// Its box is meaningless: it keeps its pairs and makes no new ones.
pub(super) const BARS: u16 = 128;
/// A rule of two plain names matches it.
pub(super) const EXACT: u16 = 32;
/// A rule with a pattern matches it.
pub(super) const SIDED: u16 = 64;

/// No group.
pub(super) const NO_GROUP: u32 = u32::MAX;

/// The reason why a pair is checked or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Because {
    /// The masks allow it: checked.
    Masks,
    /// A `check` rule: checked.
    CheckRule,
    /// An `ignore` rule.
    IgnoreRule,
    /// One is the parent of the other.
    Neighbours,
    /// Both are in one rigid group.
    RigidGroup,
    /// Both are attached to the same body.
    Attached,
    /// The masks do not allow it.
    MasksIgnore,
    /// Neither can move.
    CannotMove,
    /// Both consist of half-spaces only.
    HalfSpaces,
    /// A body is disabled or does not exist.
    Disabled,
}

impl Because {
    /// Whether the pair is checked.
    #[must_use]
    pub fn allows(self) -> bool {
        matches!(self, Self::Masks | Self::CheckRule)
    }

    /// Whether it counts as an ignored pair: because of a rule, neighbour, rigid group or attachment.
    #[must_use]
    pub fn is_ignored(self) -> bool {
        matches!(
            self,
            Self::IgnoreRule | Self::Neighbours | Self::RigidGroup | Self::Attached
        )
    }

    /// The word shown to users.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Masks => "masks allow",
            Self::CheckRule => "check rule",
            Self::IgnoreRule => "ignore rule",
            Self::Neighbours => "neighbours",
            Self::RigidGroup => "rigid group",
            Self::Attached => "attached to one body",
            Self::MasksIgnore => "masks",
            Self::CannotMove => "neither can move",
            Self::HalfSpaces => "two half-spaces",
            Self::Disabled => "disabled",
        }
    }
}

/// Data of one body for the filters, in one cache line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hot {
    pub(super) flags: u16,
    pub(super) group: u32,
    pub(super) mask: u32,
    pub(super) name: NameId,
    pub(super) parent: NameId,
    pub(super) rigid: u32,
    /// Name of its root; its own name without an attachment.
    pub(super) root: NameId,
    pub(super) report_within_m: f64,
}

impl Hot {
    pub(super) const GONE: Self = Self {
        flags: 0,
        group: 0,
        mask: 0,
        name: NameId::NONE,
        parent: NameId::NONE,
        rigid: NO_GROUP,
        root: NameId::NONE,
        report_within_m: 0.0,
    };

    pub(super) fn has(&self, flag: u16) -> bool {
        self.flags & flag != 0
    }

    pub(super) fn set(&mut self, flag: u16, on: bool) {
        self.flags = if on {
            self.flags | flag
        } else {
            self.flags & !flag
        };
    }
}

/// The compiled filters.
#[derive(Clone, Debug, Default)]
pub struct Filters {
    pub(super) bodies: Vec<Hot>,
    pub(super) rules: Rules,
    pub(super) ignored: u64,
    pub(super) forced: Vec<PairKey>,
    /// Per slot: widening of the box for rules with too many pairs to be forced, metres.
    pub(super) margins_m: Vec<f64>,
    /// Whether any margin is not 0.
    pub(super) any_margin: bool,
}

impl Filters {
    /// Whether this pair is checked. Symmetric.
    #[must_use]
    pub fn allows(&self, a: BodySlot, b: BodySlot) -> bool {
        self.decide(a, b).allows()
    }

    /// Whether the body's box is meaningless, because its place is unknown and its reach is unbounded.
    #[must_use]
    pub fn keeps(&self, slot: BodySlot) -> bool {
        self.bodies
            .get(slot.index())
            .is_some_and(|hot| hot.has(KEEPS))
    }

    /// Whether that is so and its box makes no pairs in this tick either.
    #[must_use]
    pub fn bars(&self, slot: BodySlot) -> bool {
        self.bodies
            .get(slot.index())
            .is_some_and(|hot| hot.has(BARS))
    }

    /// Whether a pair is checked, and the reason.
    #[must_use]
    pub fn decide(&self, a: BodySlot, b: BodySlot) -> Because {
        let (Some(hot_a), Some(hot_b)) = (self.bodies.get(a.index()), self.bodies.get(b.index()))
        else {
            return Because::Disabled;
        };
        let both = hot_a.flags & hot_b.flags;
        if a == b || both & LIVE == 0 || both & ENABLED == 0 {
            return Because::Disabled;
        }
        if let Some(never) = never(hot_a, hot_b) {
            return never;
        }
        if both & (EXACT | SIDED) != 0
            && let Some((_, rule)) = self.rules.last_match(hot_a.name, hot_b.name)
        {
            return by_rule(ignores(rule));
        }
        by_default(hot_a, hot_b)
    }

    /// As [`Filters::decide`], but as if both were enabled, as [`Filters::ignored_pairs_count`] counts.
    #[must_use]
    pub fn decide_if_enabled(&self, a: BodySlot, b: BodySlot) -> Because {
        match (self.bodies.get(a.index()), self.bodies.get(b.index())) {
            (Some(hot_a), Some(hot_b)) if a != b && hot_a.flags & hot_b.flags & LIVE != 0 => {
                self.decide_enabled(hot_a, hot_b)
            }
            _ => Because::Disabled,
        }
    }

    /// Whether a query shape of this group and mask, which is no body of the scene, is checked with a body: only the
    /// masks decide.
    #[must_use]
    pub fn allows_stranger(&self, group: u32, mask: u32, slot: BodySlot) -> bool {
        let hot = self.bodies.get(slot.index()).unwrap_or(&Hot::GONE);
        hot.has(LIVE) && hot.has(ENABLED) && group & hot.mask != 0 && hot.group & mask != 0
    }

    /// Whether a body is in one of these groups; if all groups are given, every body is.
    #[must_use]
    pub fn is_of(&self, groups: u32, slot: BodySlot) -> bool {
        let hot = self.bodies.get(slot.index()).unwrap_or(&Hot::GONE);
        hot.has(LIVE) && (hot.group & groups != 0 || groups == u32::MAX)
    }

    /// The reason text of the rule that decides a pair; `None`: no rule does.
    #[must_use]
    pub fn rule_reason(&self, a: BodySlot, b: BodySlot) -> Option<&str> {
        let (hot_a, hot_b) = (self.bodies.get(a.index())?, self.bodies.get(b.index())?);
        if hot_a.flags & hot_b.flags & (EXACT | SIDED) == 0 {
            return None;
        }
        let (_, rule) = self.rules.last_match(hot_a.name, hot_b.name)?;
        Some(&rule.reason)
    }

    /// Gap below which a pair is reported, metres: the larger of its bodies' values, unless a rule overrides it.
    #[must_use]
    pub fn report_within(&self, a: BodySlot, b: BodySlot) -> f64 {
        let (Some(hot_a), Some(hot_b)) = (self.bodies.get(a.index()), self.bodies.get(b.index()))
        else {
            return 0.0;
        };
        if self.rules.any_report()
            && hot_a.flags & hot_b.flags & (EXACT | SIDED) != 0
            && let Some((_, rule)) = self.rules.last_match(hot_a.name, hot_b.name)
            && let Some(report_within_m) = rule.report_within_m
        {
            return report_within_m;
        }
        hot_a.report_within_m.max(hot_b.report_within_m)
    }

    /// Pairs that are candidates at any distance, because a rule reports them beyond the widening of their boxes.
    /// Sorted; only allowed pairs; their bodies may be out of the broad phase.
    #[must_use]
    pub fn forced_pairs(&self) -> &[PairKey] {
        &self.forced
    }

    /// Number of pairs that are ignored by a rule, neighbour, rigid group or attachment.
    #[must_use]
    pub fn ignored_pairs_count(&self) -> u64 {
        self.ignored
    }

    /// Number of pair rules.
    #[must_use]
    pub fn rules_count(&self) -> usize {
        self.rules.list().len()
    }

    /// Updates the flags of a slot by the rules that match its name, after the rules or the slot changed.
    pub(super) fn mark_ruled(&mut self, slot: usize) {
        let hot = &mut self.bodies[slot];
        hot.flags &= !(EXACT | SIDED);
        if hot.has(LIVE) {
            let (exact, sided) = self.rules.speaks_of(hot.name);
            hot.flags |= if exact { EXACT } else { 0 } | if sided { SIDED } else { 0 };
        }
    }

    /// Compiles the rules for names that are new, or all of them.
    pub(super) fn sync_names(&mut self, names: &Names) {
        self.rules.sync(names);
    }
}

/// The decisions that no rule can change.
pub(super) fn never(a: &Hot, b: &Hot) -> Option<Because> {
    if (a.flags | b.flags) & MOVES == 0 {
        return Some(Because::CannotMove);
    }
    (a.flags & b.flags & HALF_SPACES != 0).then_some(Because::HalfSpaces)
}

/// The decision of a rule.
pub(super) fn by_rule(ignores: bool) -> Because {
    if ignores {
        Because::IgnoreRule
    } else {
        Because::CheckRule
    }
}

/// The decision if no rule matches.
pub(super) fn by_default(a: &Hot, b: &Hot) -> Because {
    if are_neighbours(a, b) {
        return Because::Neighbours;
    }
    by_default_of_strangers(a, b)
}

/// The decision if no rule matches and neither is the other's parent.
pub(super) fn by_default_of_strangers(a: &Hot, b: &Hot) -> Because {
    if a.rigid == b.rigid && a.rigid != NO_GROUP {
        Because::RigidGroup
    } else if a.root == b.root {
        Because::Attached
    } else if a.group & b.mask != 0 && b.group & a.mask != 0 {
        Because::Masks
    } else {
        Because::MasksIgnore
    }
}

/// Whether one is the parent of the other.
pub(super) fn are_neighbours(a: &Hot, b: &Hot) -> bool {
    a.parent == b.name || b.parent == a.name
}
