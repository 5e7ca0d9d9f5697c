//! Checks a whole request before any of it is applied, so that it succeeds or fails as a unit.
//!
//! In: edits in order. Out: nothing, or a text that says which edit is wrong, why, and what to change.

mod links;
mod rules;

use std::collections::{BTreeMap, BTreeSet};

use super::World;
use super::chain::Chain;
use super::edit::{Edit, Put};
use super::edit_same::Touch;
use super::names::Names;
use super::parts::PlacedShape;
use super::rule_draft::RuleDraft;
use crate::ids::BodyId;
use crate::limits::{EXTENT_MAX_M, PRIORITY_MAX, PRIORITY_MIN, SHAPES_PER_BODY_MAX};
use crate::math::Pose;
use crate::scene::BodySpec;
use crate::wire::BODY_NAME_LEN;
use links::Sketch;

/// Most names of bodies and rigid groups in a boot: all are kept, because an id stays with its name.
const NAMES_MAX: usize = 1 << 22;

/// Changes of the scene by the edits checked so far.
struct Draft<'a> {
    world: &'a World,
    /// Bodies that the request puts, attaches, detaches or removes (`None`).
    bodies: BTreeMap<&'a str, Option<Sketch<'a>>>,
    /// Whether the place of a body is known: a cache, without bodies for which it may have changed.
    placed: Chain<&'a str, bool>,
    /// Changes of bodies by the request, except of their places.
    touched: BTreeMap<&'a str, Touch>,
    /// The last `report_within_m` set for all bodies, as in `Touch`; bodies with a later one of their own override it.
    all_within_m: Option<Option<f64>>,
    /// Number of the edit that is being checked, from 1 on.
    at: usize,
    /// Number of the last edit that forgot the poses of a source's bodies, by source; 0: none did.
    forgotten: Vec<usize>,
    /// Ids that the request asks for, and their names; a name keeps its id even if its body is removed again.
    ids: BTreeMap<BodyId, &'a str>,
    /// The same by name.
    asked: BTreeMap<&'a str, BodyId>,
    len: usize,
    rules: Option<RuleDraft<'a>>,
    /// Patterns that a body is known to match; emptied when a body goes.
    matched: BTreeSet<&'a str>,
}

/// Checks a value of `report_within_m`.
fn is_margin(report_within_m: Option<f64>) -> Result<(), String> {
    match report_within_m {
        Some(metres) if !(0.0..=EXTENT_MAX_M).contains(&metres) => Err(format!(
            "`report_within_m` is {metres}: write metres from 0 to {EXTENT_MAX_M}"
        )),
        _ => Ok(()),
    }
}

impl World {
    /// Whether a request can be applied as a whole.
    ///
    /// * `numbered` - whether errors give the number of the edit.
    /// * `step` - called after each edit, and for each rule with a pattern.
    pub(super) fn check(
        &self,
        edits: &[Edit],
        numbered: bool,
        step: &mut dyn FnMut(),
    ) -> Result<(), String> {
        let mut draft = Draft {
            world: self,
            bodies: BTreeMap::new(),
            placed: Chain::default(),
            touched: BTreeMap::new(),
            all_within_m: None,
            at: 0,
            forgotten: vec![0; self.sources.len()],
            ids: BTreeMap::new(),
            asked: BTreeMap::new(),
            len: self.order.len(),
            rules: None,
            matched: BTreeSet::new(),
        };
        for (at, edit) in edits.iter().enumerate() {
            draft.at = at + 1;
            draft.look_at(edit).map_err(|text| {
                if numbered {
                    format!("edit {}: {text}", at + 1)
                } else {
                    text
                }
            })?;
            step();
        }
        draft.references_hold(edits)?;
        draft.patterns_hold(step)
    }
}

