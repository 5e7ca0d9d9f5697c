//! Bodies that jump out of their block while other bodies keep their lanes: they get other lanes, the rest stays.
//!
//! Only without candidates. A few bodies far from their old place would stretch their blocks over the scene; a new
//! layout of everything for them costs several times as much as giving them lanes.

use super::afresh::Afresh;
use super::lay::Bound;
use super::{BodySlot, MANY_CAME, NONE, Order, PairKey, Proxies, Tick, ones, parts, small};
use crate::simd::boxes::{Kernel, Lanes, WIDTH, prefetch};

/// Bodies ahead whose boxes are prefetched.
const AHEAD: usize = 8;

impl Order {
    /// Gives a lane to every body that came or jumped; returns whether there were enough.
    ///
    /// * `jumped` - number of bodies that jumped, by the boxes just taken.
    pub(super) fn seat_anew<P: Proxies>(&mut self, jumped: usize, tick: &Tick<'_, P>) -> bool {
        let came = self.homeless.len();
        if came + jumped == 0 {
            return true;
        }
        if (came + jumped) * MANY_CAME > tick.members.bounded().len() {
            return false;
        }
        if jumped > 0 {
            let Afresh {
                held, gone, jumped, ..
            } = &mut self.afresh;
            held.carry(
                Some(jumped),
                (gone, &self.slot_of),
                self.level,
                &mut self.carried,
            );
            self.unseat();
        }
        let homeless = std::mem::take(&mut self.homeless);
        let all = self.seat_all(&homeless, tick.proxies);
        self.homeless = homeless;
        all
    }

    /// Gives each body without a lane one, and updates the bounds of all changed blocks; returns whether there were
    /// enough. A body that has a lane keeps it.
    pub(super) fn seat_all<P: Proxies>(&mut self, bodies: &[BodySlot], proxies: &P) -> bool {
        let mut blocks = std::mem::take(&mut self.worklist);
        let level = self.level;
        let all = level.run(Seat {
            order: self,
            bodies,
            proxies,
            blocks: &mut blocks,
        });
        blocks.sort_unstable();
        blocks.dedup();
        level.run(Bound {
            order: self,
            blocks: blocks.iter().map(|block| *block as usize),
        });
        blocks.clear();
        self.worklist = blocks;
        all
    }

    /// Takes away the lanes of bodies that jumped; lists them as homeless and their blocks as changed.
    fn unseat(&mut self) {
        for block in 0..self.live.len() {
            let jumped = self.afresh.jumped[block];
            if jumped == 0 {
                continue;
            }
            for lane in ones(jumped) {
                let slot = std::mem::replace(&mut self.slot_of[block * WIDTH + lane], NONE);
                self.rank_of[slot as usize] = NONE;
                self.fat[block].set(lane, &[f32::NAN; 6]);
                self.homeless.push(BodySlot(slot));
                self.len -= 1;
            }
            self.live[block] &= !jumped;
            self.worklist.push(small(block));
        }
    }

    /// Reports which pairs of bodies that jumped have parted. Those that still overlap are reported as begun, which has
    /// no effect on stored pairs.
    pub(super) fn tell_jumped<P>(&mut self, tick: &mut Tick<'_, P>) {
        for (one, other) in self.carried.drain(..) {
            let ranks = [one, other].map(|slot| self.rank_of[slot as usize]);
            if !self.afresh.finds.met.has(ranks) {
                let key = PairKey::new(BodySlot(one), BodySlot(other));
                tick.parted.push(key);
            }
        }
    }
}

/// Gives each body without a lane one, and lists their blocks; returns whether there were enough.
struct Seat<'a, P> {
    order: &'a mut Order,
    bodies: &'a [BodySlot],
    proxies: &'a P,
    blocks: &'a mut Vec<u32>,
}

impl<P: Proxies> Kernel for Seat<'_, P> {
    type Out = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> bool {
        let (order, bodies) = (self.order, self.bodies);
        for (at, slot) in bodies.iter().enumerate() {
            if let Some(ahead) = bodies.get(at + AHEAD) {
                prefetch(self.proxies.aabb(*ahead));
            }
            if order.rank(*slot).is_some() {
                continue;
            }
            let Some((rank, one)) = order.lane_for(lanes, *slot, self.proxies) else {
                return false;
            };
            order.sit(*slot, rank, one);
            let (block, lane) = parts(rank);
            order.fat[block].set(lane, &one.corners());
            self.blocks.push(small(block));
        }
        true
    }
}
