//! Boxes for some ticks: where a body will have been if it goes on as it came.
//!
//! In: the boxes of this tick and the last. Out: swept boxes, by rank and in the blocks; and who has left his.

use super::fatten::outward;
use super::links::small;
use super::{BodySlot, NONE, Order, Proxies, ones};
use crate::simd::boxes::{Down, Lanes, SLACK, WIDTH, Work, prefetch};

/// What a swept box is padded by, in mean sides: what stands still but for its sender's rounding stays in, ...
const PAD: f32 = 0.01;
/// ... and in ticks of the body's motion.
const SWERVE: f32 = 0.25;
/// Most that a face is swept, in mean sides.
const SWEEP_MAX: f32 = 2.0;
/// Bodies ahead whose boxes are asked for, and blocks of them.
const AHEAD: usize = 16;
const AHEAD_BLOCKS: usize = 2;

impl Order {
    /// Notes where the bodies are, so that the boxes of this tick tell how they move.
    pub(super) fn note_places(&mut self) {
        for (block, live) in self.live.iter().enumerate() {
            for lane in ones(*live) {
                let [x, y, z, u, v, w] = self.fat[block].get(lane);
                let faces = [x, y, z, 0.0, -u, -v, -w, 0.0];
                self.exact[block * WIDTH + lane] = Down { faces };
            }
        }
    }

    /// Takes every box; where the list is due, sweeps all anew, else those that stray. Notes who does, and who has
    /// jumped clear of where its block was: how many.
    pub(super) fn take_swept<P: Proxies>(&mut self, proxies: &P, due: bool) -> usize {
        let left = self.afresh.verlet.pace.left(due);
        self.afresh.verlet.strays.clear();
        let level = self.level;
        #[allow(clippy::cast_precision_loss, reason = "a few ticks")]
        level.run(TakeSwept {
            order: self,
            proxies,
            due,
            ticks: left as f32,
        })
    }
}

/// The box of a body for some ticks, if it goes on as it came.
#[inline(always)]
pub(super) fn sweep(before: &Down, now: &Down, ticks: f32) -> Down {
    let f = &now.faces;
    // The sum of lower faces and minus upper ones is minus three mean sides.
    let side = ((f[0] + f[4]) + (f[1] + f[5]) + (f[2] + f[6])) * (-1.0 / 3.0);
    let side = if side.is_finite() { side } else { 0.0 };
    let (least, most) = (side * PAD, side * SWEEP_MAX);
    let mut swept = *now;
    for (face, was) in swept.faces.iter_mut().zip(&before.faces) {
        let step = *face - *was;
        let out = if step < 0.0 { -step } else { 0.0 };
        let by = out * (ticks + SWERVE) + least;
        *face -= if by < most { by } else { most };
    }
    swept
}

/// See [`Order::take_swept`].
struct TakeSwept<'a, P> {
    order: &'a mut Order,
    proxies: &'a P,
    due: bool,
    ticks: f32,
}

impl<P: Proxies> Work for TakeSwept<'_, P> {
    type Out = usize;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> usize {
        let Self {
            order,
            proxies,
            due,
            ticks,
        } = self;
        let (origin, mut jumps) = (order.origin, 0);
        for block in 0..order.live.len() {
            let ahead = order.slot_of[block * WIDTH..].chunks_exact(WIDTH);
            if let Some(ahead) = ahead.clone().nth(AHEAD_BLOCKS) {
                for slot in ahead.iter().filter(|slot| **slot != NONE) {
                    prefetch(proxies.aabb(BodySlot(*slot)));
                }
            }
            let (mut out, mut jumped) = (0, 0);
            for lane in ones(order.live[block]) {
                let rank = block * WIDTH + lane;
                let aabb = proxies.aabb(BodySlot(order.slot_of[rank]));
                let (min, max) = (aabb.min.coords.as_ref(), aabb.max.coords.as_ref());
                let before = order.exact[rank];
                let now = lanes.outward(min, max, &origin);
                order.exact[rank] = now;
                let swept = &mut order.afresh.verlet.swept[rank];
                let stays = lanes.holds(swept, &now);
                if due || !stays {
                    let clear = !meets(&now, order.tree.bound(block));
                    jumped |= u16::from(clear & !stays) << lane;
                    let wide = sweep(&before, &now, ticks);
                    if due {
                        order.fat[block].set(lane, &wide.corners());
                    }
                    *swept = open(wide);
                    // Who jumped gets another lane, and is new there.
                    if !stays && !clear {
                        order.afresh.verlet.strays.push(small(rank));
                    }
                }
                out |= u16::from(!stays) << lane;
            }
            let verlet = &mut order.afresh.verlet;
            verlet.fresh[block] = out;
            verlet.out[block] = out | order.afresh.gone[block];
            order.afresh.jumped[block] = jumped;
            jumps += jumped.count_ones() as usize;
            if due {
                let bound = lanes.bound(&order.fat[block], u16::MAX);
                order.tree.set(block, bound);
            }
        }
        order.tree.refit(lanes);
        jumps
    }
}

/// Takes every box where it was laid; its swept box stands there.
pub(super) struct TakeLaid<'a, P> {
    pub(super) order: &'a mut Order,
    pub(super) proxies: &'a P,
}

impl<P: Proxies> Work for TakeLaid<'_, P> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { order, proxies } = self;
        for rank in 0..order.slot_of.len() {
            if let Some(ahead) = order
                .slot_of
                .get(rank + AHEAD)
                .filter(|slot| **slot != NONE)
            {
                prefetch(proxies.aabb(BodySlot(*ahead)));
            }
            let slot = order.slot_of[rank];
            if slot != NONE {
                let aabb = proxies.aabb(BodySlot(slot));
                order.exact[rank] = outward(lanes, aabb, &order.origin);
                let [x, y, z, u, v, w] = order.fat[rank / WIDTH].get(rank % WIDTH);
                let faces = [x, y, z, 0.0, -u, -v, -w, 0.0];
                order.afresh.verlet.swept[rank] = open(Down { faces });
            }
        }
    }
}

/// A swept box whose spare lanes hold whatever stands in another's.
#[inline(always)]
fn open(mut swept: Down) -> Down {
    swept.faces[SLACK] = f32::NEG_INFINITY;
    swept.faces[SLACK + 4] = f32::NEG_INFINITY;
    swept
}

/// Whether a box meets a bound.
#[inline(always)]
fn meets(one: &Down, bound: &[f32; 6]) -> bool {
    let one = one.corners();
    (0..3).all(|k| one[k] <= bound[k + 3] && bound[k] <= one[k + 3])
}
