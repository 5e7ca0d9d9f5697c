//! Boxes for several ticks: where a body will have been if it keeps its course, or wanders (`course`).
//!
//! In: the boxes of this tick and the last. Out: swept boxes, by rank and in the blocks; and bodies that left theirs.

use super::course::{Reach, SAMPLE};
use super::fatten::outward;
use super::load::Taking;
use super::pace::Phase;
use super::verlet::Verlet;
use super::{Order, Proxies, ones};
use crate::ids::small;
use crate::simd::boxes::{Boxes16, Down, Kernel, Lanes, WIDTH};

impl Order {
    /// Saves the places of the bodies, so that the boxes of this tick show how they move.
    fn note_places(&mut self) {
        for (block, live) in self.live.iter().enumerate() {
            for lane in ones(*live) {
                self.exact[block * WIDTH + lane] = Down::of(self.fat[block].get(lane));
            }
        }
    }

    /// Saves the places of all bodies if a list begins in this tick, and of some if one may begin in the next.
    pub(super) fn prepare_list(&mut self, begins: bool) {
        if begins {
            self.note_places();
        } else if self.afresh.verlet.pace.nears() {
            self.watch_places();
        }
    }

    /// Saves the places of some bodies, two ticks before a list begins.
    fn watch_places(&mut self) {
        let course = &mut self.afresh.verlet.course;
        course.clear();
        for block in (0..self.live.len()).step_by(SAMPLE) {
            course.watch(self.live[block], &boxes_of(&self.fat[block]));
        }
    }

    /// Measures whether bodies keep their course; the saved places must be those of the last tick, and the blocks must
    /// hold this tick's boxes.
    ///
    /// * `kept` - whether they still have the same lanes.
    pub(super) fn ask_course(&mut self, kept: bool) {
        let course = &mut self.afresh.verlet.course;
        for block in (0..self.live.len()).step_by(SAMPLE).filter(|_| kept) {
            let then = &self.exact.as_chunks().0[block];
            let now = boxes_of(&self.fat[block]);
            course.note(block, self.live[block], then, &now);
        }
        course.close();
    }

    /// Factor by which more pairs will be near than overlap if boxes are swept for `ticks` ticks, estimated from the
    /// mean growth of the boxes of some blocks. The saved places must be those of the last tick, and the blocks must
    /// hold this tick's boxes.
    pub(super) fn crowding(&self, ticks: u32) -> f64 {
        let (mut sum, mut count) = (0.0, 0_u32);
        let reach = self.afresh.verlet.course.reach(ticks);
        for block in (0..self.live.len()).step_by(SAMPLE) {
            for lane in ones(self.live[block]) {
                let now = Down::of(self.fat[block].get(lane));
                let before = &self.exact[block * WIDTH + lane];
                let swept = reach.sweep(before, &now);
                let grown = f64::from(volume(&swept)) / f64::from(volume(&now));
                if grown.is_finite() {
                    sum += grown;
                    count += 1;
                }
            }
        }
        sum / f64::from(count.max(1))
    }

    /// Takes every box; sweeps all again if the next list begins, otherwise those of strays. Lists strays and bodies
    /// that jumped out of their block's bound; returns the number of the latter.
    ///
    /// * `span` - ticks to sweep for.
    pub(super) fn take_swept<P: Proxies>(&mut self, proxies: &P, phase: Phase, span: u32) -> usize {
        let verlet = &mut self.afresh.verlet;
        verlet.strays.clear();
        let reach = verlet.course.reach(span);
        let opens = phase == Phase::Opens;
        let asks = !opens && verlet.course.asks();
        if opens {
            verlet.course.clear();
        }
        let level = self.level;
        let jumps = level.run(TakeSwept {
            order: self,
            proxies,
            phase,
            reach: &reach,
            asks,
        });
        if asks {
            self.afresh.verlet.course.close();
        }
        jumps
    }

    /// Takes every box in its new lane; the block there holds its swept box.
    pub(super) fn take_laid<P: Proxies>(&mut self, proxies: &P) {
        let level = self.level;
        level.run(TakeLaid {
            order: self,
            proxies,
        });
    }
}

/// Volume of a box, cubic metres.
fn volume(one: &Down) -> f32 {
    let [x, y, z, u, v, w] = one.corners();
    (u - x) * (v - y) * (w - z)
}

/// See [`Order::take_swept`].
struct TakeSwept<'a, P> {
    order: &'a mut Order,
    proxies: &'a P,
    phase: Phase,
    reach: &'a Reach,
    asks: bool,
}

