//! Scene edits at run time: put, remove, enable, filter, margins, rules, attach, reset.
//!
//! In: one request, a list of [`Edit`]s with shapes already built. Out: either all edits applied and a new scene
//! revision, or none applied and a text that says what to change. Edits allocate; a tick without edits does not.

use std::sync::Arc;

use super::World;
use super::edit_links::Places;
use super::edit_rules::Uncounted;
use super::edit_same::Touch;
use super::filters::{ENABLED, HALF_SPACES, Hot, LIVE, MOVES, NO_GROUP};
use super::names::NameId;
use super::parts::Parts;
use super::place::{Entry, new_body};
use crate::ids::{BodyId, BodySlot, SourceSlot};
use crate::scene::{self, BodySpec};
use crate::wire::EndCause;

/// One change of the scene, ready to be applied.
pub type Edit = scene::Edit<Put>;

/// A body to be put.
#[derive(Clone, Debug)]
pub struct Put {
    /// The body. Id 0: the id that its name had in this boot, or else the least one that is free and not asked for by
    /// the request.
    pub body: Arc<BodySpec>,
    /// Its built shapes, in the order of `body.shapes`.
    pub shapes: Parts,
}

/// Result of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Applied {
    /// Scene revision from which on the request applies.
    pub scene_rev: u64,
    /// Whether anything changed.
    pub changed: bool,
}

/// Work that is done once per request, after its last edit.
#[derive(Clone, Debug, Default)]
struct After {
    changed: bool,
    links: bool,
    uncounted: Uncounted,
    /// Slots whose body was replaced, added or removed; may contain duplicates.
    slots: Vec<BodySlot>,
    /// Bodies that were attached or detached.
    hung: Vec<BodySlot>,
    /// Slots of bodies that were enabled or disabled; may contain duplicates and slots that are empty by now.
    enabled: Vec<BodySlot>,
    /// Places of bodies after the edits so far.
    places: Places,
}

impl After {
    /// Records a body whose attachment changed.
    pub(super) fn take_hung(&mut self, slot: BodySlot) {
        self.hung.push(slot);
        self.links = true;
    }

    /// Records a slot whose body was replaced, added or removed.
    fn take_slot(&mut self, slot: BodySlot) {
        self.slots.push(slot);
        self.links = true;
        self.places.forget();
    }
}

impl World {
    /// Applies one request: all of its edits in their order, or none.
    ///
    /// # Errors
    /// A text for the user: which edit is wrong, and what to change. Then nothing of the request was applied.
    pub fn apply(&mut self, edits: &[Edit]) -> Result<Applied, String> {
        self.apply_stepwise(edits, &mut || {})
    }

    /// As [`World::apply`].
    ///
    /// * `step` - called after each edit that was checked, and each that was applied.
    ///
    /// # Errors
    /// As [`World::apply`].
    pub fn apply_stepwise(
        &mut self,
        edits: &[Edit],
        step: &mut dyn FnMut(),
    ) -> Result<Applied, String> {
        self.check(edits, true, step)?;
        Ok(self.apply_checked(edits, step))
    }

    /// Applies edits that [`World::check`] accepted.
    pub(super) fn apply_checked(&mut self, edits: &[Edit], step: &mut dyn FnMut()) -> Applied {
        let mut after = After::default();
        self.reserve_ids(edits);
        for edit in edits {
            self.apply_one(edit, &mut after);
            step();
        }
        self.relist(&mut after.slots);
        for &slot in &after.enabled {
            self.settle(slot, false);
        }
        if self.edit_rules(edits, step) {
            after.changed = true;
            after.uncounted = Uncounted::Rules;
        }
        if after.links {
            self.link(after.slots.iter().chain(&after.hung));
        }
        self.touched.append(&mut after.slots);
        self.uncounted = self.uncounted.max(after.uncounted);
        if after.changed {
            self.scene_rev += 1;
            self.edited = true;
        }
        Applied {
            scene_rev: self.scene_rev,
            changed: after.changed,
        }
    }