impl<'a> Draft<'a> {
    fn look_at(&mut self, edit: &'a Edit) -> Result<(), String> {
        match edit {
            Edit::Put(Put { body, shapes }) => {
                bends_as_said(body, shapes)?;
                self.look_at_put(body, shapes.len())?;
                // A repeated put changes nothing, nor how well the place is known.
                if !self.is_there(body, shapes) {
                    self.bodies
                        .insert(&body.name, Some(Sketch::of_put(body, self.at)));
                    self.placed.forget(&body.name);
                }
                Ok(())
            }
            Edit::Remove { name } => {
                self.must_have(name)?;
                self.bodies.insert(name, None);
                self.placed.forget(name);
                self.matched.clear();
                self.len -= 1;
                Ok(())
            }
            Edit::Enable { name, enabled } => {
                self.must_have(name)?;
                self.touched.entry(name).or_default().enabled = Some(*enabled);
                Ok(())
            }
            Edit::Filter { name, group, mask } => {
                self.must_have(name)?;
                let touch = self.touched.entry(name).or_default();
                touch.group = group.or(touch.group);
                touch.mask = mask.or(touch.mask);
                Ok(())
            }
            Edit::Margin {
                name,
                report_within_m,
            } => self.look_at_margin(name.as_deref(), *report_within_m),
            Edit::Rule(rule) => self.look_at_rule(rule),
            Edit::DropRules { a, b } => self.look_at_drop(a, b),
            Edit::Attach { name, to, pose } => {
                self.look_at_attach(name, to.as_deref(), pose.as_ref())
            }
            Edit::Reset { source } => self.look_at_reset(source.as_deref()),
        }
    }

    fn look_at_margin(
        &mut self,
        name: Option<&'a str>,
        report_within_m: Option<f64>,
    ) -> Result<(), String> {
        if let Some(name) = name {
            self.must_have(name)?;
            self.touched.entry(name).or_default().report_within_m = Some(report_within_m);
        } else {
            self.all_within_m = Some(report_within_m);
            for touch in self.touched.values_mut() {
                touch.report_within_m = None;
            }
        }
        is_margin(report_within_m)
    }

    /// Whether an identical body exists at this point of the request.
    fn is_there(&self, spec: &BodySpec, shapes: &[PlacedShape]) -> bool {
        let name = &*spec.name;
        let sketch = self.bodies.get(name);
        // A body whose attachment the request changed counts as different: its place follows from another body, or from
        // its start pose.
        let is_other = |s: &Option<Sketch<'_>>| s.is_none_or(|s| s.is_put || s.hangs.is_some());
        let slot = self.world.slot_named(name);
        let Some(slot) = slot.filter(|_| !sketch.is_some_and(is_other)) else {
            return false;
        };
        let touch = self.touched.get(name).copied().unwrap_or_default();
        let touch = Touch {
            report_within_m: touch.report_within_m.or(self.all_within_m),
            is_let_go: sketch.is_some(),
            ..touch
        };
        self.world.is_same(slot, spec, shapes, &touch)
    }

    fn look_at_reset(&mut self, source: Option<&str>) -> Result<(), String> {
        match source {
            None => self.forgotten.fill(self.at),
            Some(name) => {
                let Some(source) = self.world.source_named(name) else {
                    return Err(format!(
                        "there is no source `{name}`: name one of the scene's sources, or none to reset all"
                    ));
                };
                self.forgotten[source.index()] = self.at;
            }
        }
        self.placed.clear();
        Ok(())
    }

    /// Whether a body exists at this point of the request.
    fn has(&self, name: &str) -> bool {
        match self.bodies.get(name) {
            Some(body) => body.is_some(),
            None => self.world.slot_named(name).is_some(),
        }
    }

