//! Room in the tree of `/tf`: a tracker may name a frame a detection, for ever.
//!
//! In: links of ever new frames. Out: frames that are needed stay, the others go when there are too many. Pure.

use super::Tree;

/// Frames of one tree beside those of bodies: a robot has some hundred; beyond it somebody invents names, and memory
/// would grow.
pub(super) const FRAMES_MAX: usize = 1 << 16;
/// Longest name of a frame, bytes: as long as a body's `ros_frame` may be. Frames are bounded by how many there are,
/// and names without an end would take all memory.
pub(super) const FRAME_NAME_BYTES_MAX: usize = 255;
/// Links refused between two looks for room, which visit every frame: who floods a full tree costs no more.
const DENIED: usize = FRAMES_MAX / 8;

impl Tree {
    /// Whether a link between these two can be taken.
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

    /// How many links that never change had to go since the last call.
    pub(in super::super) fn take_let_go(&mut self) -> u64 {
        std::mem::take(&mut self.let_go)
    }

    /// Lets the frames go that no body's chain leads over. Links that have an age come again when they are needed;
    /// those that never change are said once, and go only where they are what fills the tree.
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

    /// Which frames the chains of bodies lead over.
    ///
    /// * `fixed` - also the chains of links that never change.
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
