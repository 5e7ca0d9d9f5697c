//! Motion of continuous bodies: poses become legs of a path, and the path a box; in the next tick the box is tight
//! again.
//!
//! In: admitted poses, and the spin that the sender gives. Out: paths of bodies and of bodies attached to them. A body
//! that was not in the broad phase with its last pose has no path of its own: a first pose, one after a reset, or an
//! edit are no motion; but the motion before a reset in the same tick is. Bodies attached to it may take part
//! nevertheless, and follow its path.

use super::World;
use super::path::Path;
use super::place::tight_box;
use crate::ids::{BodySlot, SourceSlot};
use crate::math::{Aabb, Pose, Vec3};

impl World {
    /// Bodies with a path in this tick: those that are swept, and those that only carry one that is. Complete after
    /// [`World::age`].
    #[must_use]
    pub fn travelled(&self) -> &[BodySlot] {
        &self.travelled
    }

    /// Returns whether a step of a continuous body in this tick was a teleport by the scene's limit.
    #[must_use]
    pub fn has_teleported(&self) -> bool {
        let path = |slot: &BodySlot| self.body(*slot)?.path.as_ref();
        self.travelled
            .iter()
            .filter_map(path)
            .any(|path| path.has_teleported())
    }

    /// After all frames: sets in each path how many frames its source sent.
    pub(super) fn count_frames(&mut self) {
        for at in 0..self.travelled.len() {
            let slot = self.travelled[at];
            let root = self.body(self.entries[slot.index()].root);
            let source = root.and_then(|root| root.source);
            let frames = source.map_or(1, |source| self.sources[source.index()].pose_frames);
            let body = self.bodies[slot.index()].as_mut();
            if let Some(path) = body.and_then(|body| body.path.as_mut()) {
                path.set_frames(source, frames, self.tick);
            }
        }
    }

    /// A tick begins: earlier motion has been reported, boxes are tight again.
    pub(super) fn end_travels(&mut self) {
        for source in &mut self.sources {
            (source.pose_frames, source.cut) = (0, false);
        }
        for at in 0..self.travelled.len() {
            let slot = self.travelled[at];
            let entry = &mut self.entries[slot.index()];
            let Some(body) = self.bodies[slot.index()].as_mut() else {
                continue;
            };
            let Some(path) = body.path.as_mut() else {
                continue;
            };
            if path.rest() {
                entry.tight = *path.hull();
                body.proxy = entry.tight.widened(entry.widened_m);
                if body.in_broad {
                    self.lists.moved(slot);
                }
            }
        }
        self.dismiss_lost();
        self.travelled.clear();
        self.bar_lost();
    }

    /// As [`World::place`], for a pose from a frame: a continuous body moves there.
    ///
    /// * `declared` - its angular velocity times the time since its last pose, if the sender gives both.
    /// * returns - whether pose or box changed.
    pub(super) fn travel(&mut self, slot: BodySlot, pose: &Pose, declared: Option<Vec3>) -> bool {
        let Some((from, path)) = self.take_path(slot) else {
            return self.place(slot, pose);
        };
        let moved = self.place(slot, pose);
        let source = self.body(slot).and_then(|body| body.source);
        let frame = source.map_or(1, |source| self.sources[source.index()].pose_frames);
        self.lay(slot, path, (moved, false, frame), |path, end, lapses| {
            if lapses {
                path.lapse((from, *pose), end, frame)
            } else {
                path.push((from, *pose), declared, end, frame)
            }
        })
    }

    /// As [`World::place`], for an attached body: a continuous one follows the path of the body it is attached to.
    pub(super) fn place_attached(&mut self, slot: BodySlot, pose: &Pose) -> bool {
        let Some((_, path)) = self.take_path(slot) else {
            return self.place(slot, pose);
        };
        let moved = self.place(slot, pose);
        let entry = &self.entries[slot.index()];
        let (root, local) = (entry.root, entry.root_pose);
        let body = self
            .body(slot)
            .map(|body| (body.shapes.clone(), body.centre));
        // Taken out for the borrow, and put back.
        let of_root = self.take_path(root);
        // If the other has moved since its first pose of this tick, so has this one; it is settled later.
        let root_is_disabled = !self.entries[root.index()].enabled;
        let has_gone = |path: &Path| !path.is_empty() && (!path.aside || root_is_disabled);
        let goes = self.entries[slot.index()].enabled
            && of_root.as_ref().is_some_and(|(_, root)| has_gone(root));
        let moved = self.lay(slot, path, (moved, goes, 0), |path, end, _| {
            let before = *path.hull();
            match (&of_root, &body) {
                (Some((_, root)), Some((shapes, centre))) => {
                    path.follow(root, &local, (shapes, centre), end);
                }
                _ => path.restart(end),
            }
            *path.hull() != before
        });
        if let (Some(body), Some((_, path))) = (self.bodies[root.index()].as_mut(), of_root) {
            body.path = Some(path);
        }
        moved
    }

    /// Returns whether a body has a pose from which another one is a motion.
    fn is_placed(&self, slot: BodySlot) -> bool {
        let entry = &self.entries[slot.index()];
        self.body(slot).is_some_and(|body| body.in_broad) || entry.root == slot && entry.has_pose
    }

