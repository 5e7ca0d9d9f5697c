//! Edits that affect many bodies (pair rules, margins, reset), and the update of the filters after them.

use std::collections::BTreeSet;

use super::World;
use super::edit::Edit;
use super::rule_draft::RuleDraft;
use crate::ids::BodySlot;
use crate::scene::PairRule;
use crate::wire::EndCause;

/// Parts of the filters that edits have made outdated; each value includes those before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Uncounted {
    #[default]
    Nothing,
    /// Forced pairs, and margins of boxes.
    Forced,
    /// The number of ignored pairs.
    Bodies,
    /// The rules that match each body.
    Rules,
}

impl World {
    /// Applies all edits of rules in a request, and compiles the rules once; returns whether they changed.
    ///
    /// Rules do not depend on the other edits of the request: they apply to the scene after it.
    ///
    /// * `step` - called after each rule that was compiled, and after each search for its bodies.
    pub(super) fn edit_rules(&mut self, edits: &[Edit], step: &mut dyn FnMut()) -> bool {
        let is_rule = |edit: &Edit| matches!(edit, Edit::Rule(_) | Edit::DropRules { .. });
        if !edits.iter().any(is_rule) {
            return false;
        }
        let old = self.filters.rules.take_list();
        let mut draft = RuleDraft::of(&old);
        let mut changed: Vec<&PairRule> = Vec::new();
        for edit in edits {
            match edit {
                Edit::Rule(rule) if draft.add(rule) => changed.push(rule),
                Edit::DropRules { a, b } => changed.append(&mut draft.drop_of(a, b)),
                _ => {}
            }
        }
        if changed.is_empty() {
            self.filters.rules.put_back(old);
            return false;
        }
        let list = draft.to_list();
        self.filters.rules.set(list, &mut self.names, step);
        self.requery_named(&changed, step);
        true
    }

    /// Requests a new search for the pairs of all bodies that these rules match.
    ///
    /// * `step` - called after each side.
    fn requery_named(&mut self, rules: &[&PairRule], step: &mut dyn FnMut()) {
        let sides = rules.iter().flat_map(|rule| [&*rule.a, &*rule.b]);
        let patterns: BTreeSet<&str> = sides.collect();
        let mut named = vec![false; self.bodies.len()];
        for pattern in patterns {
            for name in self.names.matching(pattern) {
                if let Some(slot) = self.names.get(name).slot {
                    named[slot.index()] = true;
                }
            }
            step();
        }
        for (index, _) in named.iter().enumerate().filter(|(_, named)| **named) {
            self.requery(BodySlot::at(index));
        }
    }

    /// Sets the distance within which pairs of a body, or of all bodies, are reported as near; returns whether any
    /// changed.
    pub(super) fn set_margins(&mut self, name: Option<&str>, report_within_m: Option<f64>) -> bool {
        let Some(name) = name else {
            let slots = 0..self.bodies.len();
            return slots.fold(false, |any, slot| {
                self.set_margin(BodySlot::at(slot), report_within_m) | any
            });
        };
        let slot = self.slot_named(name);
        slot.is_some_and(|slot| self.set_margin(slot, report_within_m))
    }

    fn set_margin(&mut self, slot: BodySlot, report_within_m: Option<f64>) -> bool {
        let entry = &self.entries[slot.index()];
        let put_m = entry.spec.as_ref().map(|spec| spec.report_within_m);
        let Some(wanted_m) = report_within_m.or(put_m) else {
            return false;
        };
        let body = self.bodies.get_mut(slot.index()).and_then(Option::as_mut);
        let Some(body) = body.filter(|body| body.report_within_m.to_bits() != wanted_m.to_bits())
        else {
            return false;
        };
        body.report_within_m = wanted_m;
        if let Some(hot) = self.hot(slot) {
            hot.report_within_m = wanted_m;
        }
        self.touched.push(slot);
        // Its pairs are judged again; the recount that follows widens its box.
        self.requery(slot);
        true
    }

    pub(super) fn reset(&mut self, source: Option<&str>) {
        if let Some(name) = source {
            if let Some(source) = self.source_named(name) {
                self.forget_poses(source);
            }
            return;
        }
        for index in 0..self.bodies.len() {
            let slot = BodySlot::at(index);
            let Some(body) = self.body(slot) else {
                continue;
            };
            if body.moves {
                self.forget_pose(slot);
            } else if self.entries[index].enabled {
                self.begin_anew(slot);
            }
        }
        self.settle_attached();
    }

    /// Ends the pairs of a body that stays in the broad phase, so that they begin again.
    pub(super) fn begin_anew(&mut self, slot: BodySlot) {
        if self.body(slot).is_some_and(|body| body.in_broad) {
            self.lists.remove(slot, EndCause::Reset);
            self.lists.insert(slot);
        }
    }

    /// Updates the filters after the edits of a tick: rules of each body, ignored and forced pairs, margins of boxes.
    ///
    /// Cost: without rules and groups, that of the touched bodies, and a scan of the filters' flags of all bodies.
    pub(super) fn recount(&mut self) {
        let uncounted = std::mem::take(&mut self.uncounted);
        if uncounted == Uncounted::Nothing {
            return;
        }
        self.filters.sync_names(&self.names);
        if uncounted == Uncounted::Rules {
            (0..self.bodies.len()).for_each(|index| self.filters.mark_ruled(index));
        } else {
            let touched = self.touched.iter();
            touched.for_each(|slot| self.filters.mark_ruled(slot.index()));
        }
        if uncounted >= Uncounted::Bodies {
            self.filters.count_ignored(&self.names);
        }
        if self.filters.find_forced(&self.names) {
            (0..self.bodies.len()).for_each(|index| self.widen(BodySlot::at(index)));
        } else {
            let touched = std::mem::take(&mut self.touched);
            touched.iter().for_each(|slot| self.widen(*slot));
            self.touched = touched;
        }
    }

    /// Settles a body if the margin of its box has changed.
    fn widen(&mut self, slot: BodySlot) {
        let Some(body) = self.body(slot) else { return };
        let wanted_m = self.widening(slot, body, body.reach_m);
        if wanted_m.to_bits() != self.entries[slot.index()].widened_m.to_bits() {
            self.settle(slot, false);
        }
    }
}
