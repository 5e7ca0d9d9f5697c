//! Attached bodies: which body each hangs on in the end, and at which pose.
//!
//! In: attachments by name, after an edit. Out: roots and root poses, and each body settled whose root is another now.

use super::World;
use super::census::slot_at;
use super::filters::MOVES;
use crate::ids::{BodySlot, SourceSlot};
use crate::math::{Pose, relative};

impl World {
    /// Hangs a body on another, or lets it go; [`World::link`] does the rest.
    pub(super) fn attach(&mut self, name: &str, to: Option<&str>, pose: Option<&Pose>) -> bool {
        let Some(slot) = self.slot_named(name) else {
            return false;
        };
        self.entries[slot.index()].edited = true;
        let Some(to) = to else {
            return self.detach(slot, pose);
        };
        let now = self.pose_seen_from(slot, to);
        let to = self.names.intern(to);
        let attach = Some((to, pose.copied().unwrap_or(now)));
        let entry = &mut self.entries[slot.index()];
        let changed = entry.attach != attach;
        entry.attach = attach;
        changed
    }

    fn pose_seen_from(&self, slot: BodySlot, to: &str) -> Pose {
        let to = self.slot_named(to).and_then(|to| self.body(to));
        match (self.body(slot), to) {
            (Some(body), Some(to)) => relative(&to.pose, &body.pose),
            _ => Pose::identity(),
        }
    }

    /// It stays where it is, as old and as well known as it was; from now on its own source speaks for it.
    fn detach(&mut self, slot: BodySlot, pose: Option<&Pose>) -> bool {
        let entry = &self.entries[slot.index()];
        if entry.attach.is_none() {
            return false;
        }
        let root = &self.entries[entry.root.index()];
        let (has_pose, refused) = (root.has_pose, root.refused);
        let spec = entry.spec.clone();
        // What it hung on does not move: until now its place was beyond doubt.
        let now_ns = self.now_ns;
        if let Some(body) = self.bodies[slot.index()].as_mut().filter(|b| !b.moves) {
            body.since_ns = Some(now_ns);
        }
        let entry = &mut self.entries[slot.index()];
        entry.attach = None;
        entry.has_pose = has_pose;
        entry.refused = refused;
        entry.raw = [f64::NAN; 7];
        if let Some(spec) = spec
            && !spec.moves
        {
            entry.has_pose = true;
            entry.refused = false;
            if let Some(pose) = pose
                && self.place(slot, pose)
            {
                self.forget_way(slot);
                self.settle(slot, true);
            }
        }
        true
    }

    /// Finds every body's root anew and settles the bodies whose root, pose or freedom to move changed.
    pub(super) fn link(&mut self) {
        self.attached.clear();
        for index in 0..self.bodies.len() {
            let slot = slot_at(index);
            if self.bodies[index].is_none() {
                continue;
            }
            let (root, root_pose) = self.root_of(slot);
            let entry = &mut self.entries[index];
            let rooted = entry.root == root && entry.root_pose == root_pose;
            entry.root = root;
            entry.root_pose = root_pose;
            if root != slot {
                self.attached.push(slot);
            }
            let moves_changed = self.take_freedom(slot, root);
            if !rooted || moves_changed {
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
        }
        self.link_paths();
        // Their roots are settled now.
        for place in 0..self.attached.len() {
            let slot = self.attached[place];
            self.entries[slot.index()].touched = self.tick;
        }
        self.settle_attached();
    }

    /// Walks up to the body that hangs on none. The check before an edit has shut out rings and loose ends.
    fn root_of(&self, slot: BodySlot) -> (BodySlot, Pose) {
        let (mut at, mut pose) = (slot, Pose::identity());
        for _ in 0..self.bodies.len() {
            let Some((to, local)) = self.entries[at.index()].attach else {
                break;
            };
            let Some(next) = self.names.get(to).slot else {
                break;
            };
            pose = local * pose;
            at = next;
        }
        (at, pose)
    }

    /// A body moves when its root does, and by the hand of the root's source.
    ///
    /// * returns - whether it may move now and could not before, or the other way round.
    fn take_freedom(&mut self, slot: BodySlot, root: BodySlot) -> bool {
        let Some(spec) = self.entries[root.index()].spec.clone() else {
            return false;
        };
        let source = spec.source.filter(|_| spec.moves).map(slot_at);
        let Some(body) = self.bodies[slot.index()].as_mut() else {
            return false;
        };
        let changed = body.moves != spec.moves;
        body.moves = spec.moves;
        body.source = source.map(|s| SourceSlot(s.0));
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