    /// Claims the ids that the request asks for, so that no other name of it gets them.
    fn reserve_ids(&mut self, edits: &[Edit]) {
        for edit in edits {
            if let Edit::Put(Put { body, .. }) = edit
                && body.id != BodyId(0)
            {
                let name = self.names.intern(&body.name);
                self.names.claim(name, Some(body.id));
            }
        }
    }

    fn apply_one(&mut self, edit: &Edit, after: &mut After) {
        let changed = match edit {
            Edit::Put(put) => self.put(&put.body, &put.shapes, after),
            Edit::Remove { name } => self.remove(name, after),
            Edit::Enable { name, enabled } => self.enable(name, *enabled, &mut after.enabled),
            Edit::Filter { name, group, mask } => self.filter(name, *group, *mask),
            Edit::Margin {
                name,
                report_within_m,
            } => self.set_margins(name.as_deref(), *report_within_m),
            // All at once, after the last edit.
            Edit::Rule(_) | Edit::DropRules { .. } => false,
            Edit::Attach { name, to, pose } => {
                let attached = self.attach(name, to.as_deref(), pose.as_ref(), &mut after.places);
                if attached && let Some(slot) = self.slot_named(name) {
                    after.take_hung(slot);
                }
                attached
            }
            Edit::Reset { source } => {
                self.reset(source.as_deref());
                after.changed = true;
                return;
            }
        };
        if changed {
            after.changed = true;
            let of_bodies = matches!(
                edit,
                Edit::Put(_) | Edit::Remove { .. } | Edit::Attach { .. }
            );
            let what = if of_bodies {
                Uncounted::Bodies
            } else {
                Uncounted::Forced
            };
            after.uncounted = after.uncounted.max(what);
        }
    }

    /// Puts a body, unless an identical one exists.
    fn put(&mut self, spec: &Arc<BodySpec>, shapes: &Parts, after: &mut After) -> bool {
        let known = self.names.find_name(&spec.name).and_then(|n| n.slot);
        if let Some(slot) = known {
            if self.is_same(slot, spec, shapes, &Touch::default()) {
                return false;
            }
            self.clear_slot(slot, EndCause::Removed);
        }
        let name = self.names.intern(&spec.name);
        let wanted = (spec.id != BodyId(0)).then_some(spec.id);
        let id = self.names.claim(name, wanted);
        let slot = known
            .or_else(|| self.free.pop())
            .unwrap_or_else(|| self.new_slot());
        let kept = self.names.get_mut(name);
        kept.slot = Some(slot);
        kept.generation += 1;
        let (mut body, tight) = new_body(spec, shapes.clone(), kept.generation);
        body.id = id;
        body.source = spec.source.map(SourceSlot::at);
        let mut entry = Entry::gone(slot);
        entry.enabled = spec.enabled;
        entry.has_pose = !spec.moves;
        entry.tight = tight;
        entry.attach = spec
            .attached_to
            .as_ref()
            .map(|to| (self.names.intern(to), spec.pose));
        entry.spec = Some(spec.clone());
        self.entries[slot.index()] = entry;
        let parent = spec.parent.as_ref().map(|p| self.names.intern(p));
        let rigid = spec
            .rigid_group
            .as_ref()
            .map(|g| self.rigid_groups.intern(g).0);
        let flag = |on: bool, bit: u16| if on { bit } else { 0 };
        self.filters.bodies[slot.index()] = Hot {
            flags: LIVE
                | flag(spec.enabled, ENABLED)
                | flag(spec.moves, MOVES)
                | flag(body.only_half_spaces, HALF_SPACES),
            group: spec.group,
            mask: spec.mask,
            name,
            parent: parent.unwrap_or(NameId::NONE),
            rigid: rigid.unwrap_or(NO_GROUP),
            root: name,
            report_within_m: spec.report_within_m,
        };
        self.by_status[usize::from(body.status.code())] += 1;
        self.bodies[slot.index()] = Some(body);
        after.take_slot(slot);
        self.names_changed = true;
        self.settle(slot, true);
        true
    }

