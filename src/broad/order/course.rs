//! Whether bodies keep their course or wander; decides how their boxes are swept for the next ticks.
//!
//! In: steps of some bodies in two ticks, before the first list and when each next one is begun. Out: how the step of
//! the last tick predicts those to come.
//!
//! Where successive steps are alike a box is swept along the last one. Where directions vary, as for bodies that are
//! pushed about, the last step gives only the distance: the box is padded on every side by the expected distance of a
//! random walk, which grows with the square root of the number of steps.
//!
//! Along an axis that hardly separates neighbours, such as height in a layer, boxes are swept both ways: a body that
//! bounces there stays inside, and no further boxes are met because of it.

use super::idle::shed;
use super::links::room;
use super::ones;
use crate::simd::boxes::{Down, WIDTH};

/// Padding of a swept box, in mean sides: a body that moves only by its sender's rounding stays inside.
const PAD: f32 = 0.01;
/// Extra ticks that a body on its course is swept for. With less, a body that swerves leaves its box sooner; with more,
/// more boxes are near.
const SWERVE: f32 = 0.25;
/// Most that a face is swept, in mean sides.
const SWEEP_MAX: f32 = 2.0;
/// Padding of a wandering body for one tick, in steps: half its own step and half the mean of all, since one step is a
/// poor estimate; the mean counts as at most `OTHERS_MAX` times its own. Measured with velocities drawn at random again
/// and again: with 1.2 most lists fail, with 2.5 a third more boxes are near.
const WANDER: f32 = 1.8;
const OTHERS_MAX: f32 = 4.0;
/// Mean likeness of successive steps: below `ASTRAY` bodies wander, above `ALONG` they keep their course.
const ASTRAY: f32 = 0.25;
const ALONG: f32 = 0.5;
/// Fewer bodies are not a sample.
const FEW: u32 = 8;
/// An axis separates neighbours if fewer than this share of them, taken some blocks apart, overlap along it.
const LAYERED: f32 = 0.9;
/// The bodies of one in `SAMPLE` blocks are watched.
pub(super) const SAMPLE: usize = 8;

/// How far boxes are swept.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// In steps of each face outward; in longest steps of any face; and the mean of the latter, in mean sides.
    along: f32,
    about: f32,
    step: f32,
    /// By face: how far it is swept against a step, as a fraction of the sweep along one.
    back: [f32; 8],
}

impl Reach {
    /// For a body without history.
    pub(super) const NEW: Self = Self {
        along: 0.0,
        about: 0.0,
        step: 0.0,
        back: [0.0; 8],
    };

    /// The swept box of a body from its last box and this one.
    #[inline(always)]
    pub(super) fn sweep(&self, before: &Down, now: &Down) -> Down {
        let side = now.mean_side();
        let side = if side.is_finite() { side } else { 0.0 };
        let mut pad = side * PAD;
        if self.about > 0.0 {
            // A body at rest is not padded because of the others.
            let own = longest(before, now);
            let (mean, most) = (side * self.step, own * OTHERS_MAX);
            pad += (own + if mean < most { mean } else { most }) * self.about;
        }
        let most = side * SWEEP_MAX;
        let mut swept = *now;
        let faces = swept.faces.iter_mut().zip(&before.faces);
        for ((face, was), back) in faces.zip(&self.back) {
            let step = *face - *was;
            let out = if step < 0.0 { -step } else { 0.0 };
            let against = if step > 0.0 { step } else { 0.0 };
            let by = (out + against * back) * self.along + pad;
            *face -= if by < most { by } else { most };
        }
        swept
    }
}

/// What is known about the steps.
#[derive(Clone, Debug)]
pub(super) struct Course {
    /// The first boxes of the watched bodies, by watched block.
    watched: Vec<[Down; WIDTH]>,
    /// Sums over them: likeness of two steps, 1 for equal ones and 0 for those across or of other lengths; and longest
    /// steps of a face in mean sides.
    alike: f32,
    steps: f32,
    count: u32,
    /// The boxes of the block watched before; by axis, how many overlap the box in the same lane there, and out of how
    /// many.
    last: [Down; WIDTH],
    level: [f32; 3],
    beside: f32,
    wanders: bool,
    /// Mean longest step, in mean sides.
    step: f32,
    /// By face, see [`Reach`].
    back: [f32; 8],
}

impl Default for Course {
    fn default() -> Self {
        Self {
            watched: Vec::new(),
            alike: 0.0,
            steps: 0.0,
            count: 0,
            last: [Down::EMPTY; WIDTH],
            level: [0.0; 3],
            beside: 0.0,
            wanders: false,
            step: 0.0,
            back: [0.0; 8],
        }
    }
}

