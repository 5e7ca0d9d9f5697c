//! Attachments and known places at each point of a request. In: one edit at a time, finally the whole request. Out:
//! nothing, or an error text.

use std::collections::BTreeSet;

use super::super::World;
use super::super::edit::{Edit, Put};
use super::Draft;
use crate::ids::BodySlot;
use crate::math::Pose;
use crate::scene::BodySpec;

/// A body after the edits so far.
#[derive(Clone, Copy)]
pub(super) struct Sketch<'a> {
    pub(super) spec: &'a BodySpec,
    /// The body that it is attached to.
    pub(super) hangs: Option<&'a str>,
    /// Whether its place is known by itself, without the body that it is attached to.
    has_place: bool,
    /// Number of the edit that decided that; 0: as before the request.
    at: usize,
    /// Whether the request puts it.
    pub(super) is_put: bool,
}

impl<'a> Sketch<'a> {
    /// A body that the request puts: for the other edits of the request its start pose counts as known.
    pub(super) fn of_put(spec: &'a BodySpec, at: usize) -> Self {
        Self {
            spec,
            hangs: spec.attached_to.as_deref(),
            has_place: spec.attached_to.is_none(),
            at,
            is_put: true,
        }
    }

    /// A body that existed before the request.
    pub(super) fn of_world(world: &'a World, slot: BodySlot) -> Option<Self> {
        let entry = &world.entries[slot.index()];
        let root = &world.entries[entry.root.index()];
        // The place of a body that is too old is not known; an attached body has the age of its root.
        let now_ns = world.begun_ns.max(world.now_ns);
        let root_body = world.body(entry.root);
        let is_old = root_body.is_none_or(|body| world.is_too_old(body, now_ns));
        let bent = root_body.and_then(|body| body.vertices.as_deref());
        let is_bent = bent.is_none_or(|v| v.version.is_some() && v.refused.is_none());
        Some(Self {
            spec: entry.spec.as_deref()?,
            hangs: entry.attach.map(|(to, _)| &*world.names.get(to).text),
            has_place: root.has_pose && !root.refused && is_bent && !is_old,
            at: 0,
            is_put: false,
        })
    }
}

impl<'a> Draft<'a> {
    /// Whether the place of a body is known well enough to attach another to it, or it to another. Cost: O(bodies
    /// between it and its root that are not in the cache).
    fn is_placed(&mut self, name: &'a str) -> bool {
        let mut at = name;
        let mut way = Vec::new();
        // Bounded, since within a request attachments may form a ring.
        let is_placed = loop {
            if let Some(known) = self.placed.known.get(at) {
                break *known;
            }
            let Some(body) = self.body(at).filter(|_| way.len() <= self.len) else {
                break false;
            };
            way.push(at);
            match body.hangs.filter(|to| self.has(to)) {
                Some(to) => {
                    self.placed.hang(to, at);
                    at = to;
                }
                None => break body.has_place && !self.is_forgotten(&body),
            }
        };
        self.placed
            .known
            .extend(way.into_iter().map(|at| (at, is_placed)));
        is_placed
    }

    fn is_forgotten(&self, body: &Sketch<'_>) -> bool {
        let source = body.spec.source.filter(|_| body.spec.moves);
        let forgotten = source.and_then(|source| self.forgotten.get(source));
        forgotten.is_some_and(|edit| *edit > body.at)
    }

    pub(super) fn look_at_attach(
        &mut self,
        name: &'a str,
        to: Option<&'a str>,
        pose: Option<&Pose>,
    ) -> Result<(), String> {
        let body = self.must_have(name)?;
        if pose.is_some_and(|p| !p.to_homogeneous().iter().all(|v| v.is_finite())) {
            return Err(format!("body `{name}`: its pose must be finite"));
        }
        let Some(to) = to else {
            return self.look_at_detach(name, &body, pose);
        };
        if body.spec.deforms {
            return Err(format!(
                "body `{name}` deforms: its source says where its vertices are, so it cannot hang on another"
            ));
        }
        self.must_have(to)?;
        if pose.is_none() && !(self.is_placed(name) && self.is_placed(to)) {
            return Err(format!(
                "it is not known where `{name}` is seen from `{to}`: say where (`position`), or wait for their frames"
            ));
        }
        self.placed.forget(name);
        let hung = Sketch {
            hangs: Some(to),
            has_place: body.has_place && pose.is_none(),
            ..body
        };
        self.bodies.insert(name, Some(hung));
        Ok(())
    }

    /// Checks a detach: the body needs a place if it cannot move, else a source.
    fn look_at_detach(
        &mut self,
        name: &'a str,
        body: &Sketch<'a>,
        pose: Option<&Pose>,
    ) -> Result<(), String> {
        let spec = body.spec;
        if spec.moves && pose.is_some() {
            return Err(format!(
                "body `{name}` moves: its source says where it is, leave out `position` and `orientation`"
            ));
        }
        if spec.moves && spec.source.is_none() {
            return Err(format!(
                "body `{name}` moves, but no source may move it: put it with a `source`"
            ));
        }
        let placed = self.is_placed(name);
        if !spec.moves && pose.is_none() && !placed {
            return Err(format!(
                "it is not known where `{name}` is: wait for the frames of what it hangs on, or put it where it is"
            ));
        }
        // If its root was removed, its place is no longer known.
        let hangs_on_one = body.hangs.is_none_or(|to| self.has(to));
        let free = Sketch {
            hangs: None,
            has_place: !spec.moves || placed && hangs_on_one,
            at: self.at,
            ..*body
        };
        if free.has_place != placed {
            self.placed.forget(name);
        }
        self.bodies.insert(name, Some(free));
        Ok(())
    }

    /// Checks after the last edit that parents and attachments exist, and that no attachments form a ring.
    ///
    /// Cost: O(edits + attached bodies), each a search.
    pub(super) fn references_hold(&self, edits: &[Edit]) -> Result<(), String> {
        for edit in edits {
            if let Edit::Put(Put { body, .. }) = edit
                && self.has(&body.name)
                && let Some(parent) = body.parent.as_deref().filter(|p| !self.has(p))
            {
                let why = self.no_body(parent, "put it too");
                return Err(format!("body `{}`: its parent: {why}", body.name));
            }
        }
        let world = self.world;
        let hung = world.attached.slots().iter();
        let hung = hung.filter_map(|slot| Some(&*world.body(*slot)?.name));
        let edited = self.bodies.iter();
        let edited = edited.filter(|(_, body)| body.is_some_and(|body| body.hangs.is_some()));
        // Bodies whose chains have been checked.
        let mut held: BTreeSet<&str> = BTreeSet::new();
        for name in hung.chain(edited.map(|(name, _)| *name)) {
            self.is_held(name, &mut held)?;
        }
        Ok(())
    }

    /// Whether the chain of attachments of a body, if it exists, ends at a root.
    fn is_held<'b>(&'b self, name: &'b str, held: &mut BTreeSet<&'b str>) -> Result<(), String> {
        let mut at = name;
        let mut way = BTreeSet::new();
        while !held.contains(at) {
            if !way.insert(at) {
                return Err(format!(
                    "body `{name}` would hang on itself: let one go first"
                ));
            }
            let Some(to) = self.body(at).and_then(|body| body.hangs) else {
                break;
            };
            if !self.has(to) {
                return Err(format!(
                    "body `{at}` hangs on `{to}`, which is not there: let it go or remove it too"
                ));
            }
            at = to;
        }
        held.extend(way);
        Ok(())
    }
}