    fn take_path(&mut self, slot: BodySlot) -> Option<(Pose, Box<Path>)> {
        let body = self.bodies[slot.index()].as_mut()?;
        Some((body.pose, body.path.take()?))
    }

    /// Gives a placed body its path back, extended by `go`; returns whether pose or box changed.
    ///
    /// * `goes` - whether it has moved as `go` says, although it is not in the broad phase yet.
    /// * `frame` - number of the frame that the pose is from, in this tick; 0: of another body.
    /// * `go` - called with the path, the box at its new end, and whether the step is no motion.
    fn lay(
        &mut self,
        slot: BodySlot,
        mut path: Box<Path>,
        (moved, goes, frame): (bool, bool, u32),
        go: impl FnOnce(&mut Path, Aabb, bool) -> bool,
    ) -> bool {
        let placed = self.is_placed(slot) || goes;
        let is_out = !(goes || self.body(slot).is_some_and(|body| body.in_broad));
        // After a reset the path of this tick continues after a lapse, even if the body does not take part since: what
        // it touched before is reported.
        let lapses = path.has_moved() && (!placed || is_out && !path.aside);
        let entry = &mut self.entries[slot.index()];
        let Some(body) = self.bodies[slot.index()].as_mut() else {
            return moved;
        };
        // If it was placed, its box is new and tight.
        let end = if moved { entry.tight } else { *path.end() };
        if !lapses {
            path.set_aside(is_out);
        }
        let grown = if placed || lapses {
            let was_empty = path.is_empty();
            let grown = go(&mut path, end, lapses);
            if was_empty && !path.is_empty() {
                self.travelled.push(slot);
            }
            grown
        } else {
            path.enter(end, (self.tick, frame));
            false
        };
        entry.tight = *path.hull();
        body.path = Some(path);
        moved || grown
    }

    /// Frames of a source were dropped before its newest one: what its continuous bodies met on that part of their path
    /// is not known.
    pub(super) fn cut_ways(&mut self, source: SourceSlot) {
        let state = &mut self.sources[source.index()];
        if !state.followed {
            return;
        }
        state.cut = true;
        for at in 0..self.pathed.len() {
            let slot = self.pathed[at];
            let root = self.body(self.entries[slot.index()].root);
            if root.is_none_or(|root| root.source != Some(source)) {
                continue;
            }
            let entry = &self.entries[slot.index()];
            // A disabled root has a path for what hangs on it. A body of which nobody knows where it is has none.
            let carries = !entry.enabled && entry.has_pose;
            let Some(body) = self.bodies[slot.index()].as_mut() else {
                continue;
            };
            let takes_part = body.in_broad || carries;
            if let Some(path) = body.path.as_mut()
                && (takes_part || !path.is_empty())
            {
                if path.is_empty() {
                    self.travelled.push(slot);
                }
                path.blur();
            }
        }
    }

    /// An edit placed the body: that is no motion.
    pub(super) fn forget_way(&mut self, slot: BodySlot) {
        let entry = &mut self.entries[slot.index()];
        if let Some(body) = self.bodies[slot.index()].as_mut()
            && let Some(path) = body.path.as_mut()
        {
            path.restart(tight_box(&body.shapes, &body.pose));
            entry.tight = *path.hull();
        }
    }

    /// Makes continuous bodies that are attached to another turn about its centre, makes that body keep its path for
    /// them, and marks the sources whose frames move any.
    pub(super) fn link_paths(&mut self) {
        for source in &mut self.sources {
            source.followed = false;
        }
        let mut at = 0;
        // Grows by bodies that something continuous is attached to.
        while let Some(&slot) = self.pathed.get(at) {
            at += 1;
            let index = slot.index();
            let entry = &self.entries[index];
            let (root, local) = (entry.root, entry.root_pose);
            self.note_followed(slot, root);
            let Some(body) = self.body(slot).filter(|body| body.path.is_some()) else {
                continue;
            };
            let Some(root_body) = self.body(root) else {
                continue;
            };
            let pivot = local.inverse_transform_point(&root_body.centre);
            let arm = (pivot - body.centre).norm();
            let reach = (body.radius + arm) * (1.0 + 8.0 * f64::EPSILON);
            let (centre, radius, has) =
                (root_body.centre, root_body.radius, root_body.path.is_some());
            let tight = self.entries[root.index()].tight;
            if root != slot
                && !has
                && let Some(body) = self.bodies[root.index()].as_mut()
            {
                let mut path = Path::new(centre, radius, None, false);
                path.restart(tight);
                body.path = Some(Box::new(path));
                self.pathed.push(root);
            }
            if let Some(path) = self.bodies[index]
                .as_mut()
                .and_then(|body| body.path.as_mut())
            {
                path.set_pivot(pivot, reach);
            }
        }
    }

    /// Marks that the frames of a body's source move it, if it is continuous.
    fn note_followed(&mut self, slot: BodySlot, root: BodySlot) {
        let path = self.body(slot).and_then(|body| body.path.as_ref());
        if path.is_some_and(|path| path.is_of_continuous())
            && let Some(source) = self.body(root).and_then(|root| root.source)
        {
            self.sources[source.index()].followed = true;
        }
    }
}