    fn new_slot(&mut self) -> BodySlot {
        let slot = BodySlot::at(self.bodies.len());
        self.bodies.push(None);
        self.entries.push(Entry::gone(slot));
        self.filters.bodies.push(Hot::GONE);
        self.filters.margins_m.push(0.0);
        self.ages.grow(self.bodies.len());
        self.tags.grow(self.bodies.len());
        self.lists.grow(self.bodies.len());
        slot
    }

    /// Updates the lists of bodies after changes of these slots.
    ///
    /// * `slots` - is sorted, and duplicates are removed.
    ///
    /// Cost: O(listed bodies), and sorting the slots.
    fn relist(&mut self, slots: &mut Vec<BodySlot>) {
        if slots.is_empty() {
            return;
        }
        slots.sort_unstable();
        slots.dedup();
        let others = |slot: &BodySlot| slots.binary_search(slot).is_err();
        self.growing.retain(others);
        self.pathed.retain(others);
        self.travelled.retain(others);
        self.deforming.retain(others);
        self.order.retain(|(_, slot)| others(slot));
        for &slot in slots.iter() {
            let Some(body) = self.bodies[slot.index()].as_ref() else {
                continue;
            };
            if self.entries[slot.index()].growing {
                self.growing.push(slot);
            }
            if let Some(path) = &body.path {
                self.pathed.push(slot);
                if !path.is_empty() {
                    self.travelled.push(slot);
                }
            }
            if body.vertices.is_some() {
                self.deforming.push(slot);
            }
            self.order.push((body.id, slot));
        }
        // Only the end is out of order, so the sort is cheap.
        self.order.sort();
    }

    /// Removes a slot's body from all structures except the names and the lists of bodies.
    fn clear_slot(&mut self, slot: BodySlot, cause: EndCause) {
        let Some(body) = self.bodies[slot.index()].take() else {
            return;
        };
        if body.in_broad {
            self.lists.remove(slot, cause);
        }
        self.lists.forget(slot);
        self.by_status[usize::from(body.status.code())] -= 1;
        self.entries[slot.index()] = Entry::gone(slot);
        self.filters.bodies[slot.index()] = Hot::GONE;
        self.ages.set(slot, None, None);
        self.tags.set(slot, None);
        if let Some(name) = self.names.find(&body.name) {
            self.names.get_mut(name).slot = None;
        }
        self.names_changed = true;
    }

    fn remove(&mut self, name: &str, after: &mut After) -> bool {
        let Some(slot) = self.slot_named(name) else {
            return false;
        };
        self.clear_slot(slot, EndCause::Removed);
        after.take_slot(slot);
        self.resting.push(slot);
        true
    }

    /// Enables or disables a body. It is settled after the last edit, so a change that is undone by then has no effect.
    fn enable(&mut self, name: &str, enabled: bool, slots: &mut Vec<BodySlot>) -> bool {
        let Some(slot) = self.slot_named(name) else {
            return false;
        };
        let entry = &mut self.entries[slot.index()];
        if entry.enabled == enabled {
            return false;
        }
        entry.enabled = enabled;
        if let Some(hot) = self.hot(slot) {
            hot.set(ENABLED, enabled);
        }
        slots.push(slot);
        true
    }

    fn filter(&mut self, name: &str, group: Option<u32>, mask: Option<u32>) -> bool {
        let Some(slot) = self.slot_named(name) else {
            return false;
        };
        let Some(hot) = self.hot(slot) else {
            return false;
        };
        let (group, mask) = (group.unwrap_or(hot.group), mask.unwrap_or(hot.mask));
        if (group, mask) == (hot.group, hot.mask) {
            return false;
        }
        (hot.group, hot.mask) = (group, mask);
        self.requery(slot);
        true
    }

    /// Requests a new search for a body's pairs, if it is in the broad phase.
    pub(super) fn requery(&mut self, slot: BodySlot) {
        if self.body(slot).is_some_and(|body| body.in_broad) {
            self.lists.requery(slot);
        }
    }
}
