//! Looks at a whole request before any of it is applied, so that it succeeds or fails as one.
//!
//! In: edits in their order. Out: nothing, or a text that says which edit, what is wrong and what to change.

mod rules;

use std::collections::{BTreeMap, BTreeSet};

use super::World;
use super::edit::Edit;
use super::parts::PlacedShape;
use super::rule_draft::RuleDraft;
use crate::ids::BodyId;
use crate::limits::{EXTENT_MAX_M, PRIORITY_MAX, PRIORITY_MIN, SHAPES_PER_BODY_MAX};
use crate::math::Pose;
use crate::scene::BodySpec;
use crate::wire::BODY_NAME_LEN;

/// Most names met in a boot: each is kept, because an id stays with its name.
const NAMES_MAX: usize = 1 << 22;

/// The scene as it would be after the edits looked at so far, where they change it.
struct Draft<'a> {
    world: &'a World,
    /// Bodies that the request puts (with what they hang on) or removes (`None`).
    bodies: BTreeMap<&'a str, Option<Hangs<'a>>>,
    /// Ids that the request asks for, and for which name; they stay with it, also where its body goes again.
    ids: BTreeMap<BodyId, &'a str>,
    /// The same by name.
    asked: BTreeMap<&'a str, BodyId>,
    len: usize,
    rules: Option<RuleDraft<'a>>,
    /// Patterns that a body is known to match; emptied when a body goes.
    matched: BTreeSet<&'a str>,
}

/// What a body hangs on.
type Hangs<'a> = Option<&'a str>;

/// Whether a distance can be one that pairs are told as near within.
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
    /// * `numbered` - whether errors say which edit it is.
    pub(super) fn check(&self, edits: &[Edit], numbered: bool) -> Result<(), String> {
        let mut draft = Draft {
            world: self,
            bodies: BTreeMap::new(),
            ids: BTreeMap::new(),
            asked: BTreeMap::new(),
            len: self.order.len(),
            rules: None,
            matched: BTreeSet::new(),
        };
        for (at, edit) in edits.iter().enumerate() {
            draft.look_at(edit).map_err(|text| {
                if numbered {
                    format!("edit {}: {text}", at + 1)
                } else {
                    text
                }
            })?;
        }
        draft.references_hold(edits)
    }

    /// Whether the place of a body is known well enough to hang something on it, or it on something.
    fn is_placed(&self, name: &str) -> bool {
        let Some(slot) = self.slot_named(name) else {
            return false;
        };
        let root = &self.entries[self.entries[slot.index()].root.index()];
        root.has_pose && !root.refused
    }
}

impl<'a> Draft<'a> {
    fn look_at(&mut self, edit: &'a Edit) -> Result<(), String> {
        match edit {
            Edit::Put { body, shapes } => {
                bends_as_said(body, shapes)?;
                self.look_at_put(body, shapes.len())
            }
            Edit::Remove { name } => {
                self.must_have(name)?;
                self.bodies.insert(name, None);
                self.matched.clear();
                self.len -= 1;
                Ok(())
            }
            Edit::Enable { name, .. } | Edit::Filter { name, .. } => self.must_have(name),
            Edit::Margin {
                name,
                report_within_m,
            } => {
                if let Some(name) = name {
                    self.must_have(name)?;
                }
                is_margin(*report_within_m)
            }
            Edit::Rule(rule) => self.look_at_rule(rule),
            Edit::DropRules { a, b } => self.look_at_drop(a, b),
            Edit::Attach { name, to, pose } => {
                self.look_at_attach(name, to.as_deref(), pose.as_ref())
            }
            Edit::Reset { source } => match source {
                Some(name) if self.world.source_named(name).is_none() => Err(format!(
                    "there is no source `{name}`: name one of the scene's sources, or none to reset all"
                )),
                _ => Ok(()),
            },
        }
    }

    /// Whether a body is there at this point of the request.
    fn has(&self, name: &str) -> bool {
        match self.bodies.get(name) {
            Some(body) => body.is_some(),
            None => self.world.slot_named(name).is_some(),
        }
    }

