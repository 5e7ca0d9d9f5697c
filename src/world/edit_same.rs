//! Whether a body that is put is the one that is there.
//!
//! In: what is put. Out: yes or no; a yes makes of the put an edit that changes nothing.

use std::sync::Arc;

use super::World;
use super::parts::PlacedShape;
use super::place::same_bits;
use crate::ids::{BodyId, BodySlot};
use crate::scene::BodySpec;

/// What edits of a request have made of a body by the time of a put, where that is looked at before any is applied;
/// `None`: nothing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Touch {
    pub(super) enabled: Option<bool>,
    pub(super) group: Option<u32>,
    pub(super) mask: Option<u32>,
    /// Metres; `Some(None)`: what it was put with.
    pub(super) report_within_m: Option<Option<f64>>,
    /// It hangs on nothing by now.
    pub(super) is_let_go: bool,
}

impl World {
    /// Whether a put would change nothing: the same words, the same shapes, and what edits made of it is the same.
    ///
    /// * `touch` - what becomes of the body before.
    pub(super) fn is_same(
        &self,
        slot: BodySlot,
        spec: &BodySpec,
        shapes: &[PlacedShape],
        touch: &Touch,
    ) -> bool {
        let entry = &self.entries[slot.index()];
        let (Some(old), Some(body)) = (&entry.spec, self.body(slot)) else {
            return false;
        };
        let same_words = (spec.id == BodyId(0) || spec.id == body.id) && old.reads_as(spec);
        // A file may have changed under the same name.
        let measures = |placed: &PlacedShape| match &body.vertices {
            // As it was put: what its sender made of it since is no other shape.
            Some(vertices) => vertices.rest,
            None => (placed.shape.aabb, placed.shape.radius),
        };
        let words = old.shapes.iter().zip(&spec.shapes);
        let same_shapes = old.shapes.len() == spec.shapes.len()
            && body.shapes.len() == shapes.len()
            && (body.shapes.iter().zip(shapes))
                .zip(words)
                .all(|((a, b), (was, is))| {
                    let (aabb, radius) = measures(a);
                    // One shape has one spec, which may hold all corners of a mesh: they are not gone through again.
                    let same = Arc::ptr_eq(&a.shape, &b.shape)
                        || was.shape == is.shape
                            && aabb == b.shape.aabb
                            && radius.to_bits() == b.shape.radius.to_bits()
                            && a.shape.is_built_alike(&b.shape, body.vertices.is_some());
                    same && was.pose == is.pose
                });
        same_words && same_shapes && self.is_as_put(slot, spec, touch)
    }

    /// Whether what edits can change of a body is as it was put.
    fn is_as_put(&self, slot: BodySlot, spec: &BodySpec, touch: &Touch) -> bool {
        let (Some(body), Some(hot)) = (self.body(slot), self.filters.bodies.get(slot.index()))
        else {
            return false;
        };
        let entry = &self.entries[slot.index()];
        let attach = spec.attached_to.as_deref().map(|to| (to, spec.pose));
        let hangs = entry.attach.filter(|_| !touch.is_let_go);
        let hangs = hangs.map(|(to, pose)| (&*self.names.get(to).text, pose));
        let stays = spec.moves || attach.is_some();
        let enabled = touch.enabled.unwrap_or(entry.enabled);
        let group = touch.group.unwrap_or(hot.group);
        let mask = touch.mask.unwrap_or(hot.mask);
        let within_m = match touch.report_within_m {
            Some(told_m) => told_m.unwrap_or(spec.report_within_m),
            None => body.report_within_m,
        };
        (enabled, group, mask) == (spec.enabled, spec.group, spec.mask)
            && within_m.to_bits() == spec.report_within_m.to_bits()
            && hangs == attach
            && (stays || same_bits(&body.pose, &spec.pose))
    }
}
