//! Edits that touch many bodies: pair rules, margins, reset, and what the filters make of the scene afterwards.

use super::World;
use super::census::slot_at;
use super::rules::sides_of;
use crate::ids::BodySlot;
use crate::scene::PairRule;
use crate::wire::EndCause;

impl World {
    pub(super) fn add_rule(&mut self, rule: &PairRule) -> bool {
        if self.filters.rules.list().last() == Some(rule) {
            return false;
        }
        let mut list = self.filters.rules.list().to_vec();
        // The same rule further up has nothing to say behind this one.
        list.retain(|other| other != rule);
        list.push(rule.clone());
        self.set_rules(list, std::slice::from_ref(rule));
        true
    }

    pub(super) fn drop_rules(&mut self, a: &str, b: &str) -> bool {
        let (dropped, list): (Vec<PairRule>, Vec<PairRule>) = self
            .filters
            .rules
            .list()
            .iter()
            .cloned()
            .partition(|r| is_rule_of(r, a, b));
        self.set_rules(list, &dropped);
        !dropped.is_empty()
    }

    /// New rules, and a new search for the pairs of all bodies that the changed ones speak of.
    fn set_rules(&mut self, list: Vec<PairRule>, changed: &[PairRule]) {
        self.filters.rules.set(list, &mut self.names);
        for index in 0..self.bodies.len() {
            self.filters.mark_ruled(index);
            let slot = slot_at(index);
            let named = self
                .body(slot)
                .is_some_and(|body| changed.iter().any(|rule| sides_of(rule, &body.name) != 0));
            if named {
                self.requery(slot);
            }
        }
    }

    /// Sets the distance that pairs of a body, or of all, are told as near within; whether any was another.
    pub(super) fn set_margins(&mut self, name: Option<&str>, report_within_m: Option<f64>) -> bool {
        let Some(name) = name else {
            let slots = 0..self.bodies.len();
            return slots.fold(false, |any, slot| {
                self.set_margin(slot_at(slot), report_within_m) | any
            });
        };
        let slot = self.slot_named(name);
        slot.is_some_and(|slot| self.set_margin(slot, report_within_m))
    }

    fn set_margin(&mut self, slot: BodySlot, report_within_m: Option<f64>) -> bool {
        let entry = &mut self.entries[slot.index()];
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
        entry.edited |= put_m != Some(wanted_m);
        if let Some(hot) = self.hot(slot) {
            hot.report_within_m = wanted_m;
        }
        // Its pairs are judged anew; its box is widened as it must be now by the recount that follows.
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
            let slot = slot_at(index);
            let Some(body) = self.body(slot) else {
                continue;
            };
            if body.moves {
                self.forget_pose(slot);
            } else {
                self.begin_anew(slot);
            }
        }
        self.settle_attached();
    }

    /// Ends the pairs of a body that stays in the broad phase, and has them begin anew.
    pub(super) fn begin_anew(&mut self, slot: BodySlot) {
        if self.body(slot).is_some_and(|body| body.in_broad) {
            self.lists.remove(slot, EndCause::Reset);
            self.lists.insert(slot);
        }
    }

    /// What the filters make of the scene after an edit: ignored and forced pairs, and how wide boxes must be.
    pub(super) fn recount(&mut self) {
        self.filters.count_ignored(&self.names);
        self.filters.find_forced(&self.names);
        for index in 0..self.bodies.len() {
            let slot = slot_at(index);
            let Some(body) = self.body(slot) else {
                continue;
            };
            let wanted_m = self.widening(slot, body, body.reach_m);
            if wanted_m.to_bits() != self.entries[index].widened_m.to_bits() {
                self.settle(slot, false);
            }
        }
    }
}

/// Whether a rule has these two sides, in either order.
pub(super) fn is_rule_of(rule: &PairRule, a: &str, b: &str) -> bool {
    (rule.a == a && rule.b == b) || (rule.a == b && rule.b == a)
}
