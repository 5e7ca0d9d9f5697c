//! Attachments: the root of each attached body, and its pose relative to the root.
//!
//! In: attachments by name, after an edit. Out: roots and root poses; each body whose root changed is settled.

use std::collections::BTreeMap;

use super::World;
use super::body::Body;
use super::chain::Chain;
use super::filters::MOVES;
use crate::ids::{BodySlot, SourceSlot};
use crate::math::{Pose, relative};

/// Places of bodies after the edits of a request so far, as far as they were asked for.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    /// Whether the request may have moved any body.
    any_moved: bool,
    /// Roots of attached bodies, and their poses relative to them.
    roots: Chain<BodySlot, (BodySlot, Pose)>,
}

impl Places {
    /// Forgets all roots: bodies may have moved.
    pub(super) fn forget(&mut self) {
        self.any_moved = true;
        self.roots.clear();
    }
}

impl World {
    /// Attaches a body to another, or detaches it; [`World::link`] updates the roots.
    pub(super) fn attach(
        &mut self,
        name: &str,
        to: Option<&str>,
        pose: Option<&Pose>,
        places: &mut Places,
    ) -> bool {
        let Some(slot) = self.slot_named(name) else {
            return false;
        };
        let Some(to) = to else {
            return self.detach(slot, pose, places);
        };
        let seen = match (pose, self.slot_named(to)) {
            (None, Some(to)) => relative(&self.by_now(to, places), &self.by_now(slot, places)),
            _ => Pose::identity(),
        };
        let to = self.names.intern(to);
        let entry = &mut self.entries[slot.index()];
        let old = entry.attach;
        let hangs_there = old.is_some_and(|(on, _)| on == to);
        let attach = (to, pose.copied().unwrap_or(seen));
        if old == Some(attach) || pose.is_none() && hangs_there {
            return false;
        }
        entry.attach = Some(attach);
        places.roots.forget(slot);
        places.any_moved |= pose.is_some();
        true
    }

    /// The pose of a body after the edits so far; if its root was removed, the pose before them.
    ///
    /// Cost: that of finding its root, if the request moved any body.
    fn by_now(&self, slot: BodySlot, places: &mut Places) -> Pose {
        let pose = |slot| {
            self.body(slot)
                .map_or_else(Pose::identity, |body| body.pose)
        };
        if !places.any_moved {
            return pose(slot);
        }
        let (top, local) = self.root_by_now(slot, places);
        pose(top) * local
    }

    /// The root of a body after the edits so far, and its pose relative to it.
    ///
    /// Cost: O(bodies between it and its root), each only once until its attachment changes.
    fn root_by_now(&self, slot: BodySlot, places: &mut Places) -> (BodySlot, Pose) {
        let root = self.root_among(slot, &mut places.roots.known);
        let mut at = slot;
        while let Some((to, _)) = self.hold_of(at)
            && places.roots.hang(to, at)
        {
            at = to;
        }
        root
    }

    /// Detaches a body: it keeps its place, age and status; from now on its own source moves it.
    fn detach(&mut self, slot: BodySlot, pose: Option<&Pose>, places: &mut Places) -> bool {
        if self.entries[slot.index()].attach.is_none() {
            return false;
        }
        let by_now = self.by_now(slot, places);
        let (root, _) = self.root_by_now(slot, places);
        let of_root = &self.entries[root.index()];
        // Otherwise the root was removed, and the place is no longer known.
        let is_root = of_root.attach.is_none();
        let root_body = self.body(root);
        let bent = root_body.and_then(|body| body.vertices.as_deref());
        let has_pose = of_root.has_pose && bent.is_none_or(|v| v.version.is_some());
        let refused = of_root.refused || bent.is_some_and(|v| v.refused.is_some());
        let (has_pose, refused) = (is_root && has_pose, is_root && refused);
        let root_moves = of_root.spec.as_ref().is_some_and(|spec| spec.moves);
        let age = |b: &Body| (b.stamp_ns, b.since_ns, b.received_ns, b.reject);
        let age = root_body.map(|body| (age(body), self.timeout_of(body)));
        let now_ns = self.begun_ns.max(self.now_ns);
        let entry = &mut self.entries[slot.index()];
        let Some(moves) = entry.spec.as_ref().map(|spec| spec.moves) else {
            return false;
        };
        entry.attach = None;
        places.roots.forget(slot);
        entry.has_pose = has_pose || !moves;
        entry.refused = refused && moves;
        entry.raw = [f64::NAN; 7];
        // Its pose came from another source: a pause of its own source does not confirm it.
        entry.seen = 0;
        if let (Some(body), Some((age, timeout_ns))) = (self.bodies[slot.index()].as_mut(), age) {
            (body.stamp_ns, body.since_ns, body.received_ns, body.reject) = age;
            body.lent_timeout_ns = if moves { timeout_ns } else { u64::MAX };
            if !root_moves {
                // It was attached to a body that cannot move: its age starts now.
                body.since_ns = Some(now_ns);
            }
        }
        // At once, since later edits of the request need it.
        self.take_root(slot, (slot, Pose::identity()));
        let told = pose.filter(|_| !moves);
        let was_in = self.body(slot).is_some_and(|body| body.in_broad);
        // Its former root no longer moves it, and its own source has not sent a velocity yet.
        let other_speed = self.take_velocity(slot, None);
        let moved = self.place(slot, told.unwrap_or(&by_now));
        if moved {
            self.forget_way(slot);
        }
        // Also if it did not move: its status may have changed, and `take_root` sees no change if the request itself
        // had attached it.
        self.settle(slot, moved);
        if other_speed && !moved && was_in {
            self.lists.restated(slot);
        }
        places.any_moved |= told.is_some();
        true
    }

