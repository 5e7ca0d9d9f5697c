//! Whether bodies go on as they came, or wander: what their boxes are swept by for some ticks follows from it.
//!
//! In: steps of some bodies in two ticks, before the first list and as each next one is begun. Out: how a step of the
//! last tick tells of those to come.
//!
//! Where steps are alike a box is swept along the last one. Where each goes elsewhere, as what is pushed about does,
//! the last one says how far bodies go and not where to: the box is padded on every side, by as much as steps without a
//! direction come to, which grows with the root of their number.
//!
//! Along an axis that scarcely parts neighbours, as height in a layer, boxes are swept both ways: who bounces there
//! stays in, and nobody else is met for it.

use super::idle::shed;
use super::links::room;
use super::ones;
use crate::simd::boxes::{Down, WIDTH};

/// What a swept box is padded by, in mean sides: what stands still but for its sender's rounding stays in.
const PAD: f32 = 0.01;
/// Ticks that a body that goes on as it came is swept for beyond those asked for: with less, who swerves leaves his box
/// sooner; with more, more is near.
const SWERVE: f32 = 0.25;
/// Most that a face is swept, in mean sides.
const SWEEP_MAX: f32 = 2.0;
/// A body that wanders is padded by so many steps for one tick, half of them its own and half those of all, for one
/// step says little of the others; but by no more than so many times its own for those. Measured where velocities are
/// drawn anew: with 1.2 most lists fail, with 2.5 a third more is near.
const WANDER: f32 = 1.8;
const OTHERS_MAX: f32 = 4.0;
/// Below such a mean likeness of one step and the next bodies wander, and above it they go on.
const ASTRAY: f32 = 0.25;
const ALONG: f32 = 0.5;
/// Fewer bodies tell nothing.
const FEW: u32 = 8;
/// An axis parts neighbours where fewer than such a share of them, some blocks from each other, overlap along it.
const LAYERED: f32 = 0.9;
/// Of so many blocks the bodies of one are watched.
pub(super) const SAMPLE: usize = 8;

/// How far boxes are swept.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// In steps of each face outward, and in longest steps of any face; and the mean of those, in mean sides.
    along: f32,
    about: f32,
    step: f32,
    /// By face: how far it is swept against a step, in parts of what it is along one.
    back: [f32; 8],
}

impl Reach {
    /// Of a body that nothing is known of.
    pub(super) const NEW: Self = Self {
        along: 0.0,
        about: 0.0,
        step: 0.0,
        back: [0.0; 8],
    };

    /// The box of a body from its last place and this one.
    #[inline(always)]
    pub(super) fn sweep(&self, before: &Down, now: &Down) -> Down {
        let side = now.mean_side();
        let side = if side.is_finite() { side } else { 0.0 };
        let mut pad = side * PAD;
        if self.about > 0.0 {
            // Who rests is not padded for the others.
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

/// What is known of the steps.
#[derive(Clone, Debug)]
pub(super) struct Course {
    /// The first boxes of those who are watched, by watched block.
    watched: Vec<[Down; WIDTH]>,
    /// Sums over them: how alike two steps are, 1 for the same and 0 for those across or of other lengths; longest
    /// steps of a face in mean sides.
    alike: f32,
    steps: f32,
    count: u32,
    /// The boxes of the block watched before; by axis, how many overlap the one in their lane there, and of how many.
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

    /// Room for those of so many blocks.
    pub(super) fn reserve(&mut self, blocks: usize) {
        room(&mut self.watched, blocks.div_ceil(SAMPLE));
    }

    /// Gives the memory back.
    pub(super) fn give_back(&mut self) {
        shed(&mut self.watched);
    }

    /// Nobody is watched.
    pub(super) fn clear(&mut self) {
        self.watched.clear();
    }

    /// Takes the first boxes of some lanes of the next watched block. Out of line, as what follows: the loop around it
    /// is about others.
    #[inline(never)]
    pub(super) fn watch(&mut self, lanes: u16, before: &[Down; WIDTH]) {
        let mut watched = [Down::EMPTY; WIDTH];
        for lane in ones(lanes) {
            watched[lane] = before[lane];
        }
        self.watched.push(watched);
    }

    /// A lane has got another body.
    pub(super) fn forget(&mut self, block: usize, lane: usize) {
        if block.is_multiple_of(SAMPLE)
            && let Some(watched) = self.watched.get_mut(block / SAMPLE)
        {
            watched[lane] = Down::EMPTY;
        }
    }

    /// Whether those who are watched have yet to be asked.
    pub(super) fn asks(&self) -> bool {
        !self.watched.is_empty()
    }

    /// Takes the boxes of some lanes of a watched block one tick later and two.
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

    /// Takes the boxes of two bodies that are some blocks from each other.
    fn note_beside(&mut self, one: &Down, other: &Down) {
        let (mut apart, mut known) = ([false; 3], true);
        for k in 0..one.faces.len() {
            // Lower face of the one minus upper face of the other: above zero where they are apart.
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
        // Who rests, came or has no end has none; and one who flies far is one of many.
        if alike.is_finite() && step.is_finite() {
            self.alike += alike;
            self.steps += if step < SWEEP_MAX { step } else { SWEEP_MAX };
            self.count += 1;
        }
    }

    /// Whoever was watched has been asked.
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
