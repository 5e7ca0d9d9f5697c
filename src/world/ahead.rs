//! Bodies asked for ahead: loops that know whom they will look at next say so some steps before.
//!
//! A body, its list of shapes and the first shape lie in three places, each found by reading the one before. Whoever
//! walks over many bodies asks for each of them [`AHEAD`] steps before, then for its list, then for its shape. Hints,
//! without effect on what is computed.

use super::{Body, World};
use crate::ids::BodySlot;
use crate::simd::boxes::prefetch;

/// Steps from the first word of a body to the step that looks at it.
pub const AHEAD: usize = 6;
/// Steps from the word for its list of shapes: the body is near by then.
const LIST_AHEAD: usize = 4;
/// Steps from the word for its first shape.
const SHAPE_AHEAD: usize = 2;

impl World {
    /// Says that a body is wanted soon.
    #[inline]
    pub fn ask_ahead(&self, slot: BodySlot) {
        if let Some(body) = self.bodies.get(slot.index()) {
            prefetch(body);
        }
    }

    /// All bodies with their slots, by id, each asked for some steps ahead: for a pass over bodies that lie far away.
    pub fn bodies_ahead(&self) -> impl Iterator<Item = (BodySlot, &Body)> {
        let ahead = self.order.iter().skip(AHEAD).map(|&(_, slot)| Some(slot));
        let ahead = ahead.chain(std::iter::repeat(None));
        self.bodies().zip(ahead).map(|(body, ahead)| {
            if let Some(slot) = ahead {
                self.ask_ahead(slot);
            }
            body
        })
    }

    /// At step `at` of a loop: asks for the bodies and shapes of the steps to come.
    ///
    /// * `slots` - whom a step looks at; nobody beyond the last step.
    #[inline]
    pub fn ask_along<S: IntoIterator<Item = BodySlot>>(
        &self,
        at: usize,
        slots: impl Fn(usize) -> Option<S>,
    ) {
        for slot in slots(at + AHEAD).into_iter().flatten() {
            self.ask_ahead(slot);
        }
        for slot in slots(at + LIST_AHEAD).into_iter().flatten() {
            if let Some(first) = self.body(slot).and_then(|body| body.shapes.first()) {
                prefetch(first);
            }
        }
        for slot in slots(at + SHAPE_AHEAD).into_iter().flatten() {
            if let Some(first) = self.body(slot).and_then(|body| body.shapes.first()) {
                prefetch(&*first.shape);
            }
        }
    }

    /// Says that what the world keeps of a body is wanted soon.
    #[inline]
    pub(super) fn ask_ahead_for_entry(&self, slot: BodySlot) {
        if let Some(entry) = self.entries.get(slot.index()) {
            prefetch(entry);
        }
    }
}
