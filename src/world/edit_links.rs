//! Attached bodies: which body each hangs on in the end, and at which pose.
//!
//! In: attachments by name, after an edit. Out: roots and root poses, and each body settled whose root is another now.

use std::collections::BTreeMap;

use super::World;
use super::body::Body;
use super::chain::Chain;
use super::filters::MOVES;
use crate::ids::{BodySlot, SourceSlot};
use crate::math::{Pose, relative};

/// Where bodies are after the edits of a request so far, as far as that was asked.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    /// Whether some may be elsewhere than before the request.
    any_moved: bool,
    /// The root of bodies that hang on others, and their pose there.
    roots: Chain<BodySlot, (BodySlot, Pose)>,
}

impl Places {
    /// Bodies may be elsewhere by now.
    pub(super) fn forget(&mut self) {
        self.any_moved = true;
        self.roots.clear();
    }
}

impl World {
    /// Hangs a body on another, or lets it go; [`World::link`] does the rest.
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

    /// Where a body is after the edits so far. Where what it hung on is gone: where it was before them.
    ///
    /// Cost: that of its root, where the request moved any.
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

    /// The body that one hangs on in the end after the edits so far, and its pose there.
    ///
    /// Cost: the bodies above it; each of them once, until it hangs elsewhere.
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

    /// It stays where it is, as old and as well known as it was; from now on its own source speaks for it.
    fn detach(&mut self, slot: BodySlot, pose: Option<&Pose>, places: &mut Places) -> bool {
        if self.entries[slot.index()].attach.is_none() {
            return false;
        }
        let by_now = self.by_now(slot, places);
        let (root, _) = self.root_by_now(slot, places);
        let of_root = &self.entries[root.index()];
        // Else what it hung on is gone, and with it who says where it is.
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
        // Where it is was said by another: no pause of its own source speaks of it.
        entry.seen = 0;
        if let (Some(body), Some((age, timeout_ns))) = (self.bodies[slot.index()].as_mut(), age) {
            (body.stamp_ns, body.since_ns, body.received_ns, body.reject) = age;
            body.lent_timeout_ns = if moves { timeout_ns } else { u64::MAX };
            if !root_moves {
                // Until now its place was beyond doubt.
                body.since_ns = Some(now_ns);
            }
        }
        // At once: edits that follow find it on its own.
        self.take_root(slot, (slot, Pose::identity()));
        let told = pose.filter(|_| !moves);
        let was_in = self.body(slot).is_some_and(|body| body.in_broad);
        // What moved it does no more, and its own source has not said how it goes.
        let other_speed = self.take_velocity(slot, None);
        let moved = self.place(slot, told.unwrap_or(&by_now));
        if moved {
            self.forget_way(slot);
        }
        // Also where it was: another says how well that is known, and `take_root` sees no change where the request hung
        // it there.
        self.settle(slot, moved);
        if other_speed && !moved && was_in {
            self.lists.restated(slot);
        }
        places.any_moved |= told.is_some();
        true
    }

    /// Finds anew the roots of these bodies and of all that hang on others, and settles those whose root, pose or
    /// freedom to move changed. Any other body is its own root, as it was.
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
        // Their roots are settled now.
        for slot in &attached {
            self.entries[slot.index()].touched = self.tick;
        }
        let entries = &self.entries;
        self.attached
            .set(attached, |slot| entries[slot.index()].root);
        self.settle_attached();
    }

    /// Takes down which body one hangs on in the end and its pose there, and settles it where that, or its freedom to
    /// move, is another now.
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
            // What its certificates say of its motion was said by another rule.
            self.begin_anew(slot);
        }
    }

    /// What a body hangs on, if that is there, and its pose there.
    pub(super) fn hold_of(&self, slot: BodySlot) -> Option<(BodySlot, Pose)> {
        let (to, local) = self.entries[slot.index()].attach?;
        Some((self.names.get(to).slot?, local))
    }

    /// The bodies that one hangs on, the nearest first, each with its pose seen from there.
    pub(super) fn above(&self, slot: BodySlot) -> impl Iterator<Item = (BodySlot, Pose)> + '_ {
        let first = Some((slot, Pose::identity()));
        let next = |(at, pose): &(BodySlot, Pose)| {
            let (to, local) = self.hold_of(*at)?;
            Some((to, local * pose))
        };
        // No longer than the longest chain there can be: amid a request they may hang on each other.
        let walk = std::iter::successors(first, next).skip(1);
        walk.take(self.bodies.len())
    }

    /// The body that one hangs on in the end, itself where on none, and its pose seen from there; each body that hangs
    /// on another is walked over once.
    fn root_among(
        &self,
        slot: BodySlot,
        known: &mut BTreeMap<BodySlot, (BodySlot, Pose)>,
    ) -> (BodySlot, Pose) {
        let (mut at, mut way) = (slot, Vec::new());
        // The check before an edit has shut out rings and loose ends.
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

    /// A body moves when its root does, and by the hand of the root's source.
    ///
    /// * returns - whether it may move now and could not before, or the other way round.
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
        // Names say whose a body is, too.
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
