//! Whether bodies go on as they came, or wander: what their boxes are swept by for some ticks follows from it.
//!
//! In: steps of some bodies in two ticks, before the first list and as each next one is begun. Out: how a step of the
//! last tick tells of those to come.
//!
//! Where steps are alike a box is swept along the last one. Where each goes elsewhere, as what is pushed about does,
//! the last one says how far bodies go and not where to: the box is padded on every side, by as much as steps without a
//! direction come to, which grows with the root of their number.

use super::idle::shed;
use super::links::room;
use super::ones;
use crate::simd::boxes::{Down, WIDTH};

/// What a swept box is padded by, in mean sides: what stands still but for its sender's rounding stays in, ...
const PAD: f32 = 0.01;
/// ... and in ticks of the motion of a body that goes on as it came.
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
/// Of so many blocks the bodies of one are watched.
pub(super) const SAMPLE: usize = 8;

/// How far boxes are swept.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// In steps of each face outward, and in longest steps of any face; and the mean of those, in mean sides.
    along: f32,
    about: f32,
    step: f32,
}

impl Reach {
    /// Of a body that nothing is known of.
    pub(super) const NEW: Self = Self {
        along: 0.0,
        about: 0.0,
        step: 0.0,
    };

    /// The box of a body from its last place and this one.
    #[inline(always)]
    pub(super) fn sweep(self, before: &Down, now: &Down) -> Down {
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
        for (face, was) in swept.faces.iter_mut().zip(&before.faces) {
            let step = *face - *was;
            let out = if step < 0.0 { -step } else { 0.0 };
            let by = out * self.along + pad;
            *face -= if by < most { by } else { most };
        }
        swept
    }
}

/// What is known of the steps.
#[derive(Clone, Debug, Default)]
pub(super) struct Course {
    /// The first boxes of those who are watched, by watched block.
    watched: Vec<[Down; WIDTH]>,
    /// Sums over them: how alike two steps are, 1 for the same and 0 for those across or of other lengths; longest
    /// steps of a face in mean sides.
    alike: f32,
    steps: f32,
    count: u32,
    wanders: bool,
    /// Mean longest step, in mean sides.
    step: f32,
}

impl Course {
    /// How far boxes are swept for some ticks.
    pub(super) fn reach(&self, ticks: u32) -> Reach {
        #[allow(clippy::cast_precision_loss, reason = "a few ticks")]
        let ticks = ticks as f32;
        if !self.wanders {
            return Reach {
                along: ticks + SWERVE,
                ..Reach::NEW
            };
        }
        Reach {
            along: 0.0,
            about: WANDER * 0.5 * ticks.sqrt(),
            step: self.step,
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
            }
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
        }
        (self.alike, self.steps, self.count) = (0.0, 0.0, 0);
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
mod tests {
    use super::*;
    use crate::builtin::Random;

    /// A box of side 1 somewhere.
    fn at([x, y, z]: [f32; 3]) -> Down {
        Down::of([x, y, z, x + 1.0, y + 1.0, z + 1.0])
    }

    /// Three ticks of 16 bodies that step by 0.1 at most: each twice as before, or in a direction drawn anew.
    fn run(course: &mut Course, random: &mut Random, alike: bool) {
        #[allow(clippy::cast_possible_truncation, reason = "any step will do")]
        let mut step = || [(); 3].map(|()| random.range(-0.1, 0.1) as f32);
        let add = |p: [f32; 3], by: [f32; 3]| std::array::from_fn(|k| p[k] + by[k]);
        let steps: [_; WIDTH] = std::array::from_fn(|_| {
            let first = step();
            [first, if alike { first } else { step() }]
        });
        let mut before = [at([5.0; 3]); WIDTH];
        let then = steps.map(|[first, _]| at(add([5.0; 3], first)));
        let mut now = steps.map(|[first, second]| at(add(add([5.0; 3], first), second)));
        // Who came has no place before, and who has no end none at all.
        before[3] = Down::EMPTY;
        now[7].faces[1] = f32::NEG_INFINITY;
        course.clear();
        course.watch(u16::MAX, &before);
        assert!(course.asks());
        course.note(0, u16::MAX, &then, &now);
        course.close();
        assert!(!course.asks());
    }

