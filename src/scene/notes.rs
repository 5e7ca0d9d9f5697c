//! Notes on a scene that are not errors; `check` prints them in addition to its errors.

use std::collections::BTreeMap;

use crate::config::BroadMethod;
use crate::scene::table::shortened;
use crate::scene::{BodySpec, PairRule, Scene, is_pattern, pattern_matches};
use crate::shape::ShapeSpec;

impl PairRule {
    /// Whether it matches the pair of these two names, in either order.
    #[must_use]
    pub fn matches(&self, one: &str, other: &str) -> bool {
        (pattern_matches(&self.a, one) && pattern_matches(&self.b, other))
            || (pattern_matches(&self.a, other) && pattern_matches(&self.b, one))
    }
}

impl BodySpec {
    /// Whether one of its shapes is a half-space. Such a body has no bounding box and is paired with every body that
    /// does not consist of half-spaces only.
    #[must_use]
    pub fn is_unbounded(&self) -> bool {
        let is_half_space = |shape: &ShapeSpec| matches!(shape, ShapeSpec::HalfSpace { .. });
        self.shapes
            .iter()
            .any(|placed| is_half_space(&placed.shape))
    }

    /// Whether some of its shapes are half-spaces and some are not.
    fn is_half_space_and_more(&self) -> bool {
        let is_half_space = |shape: &ShapeSpec| matches!(shape, ShapeSpec::HalfSpace { .. });
        let others = self.shapes.iter();
        let mut others = others.filter(|placed| !is_half_space(&placed.shape));
        self.is_unbounded() && others.next().is_some()
    }
}

impl Scene {
    /// The rule that applies to a pair of names: the last one that matches.
    ///
    /// Cost: O(rules x names); for listings, not for ticks.
    #[must_use]
    pub fn rule_for(&self, one: &str, other: &str) -> Option<&PairRule> {
        self.rules
            .iter()
            .rev()
            .find(|rule| rule.matches(one, other))
    }

    /// What is legal but unusual, one sentence each: nothing to check, rules and sources without a body, half-spaces,
    /// continuous bodies, settings without effect.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.bodies.is_empty() {
            notes.push("the scene has no body: its state is never clear, add [[body]]".to_owned());
        }
        self.note_continuous(&mut notes);
        self.note_unread(&mut notes);
        self.note_half_spaces(&mut notes);
        self.note_sources(&mut notes);
        self.note_rules(&mut notes);
        self.note_groups(&mut notes);
        notes
    }

    fn note_half_spaces(&self, notes: &mut Vec<String>) {
        let unbounded = self.bodies.iter().filter(|body| body.is_unbounded());
        let unbounded: Vec<&BodySpec> = unbounded.collect();
        let [first, second, ..] = unbounded[..] else {
            return;
        };
        let others = unbounded.iter().any(|body| body.is_half_space_and_more());
        notes.push(format!(
            "{} bodies {} (\"{}\", \"{}\"{}): two half-spaces are never paired{}",
            unbounded.len(),
            if others {
                "have half-spaces"
            } else {
                "are half-spaces"
            },
            shortened(&first.name),
            shortened(&second.name),
            if unbounded.len() > 2 { ", .." } else { "" },
            if others {
                ", their other shapes are"
            } else {
                ""
            }
        ));
    }

    fn note_continuous(&self, notes: &mut Vec<String>) {
        for body in self.bodies.iter().filter(|body| body.continuous) {
            let name = shortened(&body.name);
            if body.is_unbounded() {
                notes.push(format!(
                    "body \"{name}\" says continuous = true, but a half-space is not swept: let what meets it be continuous"
                ));
            } else if !body.moves && body.attached_to.is_none() {
                notes.push(format!(
                    "body \"{name}\" says continuous = true, but it cannot move: there is nothing to sweep"
                ));
            }
        }
    }

    /// Adds notes on settings that have no effect.
    fn note_unread(&self, notes: &mut Vec<String>) {
        let unread = |body: &&BodySpec| body.teleport_m.is_some() && !body.continuous;
        if let Some(body) = self.bodies.iter().find(unread) {
            notes.push(format!(
                "body \"{}\" has teleport_m, which only a body with continuous = true reads",
                shortened(&body.name)
            ));
        }
        let unread = |body: &&BodySpec| body.attached_to.is_some() && body.on_stale.is_some();
        if let Some(body) = self.bodies.iter().find(unread) {
            notes.push(format!(
                "body \"{}\" has on_stale, but is attached: that of the body it hangs on counts",
                shortened(&body.name)
            ));
        }
        let one_thread = |method| method != BroadMethod::Order;
        if self.config.threads.is_some_and(|threads| threads > 1)
            && self.config.broad_phase.is_some_and(one_thread)
        {
            notes.push(
                "threads is more than 1, which only broad_phase = \"order\" makes use of"
                    .to_owned(),
            );
        }
    }

    fn note_sources(&self, notes: &mut Vec<String>) {
        for (place, source) in self.sources.iter().enumerate() {
            if !self.bodies.iter().any(|body| body.source == Some(place)) {
                let name = shortened(&source.name);
                notes.push(format!(
                    "source \"{name}\" has no body: it has nothing to send"
                ));
            }
        }
    }

    fn note_rules(&self, notes: &mut Vec<String>) {
        let matched = |side: &str| {
            self.bodies
                .iter()
                .any(|body| pattern_matches(side, &body.name))
        };
        for (place, rule) in self.rules.iter().enumerate() {
            for side in [&rule.a, &rule.b] {
                if !matched(side) {
                    let kind = if is_pattern(side) { "pattern" } else { "name" };
                    notes.push(format!(
                        "rule {}: no body has the {kind} \"{}\"",
                        place + 1,
                        shortened(side)
                    ));
                }
            }
            if rule.reason.is_empty() {
                notes.push(format!("rule {}: no reason is given", place + 1));
            }
        }
    }

    fn note_groups(&self, notes: &mut Vec<String>) {
        let mut members: BTreeMap<&str, usize> = BTreeMap::new();
        for body in &self.bodies {
            if let Some(group) = &body.rigid_group {
                *members.entry(group).or_default() += 1;
            }
            if body.group == 0 || body.mask == 0 {
                notes.push(format!(
                    "body \"{}\" has group or mask 0: it collides with nothing but what a rule checks",
                    shortened(&body.name)
                ));
            }
            if is_pattern(&body.name) {
                notes.push(format!(
                    "body \"{}\" has * or ? in its name: a rule of this name is a pattern",
                    shortened(&body.name)
                ));
            }
        }
        for (group, _) in members.iter().filter(|(_, count)| **count == 1) {
            notes.push(format!(
                "rigid_group \"{}\" has one body only",
                shortened(group)
            ));
        }
    }
}