    /// A body as it is at this point of the request.
    fn body(&self, name: &str) -> Option<Sketch<'a>> {
        match self.bodies.get(name) {
            Some(body) => *body,
            None => Sketch::of_world(self.world, self.world.slot_named(name)?),
        }
    }

    fn must_have(&self, name: &str) -> Result<Sketch<'a>, String> {
        self.body(name)
            .ok_or_else(|| self.no_body(name, "put the body first"))
    }

    /// Error text: no body has this name, with the nearest name as a hint.
    fn no_body(&self, name: &str, or_else: &str) -> String {
        let meant = self.world.name_meant(name).filter(|meant| self.has(meant));
        let mend = match meant {
            Some(meant) => format!("did you mean `{meant}`? If not, {or_else}"),
            None => format!("correct the name, or {or_else}"),
        };
        format!("there is no body `{name}`: {mend}")
    }

    fn look_at_put(&mut self, spec: &'a BodySpec, shapes: usize) -> Result<(), String> {
        let name = &*spec.name;
        let wrong = |what: String| Err(format!("body `{name}`: {what}"));
        if name.is_empty() || name.len() > BODY_NAME_LEN {
            return wrong(format!("a name has 1 to {BODY_NAME_LEN} bytes"));
        }
        if shapes == 0 || shapes > SHAPES_PER_BODY_MAX {
            return wrong(format!(
                "a body has 1 to {SHAPES_PER_BODY_MAX} shapes, not {shapes}"
            ));
        }
        let p = &spec.pose;
        let numbers = p.translation.vector.iter().chain(p.rotation.coords.iter());
        if !numbers
            .chain([&spec.report_within_m])
            .all(|v| v.is_finite())
        {
            return wrong("its pose and `report_within_m` must be finite".to_owned());
        }
        let speed_mps = spec.max_speed_mps.unwrap_or(0.0);
        if spec.report_within_m < 0.0 || !speed_mps.is_finite() || speed_mps < 0.0 {
            return wrong("`report_within_m` and `max_speed_mps` are not negative".to_owned());
        }
        if !(PRIORITY_MIN..=PRIORITY_MAX).contains(&spec.priority) {
            return wrong(format!(
                "`priority` is from {PRIORITY_MIN} to {PRIORITY_MAX}"
            ));
        }
        match spec.source {
            Some(source) if source >= self.world.sources.len() => {
                return wrong("its source is not in the scene: name one of the scene's".to_owned());
            }
            None if spec.moves && spec.attached_to.is_none() => {
                return wrong("it moves, but no source may move it: give `source`".to_owned());
            }
            _ => {}
        }
        self.look_at_id(spec)?;
        if !self.has(name) {
            self.len += 1;
            if self.len > self.world.bodies_limit {
                let limit = self.world.bodies_limit;
                return wrong(format!(
                    "the scene is full ({limit} bodies): raise `limits.bodies`"
                ));
            }
        }
        let is_full = |names: &Names| names.len() + self.bodies.len() >= NAMES_MAX;
        let (names, groups) = (&self.world.names, &self.world.rigid_groups);
        if !self.has(name) && is_full(names) || spec.rigid_group.is_some() && is_full(groups) {
            return wrong(format!(
                "{NAMES_MAX} names were used since the start: use names again, or restart"
            ));
        }
        Ok(())
    }

    /// An id belongs to one name for a boot, and a name has one id.
    fn look_at_id(&mut self, spec: &'a BodySpec) -> Result<(), String> {
        if spec.id == BodyId(0) {
            return Ok(());
        }
        let (name, id) = (&*spec.name, spec.id.0);
        let names = &self.world.names;
        let had = names.find_name(name).and_then(|n| n.id);
        let had = had.or_else(|| self.asked.get(name).copied());
        if let Some(had) = had.filter(|had| *had != spec.id) {
            return Err(format!(
                "body `{name}` has the id {} for this run of the daemon, not {id}: give that, or none",
                had.0
            ));
        }
        let owner = names.owner_of(spec.id).map(|n| &*n.text);
        let owner = owner.or_else(|| self.ids.get(&spec.id).copied());
        if let Some(owner) = owner.filter(|owner| *owner != name) {
            return Err(format!(
                "body `{name}`: the id {id} belongs to `{owner}` for this run of the daemon: give another, or none"
            ));
        }
        self.ids.insert(spec.id, name);
        self.asked.insert(name, spec.id);
        Ok(())
    }
}

/// Whether shapes that deform belong to a body that says so, and it can.
fn bends_as_said(spec: &BodySpec, shapes: &[PlacedShape]) -> Result<(), String> {
    let wrong = |what: &str| Err(format!("body `{}`: {what}", spec.name));
    let bending = shapes.iter().filter(|p| p.shape.is_deforming()).count();
    if !spec.deforms {
        return match bending {
            0 => Ok(()),
            _ => wrong("it has a shape that deforms: write deforms = true"),
        };
    }
    if (bending, shapes.len()) != (1, 1) || shapes[0].pose != Pose::identity() {
        return wrong("it deforms: give one triangle mesh without a pose of its own");
    }
    if !spec.moves || spec.attached_to.is_some() || spec.continuous {
        return wrong("it deforms: it moves, is not continuous and hangs on no other");
    }
    Ok(())
}