    #[test]
    fn steps_without_a_direction_widen_every_side_by_the_root_of_their_number() {
        let (mut course, mut random) = (Course::default(), Random::new(1));
        let (before, now) = (at([0.0; 3]), at([0.1, 0.0, 0.0]));
        // Ahead, and behind.
        let far = |course: &Course, ticks| {
            let swept = course.reach(ticks).sweep(&before, &now).corners();
            [swept[3] - 1.1, 0.1 - swept[0]]
        };
        run(&mut course, &mut random, true);
        let [ahead, behind] = far(&course, 8);
        assert!(!course.wanders && (ahead - 0.835).abs() < 1e-4 && (behind - PAD).abs() < 1e-4);
        run(&mut course, &mut random, false);
        let ([ahead, behind], [four, _]) = (far(&course, 16), far(&course, 4));
        assert!(course.wanders && (ahead - behind).abs() < 1e-4);
        assert!(((ahead - PAD) / (four - PAD) - 2.0).abs() < 1e-3);
        // The mean of its own step and those of all, which are shorter.
        assert!((0.2..0.4).contains(&(ahead / WANDER)), "{ahead}");
        run(&mut course, &mut random, true);
        assert!(!course.wanders);
    }

    #[test]
    fn a_few_and_those_at_rest_tell_nothing() {
        let mut course = Course {
            wanders: true,
            ..Course::default()
        };
        let rests = [at([0.0; 3]); WIDTH];
        course.watch(u16::MAX, &rests);
        course.note(0, u16::MAX, &rests, &rests);
        course.close();
        // These go on, but seven are too few: the others were not watched, or have another body's lane; and of a block
        // that was not watched nothing is known.
        course.watch(0xFF, &rests);
        course.forget(0, 3);
        let [then, now] = [1.0, 2.0].map(|x| [at([x; 3]); WIDTH]);
        course.note(0, u16::MAX, &then, &now);
        course.note(SAMPLE, u16::MAX, &then, &now);
        course.close();
        assert!(course.wanders);
        course.watch(0xFF, &rests);
        course.note(0, u16::MAX, &then, &now);
        course.close();
        assert!(!course.wanders);
    }

    #[test]
    fn who_rests_is_not_padded_for_those_who_wander_and_who_hardly_moves_by_little() {
        let wanders = Course {
            wanders: true,
            step: 0.1,
            ..Course::default()
        };
        // A floor a thousand times as large as what trembles on it.
        let floor = |x: f32| Down::of([x, 0.0, 0.0, x + 1000.0, 1000.0, 1000.0]);
        let padded = |x: f32| {
            let swept = wanders.reach(16).sweep(&floor(0.0), &floor(x)).corners();
            swept[4] - 1000.0 - 1000.0 * PAD
        };
        assert!(padded(0.0).abs() < 1e-3);
        let most = 0.1 * (1.0 + OTHERS_MAX) * WANDER * 2.0;
        assert!((0.0..1.1 * most).contains(&padded(0.1)));
    }

    #[test]
    fn what_has_no_end_or_no_place_before_is_swept_to_no_number() {
        let endless = Down::of(std::array::from_fn(|k| {
            if k < 3 {
                f32::NEG_INFINITY
            } else {
                f32::INFINITY
            }
        }));
        let wanders = Course {
            wanders: true,
            ..Course::default()
        };
        for reach in [Reach::NEW, wanders.reach(9), Course::default().reach(9)] {
            let swept = reach.sweep(&endless, &endless).corners();
            assert_eq!(swept.map(f32::to_bits), endless.corners().map(f32::to_bits));
            let appeared = reach.sweep(&Down::EMPTY, &at([0.0; 3])).corners();
            assert!(appeared.iter().all(|face| face.is_finite()));
        }
    }
}
