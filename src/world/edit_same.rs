//! Comparison of a put with the existing body of that name.
//!
//! In: the put. Out: whether they are identical; then the put changes nothing.

use std::sync::Arc;

use super::World;
use super::parts::PlacedShape;
use super::place::same_bits;
use crate::ids::{BodyId, BodySlot};
use crate::scene::BodySpec;

/// Changes of a body by the edits of a request before a put, while the request is checked; `None`: no change.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Touch {
    pub(super) enabled: Option<bool>,
    pub(super) group: Option<u32>,
    pub(super) mask: Option<u32>,
    /// Metres; `Some(None)`: the value it was put with.
    pub(super) report_within_m: Option<Option<f64>>,
    /// Whether it has been detached.
    pub(super) is_let_go: bool,
}

impl World {
    /// Whether a put would change nothing: equal entries, equal shapes, and no other edit since the last put.
    ///
    /// * `touch` - changes of the body by earlier edits of the request.
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
        // The content of a file may have changed.
        let measures = |placed: &PlacedShape| match &body.vertices {
            // As it was put: vertices sent since then do not count.
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
                    // One built shape has one spec: that may contain all vertices of a mesh, so it is not compared.
                    let same = Arc::ptr_eq(&a.shape, &b.shape)
                        || was.shape == is.shape
                            && aabb == b.shape.aabb
                            && radius.to_bits() == b.shape.radius.to_bits()
                            && a.shape.is_built_alike(&b.shape, body.vertices.is_some());
                    same && was.pose == is.pose
                });
        same_words && same_shapes && self.is_as_put(slot, spec, touch)
    }

    /// Whether no edit has changed the body since it was put.
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