impl<P: Proxies> Kernel for TakeSwept<'_, P> {
    type Out = usize;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> usize {
        let Self {
            order,
            proxies,
            phase,
            reach,
            asks,
        } = self;
        let (origin, mut jumps) = (order.origin, 0);
        let opens = phase == Phase::Opens;
        let makes = matches!(phase, Phase::Makes | Phase::Ends);
        let mut before = [Down::EMPTY; WIDTH];
        for block in 0..order.live.len() {
            let live = order.live[block];
            let taking = Taking::of(&order.slot_of, block);
            let exact = &mut order.exact.as_chunks_mut().0[block];
            let Verlet {
                swept,
                course,
                strays,
                ..
            } = &mut order.afresh.verlet;
            let swept = &mut swept.as_chunks_mut().0[block];
            let fat = &mut order.fat[block];
            let boxes = (proxies, origin);
            let watched = block.is_multiple_of(SAMPLE);
            let out = take(
                lanes,
                boxes,
                (taking, live),
                (exact, &mut before),
                (swept, opens || asks && watched),
            );
            if watched && opens {
                course.watch(live, &before);
            } else if watched && asks {
                course.note(block, live, &before, exact);
            }
            if phase == Phase::Ends {
                *swept = boxes_of(fat).map(Down::open);
            }
            if opens {
                sweep_anew(reach, (live, out), (&before, exact), (fat, swept));
            }
            let (mut late, mut jumped) = (0, 0);
            for lane in ones(out) {
                if !opens {
                    // The blocks hold the boxes of the next list: a body that has left only its old box keeps its new
                    // one.
                    let next = Down::of(fat.get(lane)).open();
                    let keeps = makes && lanes.holds(&next, &exact[lane]);
                    swept[lane] = if keeps {
                        next
                    } else {
                        reach.sweep(&before[lane], &exact[lane]).open()
                    };
                    late |= u16::from(!keeps) << lane;
                }
                if meets(&exact[lane], order.tree.bound(block)) {
                    let rank = small(block * WIDTH + lane);
                    strays.push(rank);
                } else {
                    // It gets another lane, and is new there.
                    jumped |= 1 << lane;
                }
            }
            let gone = order.afresh.gone[block];
            let verlet = &mut order.afresh.verlet;
            verlet.fresh[block] = out;
            verlet.out[block] = out | gone;
            verlet.late[block] |= late | jumped | gone;
            order.afresh.jumped[block] = jumped;
            jumps += jumped.count_ones() as usize;
            if opens {
                let bound = lanes.bound(&order.fat[block], u16::MAX);
                order.tree.set(block, bound);
            }
        }
        order.tree.refit(lanes);
        jumps
    }
}

/// Sweeps the boxes of some lanes again, into their block; a body that left its old box is tested against the new one
/// only.
#[inline(always)]
fn sweep_anew(
    reach: &Reach,
    (lanes, out): (u16, u16),
    (before, now): (&[Down; WIDTH], &[Down; WIDTH]),
    (fat, swept): (&mut Boxes16, &mut [Down; WIDTH]),
) {
    for lane in ones(lanes) {
        let wide = reach.sweep(&before[lane], &now[lane]).open();
        fat.set(lane, &wide.corners());
        // A body that leaves either box counts as having left.
        swept[lane] = if out >> lane & 1 == 1 {
            wide
        } else {
            within(&swept[lane], &wide)
        };
    }
}

/// The boxes of a block, one by one.
fn boxes_of(block: &Boxes16) -> [Down; WIDTH] {
    std::array::from_fn(|lane| Down::of(block.get(lane)))
}

/// Takes the boxes of a block; returns the lanes whose box has left its swept one.
///
/// * `before` - receives the former boxes of those lanes, or with `all` of every lane; unused ones are not read.
#[inline(always)]
fn take<L: Lanes, P: Proxies>(
    lanes: L,
    (proxies, origin): (&P, [f64; 3]),
    (taking, live): (Taking<'_>, u16),
    (exact, before): (&mut [Down; WIDTH], &mut [Down; WIDTH]),
    (swept, all): (&[Down; WIDTH], bool),
) -> u16 {
    let mut out = 0;
    for lane in ones(live) {
        let aabb = proxies.aabb(taking.slot(lane, proxies));
        let now = outward(lanes, aabb, &origin);
        let stays = lanes.holds(&swept[lane], &now);
        if all | !stays {
            before[lane] = exact[lane];
        }
        exact[lane] = now;
        out |= u16::from(!stays) << lane;
    }
    out
}

/// The intersection of two boxes.
#[inline(always)]
fn within(one: &Down, other: &Down) -> Down {
    let mut both = *one;
    for (face, least) in both.faces.iter_mut().zip(&other.faces) {
        *face = if *least > *face { *least } else { *face };
    }
    both
}

/// See [`Order::take_laid`].
struct TakeLaid<'a, P> {
    order: &'a mut Order,
    proxies: &'a P,
}

impl<P: Proxies> Kernel for TakeLaid<'_, P> {
    type Out = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { order, proxies } = self;
        let verlet = &mut order.afresh.verlet;
        let swept = verlet.swept.as_chunks_mut::<WIDTH>().0;
        let exact = order.exact.as_chunks_mut::<WIDTH>().0;
        let blocks = order.fat.iter().zip(&order.live).zip(swept).zip(exact);
        for (block, (((fat, live), swept), exact)) in blocks.enumerate() {
            let taking = Taking::of(&order.slot_of, block);
            for lane in ones(*live) {
                let aabb = proxies.aabb(taking.slot(lane, proxies));
                exact[lane] = outward(lanes, aabb, &order.origin);
                swept[lane] = Down::of(fat.get(lane)).open();
            }
        }
    }
}

/// Returns whether a box meets a bound.
#[inline(always)]
fn meets(one: &Down, bound: &[f32; 6]) -> bool {
    let one = one.corners();
    (0..3).all(|k| one[k] <= bound[k + 3] && bound[k] <= one[k + 3])
}