    fn must_have(&self, name: &str) -> Result<(), String> {
        if self.has(name) {
            return Ok(());
        }
        Err(format!(
            "there is no body `{name}`: correct the name, or put the body first"
        ))
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
            if self.world.names.len() + self.bodies.len() >= NAMES_MAX {
                return wrong(format!(
                    "{NAMES_MAX} names were used since the start: use names again, or restart"
                ));
            }
        }
        self.bodies.insert(name, Some(spec.attached_to.as_deref()));
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
                "body `{name}`: the id {id} belongs to `{owner}`: give another, or none"
            ));
        }
        self.ids.insert(spec.id, name);
        self.asked.insert(name, spec.id);
        Ok(())
    }

    fn names(&self) -> impl Iterator<Item = &str> {
        let world = self.world;
        let there = world.names.all().iter().filter(|n| n.slot.is_some());
        let put = self.bodies.iter().filter(|(_, b)| b.is_some());
        there
            .map(|n| &*n.text)
            .filter(|name| !matches!(self.bodies.get(name), Some(None)))
            .chain(put.map(|(name, _)| *name))
    }

    fn look_at_attach(
        &mut self,
        name: &'a str,
        to: Option<&'a str>,
        pose: Option<&Pose>,
    ) -> Result<(), String> {
        self.must_have(name)?;
        if pose.is_some_and(|p| !p.to_homogeneous().iter().all(|v| v.is_finite())) {
            return Err(format!("body `{name}`: its pose must be finite"));
        }
        // What this request puts has no place of its own yet but its start pose.
        let placed = |name: &str| self.bodies.contains_key(name) || self.world.is_placed(name);
        match to {
            Some(_) if self.deforms(name) => {
                return Err(format!(
                    "body `{name}` deforms: its source says where its vertices are, so it cannot hang on another"
                ));
            }
            Some(to) => {
                self.must_have(to)?;
                if pose.is_none() && !(placed(name) && placed(to)) {
                    return Err(format!(
                        "it is not known where `{name}` is seen from `{to}`: give `pose`, or wait for their frames"
                    ));
                }
            }
            None => self.look_at_detach(name, pose, placed(name))?,
        }
        self.bodies.insert(name, Some(to));
        Ok(())
    }

    /// A body let go needs a place, if it cannot move, or a source.
    fn look_at_detach(&self, name: &str, pose: Option<&Pose>, placed: bool) -> Result<(), String> {
        let slot = self.world.slot_named(name);
        let spec = slot.and_then(|s| self.world.entries[s.index()].spec.as_ref());
        let Some(spec) = spec else {
            return Ok(());
        };
        if spec.moves && pose.is_some() {
            return Err(format!(
                "body `{name}` moves: its source says where it is, leave out `pose`"
            ));
        }
        if spec.moves && spec.source.is_none() {
            return Err(format!(
                "body `{name}` moves, but no source may move it: put it with a `source`"
            ));
        }
        if !spec.moves && pose.is_none() && !placed {
            return Err(format!("it is not known where `{name}` is: give `pose`"));
        }
        Ok(())
    }

    fn deforms(&self, name: &str) -> bool {
        let slot = self.world.slot_named(name);
        let body = slot.and_then(|slot| self.world.body(slot));
        body.is_some_and(|body| body.vertices.is_some())
    }

    /// After the last edit: parents and attachments are there, and none hangs on itself.
    fn references_hold(&self, edits: &[Edit]) -> Result<(), String> {
        for edit in edits {
            if let Edit::Put { body, .. } = edit
                && self.has(&body.name)
                && let Some(parent) = body.parent.as_deref().filter(|p| !self.has(p))
            {
                return Err(format!(
                    "body `{}`: there is no body `{parent}` to be its parent: correct the name, or put it too",
                    body.name
                ));
            }
        }
        let names: Vec<&str> = self.names().collect();
        if !names.iter().any(|name| self.hangs_on(name).is_some()) {
            return Ok(());
        }
        for name in &names {
            let (mut at, mut steps) = (*name, 0);
            while let Some(to) = self.hangs_on(at) {
                if !self.has(to) {
                    return Err(format!(
                        "body `{at}` hangs on `{to}`, which is not there: let it go or remove it too"
                    ));
                }
                steps += 1;
                if steps > names.len() {
                    return Err(format!(
                        "body `{name}` would hang on itself: let one go first"
                    ));
                }
                at = to;
            }
        }
        Ok(())
    }

    fn hangs_on(&self, name: &str) -> Option<&str> {
        if let Some(body) = self.bodies.get(name) {
            return body.flatten();
        }
        let slot = self.world.slot_named(name)?;
        let (to, _) = self.world.entries[slot.index()].attach?;
        Some(&self.world.names.get(to).text)
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