impl Course {
    /// How far boxes are swept for some ticks.
    pub(super) fn reach(&self, ticks: u32) -> Reach {
        #[allow(clippy::cast_precision_loss, reason = "a few ticks")]
        let ticks = ticks as f32;
        if !self.wanders {
            return Reach {
                along: ticks + SWERVE,
                back: self.back,
                ..Reach::NEW
            };
        }
        Reach {
            about: WANDER * 0.5 * ticks.sqrt(),
            step: self.step,
            ..Reach::NEW
        }
    }

    /// Makes room for the watched bodies of `blocks` blocks.
    pub(super) fn reserve(&mut self, blocks: usize) {
        room(&mut self.watched, blocks.div_ceil(SAMPLE));
    }

    /// Gives the memory back.
    pub(super) fn give_back(&mut self) {
        shed(&mut self.watched);
    }

    /// Stops watching all bodies.
    pub(super) fn clear(&mut self) {
        self.watched.clear();
    }

    /// Takes the first boxes of some lanes of the next watched block. Out of line, like the next ones: the loop around
    /// it is about other work.
    #[inline(never)]
    pub(super) fn watch(&mut self, lanes: u16, before: &[Down; WIDTH]) {
        let mut watched = [Down::EMPTY; WIDTH];
        for lane in ones(lanes) {
            watched[lane] = before[lane];
        }
        self.watched.push(watched);
    }

    /// A lane got another body.
    pub(super) fn forget(&mut self, block: usize, lane: usize) {
        if block.is_multiple_of(SAMPLE)
            && let Some(watched) = self.watched.get_mut(block / SAMPLE)
        {
            watched[lane] = Down::EMPTY;
        }
    }

    /// Returns whether the watched bodies are still to be measured.
    pub(super) fn asks(&self) -> bool {
        !self.watched.is_empty()
    }

    /// Takes the boxes of some lanes of a watched block, one and two ticks later.
    #[inline(never)]
    pub(super) fn note(
        &mut self,
        block: usize,
        lanes: u16,
        then: &[Down; WIDTH],
        now: &[Down; WIDTH],
    ) {
        if let Some(before) = self.watched.get(block / SAMPLE).copied() {
            for lane in ones(lanes) {
                self.note_one(&before[lane], &then[lane], &now[lane]);
                let last = self.last[lane];
                self.note_beside(&last, &now[lane]);
            }
            self.last = *now;
        }
    }

    /// Takes the boxes of two bodies that are some blocks apart.
    fn note_beside(&mut self, one: &Down, other: &Down) {
        let (mut apart, mut known) = ([false; 3], true);
        for k in 0..one.faces.len() {
            // Lower face of one minus upper face of the other: above zero where they are apart.
            let gap = one.faces[k] + other.faces[(k + 4) % 8];
            known &= gap.is_finite();
            if k % 4 < 3 {
                apart[k % 4] |= gap > 0.0;
            }
        }
        if known {
            for (level, apart) in self.level.iter_mut().zip(apart) {
                *level += f32::from(u8::from(!apart));
            }
            self.beside += 1.0;
        }
    }

    /// Takes three boxes of one body.
    fn note_one(&mut self, before: &Down, then: &Down, now: &Down) {
        let (mut dot, mut first, mut second) = (0.0, 0.0, 0.0);
        for k in 0..now.faces.len() {
            let (one, other) = (
                then.faces[k] - before.faces[k],
                now.faces[k] - then.faces[k],
            );
            dot += one * other;
            first += one * one;
            second += other * other;
        }
        let longer = if first > second { first } else { second };
        let (alike, step) = (dot / longer, longest(then, now) / now.mean_side());
        // A body that rests, came or is infinite gives no number; one that flies far counts as one of many.
        if alike.is_finite() && step.is_finite() {
            self.alike += alike;
            self.steps += if step < SWEEP_MAX { step } else { SWEEP_MAX };
            self.count += 1;
        }
    }

    /// Ends the measurement of the watched bodies.
    pub(super) fn close(&mut self) {
        #[allow(clippy::cast_precision_loss, reason = "at most the bodies, a mean")]
        let count = self.count as f32;
        if self.count >= FEW {
            let least = if self.wanders { ALONG } else { ASTRAY };
            self.wanders = self.alike < least * count;
            self.step = self.steps / count;
            let most = LAYERED * self.beside;
            for (k, level) in self.level.into_iter().enumerate() {
                let both = f32::from(u8::from(level > most));
                (self.back[k], self.back[k + 4]) = (both, both);
            }
        }
        (self.alike, self.steps, self.count) = (0.0, 0.0, 0);
        (self.level, self.beside) = ([0.0; 3], 0.0);
        self.last = [Down::EMPTY; WIDTH];
        self.clear();
    }
}

/// The longest step of a face.
#[inline(always)]
fn longest(before: &Down, now: &Down) -> f32 {
    let mut longest = 0.0;
    for (face, was) in now.faces.iter().zip(&before.faces) {
        let step = (face - was).abs();
        longest = if step > longest { step } else { longest };
    }
    longest
}

#[cfg(test)]
mod tests;