    /// Finds the roots of these bodies and of all attached ones again, and settles those whose root, pose or mobility
    /// changed. Any other body stays its own root.
    ///
    /// Cost: O(n log n) of these and the attached bodies.
    pub(super) fn link<'a>(&mut self, edited: impl Iterator<Item = &'a BodySlot>) {
        let mut slots = self.attached.slots().to_vec();
        slots.extend(edited);
        slots.sort_unstable();
        slots.dedup();
        let (mut known, mut attached) = (BTreeMap::new(), Vec::new());
        for slot in slots {
            if self.body(slot).is_none() {
                continue;
            }
            let root = self.root_among(slot, &mut known);
            if root.0 != slot {
                attached.push(slot);
            }
            self.take_root(slot, root);
        }
        self.link_paths();
        // After their roots have been settled.
        for slot in &attached {
            self.entries[slot.index()].touched = self.tick;
        }
        let entries = &self.entries;
        self.attached
            .set(attached, |slot| entries[slot.index()].root);
        self.settle_attached();
    }

    /// Sets the root of a body and its pose relative to it, and settles the body if that, or its mobility, changed.
    fn take_root(&mut self, slot: BodySlot, (root, root_pose): (BodySlot, Pose)) {
        let entry = &mut self.entries[slot.index()];
        let rooted = entry.root == root && entry.root_pose == root_pose;
        entry.root = root;
        entry.root_pose = root_pose;
        let moves_changed = self.take_freedom(slot, root);
        if rooted && !moves_changed {
            return;
        }
        self.filters_of_root(slot, root);
        if root == slot {
            self.settle(slot, false);
        }
        self.requery(slot);
        if moves_changed && self.body(slot).is_some_and(|body| body.unbounded) {
            // Its certificates counted its motion by another rule.
            self.begin_anew(slot);
        }
    }

    /// The body that this one is attached to, if it exists, and the relative pose.
    pub(super) fn hold_of(&self, slot: BodySlot) -> Option<(BodySlot, Pose)> {
        let (to, local) = self.entries[slot.index()].attach?;
        Some((self.names.get(to).slot?, local))
    }

    /// The chain of bodies that this one is attached to, nearest first, each with its pose relative to it.
    pub(super) fn above(&self, slot: BodySlot) -> impl Iterator<Item = (BodySlot, Pose)> + '_ {
        let first = Some((slot, Pose::identity()));
        let next = |(at, pose): &(BodySlot, Pose)| {
            let (to, local) = self.hold_of(*at)?;
            Some((to, local * pose))
        };
        // Bounded, since within a request attachments may form a ring.
        let walk = std::iter::successors(first, next).skip(1);
        walk.take(self.bodies.len())
    }

    /// The root of a body (itself without an attachment) and its pose relative to it; each attached body is visited
    /// once.
    fn root_among(
        &self,
        slot: BodySlot,
        known: &mut BTreeMap<BodySlot, (BodySlot, Pose)>,
    ) -> (BodySlot, Pose) {
        let (mut at, mut way) = (slot, Vec::new());
        // The check of the request has excluded rings and missing bodies.
        let (root, mut pose) = loop {
            if let Some(found) = known.get(&at) {
                break *found;
            }
            match self.hold_of(at) {
                Some((to, local)) if way.len() < self.bodies.len() => {
                    way.push((at, local));
                    at = to;
                }
                _ => break (at, Pose::identity()),
            }
        };
        for (at, local) in way.into_iter().rev() {
            pose *= local;
            known.insert(at, (root, pose));
        }
        (root, pose)
    }

    /// An attached body can move if its root can, and is moved by the root's source.
    ///
    /// * returns - whether its mobility changed.
    fn take_freedom(&mut self, slot: BodySlot, root: BodySlot) -> bool {
        let Some(spec) = &self.entries[root.index()].spec else {
            return false;
        };
        let source = spec.source.filter(|_| spec.moves);
        let source = source.map(SourceSlot::at);
        let Some(body) = self.bodies[slot.index()].as_mut() else {
            return false;
        };
        let changed = body.moves != spec.moves;
        body.moves = spec.moves;
        if changed {
            self.touched.push(slot);
        }
        // The names message contains the source of a body.
        self.names_changed |= body.source != source;
        body.source = source;
        changed
    }

    fn filters_of_root(&mut self, slot: BodySlot, root: BodySlot) {
        let moves = self.body(slot).is_some_and(|body| body.moves);
        let root_name = self.filters.bodies[root.index()].name;
        if let Some(hot) = self.hot(slot) {
            hot.root = root_name;
            hot.flags = if moves {
                hot.flags | MOVES
            } else {
                hot.flags & !MOVES
            };
        }
    }
}
