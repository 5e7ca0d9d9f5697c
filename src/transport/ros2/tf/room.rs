//! Limits the size of the tree of `/tf`: a tracker may name a new frame for each detection, without end.
//!
//! In: links of ever new frames. Out: frames that bodies need stay, others are dropped when there are too many. Pure.

use super::Tree;

/// Frames of one tree, without those of bodies: a robot has some hundred. Without a limit, a sender of invented names
/// would fill the memory.
pub(super) const FRAMES_MAX: usize = 1 << 16;
/// Longest name of a frame, bytes, the same as of a body's `ros_frame`. The number of frames has a limit, but names of
/// any length would fill the memory.
pub(super) const FRAME_NAME_BYTES_MAX: usize = 255;
/// Refused links between two attempts to make room. An attempt visits every frame, so a flood must not cause one each.
const DENIED: usize = FRAMES_MAX / 8;

impl Tree {
    /// Whether a link between these frames can be taken; makes room if needed.
    pub(super) fn has_room(&mut self, child: &str, parent: &str) -> bool {
        let two = [child, parent];
        let new = two.into_iter().filter(|name| !self.ids.contains_key(*name));
        let new = new.count();
        let fits = |tree: &Self| tree.ids.len() - tree.pinned + new <= FRAMES_MAX;
        if new == 0 || fits(self) {
            return true;
        }
        if self.denied.is_multiple_of(DENIED) {
            self.make_room();
        }
        let fits = fits(self);
        self.denied = if fits { 0 } else { self.denied + 1 };
        fits
    }

    /// Takes the number of fixed links dropped since the last call.
    pub(in super::super) fn take_let_go(&mut self) -> u64 {
        std::mem::take(&mut self.let_go)
    }

    /// Drops the frames that no body's chain contains. Links that are not fixed arrive again when they are needed.
    /// Fixed links are sent only once: they are dropped only if they and the needed links fill over half of the tree.
    fn make_room(&mut self) {
        let mut needed = self.needed(true);
        let kept = needed.iter().filter(|needed| **needed).count();
        if kept - self.pinned > FRAMES_MAX / 2 {
            needed = self.needed(false);
        }
        for (id, frame) in self.frames.iter_mut().enumerate() {
            let is_needed = needed.get(id).is_some_and(|needed| *needed);
            if is_needed || self.ids.get(&frame.name) != Some(&id) {
                continue;
            }
            self.ids.remove(&frame.name);
            self.let_go += u64::from(frame.link.as_ref().is_some_and(|link| link.fixed));
            *frame = super::Frame::default();
            self.free.push(id);
        }
    }

    /// Which frames the chains of bodies contain.
    ///
    /// * `fixed` - also include the chains of fixed links.
    fn needed(&self, fixed: bool) -> Vec<bool> {
        let mut needed = vec![false; self.frames.len()];
        for (id, frame) in self.frames.iter().enumerate() {
            let lasts = fixed && frame.link.as_ref().is_some_and(|link| link.fixed);
            if frame.pins == 0 && !lasts {
                continue;
            }
            let mut next = Some(id);
            while let Some(id) = next
                && let Some(mark) = needed.get_mut(id).filter(|mark| !**mark)
            {
                *mark = true;
                next = self.link(id).map(|link| link.parent);
            }
        }
        needed
    }
}
